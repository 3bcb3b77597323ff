"""Claims about files of MATLAB 4: read as SciPy reads them, and never beyond their size."""

import struct

import numpy as np
import pytest
from array_readers import ask_for_all, held, values
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mutations import changed_bytes
from scipy.io import loadmat, savemat

from taxel.errors import BadFile
from taxel.foreign.array_files import open_arrays
from taxel.foreign.held_arrays import table_of

GRID = np.arange(12, dtype=np.float64).reshape(3, 4) / 7


def matrix(kind: int, shape: tuple[int, int], body: bytes, name: bytes = b"X\0", order="<"):
    """Return one matrix of a file, whatever its head claims."""
    return struct.pack(f"{order}5i", kind, *shape, 0, len(name)) + name + body


@pytest.mark.parametrize("kind", ["f8", "f4", "i4", "i2", "u2", "u1"])
@pytest.mark.parametrize("order", ["<", ">"])
def test_numbers_of_every_kind_and_order_of_bytes(tmp_path, kind, order):
    """As SciPy reads them, values, shape and kind; values go down the columns."""
    array = (GRID * 70).astype(kind)
    tens = {"f8": 0, "f4": 1, "i4": 2, "i2": 3, "u2": 4, "u1": 5}[kind]
    content = matrix(1000 * (order == ">") + 10 * tens, (3, 4),
                     array.astype(order + kind).tobytes("F"), order=order)  # fmt: skip
    (tmp_path / "a.mat").write_bytes(content)
    found = values(tmp_path / "a.mat", "X")
    np.testing.assert_array_equal(found, array)
    np.testing.assert_array_equal(found, loadmat(tmp_path / "a.mat")["X"])
    assert found.dtype == array.dtype


def test_texts_are_a_row_each_and_a_line_lists_what_a_file_holds(tmp_path):
    """Blanks that fill them up are left out."""
    savemat(tmp_path / "a.mat", {"X": GRID, "y": ["cup", "sponge"]}, format="4")
    assert held(tmp_path / "a.mat", "y").values == ("cup", "sponge")
    file = open_arrays(tmp_path / "a.mat")
    assert table_of(file) == "X (3 × 4 float64), y (2 texts)"
    with pytest.raises(KeyError):
        file.get("z")
    file.close()


def test_what_is_not_taken_is_refused_by_name(tmp_path):
    """Beside matrices that are taken; numbers of a VAX make the whole file another."""
    from scipy.sparse import eye

    savemat(tmp_path / "a.mat", {"C": GRID * 1j, "S": eye(3), "X": GRID}, format="4")
    for name, words in (("C", "C: complex numbers; save their real"), ("S", r"S: a sparse.*full")):
        with pytest.raises(BadFile, match=words):
            held(tmp_path / "a.mat", name)
    np.testing.assert_array_equal(values(tmp_path / "a.mat", "X"), GRID)
    (tmp_path / "a.mat").write_bytes(matrix(2000, (1, 1), bytes(8)))
    with pytest.raises(BadFile, match="one of a VAX or a Cray"):
        open_arrays(tmp_path / "a.mat")
    (tmp_path / "a.mat").write_bytes(matrix(1, (1, 1), struct.pack("<d", float("nan"))))
    with pytest.raises(BadFile, match="X with a number that is no letter"):
        held(tmp_path / "a.mat", "X")


@pytest.mark.parametrize(
    "content",
    [
        matrix(0, (2**31 - 1, 2**31 - 1), bytes(64)),
        matrix(0, (3, 4), bytes(88)),
        matrix(0, (-1, 4), bytes(64)),
        matrix(0, (3, 4), bytes(96)) + bytes(7),
        matrix(0, (3, 4), bytes(96)) + matrix(60, (1, 1), bytes(8)),
        struct.pack("<5i", 0, 1, 1, 0, 2**30) + b"X\0" + bytes(8),
        struct.pack("<5i", 0, 0, 0, 0, 200) + b"X\0",
        struct.pack("<5i", 0, 1, 1, 7, 2) + b"X\0" + bytes(16),
        matrix(0, (0, 0), b"") * 5_000,
        bytes(1_000),
        b"",
    ],
)
def test_heads_that_lie_are_refused(tmp_path, content):
    """Before anything is read that they claim, be it a size, a name's or how many there are."""
    (tmp_path / "a.mat").write_bytes(content)
    with pytest.raises(BadFile):
        open_arrays(tmp_path / "a.mat")


def test_a_file_that_is_cut_short_is_refused(tmp_path):
    """At every length that does not end with a matrix."""
    savemat(tmp_path / "a.mat", {"X": GRID, "y": ["a", "b"]}, format="4")
    content = (tmp_path / "a.mat").read_bytes()
    whole = len(matrix(0, (3, 4), bytes(96)))
    for length in {*range(0, len(content), 5), len(content) - 1} - {whole}:
        (tmp_path / "a.mat").write_bytes(content[:length])
        with pytest.raises(BadFile):
            open_arrays(tmp_path / "a.mat")


@settings(settings.get_profile("fuzz"), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_changed_bytes_give_arrays_or_one_error(tmp_path, data):
    """Whatever is asked of the file."""
    path = tmp_path / "honest.mat"
    if not path.exists():
        savemat(path, {"X": GRID, "y": ["a", "b"], "one": np.eye(2, dtype="i2")}, format="4")
    broken = tmp_path / "broken.mat"
    broken.write_bytes(data.draw(changed_bytes(path.read_bytes())))
    ask_for_all(broken)
