"""What camera trials are learned from, and the blend: members, weights, novelty, export."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from trial_makers import (
    few_small_members,
    some_trials,
    trial_images,
    write_trials,
)

import taxel.training.camera_trials.blend as blending
from taxel.bundles.engine import open_engine
from taxel.evaluation.camera_trials.contenders import OURS
from taxel.evaluation.camera_trials.crossval import judge_trials
from taxel.evaluation.camera_trials.sides import split_trials
from taxel.evaluation.camera_trials.trial_set import Sight, load_trial_set
from taxel.training.camera_trials.blend import fit_blend
from taxel.training.camera_trials.inner_folds import (
    classes_are_groups,
    held_out_parts,
    later_folds,
)
from taxel.training.camera_trials.learning import Crops, Extras, Learning
from taxel.training.camera_trials.member_weights import weigh, weigh_places
from taxel.training.camera_trials.members import MEMBERS
from taxel.training.camera_trials.novelty import Novelty, novelty_threshold
from taxel.training.camera_trials.onnx_graph import blend_to_onnx
from taxel.training.camera_trials.rank_sums import Steady
from taxel.windows.camera_trials import read_camera_trials
from taxel.windows.trial_crops import (
    MOVEMENT,
    Scene,
    look_at,
    row_of,
    rows_alone,
)


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few and small members: tests look at wiring, not at accuracy."""
    few_small_members(monkeypatch)


@pytest.mark.slow
def test_further_crops_and_mirror_images_stay_on_their_trials_side() -> None:
    """Other crops of test trials leave predictions unchanged, other ones of training do not."""
    trials = some_trials()
    first = trials.cut.place == 0
    given = Crops(trials.rows[first], trials.cut.trial[first])
    trials = replace(trials, extras=Extras(further=given))
    split = split_trials(trials.groups, trials.y, "group:object", 3, 0)
    first_fold = replace(split, folds=split.folds[:1])
    held = first_fold.folds[0].test_rows

    def predicted(further: Crops | None) -> NDArray[np.float64]:
        changed = replace(trials, extras=Extras(further=further))
        return judge_trials(changed, first_fold, 0, (OURS,))[0].probabilities[held]

    further = trials.extras.further
    assert further is not None
    before = predicted(further)
    tested = np.isin(further.trial, held)
    for side, same in ((tested, True), (~tested, False)):
        rows = np.where(side[:, None], -further.rows, further.rows)
        assert np.array_equal(predicted(replace(further, rows=rows)), before) == same
    assert not np.array_equal(predicted(None), before)


@pytest.mark.slow
@pytest.mark.parametrize(("cameras", "crops"), [(1, 6), (2, 6 + 2 * 9)])
def test_crops_that_are_only_learned_from_are_kept(
    cameras: int, crops: int, tmp_path: Path
) -> None:
    """Six lie between the three; of two cameras, each alone gives every crop once more.

    They are seen as those who learn from them do, by movement alone: the rest would take long.
    """
    trials = read_camera_trials(
        write_trials(tmp_path / "a", objects=2, each=2, shorter=4, cameras=cameras)
    )
    sight = Sight(extras=True)
    load = partial(load_trial_set, trials, "slipped", tmp_path / "kept", sight=sight)
    whole, again = load(), load().extras.further
    first = whole.extras.further
    assert first is not None
    assert first.rows.shape[1] == whole.widths["pixels"] + whole.widths["slip"]
    between = [own.name for own in (tmp_path / "kept" / "trials").glob("*-between-*")]
    assert {name.split("-")[0] for name in between} == {"pixels", "slip"}
    assert all(set(member.views) <= set(MOVEMENT) for member in MEMBERS if member.further)
    assert again is not None
    assert np.bincount(first.trial).tolist() == [crops] * len(trials)
    assert np.array_equal(first.rows, again.rows)
    assert load_trial_set(trials, "slipped", tmp_path / "kept").extras == Extras()


def test_a_camera_alone_is_what_two_that_see_the_same_give() -> None:
    scenes = [Scene(trial_images(slips, 10, 1, 100), 25.0, 0.065) for slips in (True, False)]
    views = ("pixels", "slip", "stills")
    for scene, alone in zip(scenes, rows_alone(look_at(views, scenes)), strict=True):
        both = row_of(look_at(views, [scene, scene]))
        assert all(np.array_equal(alone[name], both[name]) for name in views)
    assert rows_alone(look_at(views, scenes[:1])) == []


@pytest.mark.parametrize("classes", [2, 3])
def test_the_exported_blend_gives_what_the_trained_one_gives(classes: int) -> None:
    trials = some_trials(classes=classes)
    learning = trials.learning(trials.rows, "object")
    blend = fit_blend(learning, trials.cameras, trials.widths, 0, MEMBERS)
    model = open_engine(blend_to_onnx(blend, learning.rows.shape[1]))
    output = model.run(rows=learning.rows)
    assert output[:, :-1] == pytest.approx(blend.crops(learning.rows), abs=1e-5)
    assert output[:, -1] == pytest.approx(blend.novelty.measure(learning.rows), abs=1e-3)


