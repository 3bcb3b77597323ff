"""How long the stages of a decision took, as the page and the benches see it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from taxel.actions.interlock import Interlock, InterlockConfig
from taxel.live.station.beats import Beat, Work
from taxel.live.station.guard import Guard
from taxel.live.station.snapshots import STAGES, Latencies, consumer_snapshot, guard_snapshot

TOOK_MS = (10.0, 1.0, 2.0, 3.0, 8.0, 0.5)
"""One number a stage."""


def taken_in(latencies: Latencies, factor: float = 1.0) -> None:
    at = 1.0 + np.concatenate([[0.0], np.cumsum(TOOK_MS)]) * factor / 1000.0
    names = ("time_s", "arrival_s", "put_s", "taken_s", "began_s", "decided_s")
    latencies.add(dict(zip(names, at[:-1].tolist(), strict=True)), float(at[-1]))


def test_each_stage_takes_from_the_end_of_the_one_before_to_its_own():
    latencies = Latencies()
    taken_in(latencies)
    latencies.add({"kind": "grasp", "decided_s": 5.0}, 6.0)  # no frames, so no time of theirs
    found = {stage: values[0] for stage, values in latencies.percentiles_ms().items()}
    assert found == pytest.approx(dict(zip(STAGES, TOOK_MS, strict=True)))
    assert latencies.whole_ms() == pytest.approx([sum(TOOK_MS)])
    assert latencies.overhead_ms() == pytest.approx([1.0 + 2.0 + 3.0 + 0.5])


def test_percentiles_are_computed_once_a_second():
    latencies = Latencies()
    taken_in(latencies)
    first = latencies.lately_ms(10.0)
    taken_in(latencies, factor=9.0)
    assert latencies.lately_ms(11.0) == first
    assert latencies.lately_ms(11.1)["model"][2] > 3 * first["model"][2]


def test_what_a_start_took_can_be_forgotten():
    latencies = Latencies()
    taken_in(latencies, factor=100.0)
    latencies.clear()
    assert latencies.percentiles_ms() == {}
    taken_in(latencies)
    assert latencies.whole_ms() == pytest.approx([sum(TOOK_MS)])


def test_a_process_that_hangs_is_not_shown_as_running():
    """Its pill was green beside "beat 4482 ms". A step that asked for patience may take it."""
    beat = Beat(beat_s=10.0, work=Work.RUNNING, produced=1, consumed=2, dropped=0, patience_s=0.0)
    states = [consumer_snapshot("monitor", beat, now_s)["state"] for now_s in (10.9, 11.1)]
    assert states == ["running", "silent"]
    patient = replace(beat, patience_s=5.0)
    assert consumer_snapshot("monitor", patient, 14.0)["state"] == "running"
    over = replace(beat, work=Work.ENDED)
    assert consumer_snapshot("monitor", over, 14.0)["state"] == "ended"


def test_where_no_monitor_runs_nothing_is_said_to_hold_since_the_machine_started():
    """The clock's zero is the machine's start: a page of 14 s said "for 40:25 min"."""
    guard = Guard(Interlock(InterlockConfig(min_n=1.0, max_n=10.0)))
    guard.tick(2425.0)
    shown = guard_snapshot(guard, 2425.0)
    assert (shown["state"], shown["since_s"]) == ("NONE", None)
    guard.expect("monitor/0", 2426.0)
    guard.tick(2426.0)
    shown = guard_snapshot(guard, 2426.0)
    assert (shown["state"], shown["since_s"]) == ("UNKNOWN", 2426.0)
