"""Rows on real gels: alarms by trial, of those that slip and of those that hold."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from taxel.bench.transitions import real_recogniser
from taxel.bench.transitions.real_gels import (
    WARNINGS,
    RealTrial,
    Watched,
    judge_rows,
    real_gel_rows,
)
from taxel.bench.transitions.real_recogniser import (
    RECOGNISER,
    folds_table,
    object_folds,
    recogniser_alarm_rows,
)
from taxel.live import trial_watch
from taxel.signals import CameraInfo, Frame
from taxel.windows.pairs import FrameSet
from taxel.windows.trial_layout import Layout


def trial(number: int, slips: bool, alarm: bool, largest: float) -> RealTrial:
    watched = Watched(alarm=alarm, early=False, largest=largest)
    return RealTrial(
        object=f"object {number % 5}", slips=slips, images=100 if slips else 400,
        watched=dict.fromkeys(WARNINGS, watched),
    )  # fmt: skip


def test_alarms_are_counted_apart_for_trials_that_slip_and_that_hold():
    trials = [trial(n, slips=n < 10, alarm=n % 5 == 0, largest=n / 20) for n in range(20)]
    trials[1] = trial(1, slips=True, alarm=True, largest=0.05)
    rows = judge_rows(trials)

    assert len(rows) == 3 * len(WARNINGS)
    slipped, held, ranked = rows[:3]
    assert slipped.value == 0.3
    assert slipped.note.startswith("3 of 10, 95 % ")
    assert held.value == 0.2
    assert ranked.value == 0.0
    assert ranked.note == "20 trials; that the shorter trial slips 1.000"
    assert all(row.goal == "" for row in rows)


def test_without_recordings_there_is_no_value(tmp_path):
    for data in (None, tmp_path):
        rows = real_gel_rows(data)
        assert [row.value for row in rows] == [None] * len(WARNINGS)
        assert rows[0].note == "no recordings: name their folder with --data"


def test_each_trial_is_tested_once_by_a_recogniser_that_saw_nothing_of_its_object(
    monkeypatch: pytest.MonkeyPatch,
):
    files = [Path(f"object{n % 10}-{n}.mcap") for n in range(40)]
    monkeypatch.setattr(real_recogniser, "read_manifest", lambda path: SimpleNamespace(
        labels={"outcome": "slip" if int(path.stem[6]) % 2 else "hold"},
        groups={"object": path.stem[:7]},
    ))  # fmt: skip
    folds = object_folds(files)
    assert sorted(file for fold in folds for file in fold) == sorted(files)
    for tested in folds:
        lines = folds_table(files, tested).splitlines()
        assert lines[0] == "recording,side"
        sides = dict(line.split(",") for line in lines[1:])
        assert len(sides) == len(files)
        objects = {name[:7]: side for name, side in sides.items()}
        assert all(objects[name[:7]] == side for name, side in sides.items())
        assert set(sides.values()) == {"train", "test"}


def test_a_recogniser_without_recordings_has_no_value(tmp_path: Path):
    for data in (None, tmp_path):
        (row,) = recogniser_alarm_rows(data)
        assert row.value is None
        assert row.name.startswith(RECOGNISER)
        short = recogniser_alarm_rows(data, short=True)
        assert [row.name.partition(" on real")[0] for row in short] == [
            f"{RECOGNISER} crops of 24 images, confidence {least}" for least in (0.8, 0.6)
        ]


def test_a_verdict_on_a_recording_is_one_and_no_unknown(monkeypatch: pytest.MonkeyPatch):
    """Cameras whose frames are not looked after are in doubt: each verdict was UNKNOWN."""
    camera = CameraInfo(name="gel", width=8, height=8, rate_hz=25.0)
    contract = SimpleNamespace(
        target="outcome", classes=("hold", "slip"), layout=Layout(8, 3), sharpness=1.0, weights={},
        threshold=None, check=lambda *_: None,
    )  # fmt: skip
    manifest = SimpleNamespace(
        cameras=(camera,), labels={"outcome": "slip"}, groups={"object": "mug"}
    )
    sets = [
        FrameSet((
            Frame(camera=0, jpeg=b"%d" % n, counter=n, device_s=n / 25, arrival_s=n / 25,
                  fitted_s=n / 25),
        ))
        for n in range(20)
    ]  # fmt: skip
    monkeypatch.setattr(real_recogniser, "read_manifest", lambda _: manifest)
    monkeypatch.setattr(real_recogniser, "frame_sets", lambda *_: sets)
    monkeypatch.setattr(
        real_recogniser, "read_trial_bundle", lambda _: SimpleNamespace(contract=contract)
    )
    monkeypatch.setattr(trial_watch, "decode_frame", lambda *_: np.zeros((8, 8, 3), np.uint8))
    monkeypatch.setattr(trial_watch, "predict_crop", lambda *_: (np.array([0.1, 0.9]), 0.0))
    levels = {RECOGNISER: 0.9, "surer": 0.95}
    trial, first = real_recogniser.watch_verdicts(Path("a.taxel"), Path("a.mcap"), levels)

    assert first == {RECOGNISER: 8, "surer": None}  # with the first crop
    assert (trial.slips, trial.images, trial.object) == (True, 20, "mug")
    watched = trial.watched[RECOGNISER]
    assert (watched.alarm, watched.early) == (True, True)
    assert not trial.watched["surer"].alarm
    assert watched.largest == pytest.approx(0.9)