def test_forests_of_too_many_nodes_keep_their_first_trees(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that a bundle of many trials stays small; what is trained and what is exported agree."""
    trials = some_trials()
    learning = trials.learning(trials.rows, "object")
    whole = fit_blend(learning, trials.cameras, trials.widths, 0, MEMBERS[:1]).fitted[0]
    nodes = [tree.tree_.node_count for tree in whole.estimators_]
    monkeypatch.setattr(blending, "MOST_NUMBERS", sum(nodes) * (2 + 4) // 4)

    blend = fit_blend(learning, trials.cameras, trials.widths, 0, MEMBERS[:1])

    kept = blend.fitted[0].estimators_
    assert len(kept) == len(nodes) // 4
    assert [tree.tree_.node_count for tree in kept] == nodes[: len(kept)]
    exported = open_engine(blend_to_onnx(blend, learning.rows.shape[1])).run(rows=learning.rows)
    assert exported[:, :-1] == pytest.approx(blend.crops(learning.rows), abs=1e-5)


def test_weights_favour_the_member_that_is_right_and_sum_to_one() -> None:
    y = np.arange(40) % 2
    good = np.where(y[:, None] == [0, 1], 0.9, 0.1)
    blind = np.full((40, 2), 0.5)
    held = np.stack([blind, good], axis=1)
    drawn, free = weigh(held, y, np.ones(2)), weigh(held, y, np.zeros(2))
    assert drawn.sum() == pytest.approx(1.0)
    assert 0.5 < drawn[1] < free[1]
    assert free[1] > 0.9


def test_the_crop_that_shows_most_counts_most_the_more_groups_the_more() -> None:
    """With one or two groups crops count nearly alike: what one day shows says little of others."""
    y = np.arange(40) % 2
    right = np.where(y[:, None] == [0, 1], 0.9, 0.1)
    blind = np.full((40, 2), 0.5)
    held = np.stack([blind, right, blind], axis=1)
    few, some, many = (weigh_places(held, y, groups) for groups in (1, 4, 100))
    assert [found.sum() for found in (few, some, many)] == pytest.approx([1.0] * 3)
    assert 1 / 3 < few[1] < 0.5 < some[1] < many[1]
    assert few[0] == few[2] > many[0] == many[2] > 0


def test_a_trial_is_the_mean_of_its_crops_by_what_inner_folds_say_of_their_places() -> None:
    """The middle crops of all trials are noise; live and evaluation share these weights."""
    trials = some_trials(48)
    rows = trials.rows.copy()
    middle = trials.cut.place == 1
    rows[middle] = np.random.default_rng(3).normal(size=rows[middle].shape)
    learning = trials.learning(rows, "object")
    blend = fit_blend(learning, trials.cameras, trials.widths, 0, MEMBERS[:2])
    assert blend.places.sum() == pytest.approx(1.0)
    assert blend.places[1] < 0.25 < min(blend.places[0], blend.places[2])
    crops = blend.crops(rows).reshape(48, 3, 2)
    mean = np.einsum("tpc,p->tc", crops, blend.places) ** blend.sharpness
    expected = mean / mean.sum(axis=1, keepdims=True)
    assert blend.trials(rows, learning.trial) == pytest.approx(expected, abs=1e-5)


def test_a_class_of_a_single_group_still_leaves_trials_to_weigh_by() -> None:
    """Where no group can be held out with all classes left, trials are."""
    trials = some_trials()
    learning = replace(
        trials.learning(trials.rows, "object"), groups=np.array([f"o{k}" for k in trials.y])
    )
    blend = fit_blend(learning, trials.cameras, trials.widths, 0, MEMBERS[:2])
    assert np.isfinite(blend.inner["blend"])


@pytest.mark.slow
def test_sharpness_is_found_where_held_out_trials_are_as_what_is_to_come() -> None:
    """Where each class is one object, trials show how sure to be; where one class has two, no."""
    trials = some_trials()
    learning = trials.learning(trials.rows, "object")
    names = [f"o{k}" for k in learning.y]
    further = ["p0" if at == 0 else name for at, name in enumerate(names)]

    def sharpness(groups: list[str]) -> float:
        own = replace(learning, groups=np.array(groups))
        return fit_blend(own, trials.cameras, trials.widths, 0, MEMBERS[:2]).sharpness

    assert sharpness(names) > 1.1
    assert sharpness(further) == 1.0


def test_what_is_far_from_all_learned_is_novel() -> None:
    rows = np.random.default_rng(0).normal(size=(60, 5)).astype(np.float32)
    novelty = Novelty.of(rows)
    assert novelty.measure(rows + 50.0).min() > novelty.measure(rows).max()


def test_the_threshold_rejects_the_stated_share_of_trials_held_out() -> None:
    held: NDArray[np.float64] = np.arange(1.0, 100.0)
    assert novelty_threshold(held, 0.05) == 95.0
    assert novelty_threshold(held[:5], 0.05) == np.inf


def test_learning_from_some_trials_numbers_them_anew() -> None:
    learning = Learning(
        np.arange(8, dtype=np.float32)[:, None], np.repeat(np.arange(4), 2),
        np.array([0, 1, 0, 1]), np.array(list("aabb")), 2,
        Extras(Crops(np.array([[10], [11], [13]], np.float32), np.array([0, 1, 3]))),
    )  # fmt: skip
    part = learning.part(np.array([1, 3]))
    assert part.trial.tolist() == [0, 0, 1, 1]
    assert part.rows[:, 0].tolist() == [2, 3, 6, 7]
    assert part.groups.tolist() == ["a", "b"]
    further = part.extras.further
    assert further is not None
    assert further.trial.tolist() == [0, 1]
    assert further.rows[:, 0].tolist() == [11, 13]


@pytest.mark.parametrize(
    ("groups", "are"), [("abc", True), ("abb", False), ("aaa", False), ("aab", False)]
)
def test_classes_are_groups_only_where_each_is_one_of_its_own(groups: str, are: bool) -> None:
    """One session that holds all classes is no object by which a class is known."""
    y = np.arange(3).repeat(4)
    assert classes_are_groups(y, np.array(list(groups)).repeat(4)) is are


def test_one_session_does_not_make_a_blend_surer_of_the_sessions_to_come() -> None:
    """Nothing but single trials can be held out, which are of a session that was learned."""
    y = np.arange(24) % 2
    rows = (y[:, None] + np.random.default_rng(1).normal(0, 0.3, (24, 3))).astype(np.float32)
    member = replace(MEMBERS[4], views={"look": ()})

    def sharpness(groups: NDArray[np.str_]) -> float:
        learning = Learning(rows, np.arange(24), y, groups, 2)
        return fit_blend(learning, 1, {"look": 3}, 0, (member,)).sharpness

    assert sharpness(np.full(24, "day")) == 1.0
    assert sharpness(np.array(["ball", "cup"])[y]) > 1.0


def test_where_later_trials_are_tested_inner_folds_learn_from_what_came_before() -> None:
    """Five blocks of each class, the last three tested; trials of one number stay together."""
    y = np.tile(np.arange(2), 20)
    order = np.repeat(np.arange(20), 2) // 2.0  # two of a class share each number
    parts = later_folds(y, order)
    assert len(parts) == 3
    for train, test in parts:
        assert order[train].max() < order[test].min()
    assert sorted(np.concatenate([test for _, test in parts]).tolist()) == list(range(16, 40))
    assert later_folds(np.array([0, 0, 1, 1]), np.arange(4.0)) == []


def test_a_class_that_began_later_is_not_judged_before_it_was_learned() -> None:
    y = np.array([0, 1] * 10 + [2])
    parts = later_folds(y, np.arange(21.0))
    assert parts
    assert all(2 not in y[test] for _, test in parts)


def test_a_member_that_drifts_loses_its_weight_where_later_trials_are_tested() -> None:
    """By groups it seems the better one; by what comes later it is the worse."""
    rng = np.random.default_rng(0)
    count = 100
    y = np.arange(count) % 2
    time = np.arange(count) // 2
    # In the first column the classes change places with each ten trials; the second is weak.
    drifting = np.where((time // 10) % 2 == 0, 1.0, -1.0) * (2.0 * y - 1.0)
    steady = 0.8 * (2.0 * y - 1.0) + rng.normal(size=count)
    where = np.eye(5)[time // 10] * 3.0 * drifting[:, None]  # which block it is shows as well
    rows = np.column_stack([where, steady]).astype(np.float32)
    groups = np.array([f"g{at % 10}" for at in range(count)])
    learning = Learning(rows, np.arange(count), y, groups, 2)
    by_group = held_out_parts(learning.y, learning.groups, None, 0)
    by_time = held_out_parts(learning.y, learning.groups, time.astype(float), 0)
    assert by_time.as_to_come
    errors = {}
    for name, parts in (("group", by_group.parts), ("time", by_time.parts)):
        for columns in ((0, 1, 2, 3, 4), (5,)):
            wrong = [
                (Steady(0.5).fit(rows[train][:, columns], y[train]).predict_proba(
                    rows[test][:, columns]).argmax(axis=1) != y[test]).mean()
                for train, test in parts
            ]  # fmt: skip
            errors[name, len(columns)] = float(np.mean(wrong))
    assert errors["group", 5] < errors["group", 1]
    assert errors["time", 5] > errors["time", 1]
