"""Rows on real gels: alarms by trial, of those that slip and of those that hold."""

from pathlib import Path
from types import SimpleNamespace

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
