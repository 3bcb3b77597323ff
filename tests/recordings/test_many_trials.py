"""Claims about lines of a table that stand for many trials: labels, groups, names, refusals."""

import re
import shutil

import h5py
import numpy as np
import pytest
from array_writers import FORMS, write_mat5
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mutations import changed_bytes
from stack_imports import HEADER, OBJECTS, OWN, SESSIONS, X, bring, refusal

from taxel.errors import BadInput
from taxel.foreign.npz_file import NpzFile
from taxel.recordings.imports.importing import import_table
from taxel.recordings.reader import list_recordings, read_recording

pytestmark = pytest.mark.usefixtures("untried_hdf5")

UNSHARED = [HealthCheck.function_scoped_fixture]
"""Each example clears away its files itself."""


def test_a_npy_stack_takes_its_labels_from_files_beside_it(tmp_path):
    """Another .npy, a column of a table, an array of another file: each has a value a trial."""
    np.save(tmp_path / "X.npy", X)
    np.save(tmp_path / "y.npy", OBJECTS)
    lines = "\n".join(f"{n},{day}" for n, day in enumerate(SESSIONS))
    (tmp_path / "days.csv").write_text(f"n,day\n{lines}\n")
    made = bring(tmp_path, f"X.npy,,,from:y.npy,from:days.csv:day,{OWN},rate:50Hz")
    assert [item.manifest.labels["object"] for item in made] == OBJECTS.tolist()
    assert [item.manifest.groups["session"] for item in made] == list("112233")
    assert "lies outside" in refusal(tmp_path, f"X.npy,,,from:../y.npy,1,{OWN},rate:50Hz")
    row = f"X.npy,,,from:y.npy,from:days.csv:hour,{OWN},rate:50Hz"
    assert "one column 'hour'" in refusal(tmp_path, row)


@pytest.mark.parametrize(
    ("separator", "name", "sign"), [(",", "y.csv", "commas"), ("\t", "y.tsv", "tabs")]
)
def test_a_list_of_labels_whose_name_holds_separators_says_so(tmp_path, separator, name, sign):
    np.save(tmp_path / "X.npy", X)
    header = f"class (0 is cup{separator}1 is ball)"
    (tmp_path / name).write_text("\n".join([header, *OBJECTS.tolist()]) + "\n")
    row = f"X.npy,,trials rows channels,from:{name},,{OWN},rate:50Hz"

    message = refusal(tmp_path, row)

    assert f"got 2, for its line 1 was split at its {sign}: class (0 is cup, 1 is ball)" in message
    assert f"as in from:{name}:NAME; or, if line 1 is one name, write it in double" in message
    (tmp_path / name).write_text("\n".join([f'"{header}"', *OBJECTS.tolist()]) + "\n")
    made = bring(tmp_path, row)
    assert [item.manifest.labels["object"] for item in made] == OBJECTS.tolist()


def test_a_list_of_labels_whose_first_was_taken_for_a_name_says_so(tmp_path):
    """One that stands there once only: nothing tells it from the name of the column."""
    np.save(tmp_path / "X.npy", X)
    row = f"X.npy,,trials rows channels,from:y.txt,,{OWN},rate:50Hz"
    (tmp_path / "y.txt").write_text("bottle\ncup\nball\ncup\nball\ncup\n")
    message = refusal(tmp_path, row)
    assert "6 trials; got 5 by from:y.txt in " in message
    assert "table.csv, line 2, where line 1 of the file, 'bottle'" in message
    assert "is taken for the column's name; if it is the first trial's value, write a" in message
    (tmp_path / "y.txt").write_text("cup\nball\ncup\nball\ncup\n")
    assert "is taken for" not in refusal(tmp_path, row)
    (tmp_path / "y.txt").write_text("object\nbottle\ncup\nball\ncup\nball\ncup\n")
    notes: list[str] = []
    bring(tmp_path, row, notes=notes)
    assert not any("taken as the value" in note for note in notes)  # of the empty group


