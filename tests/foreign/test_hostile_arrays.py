"""Claims about hostile files of arrays: refused in one error, never followed, never unpickled."""

import io
import pickle
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from array_readers import STACK, ask_for_all, held, values
from array_writers import FORMS
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mutations import changed_bytes
from scipy.io import savemat

from taxel.errors import BadFile, BadTable
from taxel.foreign.array_files import open_arrays
from taxel.foreign.held_arrays import Numbers
from taxel.recordings.imports.trial_sets import label_texts

pytestmark = pytest.mark.usefixtures("untried_hdf5")

UNSHARED = [HealthCheck.function_scoped_fixture]
"""Examples write over one another's file."""


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


def test_long_lists_of_texts_are_refused_before_they_are_unpacked(tmp_path, monkeypatch):
    """Packed, 16 GiB of nothing are 15 MB of a file."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("S", data=np.array([b"a"] * 40, "S100"), compression="gzip")
        file["cells"] = np.array([file["S"].ref] * 3, h5py.ref_dtype)
    np.savez_compressed(tmp_path / "a.npz", S=np.array(["a"] * 40, "U100"))
    assert len(held(tmp_path / "a.h5", "S").values) == 40
    monkeypatch.setattr("taxel.foreign.hdf5_file.MOST_NAMES", 100)
    with pytest.raises(BadFile, match="cells of at most 100 texts"):
        held(tmp_path / "a.h5", "cells")
    for module in ("hdf5_file._TEXTS_AT_ONCE", "npz_file._LARGEST_TEXTS"):
        monkeypatch.setattr(f"taxel.foreign.{module}", 3_000)
    for name in ("a.h5", "a.npz"):
        with pytest.raises(BadFile, match="texts of at most 3,000 bytes"):
            held(tmp_path / name, "S")


@pytest.mark.parametrize("shape", [(), (7,), (3, 7), (7, 1), (1, 7), (0,), (0, 3)])
def test_texts_are_read_few_at_a_time_and_in_their_order(tmp_path, monkeypatch, shape):
    """Each may lead to the same large piece of the file."""
    texts = np.array([f"text {number}" for number in range(int(np.prod(shape)))], object)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("y", data=texts.reshape(shape), dtype=h5py.string_dtype())
    at_once = 2 * (tmp_path / "a.h5").stat().st_size
    monkeypatch.setattr("taxel.foreign.hdf5_file._TEXTS_AT_ONCE", at_once)
    read, counts = h5py.Dataset.__getitem__, []

    def counted(dataset, places):
        found = read(dataset, places)
        counts.append(np.size(found))
        return found

    monkeypatch.setattr(h5py.Dataset, "__getitem__", counted)
    assert held(tmp_path / "a.h5", "y").values == tuple(texts)
    assert max(counts, default=0) <= 2


def test_records_and_filters_of_others_are_refused(tmp_path):
    """An array of records is no array of numbers; a filter would be loaded as code."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["records"] = np.zeros(3, [("a", "f4"), ("b", "f4")])
        plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plist.set_chunk((3,))
        plist.set_filter(32001, h5py.h5z.FLAG_OPTIONAL, ())
        space = h5py.h5s.create_simple((3,))
        h5py.h5d.create(file.id, b"filtered", h5py.h5t.IEEE_F32LE, space, plist)
    with pytest.raises(BadFile, match=r"records with named fields \(a, b\)"):
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
    ask_for_all(broken)


def test_another_file_called_mat_or_npz_is_refused(tmp_path):
    """By its first bytes."""
    for name in ("a.mat", "a.npz", "a.h5", "a.npy"):
        (tmp_path / name).write_bytes(io.BytesIO(b"hello " * 50).getvalue())
        with pytest.raises(BadFile):
            open_arrays(tmp_path / name)


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        ((2**31 - 1, 0), "at most 100,000 trials; got 2,147,483,647 in y"),
        ((1, 100_001), "at most 100,000 trials; got 100,001 in y"),
        ((100_001, 2), "at most 100,000 trials; got 100,001 in y"),
        ((0, 2**31 - 1), "one value for each trial, or a one-hot row; got y: 0 × 2147483647"),
        ((3, 0), "one value for each trial, or a one-hot row; got y: 3 × 0"),
    ],
)
def test_labels_of_a_size_that_no_file_has_are_never_read(shape, words):
    """An array without columns takes no room in its file, and a number for each row in memory."""

    def cut(places):
        raise AssertionError(places)

    with pytest.raises(BadTable, match=words):
        label_texts(Numbers(shape, np.dtype("f8"), cut), "y")
