"""Claims about files of arrays: the same values from every form, and nothing from hostile ones."""

from contextlib import closing
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io.matlab
from array_readers import STACK, held, values
from array_writers import FORMS, write_mat5, write_mat73, write_packed_mat5
from scipy.io import loadmat, savemat

from taxel.errors import BadFile
from taxel.foreign.array_files import open_arrays
from taxel.foreign.held_arrays import Cells, Numbers, Texts, table_of

pytestmark = pytest.mark.usefixtures("untried_hdf5")

KINDS = ["<f4", "<f8", ">f4", "<i2", ">u2", "u1", "<i8", "<f2", "?"]
NOT_IN_MATLAB_5 = ("<f2", ">f4", ">u2")


@pytest.mark.parametrize(
    ("form", "kind"),
    [
        (form, kind)
        for form in FORMS
        for kind in KINDS
        if not (form.endswith("MATLAB 5") and kind in NOT_IN_MATLAB_5)
    ],
)
def test_numbers_are_the_same_from_every_form(tmp_path, form, kind):
    """Axes in the order of the file's own program, values bit for bit, also a piece of them."""
    ending, write = FORMS[form]
    array = STACK.astype(kind)
    write(tmp_path / f"a{ending}", {"X": array})
    np.testing.assert_array_equal(values(tmp_path / f"a{ending}", "X"), array)


@pytest.mark.parametrize("form", FORMS)
def test_texts_are_the_same_from_every_form(tmp_path, form):
    """Fixed letters, cellstr and texts of any length; letters beyond ASCII."""
    ending, write = FORMS[form]
    write(tmp_path / f"a{ending}", {"y": np.array(["cup", "Tür", "ball"])})
    found = held(tmp_path / f"a{ending}", "y")
    if isinstance(found, Cells):
        found = Texts(tuple(item.values[0] for item in found.items))
    assert found == Texts(("cup", "Tür", "ball"))


@pytest.mark.parametrize("write", [write_mat5, write_packed_mat5, write_mat73])
def test_cells_of_matrices_are_trials_of_their_own_length(tmp_path, write):
    """As MATLAB keeps ragged trials."""
    parts = [STACK[0], STACK[0, :2], STACK[1]]
    cells = np.empty(3, object)
    cells[:] = parts
    write(tmp_path / "a.mat", {"X": parts if write is write_mat73 else cells})
    found = held(tmp_path / "a.mat", "X")
    assert isinstance(found, Cells)
    assert [item.shape for item in found.items] == [(3, 4), (2, 4), (3, 4)]


def test_cells_of_matlab_hold_the_right_values(tmp_path):
    """Both versions, read while the file is open."""
    for write, cells in ((write_mat5, np.array([[None, None]])), (write_mat73, None)):
        if cells is not None:
            cells[0, 0], cells[0, 1] = STACK[0], STACK[1, :1]
        write(tmp_path / "a.mat", {"X": [STACK[0], STACK[1, :1]] if cells is None else cells})
        file = open_arrays(tmp_path / "a.mat")
        first, second = file.get("X").items
        np.testing.assert_array_equal(first.whole(), STACK[0])
        np.testing.assert_array_equal(second.whole(), STACK[1, :1])
        file.close()


def test_structures_and_letters_of_matlab(tmp_path):
    """data.force of one structure is an array, of an array of structures cells; rows of letters
    are texts."""
    many = np.zeros((1, 2), dtype=[("force", object), ("object", object)])
    many[0, 0], many[0, 1] = (STACK[0], "cup"), (STACK[1], "ball")
    single = {"force": STACK, "object": "cup", "of": {"the": {"deep": STACK[1]}}}
    letters = np.array(["cup ", "ball"])
    savemat(tmp_path / "a.mat", {"many": many, "one": single, "letters": letters, "flag": True})
    file = open_arrays(tmp_path / "a.mat")
    assert set(file.names()) == {"many.force", "many.object", "one.force", "one.object", "one.of",
                                 "letters", "flag"}  # fmt: skip
    np.testing.assert_array_equal(file.get("one.of.the.deep").whole(), STACK[1])
    np.testing.assert_array_equal(file.get("many.force").items[1].whole(), STACK[1])
    assert [item.values for item in file.get("many.object").items] == [("cup",), ("ball",)]
    np.testing.assert_array_equal(file.get("one.force").whole(), STACK)
    assert file.get("letters") == Texts(("cup", "ball"))
    nested = np.empty(2, object)
    nested[:] = [{"force": STACK[0]}, {"force": STACK[1]}]
    savemat(tmp_path / "cells.mat", {"trials": nested, "all": {"trials": nested}})
    with closing(open_arrays(tmp_path / "cells.mat")) as cells:
        for name in ("trials.force", "all.trials.force"):
            with pytest.raises(BadFile, match=r"into one array of them .*\[trials\{:\}\]"):
                cells.get(name)
    with pytest.raises(BadFile, match="a structure of force, object; name one of its fields"):
        file.get("many")
    with pytest.raises(KeyError):
        file.get("many.torque")
    file.close()


