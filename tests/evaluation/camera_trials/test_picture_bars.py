"""Bars that see the picture: what they are given, how they vote, and single images they name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from trial_makers import some_trials

from taxel.evaluation.camera_trials.contenders import (
    NEAREST_BAR,
    PICTURE_BAR,
    Nearest,
    colours,
    contenders_for,
)
from taxel.evaluation.camera_trials.crossval import judge_trials
from taxel.evaluation.camera_trials.sides import split_trials
from taxel.evaluation.camera_trials.trial_set import TrialSet
from taxel.training.camera_trials.learning import Learning
from taxel.windows.trial_layout import Layout
from taxel.windows.trial_picture import CELLS, look_at_picture

CELL_COLOURS = CELLS[0] * CELLS[1] * 3


def single_images() -> TrialSet:
    """Trials of one image, whose class shows in two cells of the picture, and nowhere else."""
    trials = some_trials(places=1, lengths=(1, 1))
    picture = trials.cut.shown["picture"].copy()
    picture[:, :3, :, 30:36] += 90.0 * trials.y[:, None, None, None]
    rows = {**trials.cut.rows, "pixels": np.zeros_like(trials.cut.rows["pixels"])}
    cut = replace(trials.cut, rows=rows, shown={**trials.cut.shown, "picture": picture})
    return replace(trials, layout=Layout(1, 1), cut=cut)


def test_both_bars_name_single_images_by_their_picture() -> None:
    """Bars that see change alone had accuracy .500 there, so that to be ahead of them was cheap."""
    trials = single_images()
    split = split_trials(trials.groups, trials.y, "group:object", 3, 0)
    bars = [own for own in contenders_for(trials)[1:] if not own.leaks]
    assert bars == [PICTURE_BAR, NEAREST_BAR]
    for result in judge_trials(trials, split, 0, bars):
        assert result.whole.accuracy == 1.0


def test_colours_are_means_of_frames_side_by_side_and_of_one_image_once() -> None:
    trials = some_trials()
    found = colours(trials)
    assert found.shape == (72, 3 * 2 * CELL_COLOURS)
    picture = trials.cut.shown["picture"]
    assert_array_equal(found[5, CELL_COLOURS : 2 * CELL_COLOURS], picture[5, 0, 1, :CELL_COLOURS])
    assert_array_equal(found[5, -CELL_COLOURS:], picture[5, 2, 1, :CELL_COLOURS])
    assert colours(single_images()).shape == (24, 2 * CELL_COLOURS)

    image = np.full((60, 80, 3), (10, 20, 30), np.uint8)
    shown = {"picture": look_at_picture([image])[None, :, None]}
    alone = replace(trials, layout=Layout(1, 1), cut=replace(trials.cut, shown=shown))
    assert_array_equal(colours(alone), np.tile(np.float32([10, 20, 30]), 64)[None])


def learning_of(rows: list[float], y: list[int], classes: int) -> Learning:
    """Single crops of one number each."""
    return Learning(
        np.array(rows, np.float32)[:, None], np.arange(len(y)), np.array(y),
        np.array([str(i) for i in range(len(y))]), classes,
    )  # fmt: skip


def test_nearest_crops_vote_and_learned_classes_share_one_more() -> None:
    """So a class without a vote has a log-loss that one trial more would mend, not 13.8."""
    nearest = Nearest()
    nearest.fit(learning_of([0, 1, 2, 3, 9, 10, 11], [0, 0, 0, 1, 1, 1, 1], 3))
    asked = np.array([[0.0], [11.0]], np.float32)
    assert_allclose(nearest.crops(asked), [[3.5 / 6, 2.5 / 6, 0], [1.5 / 6, 4.5 / 6, 0]])
    assert_allclose(nearest.trials(asked, np.array([0, 0])), [[2.5 / 6, 3.5 / 6, 0]])


def test_fewer_crops_than_five_all_vote() -> None:
    nearest = Nearest()
    nearest.fit(learning_of([0, 1, 5], [0, 0, 1], 2))
    assert_allclose(nearest.crops(np.zeros((1, 1), np.float32)), [[2.5 / 4, 1.5 / 4]])