@pytest.mark.parametrize(
    ("labels", "expected"),
    [
        (np.array([3.0, 1.0, 2.0, 3.0, 1.0, 2.0]), list("312312")),
        (np.array([0.5, 1.0, 2.5, 0.1, 1, 2], "f4"), ["0.5", "1", "2.5", "0.1", "1", "2"]),
        (np.array([True, False] * 3), ["true", "false"] * 3),
        (np.array([[1, 0], [0, 1]] * 3), list("010101")),
        (np.array([7, 8, 9, 7, 8, 9])[:, None], list("789789")),
        (np.array([b"cup ", b"ball"] * 3), ["cup", "ball"] * 3),
        (np.array(["one"]), ["one"] * 6),
    ],
)
def test_labels_are_texts_whole_numbers_or_one_hot_rows(tmp_path, labels, expected):
    """A label is text in taxel; a single one holds for all trials."""
    np.savez(tmp_path / "a.npz", X=X, y=labels)
    notes: list[str] = []
    made = bring(tmp_path, f"a.npz,X,trials rows channels,from:y,1,{OWN},rate:50Hz", notes=notes)
    assert [item.manifest.labels["object"] for item in made] == expected
    assert ("one-hot" in str(notes)) == (labels.ndim == 2 and labels.shape[1] == 2)


@pytest.mark.parametrize(
    ("labels", "words"),
    [
        (np.zeros((6, 9)), "one value for each trial, or a one-hot row; got y in .*: 6 × 9"),
        (np.zeros((6, 9, 2)), "one value for each trial"),
        (np.array([1.0, np.nan] * 3), "a value for each trial; got nothing for trial 2 in"),
        (np.array(["a", "", "b", "c", "d", "e"]), "nothing for trial 2 in y"),
        (np.arange(5), "a value for each of 6 trials; got 5 by from:y"),
    ],
)
def test_what_is_no_label_a_trial_is_refused(tmp_path, labels, words):
    """In one line, and nothing is written."""
    np.savez(tmp_path / "a.npz", X=X, y=labels)
    message = refusal(tmp_path, f"a.npz,X,trials rows channels,from:y,1,{OWN},rate:50Hz")
    assert re.search(words, message)


def test_a_split_of_the_authors_becomes_a_group(tmp_path):
    """A row of the table for each part; recordings are called by the array."""
    np.savez(tmp_path / "a.npz", X_train=X[:4], y_train=OBJECTS[:4], X_test=X[4:],
             y_test=OBJECTS[4:])  # fmt: skip
    header = HEADER.replace("session", "split")
    rows = "\n".join(f"a.npz,X_{part},,from:y_{part},{part},{OWN},rate:50Hz"
                     for part in ("train", "test"))  # fmt: skip
    made = bring(tmp_path, rows, header=header)
    assert [path.stem for path in list_recordings(tmp_path / "out")] == [
        "a-X_test-1", "a-X_test-2", *(f"a-X_train-{number}" for number in range(1, 5)),
    ]  # fmt: skip
    assert sorted(item.manifest.groups["split"] for item in made) == ["test"] * 2 + ["train"] * 4


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("gone.npz,X,,from:y,1,*[N],rate:50Hz", "gone.npz, which is not there"),
        ("a.npz,Z,,from:y,1,*[N],rate:50Hz", "the name of an array; got 'Z', where .*X .6 × 9 × 3"),
        ("a.npz,,,from:y,1,*[N],rate:50Hz", "array of trials; got none .*holds X .*, W .6 × 9 × 3"),
        ("a.npz,X,,from:q,1,*[N],rate:50Hz", "the name of an array; got 'q'"),
        ("a.npz,X,,from:y,1,*[N],rate:50Hz", "'trials rows channels' .* or 'trials channels rows'"),
        ("a.npz,X,trials rows,from:y,1,*[N],rate:50Hz", "as many axes as X in"),
        ("a.npz,X,trials channels rows,from:y,1,a[N] b[N] c[N],rate:50Hz", "1 to 9, or 9 names"),
        ("a.npz,X,,from:y,1,a[N] b[N],rate:50Hz", "6 × 9 × 3, with labels of 6 trials and 2 chan"),
        ("a.npz,X,rows channels trials,from:y,1,*[N],rate:50Hz", "a value for each of 3 trials"),
        ("a.npz,y,,from:y,1,*[N],rate:50Hz", "real numbers in y; got 6 texts"),
        ("a.npz,C,trials rows channels,from:y,1,*[N],rate:50Hz", "complex64.*the amplitude"),
        ("a.npz,n*,,from:y,1,*[N],rate:50Hz", "between 1 and 100,000 arrays n.; got 0"),
        ("a.npz,X,,from:y,1,a[N] b[N] c[N],", "rate:100Hz"),
        ("a.npz,X,,from:y,1,,rate:50Hz", "at least one channel"),
        ("plain.csv,,,from:y,1,a[N],rate:50Hz", "'label:object' without 'from:y'"),
        ("plain.npy,,,from:y,1,1[N],rate:50Hz", "got 'y', where .* from:y.npy for an array of ano"),
        ("obj.npz,X,,x,1,*[N],rate:50Hz", "only pickle could read"),
        ("odd.npz,X,trials rows channels,from:y,1,*[N],rate:50Hz", "y: one of records with named"),
        ("odd.npz,X,trials rows channels,from:t,1,*[N],rate:50Hz", "t: one of dates or times"),
    ],
)  # fmt: skip
def test_a_row_that_does_not_fit_its_file_is_refused(tmp_path, row, words):
    """One plain line, no output."""
    np.savez(tmp_path / "a.npz", X=X, W=X, y=OBJECTS, C=X * 1j)
    np.savez(tmp_path / "obj.npz", X=np.array([X[0], None], object))
    records = np.zeros(6, [("object", "U4"), ("n", "i4")])
    np.savez(tmp_path / "odd.npz", X=X, y=records, t=np.arange(6).astype("datetime64[D]"))
    np.save(tmp_path / "plain.npy", X[0])
    (tmp_path / "plain.csv").write_text("a,b\n1,2\n")
    assert re.search(words, refusal(tmp_path, row))