def test_files_of_matlab_itself_are_read_as_scipy_reads_them():
    """Of versions 5 to 7.4, of both byte orders, packed or not: what scipy's own tests hold."""
    folder = Path(scipy.io.matlab.__file__).parent / "tests" / "data"
    files = sorted(folder.glob("test*_[67].*.mat")) + sorted(folder.glob("*_endian.mat"))
    if not files:
        pytest.skip("this build of scipy comes without its tests")
    compared = 0
    for path in files:
        if "hdf5" in path.name:
            assert held(path, "testdouble").shape == (1, 9)
            continue
        theirs = loadmat(path)
        file = open_arrays(path)
        for name in set(file.names()) & set(theirs):
            try:
                found = file.get(name)
            except BadFile:
                continue
            if isinstance(found, Numbers):
                np.testing.assert_array_equal(found.whole(), theirs[name])
                compared += 1
            if isinstance(found, Texts):
                assert [text.strip() for text in theirs[name].tolist()] == list(found.values)
                compared += 1
        file.close()
    assert compared > 20


def test_structures_and_objects_of_matlab_in_hdf5(tmp_path):
    """data.force of an array of structures is cells; a string array, an object, is refused."""
    write_mat73(tmp_path / "a.mat", {"X": STACK})
    with h5py.File(tmp_path / "a.mat", "r+") as file:
        parts = [file["#refs#"].create_dataset(str(n), data=STACK[n].T) for n in range(2)]
        many = file.create_group("many")
        many["force"] = np.array([[part.ref] for part in parts], dtype=h5py.ref_dtype)
        file["one/force"] = STACK.T
        file["words"] = np.zeros((1, 6), "u4")
        file["words"].attrs["MATLAB_class"] = np.bytes_("string")
        file["words"].attrs["MATLAB_object_decode"] = 3
    file = open_arrays(tmp_path / "a.mat")
    assert set(file.names()) == {"X", "many.force", "one.force", "words"}
    np.testing.assert_array_equal(file.get("many.force").items[1].whole(), STACK[1])
    np.testing.assert_array_equal(file.get("one.force").whole(), STACK)
    with pytest.raises(BadFile, match=r"MATLAB's string object; .*cellstr"):
        file.get("words")
    file.close()


def test_attributes_of_hdf5(tmp_path):
    """Of groups, arrays and the file itself: texts, bytes and numbers."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        group = file.create_group("trials/1")
        group["force"] = STACK[0]
        group.attrs["object"] = "cup"
        group["force"].attrs["session"] = 3
        file.attrs["subject"] = np.bytes_("anna")
    assert held(tmp_path / "a.h5", "trials/1@object") == Texts(("cup",))
    assert held(tmp_path / "a.h5", "@subject") == Texts(("anna",))
    file = open_arrays(tmp_path / "a.h5")
    assert file.get("trials/1/force@session").whole() == 3
    for name in ("trials/1@none", "gone@object", "trials/1"):
        with pytest.raises(KeyError):
            file.get(name)
    file.close()


def test_values_of_an_enumeration_are_their_names(tmp_path):
    """A label of HDF5 that is one of cup and ball is that word, and not its number."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        kinds = h5py.enum_dtype({"cup": 0, "ball": 1}, basetype="i2")
        file.create_dataset("y", data=[1, 0, 1], dtype=kinds)
        file["truth"] = np.array([True, False])
    with closing(open_arrays(tmp_path / "a.h5")) as file:
        assert file.get("y") == Texts(("ball", "cup", "ball"))
        assert isinstance(file.get("truth"), Numbers)


def test_a_stack_of_npy_or_npz_is_mapped_not_read(tmp_path):
    """Whatever its size, no more memory is taken than of what is used."""
    np.save(tmp_path / "a.npy", STACK)
    np.savez(tmp_path / "a.npz", X=STACK)
    for file, name in (("a.npy", ""), ("a.npz", "X")):
        opened = open_arrays(tmp_path / file)
        assert isinstance(opened.get(name).whole(), np.memmap)
        opened.close()


def test_what_a_file_holds_is_said_in_a_line(tmp_path):
    """For messages: names, shapes and kinds."""
    FORMS["npz"][1](tmp_path / "a.npz", {"X": STACK, "y": ["a", "b"]})
    file = open_arrays(tmp_path / "a.npz")
    assert table_of(file) == "X (2 × 3 × 4 float32), y (2 texts)"
    file.close()
