"""A threshold keeps what it promises, and alarms are counted as they are judged."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.errors import BadInput
from taxel.evaluation.early_warning.learn_slip_warning import keep_promises
from taxel.evaluation.early_warning.slip_warnings import (
    WarningTrack,
    false_alarms,
    judge_track,
    keep_promise,
    score_warnings,
)

TIME_S = np.arange(360) / 60.0


def pour(drive, event_s=None, cup="1", largest_um=50.0, **later):
    return WarningTrack(
        drive=np.asarray(drive, float),
        time_s=TIME_S,
        onset_s=None if event_s is None else event_s - 0.5,
        event_s=event_s,
        later_s={"1 mm": None, "drop": None} | later,
        largest_um=largest_um,
        groups={"cup": cup, "kind": "pour"},
    )


def wandering(seed):
    """A drive that rises and falls often, within 0…1."""
    steps = np.random.default_rng(seed).normal(0, 0.12, len(TIME_S))
    return np.abs(np.cumsum(steps)) % 1.0


@pytest.mark.parametrize("threshold", [0.2, 0.5, 0.8, 0.97])
def test_fast_counting_of_alarms_equals_the_judge(threshold):
    for seed in range(40):
        track = pour(wandering(seed))
        assert false_alarms(track, threshold) == judge_track(track, threshold).false_alarms


def test_a_promise_is_kept_by_the_lowest_threshold_that_keeps_it():
    tracks = [pour(np.full(360, i / 100), cup=str(i % 10)) for i in range(100)]
    minutes = 100 * (TIME_S[-1] - 0.4) / 60

    promise = keep_promise(tracks, per_min=5 / minutes)

    assert sum(false_alarms(t, promise.threshold) for t in tracks) == 5
    assert promise.threshold == pytest.approx(0.94, abs=1e-9)
    assert promise.found_per_min == pytest.approx(5 / minutes)
    low, high = promise.found_interval
    assert low < promise.found_per_min < high
    assert promise.interval[0] <= promise.threshold <= promise.interval[1]


def test_a_promise_of_many_alarms_is_not_cut_short():
    """More pours, more alarms: the threshold still is the lowest that keeps the promise."""
    tracks = [pour(np.full(360, (i + 1) / 500), cup=str(i // 20)) for i in range(400)]
    minutes = 400 * (TIME_S[-1] - 0.4) / 60

    promise = keep_promise(tracks, per_min=200 / minutes)

    assert sum(false_alarms(t, promise.threshold) for t in tracks) == 200
    assert promise.interval[0] < promise.threshold < promise.interval[1]


@pytest.mark.parametrize("louder", ["1", "2"])
def test_a_promise_on_two_gels_is_kept_on_the_louder_too(louder):
    """Pours of one gel drive the warning twice as high; sudden slips are not promised on."""
    tracks = [
        replace(
            pour(np.full(360, i / 200 * (1 + (gel == louder))), cup=str(i % 10)),
            groups={"cup": str(i % 10), "kind": kind, "gel": gel},
        )
        for gel in ("1", "2")
        for kind in ("pour", "late slip")
        for i in range(100)
    ]
    minutes = 100 * (TIME_S[-1] - 0.4) / 60

    promise = keep_promises(tracks, per_min=5 / minutes)

    assert promise.threshold == pytest.approx(0.94, abs=1e-9)
    assert promise.hold_min == pytest.approx(minutes)
    more = keep_promises(tracks, 5 / minutes, layers_per_min=9 / minutes).threshold
    assert (more < promise.threshold) == (louder == "2")


def test_a_promise_needs_pours_that_hold():
    with pytest.raises(BadInput, match="pours that hold"):
        keep_promise([pour(np.zeros(360), event_s=2.0)], 0.3)


def test_lead_is_reported_before_each_loss():
    rise = np.where(TIME_S >= 2.0, 0.99, 0.0)
    tracks = [
        pour(rise, event_s=2.4, largest_um=900.0, **{"1 mm": 3.0, "drop": 3.5}),
        pour(np.where(TIME_S >= 3.0, 0.99, 0.0), event_s=2.4, **{"1 mm": 3.2}),
        pour(np.zeros(360), largest_um=220.0),
    ]

    scores, outcomes = score_warnings(tracks, 0.9)

    assert outcomes[0].lead_s == pytest.approx(0.4)
    assert outcomes[1].missed
    assert scores.leads["300 um"]["missed"] == 0.5
    assert scores.leads["1 mm"]["median_s"] == pytest.approx((1.0 + 0.2) / 2)
    assert scores.leads["drop"]["median_s"] == pytest.approx(1.5)
    assert scores.near["> 200 um"] == pytest.approx(1 / (TIME_S[-1] - 0.4) * 60)
    assert scores.near["> 250 um"] == 0.0


def test_a_false_alarm_is_reported_by_how_far_its_pour_slipped():
    loud = np.full(360, 0.95)
    scores, _ = score_warnings([pour(loud, largest_um=150.0), pour(loud, largest_um=0.0)], 0.9)

    assert scores.alarms_by_slip == {"0 to 100 um": 1, "100 to 200 um": 1, "> 200 um": 0}
