"""Claims about labels that are numbers of classes, and the list that names these classes."""

import re

import numpy as np
import pytest
from array_writers import FORMS
from stack_imports import HEADER, OWN, X, bring, refusal

NUMBERS = np.array([0, 2, 1, 1, 0, 2])
CLASSES = ["cup", "ball", "sponge"]
EXPECTED = ["cup", "sponge", "ball", "ball", "cup", "sponge"]

pytestmark = pytest.mark.usefixtures("untried_hdf5")


def labels_of(made) -> list[str]:
    return [item.manifest.labels["object"] for item in made]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("first", [0, 1])
def test_numbers_of_classes_become_their_names(tmp_path, form, first):
    """From 0, or with y-1 from 1; and a note says which number is which class."""
    ending, write = FORMS[form]
    write(tmp_path / f"a{ending}", {"X": X, "y": NUMBERS + first, "names": CLASSES})
    cell = "from:names[y]" if first == 0 else "from:names[y-1]"
    notes: list[str] = []
    row = f"a{ending},X,trials rows channels,{cell},1,{OWN},rate:50Hz"
    assert labels_of(bring(tmp_path, row, notes=notes)) == EXPECTED
    assert f"{cell}: {first} is cup, {first + 1} is ball, {first + 2} is sponge" in notes


def test_names_and_numbers_may_be_in_other_files(tmp_path):
    """Arrays or tables; a text's column of numbers takes its names from a table."""
    np.save(tmp_path / "X.npy", X)
    np.save(tmp_path / "y.npy", NUMBERS)
    np.save(tmp_path / "names.npy", np.array(CLASSES))
    (tmp_path / "classes.csv").write_text("id,object\n0,cup\n1,ball\n2,sponge\n")
    lines = "".join(f"{n},{number},{n}.5\n" for n, number in enumerate(NUMBERS))
    (tmp_path / "long.csv").write_text(f"trial,label,a\n{lines}")
    words = f"1,{OWN},rate:50Hz"
    text = "1,a[N],rate:50Hz"
    (tmp_path / "list.txt").write_text("\n".join(CLASSES))
    row = f"X.npy,,trials rows channels,from:list.txt[y.npy],{words}"
    assert "write the column's name into line 1" in refusal(tmp_path, row)
    cell = "from:names[label]"
    assert "in another file" in refusal(tmp_path, f"long.csv,trial,,{cell},{text}")
    for row in (
        f"X.npy,,trials rows channels,from:names.npy[y.npy],{words}",
        f"X.npy,,trials rows channels,from:classes.csv:object[y.npy],{words}",
        f"long.csv,trial,,from:classes.csv:object[label],{text}",
    ):
        assert labels_of(bring(tmp_path, row, header=HEADER)) == EXPECTED
        for path in (tmp_path / "out").iterdir():
            path.unlink()


@pytest.mark.parametrize(
    ("numbers", "names", "cell", "words"),
    [
        (NUMBERS + 1, CLASSES, "from:names[y]", "from 0 to 2.*got '3'.*from:names.y-1. if they"),
        (NUMBERS, CLASSES, "from:names[y-1]", "from 1 to 3.*got '0'.*write from:names.y. if they"),
        (NUMBERS / 2, CLASSES, "from:names[y]", "numbers of classes .* got '0.5'"),
        (
            -NUMBERS,
            CLASSES,
            "from:names[y]",
            "got '-2' of trial 2 .*leave out trials without a class",
        ),
        (NUMBERS, ["cup", "ball", "cup"], "from:names[y]", "got 'cup' twice"),
        (NUMBERS, CLASSES, "from:other[y]", "the name of an array; got 'other'"),
    ],
)
def test_numbers_without_a_class_are_refused(tmp_path, numbers, names, cell, words):
    """Never wrapped around from the end, and nothing is written."""
    np.savez(tmp_path / "a.npz", X=X, y=numbers, names=np.array(names))
    message = refusal(tmp_path, f"a.npz,X,trials rows channels,{cell},1,{OWN},rate:50Hz")
    assert re.search(words, message)


def test_numbers_without_a_zero_bring_a_doubt(tmp_path):
    """They may count from 1, and each label would be that of the class beside its own."""
    np.savez(tmp_path / "a.npz", X=X, y=np.array([1, 2, 1, 2, 1, 2]), names=np.array(CLASSES))
    notes: list[str] = []
    row = f"a.npz,X,trials rows channels,from:names[y],1,{OWN},rate:50Hz"
    assert labels_of(bring(tmp_path, row, notes=notes)) == ["ball", "sponge"] * 3
    assert "no trial has the number 0: if the numbers count from 1, write from:names[y-1]" in str(
        notes
    )
