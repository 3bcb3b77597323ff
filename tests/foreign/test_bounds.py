"""Claims about reading what others wrote: what fits is given, what does not is refused at once."""

import gzip
import json
import os
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadFile
from taxel.foreign.archives import array_of, read_arrays, read_members
from taxel.foreign.array_files import open_arrays
from taxel.foreign.files import open_file, read_bytes, read_text
from taxel.foreign.json_text import DEEPEST, Fields, parse_json
from taxel.foreign.records import record_of
from taxel.foreign.text_lines import LONGEST_LINE, lines_of
from taxel.windows.config import WindowConfig


@pytest.mark.parametrize("size", [0, 1, 99, 100])
def test_a_file_up_to_the_bound_is_read_and_no_larger(tmp_path: Path, size: int) -> None:
    (tmp_path / "a").write_bytes(b"x" * size)

    assert read_bytes(tmp_path / "a", 100) == b"x" * size
    (tmp_path / "a").write_bytes(b"x" * 101)
    with pytest.raises(BadFile, match="at most 100 bytes"):
        read_bytes(tmp_path / "a", 100)


def test_what_is_no_plain_file_is_never_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path, kind in ((tmp_path / "pipe", "pipe"), (tmp_path, "folder"), (Path("/dev/zero"),
                       "device")):  # fmt: skip
        with pytest.raises(BadFile, match=kind):
            open_file(path)
    with pytest.raises(BadFile):
        open_file(Path("a\0b"))
    with pytest.raises(FileNotFoundError):
        open_file(tmp_path / "none")


def test_another_coding_is_named_by_its_byte(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes("é".encode("latin-1"))

    with pytest.raises(BadFile, match="0xe9 at 0"):
        read_text(tmp_path / "a", 10)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("[" * (DEEPEST + 1) + "]" * (DEEPEST + 1), "deep"),
        ('{"a": 1, "a": 2}', "twice"),
        ("9" * 21, "digits"),
        ('"\\ud800"', "surrogates"),
        ("[1,", "something else"),
        (b"\xff", "something else"),
        ("[" + "1," * 2_000_000 + "1]", "values"),
    ],
)
def test_json_beyond_the_bounds_is_refused(text: str | bytes, word: str) -> None:
    with pytest.raises(BadFile, match=word):
        parse_json(text)


@pytest.mark.parametrize("text", ["1e999", "-1E400", "Infinity", "NaN"])
def test_where_numbers_are_finite_no_spelling_of_infinity_is_read(text: str) -> None:
    with pytest.raises(BadFile, match=text):
        parse_json(f'{{"a": [{text}]}}', finite=True)
    assert parse_json('{"a": [1.5e3, -2.0]}', finite=True) == {"a": [1500.0, -2.0]}


def test_json_within_the_bounds_is_read() -> None:
    """Brackets within texts do not count as depth, and a pair of surrogates is a letter."""
    found = {"a": ["[" * 500, '\\"', "😀"], "b": {"c": [1, 2.5, None, True]}}

    assert parse_json(json.dumps(found)) == found
    inner = "[" * DEEPEST + "]" * DEEPEST
    assert json.dumps(parse_json(inner)) == inner


@pytest.mark.parametrize(
    ("name", "value"),
    [("n", True), ("n", "1"), ("n", float("nan")), ("n", 11), ("n", None)],
)
def test_a_number_is_a_finite_one_in_its_range(name: str, value: object) -> None:
    fields = Fields({name: value}, "it")

    with pytest.raises(ValueError, match=name):
        fields.number(name, 0, 10)
    with pytest.raises(ValueError, match=name):
        fields.count(name, 0, 10)


@pytest.mark.parametrize("rows", [[[1, 2], [3]], [[1, "2"]], [[1, None]], [[True, False]], [1, 2],
                                  [[1, 10**30]], [[1, float("inf")]]])  # fmt: skip
def test_an_array_is_numbers_of_its_shape(rows: list[object]) -> None:
    with pytest.raises(ValueError, match="a is not"):
        Fields({"a": rows}, "it").array("a", (None, 2))
    np.testing.assert_array_equal(Fields({"a": [[1, 2.5]]}, "it").array("a", (1, 2)), [[1, 2.5]])


