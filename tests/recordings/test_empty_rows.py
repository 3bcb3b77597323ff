"""Trials of a long text that empty rows, or blank lines, part."""

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.errors import BadTable
from taxel.recordings.imports.importing import ImportOptions, import_table
from taxel.recordings.reader import read_recording

TRIALS = ([1.0, 2.0, 3.0], [4.0, 5.0], [7.0, 8.0, 9.0, 9.5])


def write(folder, between, *, stamps=False, cells="empty rows"):
    """A long text of three trials, and its import table."""
    clock = "12:00:0{}.5" if stamps else "{}"
    parts = [
        "".join(f"{clock.format(n)},{value},-{value},{kind}\n" for n, value in enumerate(values))
        for values, kind in zip(TRIALS, ("cup", "box", "cup"), strict=True)
    ]
    (folder / "all.csv").write_text("t,x,y,object\n" + between.join(parts) + between)
    (folder / "table.csv").write_text(
        "file,trials,label:object,channels,time\n"
        f"all.csv,{cells},from:object,x[N] y[N],{'t[iso]' if stamps else 't[s]'}\n"
    )
    return folder / "table.csv"


@pytest.mark.parametrize("stamps", [False, True])
@pytest.mark.parametrize("between", ["\n", ",,,\n", "\n,,,\n\n", " , ,,\n"])
def test_empty_rows_part_trials(tmp_path, between, stamps):
    made = import_table(write(tmp_path, between, stamps=stamps), tmp_path / "out")

    found = [read_recording(path) for path in made]
    assert [own.manifest.labels["object"] for own in found] == ["cup", "box", "cup"]
    for own, values in zip(found, TRIALS, strict=True):
        np.testing.assert_array_equal(own.samples.values[:, 0], np.float32(values))
        np.testing.assert_allclose(
            own.samples.fitted_s - own.samples.fitted_s[0], np.arange(len(values)), atol=1e-6
        )


def test_a_note_says_how_many_there_are(tmp_path, capsys):
    main(["import", str(write(tmp_path, "\n")), "--output", str(tmp_path / "out")])
    assert "note: all.csv was read as 3 trials by its empty rows\n" in capsys.readouterr().err


def test_a_missing_value_within_a_trial_is_refused_with_its_line_or_kept(tmp_path):
    table = write(tmp_path, "\n\n")
    text = (tmp_path / "all.csv").read_text()
    (tmp_path / "all.csv").write_text(text.replace("5.0", "", 1))

    with pytest.raises(BadTable, match=r"got nan in \S+, line 8, column 'x'"):
        import_table(table, tmp_path / "out")
    made = import_table(table, tmp_path / "out", options=ImportOptions(missing="keep"))
    assert np.isnan(read_recording(made[1]).samples.values[1, 0])


def test_a_text_with_empty_rows_is_refused_with_what_helps(tmp_path):
    """Whether they were written as separators only, or as blank lines."""
    words = r"write 'empty rows' in the column 'trials'"
    for between, problem in (
        (",,,\n", r"got nan in \S+, line 5, where no channel has a value; if such rows part "),
        ("\n", r"needed 4 cells in every line; got 0 in \S+, line 5; remove the blank line; if "),
    ):
        table = write(tmp_path, between)
        table.write_text("file,channels,time\nall.csv,x[N] y[N],t[s]\n")
        with pytest.raises(BadTable, match=f"{problem}.*{words}"):
            import_table(table, tmp_path / "out")


@pytest.mark.parametrize("time", ["t[s]", "rate:1Hz"])
def test_labels_of_rows_stay_with_their_trials(tmp_path, time):
    """Without a column of time, each trial begins at 0."""
    table = write(tmp_path, "\n,,,\n")
    table.write_text(
        f"file,trials,label:object,channels,time\nall.csv,empty rows,rows:object,x[N],{time}\n"
    )
    found = [read_recording(path) for path in import_table(table, tmp_path / "out")]
    assert [[mark.labels["object"] for mark in own.marks] for own in found] == [
        ["cup"], ["box"], ["cup"],
    ]  # fmt: skip
    assert [own.samples.fitted_s[0] for own in found] == [0.0, 0.0, 0.0]
