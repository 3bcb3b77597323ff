"""Claims about one long text of many trials: told apart by a column, or by several."""

import re

import numpy as np
import pytest
from stack_imports import bring as import_row

from taxel.errors import BadTable
from taxel.recordings.imports.importing import import_table
from taxel.recordings.reader import read_recording

HEADER = "file,trials,label:object,group:person,channels,time\n"
TEXT = """who,trial,ms,a,b,what
anna,1,0,1,2,cup
anna,1,10,3,4,cup
anna,2,500,5,6,ball
bo,1,0,7,8,cup
bo,1,10,9,10,cup
bo,1,30,11,12,cup
"""
ROW = "all.csv,who+trial,from:what,from:who,a[N] b[N],ms[ms]"


def bring(folder, row=ROW, text=TEXT):
    """Import the text by a row of the table."""
    (folder / "all.csv").write_text(text)
    (folder / "table.csv").write_text(HEADER + row + "\n")
    return import_table(folder / "table.csv", folder / "out")


@pytest.mark.parametrize("channels", ["a[N] b[N]", "*[N]"])
def test_rows_of_one_trial_become_a_recording(tmp_path, channels):
    """Values, times of the text itself, labels and groups; called by what tells them apart."""
    made = bring(tmp_path, ROW.replace("a[N] b[N]", channels))
    assert [path.name for path in made] == [
        "all-anna-1.mcap", "all-anna-2.mcap", "all-bo-1.mcap",
    ]  # fmt: skip
    first, second, third = map(read_recording, made)
    np.testing.assert_array_equal(first.samples.values, [[1, 2], [3, 4]])
    np.testing.assert_array_equal(second.samples.values, [[5, 6]])
    np.testing.assert_array_equal(third.samples.values, [[7, 8], [9, 10], [11, 12]])
    np.testing.assert_allclose(second.samples.fitted_s, [0.5])
    np.testing.assert_allclose(third.samples.fitted_s, [0, 0.01, 0.03])
    assert third.manifest.labels == {"object": "cup"}
    assert third.manifest.groups == {"person": "bo", "file": "all.csv:who+trial[bo-1]"}


def test_by_a_rate_each_trial_begins_at_zero(tmp_path):
    """Its first scan is its own."""
    *_, last = bring(tmp_path, ROW.replace("ms[ms]", "rate:50Hz"))
    np.testing.assert_allclose(read_recording(last).samples.fitted_s, [0, 0.02, 0.04])


def test_names_that_no_file_may_have_become_numbers(tmp_path):
    """A trial's name in a text of others is no path."""
    text = TEXT.replace("anna", "../../anna").replace("bo", "b/o")
    made = bring(tmp_path, text=text)
    assert [path.name for path in made] == ["all-1.mcap", "all-2.mcap", "all-3.mcap"]
    assert read_recording(made[0]).manifest.groups["person"] == "../../anna"


@pytest.mark.parametrize(
    ("row", "text", "words"),
    [
        (ROW.replace("who+trial", "trial"), TEXT, "then 'bo' in trial|the rows of each trial toge"),
        (ROW, TEXT + "anna,1,90,1,1,cup\n", "trial anna-1 once more in .*all.csv, line 8; sort"),
        (ROW, TEXT.replace("3,4,cup", "3,4,ball"), "one value a trial in the column 'what'; got "
                                                   "'cup', then 'ball' .*line 3"),
        (ROW, TEXT.replace("anna,2", "anna,"), "a trial in every row; got none in .*line 4"),
        (ROW, TEXT.replace("6,ball", "6,"), "a value for each trial; got nothing in .*line 4"),
        (ROW, TEXT.replace("bo,1,10", "bo,1,0"), "times that increase .*trial bo-1, line 6"),
        (ROW, TEXT.replace(",3,4,", ",x,4,"), "a number; got 'x' in .*line 3, column 'a'"),
        (ROW.replace("who+", "whom+"), TEXT, "the column 'whom'; got no such column"),
        (ROW.replace("from:what", "from:that"), TEXT, "the column 'that'"),
        (ROW, "who,trial,ms,a,b,what\n", "rows of numbers; got none"),
    ],
)  # fmt: skip
def test_a_text_that_does_not_tell_trials_apart_is_refused(tmp_path, row, text, words):
    """Naming the line, and what to name instead."""
    with pytest.raises(BadTable) as caught:
        bring(tmp_path, row, text)
    assert re.search(words, str(caught.value))
    assert not (tmp_path / "out").exists()


