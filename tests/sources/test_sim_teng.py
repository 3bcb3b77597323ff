"""Claims about sim://teng: its options reach the simulator, its clock is fitted like a board's."""

from dataclasses import fields

import numpy as np
import pytest

from taxel.clock import ManualClock
from taxel.errors import BadSource
from taxel.signals import Mark, Samples
from taxel.sim.teng.hand import GraspStream, TengHandConfig
from taxel.sources.opening import open_source
from taxel.sources.simulated.teng_options import LIMITS, OPTIONS, checked_config, parse_options


def run(url: str) -> tuple[Samples, list[Mark]]:
    parts, marks = [], []
    with open_source(url, ManualClock(100.0)) as source:
        while not source.ended:
            parts.append(source.read())
            marks += source.marks()
    return Samples.join(parts), marks


def test_the_values_are_the_simulators():
    samples, _ = run("sim://teng?speed=max&seconds=1&seed=5&shape=cylinder&material=glass")
    stream = GraspStream(TengHandConfig(seed=5), shape="cylinder", material="glass")
    np.testing.assert_array_equal(samples.values, stream.next_block()[0].values[:1000])


def test_the_same_address_gives_the_same_stream_and_another_seed_another():
    first, _ = run("sim://teng?speed=max&seconds=4&seed=1")
    again, _ = run("sim://teng?speed=max&seconds=4&seed=1")
    other, _ = run("sim://teng?speed=max&seconds=4&seed=2")
    np.testing.assert_array_equal(first.values, again.values)
    np.testing.assert_array_equal(first.fitted_s, again.fitted_s)
    assert not np.array_equal(first.values, other.values)


def test_one_kind_only_is_grasped_where_the_address_says_so():
    _, marks = run("sim://teng?speed=max&seconds=40&rate_hz=100&shape=sphere&material=plastic")
    assert len(marks) > 3
    assert {(m.labels["shape"], m.labels["material"]) for m in marks} == {("sphere", "plastic")}


def test_the_fitted_time_is_that_of_the_scan_and_not_of_its_arrival():
    """Arrivals are late by milliseconds; the fit, which knows only them, is within 0.2 ms.

    The first scan's delay is left out: no fit can know it.
    """
    samples, _ = run("sim://teng?speed=max&seconds=30")
    true_s = samples.counter / 1000.0
    late_s = samples.arrival_s - true_s
    fitted_late_s = samples.fitted_s - true_s
    settled = slice(2000, None)
    assert np.ptp(late_s[settled]) > 2e-3
    assert np.ptp(fitted_late_s[settled]) < 2e-4
    assert abs(np.median(fitted_late_s[settled]) - late_s.min()) < 2e-4


def test_the_board_keeps_its_own_clock():
    """Device time differs from true time by the board's parts per million, from the first scan."""
    samples, _ = run("sim://teng?speed=max&seconds=10")
    ratio = samples.device_s[1:] / (samples.counter[1:] / 1000.0)
    assert np.ptp(ratio) < 1e-9
    assert 0 < abs(ratio[0] - 1) < 200e-6


def test_the_options_are_the_fields_of_the_configuration():
    names = {field.name for field in fields(TengHandConfig)}
    assert set(OPTIONS) == names - {"scans_per_class", "sessions"} | {
        "shape",
        "material",
        "seconds",
    }
    assert set(LIMITS) == names - {"preset", "wiring", "unknown"}


def test_ranges_and_single_numbers_are_both_read():
    config, choice = parse_options({"humidity_pct": "40", "force_n": "1..2", "shape": "sphere"})
    assert (config.humidity_pct, config.force_n) == ((40.0, 40.0), (1.0, 2.0))
    assert (choice.shape, choice.material, choice.seconds) == ("sphere", None, np.inf)


def test_unknown_objects_come_where_the_address_asks_for_them():
    _, marks = run("sim://teng?speed=max&seconds=30&rate_hz=100&shape=prism&material=rubber")
    assert {(m.labels["shape"], m.labels["material"]) for m in marks} == {("prism", "rubber")}
    _, marks = run("sim://teng?speed=max&seconds=120&rate_hz=100&unknown=yes")
    assert {m.labels["shape"] for m in marks} == {"sphere", "cylinder", "rectangle", "prism"}
    with pytest.raises(BadSource, match="unknown"):
        parse_options({"unknown": "maybe"})


def test_the_defaults_are_within_their_limits():
    defaults = {field.name: field.default for field in fields(TengHandConfig)}
    assert checked_config(**defaults) == TengHandConfig()


@pytest.mark.parametrize("rate_hz", [20, 1000, 4000])
def test_seconds_end_the_stream_to_the_scan(rate_hz: int):
    samples, marks = run(f"sim://teng?speed=max&seconds=2.5&rate_hz={rate_hz}")
    assert len(samples) == int(2.5 * rate_hz)
    assert all(mark.end_s <= samples.fitted_s[-1] for mark in marks)
