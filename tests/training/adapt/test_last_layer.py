"""A new class from a few grasps: what it must reach, keep and refuse."""

from dataclasses import replace

import numpy as np
import pytest
from make_dataset import make_dataset

from taxel.errors import BadDataset, BadInput
from taxel.evaluation.adaptation.held_sessions import predicted, run_of, windows_of
from taxel.evaluation.adaptation.new_class import first_grasps
from taxel.models.catalogue import find_network
from taxel.training.adapt.last_layer import adapt_last_layer
from taxel.training.exemplars import Exemplars, all_exemplars, thin_out
from taxel.training.loop import TrainConfig
from taxel.training.recipes import find_recipe
from taxel.training.run import Run, load_run, save_run
from taxel.training.unknown import fit_unknown

DATA = make_dataset(sessions=5, trials_a_session=18, windows_a_trial=4)
CLASSES = DATA.classes("shape")
ALL = all_exemplars(DATA, CLASSES, "shape")
TEST = ALL[ALL.session == "s4"]
RECIPE = replace(find_recipe("teng"), train=TrainConfig(epochs=8, learning_rate=1e-2))


@pytest.fixture(scope="module")
def run() -> Run:
    train = ALL[(ALL.session != "s4") & (ALL.y != 2)]
    return run_of(DATA, train, CLASSES[:2], "shape", RECIPE)


def learn(run: Run, new: Exemplars, **options: object) -> Run:
    names = [CLASSES[i] for i in new.y]
    return adapt_last_layer(
        run,
        windows_of(new),
        names,
        list(new.grasp),
        list(new.session),
        **options,  # type: ignore[arg-type]
    ).run


def five(run: Run) -> Exemplars:
    return first_grasps(ALL[(ALL.session != "s4") & (ALL.y == 2)], 5, "s4", 1)


def test_five_grasps_teach_a_class_and_the_old_ones_stay(run: Run) -> None:
    before = (predicted(run, TEST) == TEST.y)[TEST.y < 2].mean()

    right = predicted(learn(run, five(run)), TEST) == TEST.y

    assert right[TEST.y == 2].mean() > 0.9
    assert right[TEST.y < 2].mean() >= before - 0.02


def test_the_run_that_was_adapted_is_not_changed(run: Run) -> None:
    weights = {k: v.clone() for k, v in run.networks[0].state_dict().items()}

    adapted = learn(run, five(run))

    assert run.contract.classes == tuple(CLASSES[:2])
    assert adapted.contract.classes == tuple(CLASSES)
    assert all(bool((v == weights[k]).all()) for k, v in run.networks[0].state_dict().items())
    assert adapted.contract.accuracy == {}


def test_the_body_stays_and_only_the_last_layer_is_new(run: Run) -> None:
    adapted = learn(run, five(run), features="body")

    old, new = run.networks[0].state_dict(), adapted.networks[0].state_dict()
    assert adapted.contract.model == run.contract.model == "cnn2d"
    assert {k for k in old if old[k].shape != new[k].shape or bool((old[k] != new[k]).any())} == {
        "last.weight",
        "last.bias",
    }


@pytest.mark.parametrize("features", ["body", "statistics"])
def test_an_adapted_run_comes_back_from_its_folder_and_can_learn_again(
    run: Run, tmp_path, features: str
) -> None:
    adapted = learn(run, five(run), features=features)
    save_run(tmp_path / "run", adapted)

    back = load_run(tmp_path / "run")

    np.testing.assert_array_equal(predicted(back, TEST), predicted(adapted, TEST))
    assert back.exemplars is not None
    assert set(back.exemplars.y) == {0, 1, 2}
    fourth = replace(five(run), values=five(run).values[:, ::-1] * 3.0, y=five(run).y)
    again = adapt_last_layer(
        back, windows_of(fourth), ["c9"] * len(fourth), list(fourth.grasp), list(fourth.session)
    )
    assert again.run.contract.classes == (*CLASSES, "c9")
    assert again.run.contract.model.count("+statistics") == 1


def test_a_class_that_does_not_stand_out_in_statistics_leaves_them_out(run: Run) -> None:
    """Its windows are drawn from the old classes' own: nothing tells it."""
    rng = np.random.default_rng(0)
    old = ALL[(ALL.session == "s0") & (ALL.y < 2)]
    grasps = rng.permutation(np.unique(old.grasp))[:6]
    same = old[np.isin(old.grasp, grasps)]

    found = adapt_last_layer(
        run, windows_of(same), ["same"] * len(same), list(same.grasp), list(same.session)
    )
    new = five(run)
    other = adapt_last_layer(
        run, windows_of(new), ["c2"] * len(new), list(new.grasp), list(new.session)
    )

    assert not found.statistics
    assert other.statistics
    assert other.stands_out > found.stands_out


def test_a_test_for_unknown_touch_that_never_saw_the_class_is_left_out(run: Run) -> None:
    """It would call the new class unknown."""
    scaling = run.contract.scaling
    learned = fit_unknown(DATA, "shape", scaling)
    contract = replace(run.contract, unknown=learned)

    assert learn(replace(run, contract=contract), five(run)).contract.unknown is None


def test_a_run_without_exemplars_is_refused(run: Run) -> None:
    with pytest.raises(BadInput, match="chose its model by a search; train one that keeps them"):
        learn(replace(run, exemplars=None), five(run))


def test_windows_of_another_length_or_none_are_refused(run: Run) -> None:
    new = five(run)
    with pytest.raises(BadDataset, match="rows"):
        learn(run, replace(new, values=new.values[:, :3], mask=new.mask[:, :3]))
    with pytest.raises(BadDataset, match="at least one window"):
        learn(run, new[np.zeros(len(new), bool)])


def test_exemplars_are_whole_grasps_and_few(run: Run) -> None:
    few = thin_out(ALL, most=2)

    for number in range(3):
        for session in np.unique(ALL.session):
            own = few[(few.y == number) & (few.session == session)]
            assert len(np.unique(own.grasp)) == 2
            assert len(own) == 8  # all four windows of each


def test_any_network_can_stand_beside_statistics_but_a_forest_cannot() -> None:
    for name in ("cnn1d", "lstm", "touchnet"):
        network = find_network(f"{name}+statistics").build(12, 12, 4)
        assert network.last.out_features == 4
    with pytest.raises(BadInput, match="course-forest"):
        find_network("course-forest+statistics")