def test_axes_of_a_text_say_that_each_line_is_a_trial_or_are_refused(tmp_path):
    """A column that would change nothing is refused."""
    (tmp_path / "all.csv").write_text(TEXT)
    (tmp_path / "table.csv").write_text(
        HEADER.replace("trials,", "trials,axes,") + ROW.replace("trial,", "trial,rows channels,", 1)
    )
    with pytest.raises(BadTable, match="axes of a text: 'trials channels'"):
        import_table(tmp_path / "table.csv", tmp_path / "out")


def test_a_column_of_one_value_a_trial_is_no_channel_without_a_note(tmp_path):
    """* takes all columns that no cell names: a subject's number, from which a model may learn."""
    rows = "".join(
        f"{trial},{trial % 2},{trial * 10 + n},7,{trial // 2}\n"
        for trial in range(4)
        for n in range(5)
    )
    (tmp_path / "a.csv").write_text(f"trial,object,touch,dead,subject\n{rows}")
    header = "file,trials,label:object,group:who,channels,time\n"
    notes: list[str] = []
    made = import_row(
        tmp_path, "a.csv,trial,from:object,1,*[N],rate:50Hz", header=header, notes=notes
    )
    assert made[0].manifest.sensor.channels == ("touch", "dead", "subject")
    assert sum("a.csv: subject has one value in each trial" in note for note in notes) == 1
    for row in (
        "a.csv,trial,from:object,from:subject,*[N],rate:50Hz",
        "a.csv,trial,from:object,1,touch[N] subject[N],rate:50Hz",
    ):
        notes = []
        import_row(tmp_path, row, header=header, notes=notes)
        assert "one value" not in str(notes)


ANEW = """day,ms,a,b,what
1,7,1,2,cup
1,17,3,4,cup
1,27,3,4,cup
1,8,5,6,ball
1,18,5,7,ball
2,9,7,8,cup
2,19,9,10,cup
2,9.5,11,12,cup
"""


@pytest.mark.parametrize(("trials", "names", "note"), [
    ("restarts", ["all-1", "all-2", "all-3", "all-4"], "by where the times in ms begin anew"),
    ("day+restarts", ["all-1-1", "all-1-2", "all-2-1", "all-2-2"],
     "by its column day, and by where the times in ms begin anew"),
])  # fmt: skip
def test_a_text_is_cut_where_its_times_begin_anew(tmp_path, trials, names, note):
    """Beside a column that says the day, restarts are counted within each day."""
    (tmp_path / "all.csv").write_text(ANEW)
    notes: list[str] = []
    made = import_row(
        tmp_path, f"all.csv,{trials},from:what,from:day,*[N],ms[ms]", header=HEADER, notes=notes
    )
    assert sorted(path.stem for path in (tmp_path / "out").iterdir()) == names
    assert [item.manifest.labels["object"] for item in made] == ["cup", "ball", "cup", "cup"]
    np.testing.assert_allclose(made[1].samples.fitted_s, [0.008, 0.018])
    np.testing.assert_array_equal(made[1].samples.values, [[5, 6], [5, 7]])
    assert notes == [f"all.csv was read as 4 trials {note}"]


def test_a_column_that_is_called_restarts_tells_trials_apart(tmp_path):
    text = "restarts,ms,a\n4,0,1\n4,9,1\n5,1,1\n"
    made = bring(tmp_path, "all.csv,restarts,cup,,a[N],ms[ms]", text)
    assert [path.stem for path in made] == ["all-4", "all-5"]


@pytest.mark.parametrize(("time", "text", "words"), [
    ("rate:9Hz", ANEW, "a column of time for restarts in the column 'trials'; got a rate"),
    ("ms[ms]", ANEW.replace("1,18,", "1,,"), "a time in every row; got '' in .*all.csv, line 6"),
    ("ms[ms]", ANEW.replace("1,27,", "1,12,"), "begin anew near where they began; got 12 after 17 "
     "in .*line 4; sort the rows of each trial"),
    ("ms[ms]", ANEW.replace("1,27,", "1,17,"), "times that increase .*trial 1, line 4: 1 of 3 "
     "rows has"),
])  # fmt: skip
def test_what_cannot_be_cut_where_times_begin_anew_is_refused(tmp_path, time, text, words):
    with pytest.raises(BadTable, match=words):
        bring(tmp_path, f"all.csv,restarts,from:what,,a[N],{time}", text)
    assert not (tmp_path / "out").exists()


def test_times_that_begin_anew_within_a_trial_say_how_to_cut_there(tmp_path):
    with pytest.raises(BadTable, match=r"trial 1, line 5: time goes back once, .* run\+restarts"):
        bring(tmp_path, "all.csv,day,cup,,a[N],ms[ms]", ANEW)
