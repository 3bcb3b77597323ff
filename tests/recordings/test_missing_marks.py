"""Claims about numbers that mark missing values: named, they are missing; unnamed, values."""

import json

import numpy as np
import pytest
from scipy.io import wavfile

from taxel.cli.main import main
from taxel.errors import BadTable
from taxel.recordings.imports.value_tables.missing_marks import parse_marks, without_marked
from taxel.recordings.reader import read_recording
from taxel.signals import Validity


def run(folder, capsys, marks, *, file="a.csv", cells="a[N] b[N],t[ms],"):
    """Import one file, and return the notes and the recordings."""
    text = f"file,label:object,channels,time,axes,full_scale,missing\n{file},cup,{cells},900,"
    (folder / "table.csv").write_text(f"{text}{marks}\n")
    main(["import", str(folder / "table.csv"), "--output", str(folder / "out"), "--json",
          "--overwrite"])  # fmt: skip
    found = json.loads(capsys.readouterr().out)
    return found["notes"], [read_recording(path) for path in found["recordings"]]


def test_marked_values_are_missing_and_counted(tmp_path, capsys):
    """Also beyond the full scale, where they would be saturated; without the column they stay."""
    (tmp_path / "a.csv").write_text("t,a,b\n0,1,-32768\n10,9999,2\n20,3,-32768.0\n9999,4,5\n")

    notes, (made,) = run(tmp_path, capsys, "-32768 9999")

    values, flags = made.samples.values, made.samples.validity
    marked = np.array([[0, 1], [1, 0], [0, 1], [0, 0]], bool)
    np.testing.assert_array_equal(np.isnan(values), marked)
    np.testing.assert_array_equal(flags, np.where(marked, int(Validity.NOT_FINITE), 0))
    assert made.samples.fitted_s[-1] == pytest.approx(9.999)  # a time is no value
    assert notes[:2] == [
        "2 values (25 %) in 1 of 1 file are -32768, and were taken as missing (a.csv)",
        "1 value (12 %) in 1 of 1 file is 9999, and was taken as missing (a.csv)",
    ]
    _, (plain,) = run(tmp_path, capsys, "")
    assert plain.samples.values[0, 1] == -32768


def test_a_mark_that_does_not_occur_is_a_note(tmp_path, capsys):
    """It may be misspelt; nothing is refused."""
    (tmp_path / "a.csv").write_text("t,a,b\n0,1,2\n10,3,4\n")

    notes, made = run(tmp_path, capsys, "-9999")

    assert len(made) == 1
    assert notes[0].startswith("no value is -9999, which the column 'missing' names as a mark")


def test_marks_in_trials_of_one_array_are_counted_over_all(tmp_path, capsys):
    """In 32 bits a mark is another number, and is found."""
    stack = np.ones((3, 4, 2), "f4")
    stack[0, 1, 0] = stack[2, :2, 1] = -999.9
    np.save(tmp_path / "a.npy", stack)

    notes, made = run(
        tmp_path, capsys, "-999.9", file="a.npy", cells="*[N],rate:10Hz,trials rows channels"
    )

    assert [int(np.isnan(item.samples.values).sum()) for item in made] == [1, 0, 2]
    assert ("3 values (12 %) in 2 of 3 files are -999.9, and were taken as missing, at most 2 "
            "(a.npy[3])") in notes  # fmt: skip


def test_empty_cells_are_refused_all_the_same(tmp_path, capsys):
    """A mark says nothing of what else is missing."""
    (tmp_path / "a.csv").write_text("t,a,b\n0,1,-1\n10,nan,4\n")

    with pytest.raises(SystemExit):
        run(tmp_path, capsys, "-1")
    assert "--missing keep" in capsys.readouterr().err


@pytest.mark.parametrize("text", ["NA", "nan", "inf", "1e300", "1,2", " ".join("abc"),
                                  " ".join(map(str, range(17)))])  # fmt: skip
def test_what_is_no_mark_is_refused(text):
    """By the column's name and the line."""
    with pytest.raises(BadTable, match=r"in the column 'missing'.*line 2"):
        parse_marks(text, "table.csv, line 2")


