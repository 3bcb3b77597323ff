"""Claims about how the touch encoder is judged: every network has the same probe."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from torch import nn

from taxel.evaluation.camera_trials.encoder_study import (
    ProbeSet,
    few_objects,
    probe_all,
    slip_probe_set,
)
from taxel.evaluation.camera_trials.probe import commonest
from taxel.evaluation.camera_trials.sides import split_trials
from taxel.training.encoder.videos import TouchVideo

OBJECTS, EACH, CAMERAS = 8, 2, 2


class Colours(nn.Module):
    """A network whose features are an image's mean colours."""

    def forward(self, images: torch.Tensor) -> torch.Tensor:
        return images.mean(dim=(2, 3))


@pytest.fixture(scope="module")
def probed() -> ProbeSet:
    """Sixteen trials of eight objects; those that slipped are brighter."""
    random = np.random.default_rng(0)
    y = np.tile([0, 1], OBJECTS * EACH // 2)
    names = np.repeat([f"object {i}" for i in range(OBJECTS)], EACH)
    groups = [{"object": str(name)} for name in names]
    shape = 3, 8, 120, 160, 3
    videos = [
        TouchVideo(
            folder="real",
            trial=f"trial {i}",
            groups=groups[i],
            digest=str(i),
            images=(random.integers(0, 90, shape[:2])[..., None, None, None] + 120 * y[i])
            .repeat(120, axis=2).repeat(160, axis=3).repeat(3, axis=4).astype(np.uint8),
            slip_um=np.full(shape[:2], np.nan, np.float32),
        )
        for i in range(len(y))
        for _ in range(CAMERAS)
    ]  # fmt: skip
    split = split_trials(groups, y, "group:object", 4, 0)
    return ProbeSet(y=y, objects=names, split=split, videos=videos)


@pytest.mark.slow
def test_brightness_is_found_by_the_probe_and_from_few_objects_too(probed: ProbeSet) -> None:
    rows = [probed.rows_of(Colours())] * len(probed.split.folds)
    found = probe_all(probed, {"colours": rows})["colours"]

    assert (found.probabilities.argmax(axis=1) == probed.y).all()
    assert few_objects(probed, rows, 4, 2)[0] == 1.0


def test_the_commonest_class_is_counted_on_each_folds_training_side(probed: ProbeSet) -> None:
    found = commonest(probed.labelled, probed.split)

    for fold in probed.split.folds:
        share = probed.y[fold.train_rows].mean()
        assert found.probabilities[fold.test_rows] == pytest.approx(
            np.tile([1 - share, share], (len(fold.test_rows), 1))
        )


def test_who_slipped_is_asked_of_whole_objects_never_seen() -> None:
    trials = [
        SimpleNamespace(labels={"outcome": outcome}, groups={"object": f"object {i}"})
        for i in range(OBJECTS)
        for outcome in ("slip", "stable")
    ]
    found = slip_probe_set(trials)  # type: ignore[arg-type]  # all of a trial that it looks at

    assert found.y.tolist() == [1, 0] * OBJECTS
    assert len(found.split.folds) == 5
    for fold in found.split.folds:
        assert not set(found.objects[fold.train_rows]) & set(found.objects[fold.test_rows])
