"""Claims about the column `pieces`: equal trials that know what they were cut from."""

import json

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.errors import BadTable
from taxel.recordings.imports.importing import ImportOptions, import_table
from taxel.recordings.imports.intervals import Interval, marks_of
from taxel.recordings.imports.notes import notes_of
from taxel.recordings.imports.pieces import Pieces, cut, parse_pieces
from taxel.recordings.reader import read_recording


def text(rows: int, step_ms: float = 10.0, state: str = "") -> str:
    """Return a table of one channel, and a column of labels where these are given."""
    states = [f",{word}" for word in state.split()] or [""]
    lines = [f"{n * step_ms:g},{n}{states[n * len(states) // rows]}" for n in range(rows)]
    return "\n".join(["ms,a" + (",state" if state else ""), *lines]) + "\n"


def bring(folder, table, *texts, **options):
    """Import files t0.csv, t1.csv … by the lines of a table."""
    for number, content in enumerate(texts):
        (folder / f"t{number}.csv").write_text(content)
    (folder / "table.csv").write_text(table)
    facts = []
    made = import_table(folder / "table.csv", folder / "out", on_file=facts.append, **options)
    return [read_recording(path) for path in made], notes_of(facts)


TABLE = "file,label:object,channels,time,pieces\nt0.csv,cup,a[N],ms[ms],{}\n"


@pytest.mark.parametrize("length", ["500ms", "0.5s", "50rows", "50 rows"])
def test_a_recording_is_cut_into_equal_pieces_and_its_rest_is_in_none(tmp_path, length):
    (recording,), notes = bring(tmp_path, TABLE.format(length), text(120))

    spans = [(mark.start_s, mark.end_s) for mark in recording.marks]
    assert spans == [pytest.approx((0.0, 0.49)), pytest.approx((0.5, 0.99))]
    assert [dict(mark.groups) for mark in recording.marks] == [
        {"cut_from": "t0.csv", "piece_number": "1"}, {"cut_from": "t0.csv", "piece_number": "2"},
    ]  # fmt: skip
    assert recording.manifest.labels == {"object": "cup"}
    assert len(recording.samples.values) == 120  # nothing is thrown away
    assert notes[0] == (
        "1 recording was cut into 2 pieces, each a trial; 20 rows behind the last whole piece are "
        "in none; the group cut_from names what a piece was cut from"
    )


def test_stretches_of_labels_are_cut_each_by_itself_and_keep_their_labels(tmp_path):
    table = "file,label:state,channels,time,pieces\nt0.csv,rows:state,a[N],ms[ms],20rows\n"
    (recording,), notes = bring(tmp_path, table, text(150, state="held slip held"))

    found = [(mark.labels["state"], mark.groups["cut_from"], mark.groups["piece_number"])
             for mark in recording.marks]  # fmt: skip
    assert found == [
        ("held", "t0.csv#1", "1"), ("held", "t0.csv#1", "2"), ("slip", "t0.csv#2", "1"),
        ("slip", "t0.csv#2", "2"), ("held", "t0.csv#3", "1"), ("held", "t0.csv#3", "2"),
    ]  # fmt: skip
    assert "30 rows behind" in notes[1]


def test_so_are_intervals(tmp_path):
    (tmp_path / "marks.csv").write_text("start_s,end_s,label:state\n0.1,0.5,held\n0.6,0.75,slip\n")
    table = "file,channels,time,pieces\nt0.csv,a[N],ms[ms],0.2s\n"
    (recording,), notes = bring(tmp_path, table, text(100), intervals=tmp_path / "marks.csv")
    assert "15 rows behind the last whole piece are in none; 1 stretch is shorter" in notes[0]

    assert [(mark.start_s, mark.end_s) for mark in recording.marks] == [
        pytest.approx((0.1, 0.29)), pytest.approx((0.3, 0.49)),
    ]  # fmt: skip  # the second is shorter than a piece
    assert {mark.labels["state"] for mark in recording.marks} == {"held"}


def test_so_is_each_trial_of_a_stack(tmp_path):
    np.save(tmp_path / "X.npy", np.arange(120.0).reshape(2, 60, 1))
    (tmp_path / "y.txt").write_text("cup\ncan\n")
    table = ("file,axes,label:object,channels,time,pieces\n"
             "X.npy,trials rows channels,from:y.txt,*[N],rate:100Hz,25rows\n")  # fmt: skip
    made, _ = bring(tmp_path, table)
    assert [len(recording.marks) for recording in made] == [2, 2]
    assert [mark.groups["cut_from"] for mark in made[1].marks] == ["X.npy[2]"] * 2