def test_a_dataclass_takes_values_of_its_own_types_only() -> None:
    assert record_of(WindowConfig, {"steps": 3, "channels": ["a"]}).channels == ("a",)
    for bad in ({"steps": "3"}, {"steps": 3.0}, {"steps": True}, {"layout": "C"}, {"gate": "x"},
                {"channels": [1]}, {"stride": 0}, {"colour": 1}, [1],
                {"gate": float("nan")}):  # fmt: skip
        with pytest.raises(ValueError, match=r"."):
            record_of(WindowConfig, bad)


@pytest.mark.parametrize("array", [np.arange(6.0).reshape(2, 3), np.asfortranarray(np.eye(3)),
                                   np.array([True, False]), np.array(["é", "ab"]),
                                   np.zeros((0, 3), ">i2"), np.float32(3)])  # fmt: skip
def test_arrays_come_back_as_numpy_writes_them(tmp_path: Path, array: np.ndarray) -> None:
    np.save(tmp_path / "a.npy", array)
    np.savez_compressed(tmp_path / "a.npz", a=array, other=array)

    found = array_of((tmp_path / "a.npy").read_bytes(), "biufU")
    np.testing.assert_array_equal(found, array)
    assert found.dtype == array.dtype
    assert list(read_arrays(tmp_path / "a.npz", ["a"])) == ["a"]


def test_an_array_of_no_unicode_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array(["ab"]))
    content = (tmp_path / "a.npy").read_bytes()

    for letter in (0x110000, 0xD800, 0xFFFFFFFF):
        with pytest.raises(BadFile, match="Unicode"):
            array_of(content[:-4] + struct.pack("<I", letter), "U")


def test_only_wanted_members_are_unpacked_and_each_within_its_bound(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("large", bytes(2**26))
        archive.writestr("small", b"x" * 100)
    with (tmp_path / "a.zip").open("rb") as file:
        assert read_members(file, {"small": 100, "none": 1}, 1) == {"small": b"x" * 100}
        with pytest.raises(BadFile, match="small of 100 bytes, above 99"):
            read_members(file, {"small": 99}, 1)
        with pytest.raises(BadFile, match="packed more than 8 times"):
            read_members(file, {"large": 2**27}, 8)


@pytest.mark.parametrize(("method", "name"), [(zipfile.ZIP_BZIP2, "bzip2"),
                                            (zipfile.ZIP_LZMA, "LZMA")])  # fmt: skip
def test_a_member_that_unpacks_without_a_bound_is_never_begun(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, method: int, name: str
) -> None:
    """Of 4 MiB only 1,000 bytes are said, and yet all of them would be made at once."""
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w", method) as archive:
        archive.writestr("X.npy", bytes(2**22))
    content = bytearray(path.read_bytes())
    at = content.rfind(b"PK\1\2")
    content[at + 24 : at + 28] = (1000).to_bytes(4, "little")
    path.write_bytes(content)
    monkeypatch.setattr(zipfile.ZipFile, "open", lambda *_: pytest.fail("it is unpacked"))

    with path.open("rb") as file, pytest.raises(BadFile, match=f"X.npy, packed by {name}"):
        read_members(file, {"X.npy": 1000}, 64)
    with pytest.raises(BadFile, match=f"packed by {name}"):
        read_arrays(path, ["X"])
    arrays = open_arrays(path)
    with pytest.raises(BadFile, match=f"packed by {name}"):
        arrays.get("X")
    arrays.close()


def test_lines_keep_their_ends_whatever_the_coding(tmp_path: Path) -> None:
    text = "a\nb\r\nc\rd"
    for coding in ("utf-8", "utf-8-sig", "utf-16"):
        (tmp_path / "a").write_bytes(text.encode(coding))
        (tmp_path / "a.gz").write_bytes(gzip.compress(text.encode(coding)))
        for name in ("a", "a.gz"):
            assert list(lines_of(tmp_path / name, 100)) == ["a\n", "b\r\n", "c\r", "d"]


def test_a_line_or_text_too_long_is_refused_where_it_is(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("a\n" + "b" * LONGEST_LINE)
    (tmp_path / "b.gz").write_bytes(gzip.compress(b"ab\n" * 10_000))
    (tmp_path / "c.gz").write_bytes(gzip.compress(b"ab\n" * 2**20, 9))

    with pytest.raises(BadFile, match="line 2"):
        list(lines_of(tmp_path / "a", 2**30))
    with pytest.raises(BadFile, match="at most 20,000 bytes"):
        list(lines_of(tmp_path / "b.gz", 20_000))
    with pytest.raises(BadFile, match="packed at most 100 times"):
        list(lines_of(tmp_path / "c.gz", 2**30))