def test_a_file_of_arrays_for_each_trial_is_called_by_the_file(tmp_path):
    """Its label may be an array of it; of many files only the first ways of reading are said."""
    for number, trial in enumerate(X):
        write_mat5(tmp_path / f"grasp{number}.mat", {"data": trial, "object": OBJECTS[number]})
    rows = "\n".join(
        f"grasp{n}.mat,data,rows channels,from:object,1,*[N],rate:50Hz" for n in range(6)
    )
    notes: list[str] = []
    made = bring(tmp_path, rows, notes=notes)
    assert [path.stem for path in list_recordings(tmp_path / "out")] == [
        f"grasp{number}" for number in range(6)
    ]
    assert [item.manifest.labels["object"] for item in made] == OBJECTS.tolist()
    assert [item.manifest.groups["file"] for item in made] == [f"grasp{n}.mat" for n in range(6)]
    assert notes == [
        *(f"data in grasp{number}.mat was read as 1 trial of 'rows channels': 9 scans of 3 channels"
          for number in range(4)),
        "2 more files or arrays were read likewise",
    ]  # fmt: skip
    for recording, trial in zip(made, X, strict=True):
        np.testing.assert_array_equal(recording.samples.values, trial)


def test_intervals_may_name_a_trial(tmp_path):
    """By its recording's name."""
    np.savez(tmp_path / "a.npz", X=X, y=OBJECTS)
    (tmp_path / "table.csv").write_text(HEADER + f"a.npz,X,,from:y,1,{OWN},rate:50Hz\n")
    (tmp_path / "iv.csv").write_text("file,start_s,end_s,label:phase\na-2,0.02,0.1,lift\n")
    made = import_table(tmp_path / "table.csv", tmp_path / "out", intervals=tmp_path / "iv.csv")
    assert [len(read_recording(path).marks) for path in made] == [0, 1, 0, 0, 0, 0]


def test_rows_of_one_array_twice_are_refused(tmp_path):
    """The same trials would be in two recordings."""
    np.savez(tmp_path / "a.npz", X=X, y=OBJECTS)
    row = f"a.npz,X,,from:y,1,{OWN},rate:50Hz"
    assert "each file in one row" in refusal(tmp_path, f"{row}\n{row}")


@pytest.mark.parametrize("form", [form for form in FORMS if form not in ("HDF5", "MATLAB 7.3")])
@settings(settings.get_profile("fuzz"), suppress_health_check=UNSHARED)
@given(data=st.data())
def test_a_damaged_file_is_imported_as_a_whole_or_refused_in_one_line(tmp_path, form, data):
    """Never half, and never with another error."""
    ending, write = FORMS[form]
    honest = tmp_path / f"honest{ending}"
    if not honest.exists():
        write(honest, {"X": X, "y": OBJECTS, "t": np.arange(9.0), "n": np.full(6, 9)})
    (tmp_path / f"a{ending}").write_bytes(data.draw(changed_bytes(honest.read_bytes())))
    header = HEADER.replace("axes,", "axes,length,")
    row = f"a{ending},X,,from:n,from:y,1,{OWN},from:t[ms]\n"
    (tmp_path / "table.csv").write_text(header + row)
    before = sorted(path.name for path in tmp_path.iterdir())
    message = None
    try:
        import_table(tmp_path / "table.csv", tmp_path / "out")
    except BadInput as error:
        message = str(error)
    if message is None:
        shutil.rmtree(tmp_path / "out")
    assert "\n" not in (message or "")
    assert sorted(path.name for path in tmp_path.iterdir()) == before


