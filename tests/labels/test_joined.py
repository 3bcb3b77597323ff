"""Joined labels: one text for one combination, and a label of that very name comes first."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from make_dataset import make_dataset

from taxel.errors import BadDataset
from taxel.evaluation.unknown.objects import kinds_of
from taxel.labels.joined import joined_label, parts_of, refuse_merged, with_joined_label
from taxel.training.unknown import fit_unknown
from taxel.windows.dataset import Dataset, only_labelled
from taxel.windows.scaling import fit_scaling

TARGET = "shape+material"
FOLDER = Path("folder")


def labelled(*labels: dict[str, str]) -> Dataset:
    """Return a data set whose trials have these labels in turn."""
    dataset = make_dataset(sessions=5, trials_a_session=12)
    trials = tuple(replace(trial, labels=labels[i % len(labels)])
                   for i, trial in enumerate(dataset.trials))  # fmt: skip
    return replace(dataset, trials=trials)


BALL, BLOCK = {"shape": "ball", "material": "glass"}, {"shape": "block", "material": "wood"}


def test_both_values_are_joined_where_both_are_there() -> None:
    assert joined_label(BALL, TARGET) == "ball glass"
    assert joined_label({"shape": "ball"}, TARGET) is None
    assert only_labelled(labelled(BALL, BLOCK), TARGET, FOLDER).classes(TARGET) == [
        "ball glass", "block wood"
    ]  # fmt: skip


def test_a_label_of_that_very_name_comes_first() -> None:
    """A column of the import table is called so; its values are kept."""
    own = {**BALL, TARGET: "tumbler"}
    dataset = only_labelled(labelled(own, {**BLOCK, TARGET: "toy"}), TARGET, FOLDER)

    assert dataset.classes(TARGET) == ["toy", "tumbler"]
    assert joined_label(own, TARGET) == "tumbler"


def test_two_combinations_of_one_text_are_refused() -> None:
    """They would be one class without a word."""
    cup, big = (
        {"shape": "big", "material": "cup glass"},
        {"shape": "big cup", "material": "glass"},
    )
    message = (
        "needed values of shape+material that differ once they are joined by a blank; got shape "
        "'big', material 'cup glass' and shape 'big cup', material 'glass' in folder, both "
        "'big cup glass'; rename a value"
    )
    with pytest.raises(BadDataset, match=message.replace("+", r"\+")):
        only_labelled(labelled(cup, BALL, big), TARGET, FOLDER)
    of_two = [with_joined_label(trial, TARGET) for trial in labelled(cup, big).trials]
    with pytest.raises(BadDataset, match="both 'big cup glass'"):  # of a folder to test on, too
        refuse_merged(of_two, TARGET, FOLDER)
    own = [{**labels, TARGET: "glass cup"} for labels in (cup, big)]
    assert only_labelled(labelled(BALL, *own), TARGET, FOLDER).classes(TARGET) == [
        "ball glass", "glass cup"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("labels", "target", "parts"),
    [
        (BALL, TARGET, ("shape", "material")),
        ({**BALL, TARGET: "ball glass"}, TARGET, ("shape", "material")),
        ({**BALL, TARGET: "tumbler"}, TARGET, (TARGET,)),
        ({"grip+load": "a"}, "grip+load", ("grip+load",)),
        (BALL, "shape", ("shape",)),
    ],
)
def test_the_parts_of_a_target(labels: dict[str, str], target: str, parts: tuple[str, ...]) -> None:
    assert parts_of(target, [labels]) == parts


def test_a_label_whose_own_name_holds_a_plus_may_be_judged_for_novelty() -> None:
    dataset = make_dataset(sessions=6, trials_a_session=12)
    trials = tuple(replace(trial, labels={"grip+load": trial.labels["shape"]})
                   for trial in dataset.trials)  # fmt: skip
    own = replace(dataset, trials=trials)
    values, mask = dataset.windows.values, dataset.windows.mask
    scaling = fit_scaling("standard", values, mask, None)

    kinds = kinds_of(own, "grip+load", ["c2"])
    test, same = (fit_unknown(data, target, scaling)
                  for data, target in ((own, "grip+load"), (dataset, "shape")))  # fmt: skip

    assert set(kinds) == {"", "c2"}
    assert [density.label for density in test.densities] == ["grip+load"]
    np.testing.assert_array_equal(test.densities[0].centres, same.densities[0].centres)
