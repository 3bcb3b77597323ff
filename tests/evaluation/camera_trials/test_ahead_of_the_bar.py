"""Sets unlike gelsight-slip: short trials of a single camera, three classes, test trials apart."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from trial_makers import as_avi, trial_images, write_trials

import taxel.training.camera_trials.blend as blending
from taxel.cli.evaluation.evaluate_trials import EvaluateTrials
from taxel.cli.options.trials import TrialOptions
from taxel.cli.training.train_trials import TrainTrials
from taxel.training.camera_trials.member_weights import trusted

SPEEDS = {"holds": 0.0, "creeps": 0.25, "slides": 1.2}
"""What an object does → pixels of a slip in a frame."""


def write_short_trials(folder: Path, classes: int, objects: int = 8) -> Path:
    """Write 21 frames of one camera a trial and their table; each object has each class twice."""
    folder.mkdir()
    lines = ["left,label:what,group:object"]
    names = list(SPEEDS) if classes == 3 else ["holds", "slides"]
    for number in range(2 * classes * objects):
        thing, name = number % objects, names[number // objects % classes]
        speed = SPEEDS[name] * (1 + 0.1 * (thing % 3))
        images = trial_images(speed > 0, 21, number, 80 + 9 * thing, speed)
        lines.append(f"{as_avi(folder / f't{number}', images)},{name},object {thing}")
    (folder / "trials.csv").write_text("\n".join(lines) + "\n")
    return folder / "trials.csv"


@pytest.mark.slow
@pytest.mark.parametrize("classes", [2, 3])
def test_the_default_is_ahead_of_the_forest_on_short_trials_of_one_camera(
    classes: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Where movement decides, the default is right as often as its bar, and surer."""
    monkeypatch.setattr(blending, "TREES", 40)
    monkeypatch.setattr(blending, "INNER_TREES", 20)
    table = write_short_trials(tmp_path / "a", classes)
    options = TrialOptions(fold_count=2, cache=tmp_path / "cache")
    EvaluateTrials(trials=table, options=options, json=True).run()
    found = json.loads(capsys.readouterr().out)
    assert (found["cameras"], found["crop"], found["crops_a_trial"]) == (1, 21, 1)
    assert len(found["classes"]) == classes
    ours, bar = (row["trials"] for row in found["rows"][:2])
    assert ours["accuracy"] >= max(0.9, bar["accuracy"])
    assert ours["auc"] >= bar["auc"]
    assert ours["loss"] <= bar["loss"]


@pytest.mark.slow
def test_test_trials_of_their_own_without_a_class_give_a_run_and_a_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Untested trials and an AUC of a missing class stand in no file as NaN."""
    monkeypatch.setattr(blending, "TREES", 12)
    monkeypatch.setattr(blending, "INNER_TREES", 6)
    table = write_trials(tmp_path / "a", objects=3, each=4, frames=10)
    others = write_trials(tmp_path / "b", objects=2, each=1, frames=10, first=50)
    options = TrialOptions(test=others, cache=tmp_path / "cache")
    TrainTrials(trials=table, output=tmp_path / "run", options=options).run()
    capsys.readouterr()
    about = json.loads((tmp_path / "run" / "run.json").read_text())
    assert len(about["predictions"]) == about["rows"][0]["trials"]["trials"] == 2
    assert about["learned_trials"] == 12


def test_the_kind_of_members_that_predicts_better_is_preferred_the_more_groups_say_so() -> None:
    """Not beyond thirty: those to come may be of another session."""
    y = np.arange(40) % 2
    good, blind = np.where(y[:, None] == [0, 1], 0.9, 0.1), np.full((40, 2), 0.5)
    held = np.stack([good, blind, blind, good], axis=1)
    prior, look = np.array([2.0, 1.0, 1.0, 0.0]), np.array([False, False, True, True])
    few, many = (trusted(held, y, groups, prior, look) for groups in (3, 30))
    for found in (few, many):
        assert found[3] == 0.0
    assert many[2] / many[:2].sum() < few[2] / few[:2].sum() < 1.0
    alone = [trusted(held[:, :2], y, groups, prior[:2], np.array([0, 1])) for groups in (30, 300)]
    np.testing.assert_allclose(alone[0], alone[1])


def test_the_better_member_of_a_kind_is_preferred_ten_times_less_than_a_kind() -> None:
    """A tenth of an observation a group: of ten groups members keep about their priors."""
    y = np.arange(40) % 2
    good, blind = np.where(y[:, None] == [0, 1], 0.9, 0.1), np.full((40, 2), 0.5)
    held, prior = np.stack([good, blind], axis=1), np.array([1.0, 2.0])
    ahead = np.log(0.9 / 0.5)
    for groups in (1, 10, 200):
        found = trusted(held, y, groups, prior, np.array(["look", "look"]))
        assert found[0] / found[1] == pytest.approx(0.5 * np.exp(0.1 * groups * ahead), rel=1e-6)
        assert found.sum() == pytest.approx(1.0)


def test_a_kind_that_counts_half_before_any_trial_has_half_of_what_it_would_have() -> None:
    y = np.arange(40) % 2
    good, blind = np.where(y[:, None] == [0, 1], 0.9, 0.1), np.full((40, 2), 0.5)
    held, prior = np.stack([good, blind, blind], axis=1), np.ones(3)
    kinds = np.array(["miniature", "look", "look"])
    whole = trusted(held, y, 10, prior, kinds)
    half = trusted(held, y, 10, prior, kinds, np.array([0.5, 1.0, 1.0]))
    np.testing.assert_allclose(half, [0.5 * whole[0], *whole[1:]])


@pytest.mark.parametrize(("frames", "part"), [(1, 1.0), (10, 0.5)])
def test_plain_colours_count_as_one_kind_where_images_change_within_a_crop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, frames: int, part: float
) -> None:
    """Of a crop of a single image nothing else shows more."""
    seen: list[dict[str, float]] = []

    def watched(*args: Any) -> Any:
        seen.append(dict(zip(args[4].tolist(), args[5].tolist(), strict=True)))
        return trusted(*args)

    monkeypatch.setattr(blending, "trusted", watched)
    monkeypatch.setattr(blending, "TREES", 6)
    monkeypatch.setattr(blending, "INNER_TREES", 4)
    table = write_trials(tmp_path / "a", objects=4, each=4, frames=frames)
    options = TrialOptions(cache=tmp_path / "cache", network=False)
    TrainTrials(trials=table, output=tmp_path / "run", options=options).run()
    assert seen
    for parts in seen:
        assert parts.pop("picture") == parts.pop("miniature") == part
        assert set(parts.values()) == {1.0}