def test_labels_may_stand_in_the_names_of_the_arrays(tmp_path):
    """In groups of HDF5 and names of a .npz: by the number of the star."""
    np.savez(tmp_path / "a.npz", **{f"{OBJECTS[n]}_{n}": X[n] for n in range(6)})
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for number, trial in enumerate(X):
            file[f"day{number // 2}/{OBJECTS[number]}/trial_{number}"] = trial
    for row in (f"a.npz,*_*,,star:1,star:2,{OWN},rate:50Hz",
                f"a.h5,*/*/trial_*,,star:2,star:3,{OWN},rate:50Hz"):  # fmt: skip
        made = bring(tmp_path, row)
        found = {item.manifest.groups["session"]: item.manifest.labels["object"] for item in made}
        assert found == {str(number): OBJECTS[number] for number in range(6)}
        for recording in made:
            number = int(recording.manifest.groups["session"])
            np.testing.assert_array_equal(recording.samples.values, X[number])
        shutil.rmtree(tmp_path / "out")
    np.savez(tmp_path / "b.npz", X=X, y=OBJECTS)
    (tmp_path / "c.csv").write_text("a,b\n1,2\n")
    for row, words in (
        (f"a.npz,*_*,,star:3,1,{OWN},rate:50Hz", "star:1 to star:2; got 'star:3'"),
        (f"b.npz,X,,star:1,from:y,{OWN},rate:50Hz", "a * in the column 'trials'; got 'star:1'"),
        ("c.csv,,,star:1,1,a[N],rate:50Hz", "for a file of one trial"),
    ):
        assert words in refusal(tmp_path, row)


def test_folders_may_hold_files_of_the_same_name(tmp_path):
    """s1/touch.npz and s2/touch.npz: the folder tells their recordings apart."""
    for number in (1, 2):
        (tmp_path / f"s{number}").mkdir()
        np.savez(tmp_path / f"s{number}" / "touch.npz", X=X * number, y=OBJECTS)
    words = f"X,trials rows channels,from:y,1,{OWN},rate:50Hz"
    twice = f"s1/touch.npz,{words}\ns1/touch.npz,{words}"
    assert "each file in one row" in refusal(tmp_path, twice)
    made = bring(tmp_path, f"s1/touch.npz,{words}\ns2/touch.npz,{words}")
    names = [path.name for path in list_recordings(tmp_path / "out")]
    assert names == [f"s{number}-touch-{n}.mcap" for number in (1, 2) for n in range(1, 7)]
    np.testing.assert_array_equal(made[8].samples.values, X[2] * 2)


def test_one_file_of_many_is_open_at_a_time(tmp_path, monkeypatch):
    """A line for each of 1,000 files does not use up what a process may open."""
    opened: list[int] = []
    now = [0]
    real = NpzFile.close

    def init(self, path, made=NpzFile.__init__):
        made(self, path)
        now[0] += 1
        opened.append(now[0])

    def close(self):
        real(self)
        now[0] -= 1

    monkeypatch.setattr(NpzFile, "__init__", init)
    monkeypatch.setattr(NpzFile, "close", close)
    for number in range(5):
        np.savez(tmp_path / f"t{number}.npz", X=X[number])
    rows = "\n".join(f"t{n}.npz,X,rows channels,cup,1,{OWN},rate:50Hz" for n in range(5))
    assert len(bring(tmp_path, rows)) == 5
    assert max(opened) == 1
    assert now == [0]


