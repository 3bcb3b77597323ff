"""Which part of a trial crops are taken from: inner folds choose, on each training side anew."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from trial_makers import SIZE, as_avi, few_small_members, some_trials, write_trials

import taxel.training.camera_trials.blend as blending
from taxel.bundles.trials import IN_RUN, read_trial_contract
from taxel.cli.options.trials import TrialOptions
from taxel.cli.training.train_trials import TrainTrials
from taxel.evaluation.camera_trials.contenders import BAR
from taxel.evaluation.camera_trials.crossval import judge_trials
from taxel.evaluation.camera_trials.cut_choice import (
    MOVING,
    CutTrials,
    choose_cuts,
    completed,
    load_ways,
    training_sides,
)
from taxel.evaluation.camera_trials.sides import split_trials
from taxel.evaluation.camera_trials.trial_set import Sight, TrialSet
from taxel.views.tables.trial_notes import cut_line
from taxel.views.tables.trials import part_choices
from taxel.windows.camera_trials import read_camera_trials
from taxel.windows.trial_layout import Layout


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    few_small_members(monkeypatch)
    monkeypatch.setattr(blending, "MEMBERS", blending.MEMBERS[:2])


def both_ways(whole_shows: bool) -> tuple[TrialSet, TrialSet]:
    """Trials whose class shows in crops of whole trials, or else in those of the moving part."""
    shown = some_trials()
    rng = np.random.default_rng(1)
    noise = {
        name: rng.normal(size=rows.shape).astype(np.float32)
        for name, rows in shown.cut.rows.items()
    }
    blind = replace(shown, cut=replace(shown.cut, rows=noise))
    whole, part = (shown, blind) if whole_shows else (blind, shown)
    return whole, replace(part, layout=Layout(20, 3, moving=True, step=2))


@pytest.mark.parametrize("whole_shows", [True, False])
def test_each_training_side_takes_the_part_that_is_better_on_its_inner_folds(
    whole_shows: bool,
) -> None:
    ways = both_ways(whole_shows)
    split = split_trials(ways[0].groups, ways[0].y, "group:object", 3, 0)
    sides = training_sides(ways[0], split, folds=True, final=True)
    assert [len(side) for side in sides] == [16, 16, 16, 24]
    cut = choose_cuts(ways, split, sides, 0)
    assert [own.layout.moving for own in cut.sides] == [not whole_shows] * 4
    assert cut.moving == (0 if whole_shows else 4)
    assert cut.usual is ways[0 if whole_shows else 1]
    assert all((whole < part) == whole_shows for whole, part in cut.losses)


def test_no_label_of_a_test_trial_has_a_say() -> None:
    ways = both_ways(whole_shows=False)
    split = split_trials(ways[0].groups, ways[0].y, "group:object", 3, 0)
    (side, *_) = training_sides(ways[0], split, folds=True, final=False)
    y = ways[0].y.copy()
    y[split.folds[0].test_rows] = 1 - y[split.folds[0].test_rows]
    changed = tuple(replace(own, y=y) for own in ways)
    assert (
        choose_cuts(changed, split, [side], 0).losses == choose_cuts(ways, split, [side], 0).losses
    )


def test_only_what_is_chosen_is_finished_and_each_fold_is_judged_on_its_own_crops() -> None:
    whole, part = both_ways(whole_shows=False)
    split = split_trials(whole.groups, whole.y, "group:object", 3, 0)
    made: list[bool] = []

    def finish(own: TrialSet) -> TrialSet:
        made.append(own.layout.moving)
        return own

    cut = completed(CutTrials(sides=(part, whole, whole), losses=((0.6, 0.1),) * 3), finish)
    assert sorted(made) == [False, True]
    (bar,) = judge_trials(cut.usual, split, 0, (BAR,), cuts=cut.sides)
    right = bar.probabilities.argmax(axis=1) == whole.y
    shares = [right[fold.test_rows].mean() for fold in split.folds]
    assert shares[0] == 1.0
    assert max(shares[1:]) < 1.0
    line = cut_line(cut)
    assert "in 1 of 3 training sides" in line
    assert "0.600 with crops of whole trials, 0.100" in line
    assert cut_line(CutTrials(sides=(whole,))) == ""
    nothing = CutTrials(sides=(whole,) * 4, losses=((float("nan"), float("nan")),) * 4)
    assert "no trial could be held out" in cut_line(nothing)
    assert "0.600" in cut_line(replace(nothing, losses=((0.6, 0.7), *nothing.losses[1:])))
    found = part_choices(nothing, split)
    assert [own["side"] for own in found] == [*(fold.name for fold in split.folds), "kept"]
    assert {own["loss_whole"] for own in found} == {None}
    assert part_choices(cut, split)[0] == {
        "side": split.folds[0].name, "moving": True, "loss_whole": 0.6, "loss_moving": 0.1
    }  # fmt: skip


def test_where_nothing_can_be_held_out_whole_trials_are_kept() -> None:
    """A class of one trial."""
    ways = tuple(replace(own, y=np.array([0] * 23 + [1])) for own in both_ways(whole_shows=False))
    split = split_trials(ways[0].groups, some_trials().y, "group:object", 3, 0)
    cut = choose_cuts(ways, split, [np.arange(24)], 0)
    assert np.isnan(cut.losses).all()
    assert cut.moving == 0


def pressed(slips: bool, before: int, behind: int, seed: int) -> list[NDArray[np.uint8]]:
    """Return images of rest, a patch that comes, stays for ten images and goes, and rest again."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(np.float32)
    force = np.concatenate([np.zeros(before), np.linspace(0, 1, 4), np.ones(10),
                            np.linspace(1, 0, 4), np.zeros(behind)])  # fmt: skip
    images = []
    for number, own in enumerate(force):
        moved = 2.0 * np.clip(number - before - 4, 0, 10) * slips
        patch = np.exp(-(((x - 25 - moved) / 9) ** 2 + ((y - 30) / 12) ** 2))
        grey = 60 + 25 * np.sin(x / 2.5) + 110 * own * patch + rng.normal(0, 1, SIZE)
        images.append(np.repeat(np.rint(grey).astype(np.uint8)[..., None], 3, axis=2))
    return images


