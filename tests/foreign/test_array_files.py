"""Claims about files of arrays: the same values from every form, and nothing from hostile ones."""

import io
import pickle
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io.matlab
from array_writers import FORMS, write_mat5, write_mat73, write_packed_mat5
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mutations import changed_bytes
from scipy.io import loadmat, savemat

from taxel.errors import BadFile
from taxel.foreign.array_files import open_arrays
from taxel.foreign.held_arrays import Cells, Numbers, Texts, table_of


@pytest.fixture(autouse=True)
def untried(monkeypatch):
    """Leave out the process that reads HDF5 first: 0.3 s a file, and tested by itself."""
    monkeypatch.setattr("taxel.foreign.hdf5_file.try_hdf5", lambda path: None)


UNSHARED = [HealthCheck.function_scoped_fixture]
"""Examples write over one another's file."""
STACK = np.arange(2 * 3 * 4, dtype=np.float32).reshape(2, 3, 4) / 3


def held(path, name):
    """Return one array of a file, which is closed again."""
    file = open_arrays(path)
    try:
        return file.get(name)
    finally:
        file.close()


def values(path, name) -> np.ndarray:
    """Return the numbers of one array."""
    file = open_arrays(path)
    try:
        found = file.get(name)
        assert isinstance(found, Numbers)
        whole = np.array(found.whole())
        assert (found.shape, found.dtype) == (whole.shape, whole.dtype)
        axis = len(found.shape) - 1
        np.testing.assert_array_equal(found.part(axis, 0, 1), whole[..., :1])
        return whole
    finally:
        file.close()


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
    one = {"force": STACK, "object": "cup", "of": {"the": {"deep": STACK[1]}}}
    letters = np.array(["cup ", "ball"])
    savemat(tmp_path / "a.mat", {"many": many, "one": one, "letters": letters, "flag": True})
    file = open_arrays(tmp_path / "a.mat")
    assert set(file.names()) == {"many.force", "many.object", "one.force", "one.object", "one.of",
                                 "letters", "flag"}  # fmt: skip
    np.testing.assert_array_equal(file.get("one.of.the.deep").whole(), STACK[1])
    np.testing.assert_array_equal(file.get("many.force").items[1].whole(), STACK[1])
    assert [item.values for item in file.get("many.object").items] == [("cup",), ("ball",)]
    np.testing.assert_array_equal(file.get("one.force").whole(), STACK)
    assert file.get("letters") == Texts(("cup", "ball"))
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


class Trap:
    """Makes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return Path.touch, (Path(self.path),)


@pytest.mark.parametrize("ending", [".npy", ".npz"])
def test_objects_are_never_unpickled(tmp_path, ending):
    """The refusal says how to write trials that differ in length."""
    trap = np.array([Trap(tmp_path / "trapped"), None], object)
    (np.save if ending == ".npy" else np.savez)(tmp_path / f"a{ending}", trap)
    with pytest.raises(BadFile, match=r"only pickle could read; write texts as y\.astype\(str\)"):
        held(tmp_path / f"a{ending}", "" if ending == ".npy" else "arr_0")
    (tmp_path / "b.npy").write_bytes(pickle.dumps(trap))
    with pytest.raises(BadFile):
        open_arrays(tmp_path / "b.npy")
    assert not (tmp_path / "trapped").exists()


def npy(head: str, body: bytes = b"") -> bytes:
    """Return a .npy file with a head of one's own."""
    text = head.encode() + b"\n"
    return b"\x93NUMPY\1\0" + len(text).to_bytes(2, "little") + text + body


HUGE = "{'descr': '<f4', 'fortran_order': False, 'shape': (1000000, 1000000, 1000), }"


def test_a_flipped_bit_in_a_zip_is_found(tmp_path):
    """Also in what is not packed, and would be mapped: a zip holds a sum of each array."""
    for write in (np.savez, np.savez_compressed):
        write(tmp_path / "a.npz", X=STACK)
        content = bytearray((tmp_path / "a.npz").read_bytes())
        content[content.rfind(b"PK\1\2") - 30] ^= 1
        (tmp_path / "a.npz").write_bytes(content)
        file = open_arrays(tmp_path / "a.npz")
        with pytest.raises(BadFile, match=r"a whole \.npz file"):
            np.array(file.get("X").whole())
        file.close()