def test_labels_beside_trials_that_the_file_lists_in_another_order_bring_a_note(tmp_path):
    """HDF5 lists run10 before run2: labels written in that order would go to other trials."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for number in range(1, 12):
            file[f"run{number}/force"] = X[0] + number
            file[f"run{number}"].attrs["object"] = f"o{number}"
        file["y"] = np.arange(1, 12)
    np.savez(tmp_path / "a.npz", *[X[0] + number for number in range(1, 12)], y=np.arange(1, 12))
    expected = [str(number) for number in range(1, 12)]
    for row, doubts in (
        ("a.h5,run*/force,rows channels,from:y", 1),
        ("a.h5,run*/force,rows channels,from:run*@object", 0),
        ("a.npz,arr_*,rows channels,from:y", 0),
    ):
        notes: list[str] = []
        made = bring(tmp_path, f"{row},1,{OWN},rate:50Hz", notes=notes)
        assert [item.manifest.labels["object"].lstrip("o") for item in made] == expected
        np.testing.assert_array_equal(made[9].samples.values, (X[0] + 10).astype("f4"))
        assert sum("run2/force before run10/force" in note for note in notes) == doubts
        for path in (tmp_path / "out").iterdir():
            path.unlink()


def test_doubts_are_shown_however_many_files_were_read(tmp_path):
    """How files were read is cut short after a few lines; what may be wrong is not lost in it."""
    for number in range(8):
        np.savez(tmp_path / f"t{number}.npz", X=X, y=np.array([1, 2] * 3), names=["a", "b", "c"])
    rows = "\n".join(
        f"t{n}.npz,X,trials rows channels,from:names[y],1,{OWN},rate:50Hz" for n in range(8)
    )
    notes: list[str] = []
    bring(tmp_path, rows, notes=notes)
    assert "4 more files or arrays were read likewise" in notes
    assert sum("no trial has the number 0" in note for note in notes) == 1
    assert len(notes) == 6


def test_a_group_above_the_trials_may_hold_their_labels(tmp_path):
    """subject*@age of subject*/trial_*/force; a pattern that begins otherwise is refused."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for who in (9, 10):
            for number in (1, 2):
                file[f"subject{who}/trial_{number}/force"] = X[number] * who
            file[f"subject{who}"].attrs["age"] = who + 20
    row = f"a.h5,subject*/trial_*/force,rows channels,{{}},1,{OWN},rate:50Hz"
    assert "needed as many * as" in refusal(tmp_path, row.format("from:trial_*@age"))
    made = bring(tmp_path, row.format("from:subject*@age"))
    assert [item.manifest.labels["object"] for item in made] == ["29", "29", "30", "30"]
    np.testing.assert_array_equal(made[2].samples.values, X[1] * 10)


def test_the_name_of_an_array_as_a_value_brings_a_note(tmp_path):
    """y for from:y gives all trials the label y; a capital From:y is from:y."""
    np.savez(tmp_path / "a.npz", X=X, y=OBJECTS, t=np.arange(9.0))
    words = f"a.npz,X,trials rows channels,{{}},1,{OWN},{{}}"
    assert "write from:t[ms]" in refusal(tmp_path, words.format("From:y", "t[ms]"))
    for label, expected in (
        ("y", "y in the column label:object is taken as the value of all trials; write from:y"),
        ("y.npy", "write from:y.npy for each trial's own"),
        ("From:y", ""),
        ("cup", ""),
    ):
        notes: list[str] = []
        made = bring(tmp_path, words.format(label, "From:t[ms]"), notes=notes)
        wanted = OBJECTS.tolist() if label == "From:y" else [label] * 6
        assert [item.manifest.labels["object"] for item in made] == wanted
        assert sum("taken as the value" in note for note in notes) == bool(expected)
        assert expected in str(notes)


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ("5\n6\n5\n6\n5\n7\n", list("565657")),
        ("cup\nball\ncup\nball\ncup\nball\n", ["cup", "ball"] * 3),
        ("object\ncup\nball\ncup\nball\ncup\nball\n", ["cup", "ball"] * 3),
    ],
)
def test_a_list_of_labels_needs_no_name_above_it(tmp_path, lines, expected):
    """Its line 1 is a value where it is a number, or comes again; else it is the column's name."""
    np.save(tmp_path / "X.npy", X)
    (tmp_path / "y.txt").write_text(lines + "more\n")
    row = f"X.npy,,trials rows channels,from:y.txt,1,{OWN},rate:50Hz"
    assert "a value for each of 6 trials; got 7 by from:y.txt" in refusal(tmp_path, row)
    (tmp_path / "y.txt").write_text(lines)
    made = bring(tmp_path, row)
    assert [item.manifest.labels["object"] for item in made] == expected