def write_pressed(folder: Path, trials: int, before: int, behind: int) -> Path:
    """Write trials of four objects, half of which slip, with rest of two lengths; their table."""
    lines = ["camera:wrist,label:slipped,group:object"]
    for number in range(trials):
        slips, early = number // 4 % 2 == 1, (number + number // 4) % 2
        rest = (before, behind + number) if early else (behind + number, before)
        name = as_avi(folder / f"t{number}", pressed(slips, *rest, number))
        lines.append(f"{name},{int(slips)},object {number % 4}")
    (folder / "trials.csv").write_text("\n".join(lines) + "\n")
    return folder / "trials.csv"


def test_trials_are_cut_both_ways_only_where_the_ways_differ(tmp_path: Path) -> None:
    trials = read_camera_trials(write_pressed(tmp_path, 8, 12, 20))
    load = partial(load_ways, trials, None, tmp_path / "cache", sight=Sight(views=("pixels",)))
    passes: list[str] = []
    whole, part = load(crop=8, on_trial=lambda name, done, of: passes.append(name))
    assert (whole.layout, part.layout) == (Layout(8, 3), Layout(8, 3, moving=True))
    assert not np.array_equal(whole.rows, part.rows)
    assert passes.count(MOVING) == 8
    assert [own.layout for own in load(crop=8, moving=True)] == [part.layout]
    assert [own.layout for own in load(crop=8, moving=False)] == [whole.layout]
    short = read_camera_trials(write_trials(tmp_path / "short", objects=2, each=2, frames=10))
    found = load_ways(short, None, tmp_path / "cache", sight=Sight(views=("pixels",)))
    assert [own.layout for own in found] == [Layout(10, 1)]


@pytest.mark.slow
def test_a_touch_between_rest_is_found_and_its_crops_are_kept_in_the_bundle(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Rest before and behind, of another length in each trial, in which no class shows: a crop at a
    trial's start, middle or end seldom shows the touch.
    """
    table = write_pressed(tmp_path, 16, 25, 70)
    options = TrialOptions(fold_count=2, crop=16, cache=tmp_path / "cache", network=False)
    TrainTrials(trials=table, output=tmp_path / "run", options=options).run()
    about = json.loads((tmp_path / "run" / "run.json").read_text())
    assert [own["moving"] for own in about["part_chosen"]] == [True] * 3
    assert all(own["loss_moving"] < own["loss_whole"] for own in about["part_chosen"])
    assert "the part in which something moves in each training side" in capsys.readouterr().out
    assert read_trial_contract(tmp_path / "run" / IN_RUN).layout.moving