def test_a_head_that_claims_more_than_there_is_is_refused(tmp_path):
    """Before anything is mapped or unpacked."""
    (tmp_path / "a.npy").write_bytes(npy(HUGE, bytes(64)))
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("X.npy", npy(HUGE, bytes(64)))
    with zipfile.ZipFile(tmp_path / "b.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("X.npy", npy(HUGE, bytes(64)))
    with pytest.raises(BadFile, match="as many bytes as its shape says"):
        held(tmp_path / "a.npy", "")
    with pytest.raises(BadFile, match="as many bytes as its shape says"):
        held(tmp_path / "a.npz", "X")
    file = open_arrays(tmp_path / "b.npz")
    with pytest.raises(BadFile):
        file.get("X").whole()
    file.close()


def test_a_member_that_unpacks_to_more_than_a_gibibyte_is_refused_by_its_size(tmp_path):
    """The mend names the forms that are read a piece at a time."""
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("X.npy", npy(HUGE, bytes(64)))
    content = bytearray((tmp_path / "a.npz").read_bytes())
    at = content.rfind(b"PK\1\2")
    content[at + 24 : at + 28] = (2**31).to_bytes(4, "little")
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(BadFile, match=r"at most 1,024\.0 MiB.*np\.savez, which does not pack"):
        held(tmp_path / "a.npz", "X")


def test_a_matrix_that_unpacks_beyond_its_file_is_cut_off(tmp_path, monkeypatch):
    """A packed variable is unpacked up to the bound and no further."""
    savemat(tmp_path / "a.mat", {"X": np.zeros((64, 64, 8))}, do_compression=True)
    monkeypatch.setattr("taxel.foreign.mat_file.LARGEST_MAT", 100_000)
    with pytest.raises(BadFile, match=r"at most 100,000 bytes.*-v7\.3"):
        values(tmp_path / "a.mat", "X")


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (STACK * 1j, "real numbers.*complex ones"),
        ({"a": {"b": {"c": STACK}}}, "a structure of b; name one of its fields"),
    ],
)
def test_what_matlab_has_beyond_numbers_and_texts_is_refused_by_name(tmp_path, value, words):
    """Not read as something else."""
    savemat(tmp_path / "a.mat", {"X": value})
    name = "X.a" if isinstance(value, dict) else "X"
    with pytest.raises(BadFile, match=words):
        held(tmp_path / "a.mat", name)


def test_sparse_arrays_are_refused(tmp_path):
    """By name."""
    from scipy.sparse import eye

    savemat(tmp_path / "a.mat", {"X": eye(3, format="csc")})
    with pytest.raises(BadFile, match="a sparse array"):
        held(tmp_path / "a.mat", "X")


def test_nothing_leads_out_of_an_hdf5_file(tmp_path):
    """External and soft links are not followed; external storage and virtual arrays are refused."""
    with h5py.File(tmp_path / "secret.h5", "w") as other:
        other["X"] = STACK
    (tmp_path / "raw.bin").write_bytes(STACK.tobytes())
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["X"] = STACK
        file["outside"] = h5py.ExternalLink("secret.h5", "/X")
        file["soft"] = h5py.SoftLink("/X")
        file["ring"] = h5py.SoftLink("/ring")
        file.create_dataset("stored", STACK.shape, STACK.dtype, external=str(tmp_path / "raw.bin"))
        layout = h5py.VirtualLayout(shape=STACK.shape, dtype=STACK.dtype)
        layout[:] = h5py.VirtualSource(str(tmp_path / "secret.h5"), "X", shape=STACK.shape)
        file.create_virtual_dataset("virtual", layout)
    file = open_arrays(tmp_path / "a.h5")
    assert file.names() == ("X", "stored", "virtual")
    for name in ("outside", "soft", "ring"):
        with pytest.raises(KeyError):
            file.get(name)
    for name in ("stored", "virtual"):
        with pytest.raises(BadFile, match="whose values are in another"):
            file.get(name)
    file.close()


