"""Short trials of a single camera, two classes and three: the default is not behind its own bar."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from trial_makers import as_avi, trial_images

import taxel.training.trial_blend as blending
from taxel.cli.evaluate_trials import EvaluateTrials
from taxel.cli.trial_data import TrialOptions

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