@pytest.mark.parametrize(
    ("text", "mend"),
    [("-32768,9999", "write blanks between marks, and decimal points."),
     ("0;1", "write blanks between marks, and decimal points."),
     ("1e39", "correct it: recordings hold no value beyond 3.4e+38."),
     ("NA", "empty cells and NaN are no marks: --missing keep keeps them.")],
)  # fmt: skip
def test_a_refusal_says_how_to_write_marks(text, mend):
    """By what is wrong with it."""
    with pytest.raises(BadTable, match="with blanks between them") as caught:
        parse_marks(text, "table.csv, line 2")
    assert str(caught.value).endswith(mend)


def test_a_number_is_one_mark_however_it_is_written():
    """As it is written first."""
    assert parse_marks("1 1.0 1e0 2 -0 0.00", "a") == ("1", "2", "-0")


@pytest.mark.parametrize(
    ("name", "write", "missing"),
    [
        ("a.npy", lambda path, v: np.save(path, v), 1),
        ("a.npy", lambda path, v: np.save(path, np.asfortranarray(v)), 1),
        ("a.npz", lambda path, v: np.savez(path, X=v), 1),
        ("a.csv", lambda path, v: np.savetxt(path, v, "%d", ","), 1),
        ("a.npy", lambda path, v: np.save(path, v.astype("f4")), 2),
        ("a.npz", lambda path, v: np.savez(path, X=v.astype(">f4")), 2),
        ("a.wav", lambda path, v: wavfile.write(path, 10, v), 1),
        ("a.wav", lambda path, v: wavfile.write(path, 10, v.astype("f4")), 2),
    ],
)
def test_another_number_is_no_mark_unless_the_file_cannot_tell_them_apart(
    tmp_path, capsys, name, write, missing
):
    """In 32 bits 16777217 is 16777216."""
    write(tmp_path / name, np.array([[16777216.0, 1], [16777217, 2], [3, 4]]))
    cells = {"a.wav": "*[N],,", "a.npz": "*[N],rate:10Hz,rows channels"}
    cells = cells.get(name, "*[N],rate:10Hz,")

    _, (made,) = run(tmp_path, capsys, "16777217", file=name, cells=cells)

    assert int(np.isnan(made.samples.values).sum()) == missing


def test_a_mark_that_short_floats_cannot_hold_matches_nothing():
    """Not even what is infinite there."""
    values = np.array([[np.inf], [1.0]])
    assert without_marked(values, ("1e5", "1"), np.dtype("f2"))[1] == {"1e5": 0, "1": 1}


def test_a_layout_of_ones_own_may_return_32_bits(tmp_path, capsys):
    """As arrays do."""
    (tmp_path / "own.py").write_text(
        "import numpy as np\n"
        "def read(path): return np.array([[-999.9], [1]], 'f4'), [0, 1], ['a'], ['N']\n"
    )
    (tmp_path / "a.bin").write_text("")
    (tmp_path / "t.csv").write_text(
        "file,label:object,layout,missing\na.bin,cup,own.py:read,-999.9\n"
    )
    main(["import", str(tmp_path / "t.csv"), "--output", str(tmp_path / "out"), "--json",
          "--allow-code"])  # fmt: skip
    (path,) = json.loads(capsys.readouterr().out)["recordings"]
    assert np.isnan(read_recording(path).samples.values.ravel()).tolist() == [True, False]


def test_values_without_a_mark_stay_as_they_are():
    """The array that was read is not changed either."""
    values = np.array([[1.0, np.nan], [5.0, 7.0]])
    assert without_marked(values, (), values.dtype) == (values, {})
    assert without_marked(values, ("8",), values.dtype)[0] is values
    cut, counts = without_marked(values, parse_marks(" 5  7 5 ", "a"), values.dtype)
    assert counts == {"5": 1, "7": 1}
    np.testing.assert_array_equal(cut, [[1.0, np.nan], [np.nan, np.nan]])
    assert values[1, 0] == 5.0