def test_groups_within_themselves_end(tmp_path):
    """A hard link to a group above it, and groups deeper than anybody nests."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        inner = file.create_group("a/b")
        inner["up"] = file["a"]
        inner["X"] = STACK
        deep = file
        for _ in range(40):
            deep = deep.create_group("d")
        deep["Y"] = STACK
    file = open_arrays(tmp_path / "a.h5")
    assert file.names() == ("a/b/X",)
    file.close()


def test_what_was_never_written_is_no_zero(tmp_path):
    """HDF5 fills pieces that are not there; such an array is refused, huge or not."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        half = file.create_dataset("half", (8, 3, 4), chunks=(2, 3, 4), dtype="f4")
        half[:4] = 1.0
        file.create_dataset("huge", (2**40, 3, 4), chunks=(2, 3, 4), dtype="f4")
        file.create_dataset("none", (8, 3, 4), dtype="f4")
        file.create_dataset("piece", (2**30, 4), chunks=(2**28, 4), dtype="f4")
    for name, words in (("half", "4 pieces.*2; the rest would read as zeros"), ("huge", "zeros"),
                        ("none", "without any"), ("piece", "at most 512 MiB")):  # fmt: skip
        with pytest.raises(BadFile, match=words):
            held(tmp_path / "a.h5", name)


def test_records_and_filters_of_others_are_refused(tmp_path):
    """An array of records is no array of numbers; a filter would be loaded as code."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["records"] = np.zeros(3, [("a", "f4"), ("b", "f4")])
        plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plist.set_chunk((3,))
        plist.set_filter(32001, h5py.h5z.FLAG_OPTIONAL, ())
        space = h5py.h5s.create_simple((3,))
        h5py.h5d.create(file.id, b"filtered", h5py.h5t.IEEE_F32LE, space, plist)
    with pytest.raises(BadFile, match="values of the kind"):
        held(tmp_path / "a.h5", "records")
    with pytest.raises(BadFile, match="the filter 32001"):
        held(tmp_path / "a.h5", "filtered")


def both(path):
    """Read the two arrays of a file."""
    return [held(path, name) for name in ("X", "y")]


@pytest.mark.parametrize("form", FORMS)
def test_a_file_that_is_cut_short_is_refused(tmp_path, form):
    """At every length, in one error, whatever is asked of it."""
    ending, write = FORMS[form]
    write(tmp_path / f"a{ending}", {"X": STACK, "y": ["a", "b"]})
    content = (tmp_path / f"a{ending}").read_bytes()
    for length in (0, 7, 100, 130, len(content) // 2, len(content) - 9):
        (tmp_path / f"a{ending}").write_bytes(content[:length])
        with pytest.raises((BadFile, KeyError)):  # MATLAB's last variable may be gone altogether
            both(tmp_path / f"a{ending}")


@pytest.mark.parametrize("form", [form for form in FORMS if form not in ("HDF5", "MATLAB 7.3")])
@settings(settings.get_profile("fuzz"), suppress_health_check=UNSHARED)
@given(data=st.data())
def test_changed_bytes_give_arrays_or_one_error(tmp_path, form, data):
    """Of the forms that taxel reads by itself; HDF5 is read by its own library."""
    ending, write = FORMS[form]
    path = tmp_path / f"honest{ending}"
    if not path.exists():
        write(path, {"X": STACK, "y": ["a", "b"], "one": np.eye(2)})
    broken = tmp_path / f"broken{ending}"
    broken.write_bytes(data.draw(changed_bytes(path.read_bytes())))
    try:
        file = open_arrays(broken)
    except BadFile:
        return
    try:
        for name in file.names():
            try:
                found = file.get(name)
                if isinstance(found, Numbers):
                    np.array(found.whole())
            except BadFile:
                pass
    finally:
        file.close()


def test_another_file_called_mat_or_npz_is_refused(tmp_path):
    """By its first bytes."""
    for name in ("a.mat", "a.npz", "a.h5", "a.npy"):
        (tmp_path / name).write_bytes(io.BytesIO(b"hello " * 50).getvalue())
        with pytest.raises(BadFile):
            open_arrays(tmp_path / name)
