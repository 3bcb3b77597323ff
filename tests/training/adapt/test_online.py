"""Learning on the fly: right answers count at once, and no class is forgotten."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from make_dataset import make_dataset

from taxel.bundles.versions import class_key
from taxel.errors import BadDataset, MissingExtra
from taxel.evaluation.adaptation.held_sessions import predicted, run_of, windows_of
from taxel.training.adapt.correcting import learn_corrections, run_probabilities
from taxel.training.adapt.drift import DriftWatch
from taxel.training.adapt.new_data import Grasps, by_class
from taxel.training.adapt.online import OnlineLearner, Reservoir
from taxel.training.exemplars import Exemplars, all_exemplars
from taxel.training.loop import TrainConfig, predict
from taxel.training.recipes import find_recipe
from taxel.training.run import Run

DATA = make_dataset(sessions=4, trials_a_session=18, windows_a_trial=4)
CLASSES = DATA.classes("shape")
ALL = all_exemplars(DATA, CLASSES, "shape")
RECIPE = replace(find_recipe("teng"), train=TrainConfig(epochs=8, learning_rate=1e-2))


@pytest.fixture(scope="module")
def run() -> Run:
    return run_of(DATA, ALL[ALL.session != "s3"], CLASSES, "shape", RECIPE)


def shifted() -> Exemplars:
    """The last session, its first channel weaker: answers are wrong until corrected."""
    own = ALL[ALL.session == "s3"]
    values = own.values.copy()
    values[:, :, 0] *= 0.75
    return replace(own, values=values)


def grasps(own: Exemplars) -> Grasps:
    return Grasps(
        windows=windows_of(own),
        label=tuple(CLASSES[i] for i in own.y),
        grasp=tuple(own.grasp),
        session=tuple(own.session),
        start_s=tuple(np.zeros(len(own))),
        recording=("",) * len(own),
        digest="",
    )


def test_before_any_correction_it_answers_as_the_run_does(run: Run) -> None:
    own = ALL[ALL.session == "s3"][np.arange(8)]

    now = OnlineLearner(run).answer(windows_of(own)).probabilities

    scaled = run.contract.scaling.apply(own.values, own.mask)
    np.testing.assert_allclose(now, predict(run.networks[0], scaled, own.mask), atol=1e-5)
    np.testing.assert_array_equal(predicted(OnlineLearner(run).learned(), ALL), predicted(run, ALL))


def test_corrections_make_answers_better_and_forget_no_class(run: Run) -> None:
    own = shifted()
    late = np.isin(own.grasp, list(dict.fromkeys(own.grasp))[9:])
    old = ALL[ALL.session == "s0"]

    found = learn_corrections(run, grasps(own[~late]), watch=False)

    was, now = (
        float((predicted(trained, own[late]) == own.y[late]).mean()) for trained in (run, found.run)
    )
    assert now > was
    for number in range(3):
        part = old[old.y == number]
        before, after = (predicted(trained, part) == number for trained in (run, found.run))
        lost = before.mean() - after.mean()
        assert lost <= 0.15


def test_the_same_grasps_in_the_same_order_give_the_same_weights(run: Run) -> None:
    first, second = (learn_corrections(run, grasps(shifted()), watch=False) for _ in range(2))

    assert first.prequential == second.prequential
    for one, two in zip(
        first.run.networks[0].parameters(), second.run.networks[0].parameters(), strict=True
    ):
        assert bool((one == two).all())


def test_an_answer_is_given_before_it_is_learned(run: Run) -> None:
    """One grasp alone: whatever it teaches comes too late for itself."""
    own = shifted()
    grasp = own[own.grasp == own.grasp[0]]

    found = learn_corrections(run, grasps(grasp), watch=False)

    assert found.grasps == 1
    assert found.prequential == found.unlearned


def test_an_unknown_class_is_refused_with_the_way_to_learn_it(run: Run) -> None:
    own = grasps(shifted())

    with pytest.raises(BadDataset, match="--new"):
        learn_corrections(run, replace(own, label=("cone",) * len(own)), watch=False)


def test_accuracy_by_class_counts_unknown_classes_as_wrong(run: Run) -> None:
    own = ALL[ALL.session == "s0"]
    label = tuple("cone" if i == 2 else CLASSES[i] for i in own.y)

    best = run_probabilities(run, windows_of(own))
    found = by_class(best, run.contract.classes, label, run.contract.classes)

    assert found["cone"] == 0.0
    assert found["all known before"] > found["all"]


def test_a_class_that_is_called_like_a_total_stands_apart_from_it(run: Run) -> None:
    own = ALL[ALL.session == "s0"]
    names = dict(zip(CLASSES, ("all", "class all", "all known before"), strict=True))
    label = tuple(names[CLASSES[i]] for i in own.y)
    classes = tuple(names[name] for name in CLASSES)
    shown = np.eye(3)[np.where(own.y == 0, 0, 1)]

    found = by_class(shown, classes, label, ("all", "class all"))

    assert found["class all"] == found["class class all"] == 1.0
    assert found["class all known before"] == 0.0
    assert found["all known before"] == 1.0
    assert 0.0 < found["all"] < 1.0
    assert [class_key(name) for name in ("cup", "classes", "class 1")] == ["cup", "classes",
                                                                          "class 1"]  # fmt: skip


def test_a_reservoir_keeps_early_and_late_windows_alike() -> None:
    rng = np.random.default_rng(0)
    kept = []
    for _ in range(200):
        reservoir = Reservoir(10)
        for row in range(100):
            reservoir.add(row, rng)
        assert len(reservoir.rows) == 10
        kept += reservoir.rows
    assert np.mean(kept) == pytest.approx(49.5, abs=2.5)


def test_drift_is_dated_to_where_the_answers_turned_worse() -> None:
    rng = np.random.default_rng(0)
    watch, found = DriftWatch(), []
    for number in range(160):
        doubt = float(np.clip(rng.normal(0.1 if number < 80 else 0.6, 0.1), 0, 1))
        drift = watch.add(doubt)
        if drift is not None:
            found.append((number, drift))

    (at, drift), *more = found
    assert not more
    assert at < 105
    assert abs(drift.grasp - 80) <= 2
    assert drift.after > drift.before + 0.3


def test_steady_or_falling_doubts_are_no_drift() -> None:
    rng = np.random.default_rng(1)
    watch = DriftWatch()
    steady = [watch.add(float(rng.uniform(0, 0.4))) for _ in range(300)]
    better = [watch.add(float(rng.uniform(0, 0.05))) for _ in range(100)]

    assert steady == [None] * 300
    assert better == [None] * 100


def test_without_river_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "river.drift", None)

    with pytest.raises(MissingExtra, match=r"taxel\[adapt\]"):
        DriftWatch()
