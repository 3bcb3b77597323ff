"""A bundle that watches a grasp on recordings: false alarms, misses and leads by what is known."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from taxel.decisions.grasp_track import GraspTrack
from taxel.decisions.stability import Stability
from taxel.errors import BadDataset
from taxel.evaluation.early_warning import bundle_warnings
from taxel.evaluation.early_warning.bundle_warnings import judged, summed
from taxel.labels.corrections import Correction

SECOND = 25
"""Frames."""
LENGTH = 10 * SECOND
NOWHERE = Path("recordings")


def track(alarm_s: float | None = None, until_s: float = 99.0, **labels: str) -> GraspTrack:
    """Ten seconds at 25 images a second, with an alarm from a moment on until another."""
    time_s = np.arange(LENGTH) / SECOND
    alarm = np.zeros(LENGTH, bool) if alarm_s is None else (time_s >= alarm_s) & (time_s < until_s)
    states = np.where(alarm, Stability.WARNING, Stability.STABLE).astype(np.int8)
    cup = labels.pop("cup", "a")
    return GraspTrack(
        states=states, time_s=time_s, scores=np.where(alarm, 0.9, 0.1), labels=labels,
        groups={"cup": cup},
    )  # fmt: skip


@pytest.fixture(autouse=True)
def recordings(monkeypatch: pytest.MonkeyPatch) -> dict[str, Correction]:
    """Recordings of cameras without truth, and a person's corrections of them."""
    own: dict[str, Correction] = {}
    pour = SimpleNamespace(
        time_s=np.arange(LENGTH) / SECOND, sensor=SimpleNamespace(channels=())
    )  # fmt: skip
    monkeypatch.setattr(bundle_warnings, "read_camera_recording", lambda _: pour)
    monkeypatch.setattr(bundle_warnings, "read_corrections", lambda *_: own)
    return own


def scores(*tracks: GraspTrack) -> Any:
    return summed([grasp for own in tracks for grasp in judged(NOWHERE, [own])], NOWHERE)


def test_alarms_in_grasps_that_held_are_false_and_counted_by_time():
    found = scores(
        track(outcome="hold"), track(2.0, 3.0, outcome="Held "), track(1.0, outcome="hold")
    )

    assert (found.grasps, found.held, found.held_alarmed, found.false_alarms) == (3, 3, 2, 2)
    minutes = 3 * (10.0 - 1 / SECOND - 0.4) / 60
    assert found.held_min == pytest.approx(minutes)
    assert found.false_alarms_per_min == pytest.approx(2 / minutes)
    low, high = found.false_alarms_interval
    assert low < found.false_alarms_per_min < high
    assert np.isnan([found.area, found.missed_share, found.lead_median_s]).all()


def test_without_a_moment_a_slip_has_an_alarm_or_none_and_no_lead():
    found = scores(
        track(outcome="hold"), track(2.0, outcome="slip"), track(outcome="dropped", cup="b")
    )

    assert (found.held, found.slipped, found.slipped_alarmed, found.timed) == (1, 2, 1, 0)
    assert np.isnan([found.missed_share, found.lead_median_s]).all()
    assert found.false_alarms == 0  # an alarm in a grasp that slips is none
    assert found.area == 0.75
    assert found.length_area == 0.5


def test_a_persons_onset_gives_lead_and_misses_and_wins_over_the_outcome(
    recordings: dict[str, Correction],
):
    recordings["gross-slip"] = Correction(rule="gross-slip", onset_s=5.0)
    in_time, late = judged(NOWHERE, [track(4.5, outcome="hold")]), judged(NOWHERE, [track(5.5)])
    recordings["gross-slip"] = Correction(rule="gross-slip", onset_s=None)
    stable = judged(NOWHERE, [track(outcome="slip")])
    found = summed([*in_time, *late, *stable], NOWHERE)

    assert (found.held, found.slipped, found.timed) == (1, 2, 2)
    assert found.missed_share == 0.5
    low, high = found.missed_interval
    assert low < 0.02
    assert high > 0.98  # one of two
    assert found.lead_median_s == pytest.approx(0.0, abs=1 / SECOND)  # 0.5 s before, 0.5 after


def test_an_outcome_that_says_neither_is_left_out_and_named():
    found = scores(track(outcome="hold"), track(1.0, outcome="full"), track())

    assert found.grasps == 1
    assert found.left_out == {"": 1, "full": 1}
    with pytest.raises(BadDataset, match="label outcome, such as drop, dropped"):
        scores(track(outcome="full"))


def test_several_grasps_of_one_recording_go_by_their_outcomes():
    found = judged(NOWHERE, [track(outcome="hold"), track(1.0, outcome="slip")])

    assert [grasp.slips for grasp in found] == [False, True]
    assert [grasp.timed for grasp in found] == [True, False]


def test_intervals_go_by_the_first_group_that_tells_grasps_apart():
    assert scores(track(outcome="hold"), track(outcome="hold", cup="b")).cluster == "cup"
    assert scores(track(outcome="hold"), track(outcome="hold")).cluster == "recording"
