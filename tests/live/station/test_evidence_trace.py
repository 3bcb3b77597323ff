"""One line of what several grasp monitors go by: the largest, and none of them hides another."""

import math
from contextlib import ExitStack

import numpy as np

from taxel.live.station.beats import Beats
from taxel.live.station.evidence_trace import EvidenceTrace
from taxel.live.station.packets import pack
from taxel.live.station.page_link import StationView, ViewConfig
from taxel.live.station.ring import Ring, RingWriter

PERIOD_S = 1 / 60


def test_a_grasp_that_slips_is_seen_beside_one_that_holds():
    """The page reads one monitor's ring after the other's: the second one's points, which are not
    later than the first one's, were left out."""
    trace = EvidenceTrace(30.0)
    for push in range(4):
        for who, p in (("monitor 1/0", 0.1), ("monitor 2/0", 0.9)):
            for number in range(3):
                trace.add(who, (3 * push + number) * PERIOD_S, p)
    t, p = np.array(trace.points).T
    assert (np.diff(t) > 0).all()
    assert p[3:].tolist() == [0.9] * len(p[3:])


def test_two_monitors_of_one_rate_keep_the_whole_time():
    """A page that is opened gets the last 30 s, as of one monitor."""
    trace = EvidenceTrace(30.0)
    for number in range(60 * 30):
        trace.add("a", number * PERIOD_S, 0.1)
        trace.add("b", number * PERIOD_S + 0.004, 0.2)
    assert trace.points[-1][0] - trace.points[0][0] > 29.0


def test_a_single_peak_of_either_is_drawn():
    trace = EvidenceTrace(30.0)
    for number in range(20):
        trace.add("a", number * PERIOD_S, 0.1)
        trace.add("b", number * PERIOD_S + 0.004, 0.95 if number == 10 else 0.2)
    assert max(p for _, p in trace.points) == 0.95


def test_what_a_monitor_said_before_it_fell_silent_is_not_drawn_on():
    trace = EvidenceTrace(30.0)
    trace.add("a", 0.0, 0.1)
    trace.add("b", 0.02, 0.9)
    trace.add("a", 1.0, 0.1)
    trace.add("a", 1.1, math.nan)
    times_s, values = zip(*trace.points, strict=True)
    assert times_s == (0.0, 0.02, 1.0, 1.1)
    assert values[:3] == (0.1, 0.9, 0.1)
    assert math.isnan(values[3])


def test_one_monitor_is_drawn_as_it_says():
    """Also one of fast cameras, and where nothing is said of some frames."""
    trace = EvidenceTrace(30.0)
    for number, p in enumerate((0.1, math.nan, 0.3)):
        trace.add("a", number * 0.005, p)
    trace.lack()
    np.testing.assert_allclose(
        np.array(trace.points),
        [[0.0, 0.1], [0.005, math.nan], [0.01, 0.3], [0.010001, math.nan]],
    )


def test_the_page_draws_the_larger_score_of_two_monitors():
    """Each has a ring of its own, and both are read in one look."""
    with ExitStack() as stack:
        rings = [stack.enter_context(Ring(2**16)).name for _ in range(4)]
        beats = stack.enter_context(Beats())
        view = StationView(
            ViewConfig(sources=(), decisions=tuple(rings[:2]), status=rings[2], requests=rings[3],
                       beats=beats.name, stall_s=0.1)
        )  # fmt: skip
        stack.callback(view.close)
        writers = [stack.enter_context(RingWriter(name)) for name in rings[:2]]
        for first in (0, 3):
            for who, writer in enumerate(writers):
                for number in range(first, first + 3):
                    note = {"kind": "grasp", "who": f"m/{who}", "p": 0.1 + 0.8 * who}
                    writer.put(pack(note | {"time_s": 1.0 + number * PERIOD_S}))
            drawn = view.traces(-math.inf)["probability"]
    assert (np.diff(drawn["t"]) > 0).all()  # a chart leaves out what is not later
    assert drawn["p"][3:] == [0.9, 0.9, 0.9]