def test_a_file_too_short_for_a_piece_is_refused_or_left_out(tmp_path):
    table = TABLE.format("1s") + "t1.csv,can,a[N],ms[ms],1s\n"
    with pytest.raises(
        BadTable, match=r"recording of at least 1 s for one piece; got 0\.5 s in t1"
    ):
        bring(tmp_path, table, text(100), text(50))
    assert not (tmp_path / "out").exists()
    made, notes = bring(tmp_path, table, text(100), text(50),
                        options=ImportOptions(skip_unreadable=True))  # fmt: skip
    assert len(made) == 1
    assert any("left out t1.csv: needed a recording of at least 1 s" in note for note in notes)


def test_gaps_and_uneven_times_give_no_empty_piece():
    time_s = 1.7e9 + np.concatenate(
        [np.arange(10) * 0.1 + 1e-7, [3.05, 3.15], 4 + np.arange(5) / 10]
    )
    marks, left, _ = cut((), time_s, Pieces(seconds=1.0), "t")
    assert [(round(mark.start_s - 1.7e9, 2), mark.groups["piece_number"]) for mark in marks] == [
        (0.0, "1"), (3.05, "4"),
    ]  # fmt: skip
    assert left == 5


def test_pieces_of_times_since_1970_are_equal():
    time_s = 1.7e9 + np.arange(1000) / 300.0
    marks, left, _ = cut((), time_s, Pieces(seconds=0.5), "t")
    rows = [np.count_nonzero((time_s >= mark.start_s) & (time_s <= mark.end_s)) for mark in marks]
    assert (rows, left) == ([150] * 6, 100)


def test_marks_of_intervals_are_whole_where_a_scan_starts_at_the_last_moment():
    time_s = np.arange(10) / 10.0
    whole = marks_of([Interval(start_s=0.2, end_s=0.8)], time_s, 10.0)
    marks, left, _ = cut(whole, time_s, Pieces(rows=3), "t")
    assert [(mark.start_s, mark.end_s) for mark in marks] == [(0.2, 0.4), (0.5, 0.7)]
    assert left == 0


@pytest.mark.parametrize("text", ["1", "0s", "1.5rows", "-1s", "1 min", "nan s", "1e9s", "0rows"])
def test_a_length_that_is_none_is_refused(text):
    with pytest.raises(BadTable, match="a length such as 1s, 500ms or 100rows"):
        parse_pieces(text, "table, line 2")


def test_too_many_pieces_are_refused_before_they_are_made():
    with pytest.raises(BadTable, match="at most 100,000 pieces of a whole; got 1,100,000"):
        cut((), np.arange(11) * 1000.0, Pieces(seconds=0.01), "t")


def split(folder, capsys, *words):
    capsys.readouterr()
    main(["split", str(folder / "out"), "--target", "object", "--json", *words])
    return json.loads(capsys.readouterr().out)


def test_the_usual_split_holds_out_recordings_never_single_pieces(tmp_path, capsys):
    table = "file,label:object,channels,time,pieces\n" + "".join(
        f"t{n}.csv,{'cup' if n % 2 else 'can'},a[N],ms[ms],200ms\n" for n in range(6)
    )
    bring(tmp_path, table, *[text(100)] * 6)
    assert "file held out" in split(tmp_path, capsys)["split"]


def test_of_one_recording_it_holds_out_labelled_stretches(tmp_path, capsys):
    table = "file,label:object,channels,time,pieces\nt0.csv,rows:state,a[N],ms[ms],100ms\n"
    bring(tmp_path, table, text(400, state="cup can cup can cup can"))
    assert "cut_from held out" in split(tmp_path, capsys)["split"]


def test_where_each_class_was_recorded_once_it_is_refused_with_what_to_do(tmp_path, capsys):
    table = "file,label:object,channels,time,pieces\n" + "".join(
        f"t{n}.csv,{name},a[N],ms[ms],100ms\n" for n, name in enumerate(["cup", "can"])
    )
    bring(tmp_path, table, *[text(100)] * 2)
    with pytest.raises(SystemExit):
        split(tmp_path, capsys)
    assert "needed pieces of several recordings or stretches of each object" in (
        capsys.readouterr().err
    )
    later = split(tmp_path, capsys, "--split", "order:piece_number:70%")
    assert later["split"].startswith("piece_number up to 7")
