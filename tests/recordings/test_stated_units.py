"""A file that states another unit than the import table is noted, and nothing is converted."""

from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadTable
from taxel.recordings.imports.importing import import_table
from taxel.recordings.imports.notes import FileFacts, notes_of
from taxel.recordings.imports.value_tables.stated_units import other_units, stated_in
from taxel.recordings.imports.value_tables.tables import parse_columns, parse_time
from taxel.recordings.reader import read_recording

BEHIND = "; values stay as they are: if the file is right, correct the import table's unit"


def notes(folder: Path, text: str, columns: str) -> list[str]:
    """Import one file by an import table with these channels and this time; return the notes."""
    (folder / "a.csv").write_text(text)
    (folder / "table.csv").write_text(f"file,channels,time\na.csv,{columns}\n")
    return imported(folder)


def imported(folder: Path) -> list[str]:
    found: list[FileFacts] = []
    import_table(folder / "table.csv", folder / "out", on_file=found.append)
    return notes_of(found)


@pytest.mark.parametrize(("head", "columns", "stated"), [
    ("t [ms],F [mN]\n", "1[ms]x2[N]", "mN instead of N for F [mN]"),
    ("t (s),F (N)\n", "1[ms]x2[N]", "s instead of ms for t (s)"),
    ("t,F\nms,mN\n", "t[ms]x*[N]", "mN instead of N for F"),
    ("t,F\n[ms],[mN]\n", "t[us]xF[N]", "mN instead of N for F, ms instead of us for t"),
])  # fmt: skip
def test_a_unit_that_the_file_states_otherwise_is_noted_and_values_stay(
    tmp_path: Path, head: str, columns: str, stated: str
) -> None:
    time, _, channels = columns.partition("x")
    found = notes(tmp_path, f"{head}0,1500\n5,1600\n", f"{channels},{time}")

    assert f"a.csv: states {stated}{BEHIND}" in found
    recording = read_recording(tmp_path / "out" / "a.mcap")
    np.testing.assert_array_equal(recording.samples.values[:, 0], [1500, 1600])
    assert recording.manifest.sensor.units == ("N",)


@pytest.mark.parametrize(("head", "columns"), [
    ("t [ms],F [N]\n", "2[N],1[ms]"),
    ("t [sec],F (Newton)\n", "2[N],1[s]"),  # the same in words
    ("t,sensor (A)\n", "2[V],t[ms]"),  # a letter that numbers sensors
    ("t,F (left)\n", "2[N],t[ms]"),
    ("t,F [1/min]\n", "2[N],t[ms]"),  # a unit that is not known is not compared
])  # fmt: skip
def test_what_is_no_other_unit_is_not_noted(tmp_path: Path, head: str, columns: str) -> None:
    assert not [note for note in notes(tmp_path, f"{head}0,1.5\n5,1.6\n", columns)
                if "states" in note]  # fmt: skip


def test_trials_of_one_long_text_are_noted_once(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("k,t [ms],F [mN]\n1,0,1\n1,5,2\n2,0,3\n2,5,4\n")
    (tmp_path / "table.csv").write_text("file,trials,channels,time\na.csv,k,3[N],2[ms]\n")

    assert [note for note in imported(tmp_path) if "states" in note] == [
        f"a.csv[1] and 1 more: states mN instead of N for F [mN]{BEHIND}"
    ]


def test_micro_and_ohm_are_known_in_each_spelling() -> None:
    assert stated_in("t (\u00b5s)") == "\u00b5s"
    assert other_units([("t", "\u00b5s"), ("R", "k\u03a9")], ["us", "kohm"]) == ""
    assert other_units([("t", "\u03bcs")], ["ms"]) == "\u03bcs instead of ms for t"


def test_only_the_first_columns_are_named() -> None:
    stated = [(name, "mV") for name in "abcde"]
    assert other_units(stated, ["V"] * 5).endswith("mV instead of V for c …")


def test_a_name_with_brackets_is_refused_with_what_to_write() -> None:
    with pytest.raises(BadTable, match=r"write its number from 1, as in 2\[N\]"):
        parse_columns("Kraft links [N][N]", "here")
    with pytest.raises(BadTable, match=r"write its number from 1, as in 2\[ms\]"):
        parse_time("Zeit [ms][ms]", "here")
