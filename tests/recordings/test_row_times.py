"""Claims about times that repeat, or that were garbled: no trial is lost, or cut, by a stamp."""

from pathlib import Path

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.errors import BadTable
from taxel.recordings.imports.importing import ImportOptions, import_table
from taxel.recordings.imports.value_tables.stray_times import strays_of
from taxel.recordings.reader import read_recording

HEADER = "file,label:object,channels,time\n"
DROP = ImportOptions(repeated_times="drop")
DROP_GARBLED = ImportOptions(garbled_times="drop")
DROP_BOTH = ImportOptions(repeated_times="drop", garbled_times="drop")
AGAIN = [0, 10, 20, 20, 30, 40]
"""Times, milliseconds, of which the fourth repeats the third."""


def text(times, names="ms,a"):
    """Write a table; the first channel counts the rows."""
    return f"{names}\n" + "".join(f"{time},{row}\n" for row, time in enumerate(times))


def import_times(folder, times, options=DROP, unit="ms"):
    (folder / "a.csv").write_text(text(times))
    (folder / "table.csv").write_text(f"{HEADER}a.csv,cup,a[N],ms[{unit}]\n")
    (made,) = import_table(folder / "table.csv", folder / "out", options=options)
    return read_recording(made)


def test_of_rows_with_one_time_the_first_is_kept(tmp_path):
    times = [*range(0, 1000, 10), 990, 990, 1000]
    samples = import_times(tmp_path, times).samples

    assert samples.values[:, 0].tolist() == [*range(100), 102]
    np.testing.assert_allclose(samples.fitted_s, np.arange(101) / 100)


def test_rows_that_repeat_a_time_are_refused_with_the_option_and_counted_with_it(tmp_path, capsys):
    longer = [*AGAIN, *range(50, 350, 10)]
    for name, times in (("a", AGAIN), ("b", range(0, 140, 10)), ("c", longer)):
        (tmp_path / f"{name}.csv").write_text(text(times))
    rows = "".join(f"{name}.csv,cup,a[N],ms[ms]\n" for name in "abc")
    (tmp_path / "table.csv").write_text(HEADER + rows)
    words = ["import", str(tmp_path / "table.csv"), "--output", str(tmp_path / "out")]
    with pytest.raises(SystemExit) as refused:
        main(words)
    assert refused.value.code == 2
    assert (
        "a.csv, line 5: 1 of 6 rows has the time of the row above; leave such rows out with "
        "--repeated-times drop, or give" in capsys.readouterr().err
    )
    main([*words, "--repeated-times", "drop"])

    assert capsys.readouterr().err == (
        "note: 2 rows (3.6 %) in 2 of 3 files have the time of the row above and were left out, at "
        "most 1 (a.csv)\n"
    )
    (tmp_path / "table.csv").write_text(HEADER + rows.splitlines()[0])
    words[-1] = str(tmp_path / "again")
    main([*words, "--repeated-times", "drop"])
    assert capsys.readouterr().err == (
        "note: 1 row (17 %) in 1 of 1 file has the time of the row above and was left out (a.csv)\n"
    )


@pytest.mark.parametrize("repeats", [5, 6])
def test_where_many_rows_repeat_the_clock_is_too_coarse(tmp_path, repeats):
    times = [*range(100 - repeats), *range(repeats)]
    if repeats == 5:
        assert len(import_times(tmp_path, sorted(times)).samples) == 95
        return
    with pytest.raises(BadTable, match=r"6 of 100 rows have .*too coarse: .* 5 % of a file's rows"):
        import_times(tmp_path, sorted(times))


def test_times_that_go_back_are_refused_all_the_same(tmp_path):
    with pytest.raises(BadTable, match="time goes back once; sort"):
        import_times(tmp_path, [0, 10, 20, 20, 40, 30, 50])


def test_times_since_1970_are_shown_with_their_fraction(tmp_path):
    """With six digits both would read 1.70934e+09."""
    with pytest.raises(BadTable, match=r"got 1709337599\.5 s after 1709337599\.87 s"):
        import_times(tmp_path, [1709337599.87, 1709337599.5], unit="s")


def test_steps_below_a_nanosecond_are_refused_beside_repeats_too(tmp_path):
    with pytest.raises(BadTable, match="scans at least 1 ns apart"):
        import_times(tmp_path, [0, 0.01, 0.01, 0.02], unit="ns")


def test_labels_that_stand_in_rows_keep_their_rows(tmp_path):
    rows = "".join(f"{time},{row},{'ab'[row > 3]}\n" for row, time in enumerate(AGAIN))
    (tmp_path / "a.csv").write_text("ms,a,state\n" + rows)
    (tmp_path / "table.csv").write_text(
        "file,label:state,channels,time\na.csv,rows:state,a[N],ms[ms]\n"
    )
    (made,) = import_table(tmp_path / "table.csv", tmp_path / "out", options=DROP)
    first, second = read_recording(made).marks

    assert (first.labels["state"], second.labels["state"]) == ("a", "b")
    assert first.end_s == pytest.approx(0.02)
    assert (second.start_s, second.end_s) == (pytest.approx(0.03), pytest.approx(0.04))


@pytest.mark.parametrize("trials", ["run", "restarts"])
def test_in_a_text_of_many_trials_rows_are_left_out_of_their_own(tmp_path, trials):
    rows = "".join(
        f"{run},{time},{row}\n"
        for run, times in ((1, AGAIN), (2, range(0, 60, 10)))
        for row, time in enumerate(times)
    )
    (tmp_path / "all.csv").write_text("run,ms,a\n" + rows)
    (tmp_path / "table.csv").write_text(
        f"file,trials,channels,time\nall.csv,{trials},a[N],ms[ms]\n"
    )
    drop_of_the_first_trial_alone(tmp_path, r"trial 1, line 5: 1 of 6 rows has .*--repeated")


def drop_of_the_first_trial_alone(folder: Path, refusal: str) -> None:
    """Import two trials of six rows, of which the first one repeats a time."""
    with pytest.raises(BadTable, match=refusal):
        import_table(folder / "table.csv", folder / "out")
    first, second = import_table(folder / "table.csv", folder / "out", options=DROP)

    assert read_recording(first).samples.values[:, 0].tolist() == [0, 1, 2, 4, 5]
    assert len(read_recording(second).samples) == 6


def test_in_a_stack_rows_are_left_out_of_their_trial(tmp_path):
    values = np.arange(12.0).reshape(2, 6, 1)
    np.savez(tmp_path / "a.npz", X=values, t=[AGAIN, range(0, 60, 10)])
    (tmp_path / "table.csv").write_text(
        "file,trials,axes,channels,time\na.npz,X,trials rows channels,1[N],from:t[ms]\n"
    )
    drop_of_the_first_trial_alone(tmp_path, "--repeated-times drop")


def test_in_a_layout_of_ones_own_rows_are_left_out_too(tmp_path):
    (tmp_path / "own.py").write_text(
        "def read(path):\n"
        f"    return [[n, n] for n in range(6)], [t / 1000 for t in {AGAIN}], 'ab', 'NN'\n"
    )
    (tmp_path / "a.bin").write_text("")
    (tmp_path / "table.csv").write_text(
        "file,label:object,channels,layout\na.bin,cup,b[N],own.py:read\n"
    )
    options = ImportOptions(repeated_times="drop", allow_code=True)
    notes = []
    (made,) = import_table(
        tmp_path / "table.csv", tmp_path / "out", options=options, on_file=notes.append
    )

    assert read_recording(made).samples.values[:, 0].tolist() == [0, 1, 2, 4, 5]
    assert notes[0].repeated == 1


GARBLED = [61_040, 61_069, 61_098, 61_127, 6_114_875_408, 75_429, 75_459, 75_488]
"""As a serial line wrote them that lost bytes, milliseconds (a public set of a glove)."""


@pytest.mark.parametrize(("times", "words"), [
    (GARBLED, "got 6114875.408 s in {}, line 6, between 61.127 s above and 75.429 s below; such a "
              "time is garbled: leave that row out with --garbled-times drop, or mend the time."),
    ([3000, 3010, 3020, 7, 3030, 3040], "got 0.007 s in {}, line 5, between 3.02 s above and 3.03"),
    ([0, 10, 20, 900, 800, 30, 40, 50], "0.9 s and 0.8 s in {}, lines 5 and 6, between 0.02 s ab"),
    ([3000, 3010, 3020, 9000, 7, 3030, 3040], "9 s and 0.007 s in {}, lines 5 and 6, between 3.02"),
    ([0, 10, 900, 20, 30, 40, 800, 50], "got 0.9 s in {}, line 4, between 0.01 s above and 0.02 s b"
     "elow, the first of 2 such rows; such a time is garbled: mend the times, or give a rate"),
    ([3000, 3010, 3020, 7, 9000, *range(3030, 3080, 10)], "0.007 s and 9 s in {}, lines 5 and 6, "),
    ([0, 10, 20, 9e25, 30, 40], "s in {}, line 5, between 0.02 s above and 0.03 s below; such"),
])  # fmt: skip
def test_a_garbled_time_is_named_and_no_restart(tmp_path, times, words):
    with pytest.raises(BadTable) as caught:
        import_times(tmp_path, times)
    assert words.format(tmp_path / "a.csv") in str(caught.value)
    assert "restart" not in str(caught.value)


@pytest.mark.parametrize("times", [
    [0, 10, 20, 30, 0, 10, 20, 30],  # a restart
    [0, 10, 20, 30, 0, 10, 20, 30, 0],  # and one in the last row
    [0, 10, 0, 15, 0, 12],  # trials of two rows
    [0, 10, 20, 40, 30, 50],  # two rows in a wrong order
    [0, 100, 50, 200, 150, 300, 250],  # many of them
    [500, 100, 900, 0, 700, 300, 800, 200],  # rows in no order
    [0, 10, 20, 900, 800, 700, 30, 40, 50, 60, 70, 80],  # a clock that was set, and set back
    [5, 5], [1], [],
])  # fmt: skip
def test_other_times_that_go_back_are_not_called_garbled(times):
    assert strays_of(np.array(times, float)) == []


@pytest.mark.parametrize(("times", "lines"), [
    ([0, 10, 20, 900, 30, 40, 0, 10, 20], r"trial 1, line 5, between 0\.02 s above and 0\.03 s"),
    ([0, 10, 20, 0, 10, 20, 900, 30, 40], r"trial 2, line 8, between 0\.02 s above and 0\.03 s"),
    ([10, 20, 30, 900, 950, 40], r"0\.9 s and 0\.95 s in .*, lines 5 and 6, between 0\.03 s above"),
    ([10, 20, 30, 900, 500, 600], r"line 5, between 0\.03 s above and 0\.5 s below"),
])  # fmt: skip
def test_a_text_is_not_cut_at_a_garbled_time(tmp_path, times, lines):
    """It would make two trials of one, without a word."""
    (tmp_path / "all.csv").write_text(text(times))
    (tmp_path / "table.csv").write_text("file,trials,channels,time\nall.csv,restarts,a[N],ms[ms]\n")
    with pytest.raises(BadTable, match=lines):
        import_table(tmp_path / "table.csv", tmp_path / "out")


def test_a_trial_of_one_row_between_others_is_no_garbled_time(tmp_path):
    """Where another column says that trials change, times need not go on."""
    days = {1: [0, 10, 20], 2: [900], 3: [20, 30, 40, 20, 30, 35]}
    lines = [f"{day},{time},1\n" for day, times in days.items() for time in times]
    (tmp_path / "all.csv").write_text("day,ms,a\n" + "".join(lines))
    (tmp_path / "table.csv").write_text(
        "file,trials,channels,time\nall.csv,day+restarts,a[N],ms[ms]\n"
    )
    assert len(import_table(tmp_path / "table.csv", tmp_path / "out")) == 4
    garbled = "".join(f"3,{time},1\n" for time in (700, 50, 60, 70))
    (tmp_path / "all.csv").write_text("day,ms,a\n" + "".join([*lines[:7], garbled, *lines[7:]]))
    with pytest.raises(
        BadTable, match=r"trial 3-1, line 9, between 0\.04 s above and 0\.05 s below"
    ):
        import_table(tmp_path / "table.csv", tmp_path / "again")


def test_a_row_with_a_garbled_time_is_left_out_with_the_option(tmp_path):
    samples = import_times(tmp_path, GARBLED, DROP_GARBLED).samples

    assert samples.values[:, 0].tolist() == [0, 1, 2, 3, 5, 6, 7]
    np.testing.assert_allclose(samples.fitted_s[[0, -1]], [61.04, 75.488])


def test_garbled_times_are_refused_with_the_option_and_counted_with_it(tmp_path, capsys):
    times = {"a": [0, 10, 20, 9000, 30], "b": [0, 10, 10, 20], "c": range(0, 410, 10)}
    times["d"] = [*times["c"], 7, 8, *range(410, 700, 10)]
    for name, own in times.items():
        (tmp_path / f"{name}.csv").write_text(text(own))
    rows = "".join(f"{name}.csv,cup,a[N],ms[ms]\n" for name in times)
    (tmp_path / "table.csv").write_text(HEADER + rows)
    words = ["import", str(tmp_path / "table.csv"), "--output", str(tmp_path / "out")]
    with pytest.raises(SystemExit) as refused:
        main([*words, "--repeated-times", "drop"])
    assert refused.value.code == 2
    assert "leave that row out with --garbled-times drop, or mend" in capsys.readouterr().err
    main([*words, "--repeated-times", "drop", "--garbled-times", "drop"])

    first, second, *gaps = capsys.readouterr().err.splitlines()
    assert first == (
        "note: 3 rows (2.5 %) in 2 of 4 files have a garbled time and were left out, at most 2 "
        "(d.csv)"
    )
    assert second == (
        "note: 1 row (0.82 %) in 1 of 4 files has the time of the row above and was left out "
        "(b.csv)"
    )
    assert gaps == []


def test_repeats_are_looked_for_among_the_rows_that_garbled_times_leave(tmp_path):
    times = [0, 10, 20, 9000, 30, 30, 40]
    with pytest.raises(BadTable, match=r"line 5, between .* --garbled-times drop"):
        import_times(tmp_path, times)
    with pytest.raises(BadTable, match=r"line 7: 1 of 7 rows has .* --repeated-times drop"):
        import_times(tmp_path, times, DROP_GARBLED)
    samples = import_times(tmp_path, times, DROP_BOTH).samples

    assert samples.values[:, 0].tolist() == [0, 1, 2, 4, 6]


@pytest.mark.parametrize(("times", "words"), [
    ([0, 10, 900, 20, 30, 50, 40, 60], "0.04 s after 0.05 s in .*, line 8: time goes back once"),
    ([0, 10, 900, 20, 30, 40, 9e13], "got 9e.10 s in .*, line 8; correct the column's unit"),
])  # fmt: skip
def test_below_a_row_that_was_left_out_lines_are_those_of_the_file(tmp_path, times, words):
    with pytest.raises(BadTable, match=words):
        import_times(tmp_path, times, DROP_BOTH)


@pytest.mark.parametrize("strays", [5, 6])
def test_where_many_times_are_garbled_the_file_is_refused(tmp_path, strays):
    times = list(range(0, 1000, 10))
    for row in range(10, 10 * strays + 10, 10):
        times[row] = 900_000
    if strays == 5:
        assert len(import_times(tmp_path, times, DROP_GARBLED).samples) == 95
        return
    with pytest.raises(BadTable) as caught:
        import_times(tmp_path, times, DROP_GARBLED)
    assert (
        "line 12, between 0.09 s above and 0.11 s below, the first of 6 such rows; such a time is "
        "garbled: mend the times, or give a rate instead of a time column: --garbled-times drop "
        "leaves out 5 % of a file's rows at most" in str(caught.value)
    )


def test_two_garbled_times_that_fall_count_once_each():
    times = np.array([0, 10, 20, 30, 900, 500, 40, 50, 60, 70, 80, 90.0])

    assert strays_of(times) == [range(4, 6)]


@pytest.mark.parametrize(("times", "sizes"), [
    ([*range(0, 200, 10), 0, 9000, 10, 20, 30], [20, 4]),  # not the 0, with a cut below the 9000
    ([*range(0, 200, 10), 0, 9000, 9500, *range(10, 400, 10)], [20, 40]),
    ([*range(5000, 5200, 10), 5000, 7, 5010], [20, 2]),  # seen by the steps of both trials
])  # fmt: skip
def test_a_garbled_time_below_a_restart_is_left_out_of_the_new_trial(tmp_path, times, sizes):
    (tmp_path / "all.csv").write_text(text(times))
    (tmp_path / "table.csv").write_text("file,trials,channels,time\nall.csv,restarts,a[N],ms[ms]\n")
    made = import_table(tmp_path / "table.csv", tmp_path / "out", options=DROP_GARBLED)

    assert [len(read_recording(path).samples) for path in made] == sizes


def test_labels_in_rows_keep_their_rows_where_garbled_and_repeated_ones_are_left_out(tmp_path):
    rows = [(0, "a"), (10, "a"), (9000, "b"), (20, "a"), (20, "a"), (30, "b"), (40, "b")]
    lines = "".join(f"{time},{n},{state}\n" for n, (time, state) in enumerate(rows))
    (tmp_path / "a.csv").write_text("ms,a,state\n" + lines)
    (tmp_path / "table.csv").write_text(
        "file,label:state,channels,time\na.csv,rows:state,a[N],ms[ms]\n"
    )
    (made,) = import_table(tmp_path / "table.csv", tmp_path / "out", options=DROP_BOTH)

    first, second = read_recording(made).marks

    assert (first.labels["state"], second.labels["state"]) == ("a", "b")
    assert (first.start_s, first.end_s) == (0, pytest.approx(0.02))
    assert (second.start_s, second.end_s) == (pytest.approx(0.03), pytest.approx(0.04))


@pytest.mark.parametrize("trials", ["run", "restarts", "run+restarts"])
def test_in_a_text_of_many_trials_a_garbled_time_neither_cuts_nor_moves_a_trial(tmp_path, trials):
    """Back in the first trial, forwards in the second, whose labels stand in the rows."""
    lines = "".join(
        f"{run},{time},{row},{'ab'[row > 2]}\n"
        for run, times in (
            (1, [5000, 5010, 5020, 7, 5030, 5040, 5050]),
            (2, [0, 10, 20, 900, 30, 40]),
        )
        for row, time in enumerate(times)
    )
    (tmp_path / "all.csv").write_text("run,ms,a,state\n" + lines)
    (tmp_path / "table.csv").write_text(
        f"file,trials,label:state,channels,time\nall.csv,{trials},rows:state,a[N],ms[ms]\n"
    )
    with pytest.raises(BadTable, match=r"trial 1\S*, line 5, .* --garbled-times drop"):
        import_table(tmp_path / "table.csv", tmp_path / "out", options=DROP)
    facts = []
    made = import_table(
        tmp_path / "table.csv", tmp_path / "out", options=DROP_GARBLED, on_file=facts.append
    )
    first, second = map(read_recording, made)

    assert first.samples.values[:, 0].tolist() == [0, 1, 2, 4, 5, 6]
    assert second.samples.values[:, 0].tolist() == [0, 1, 2, 4, 5]
    assert [mark.labels["state"] for mark in second.marks] == ["a", "b"]
    assert (second.marks[0].end_s, second.marks[1].start_s) == (
        pytest.approx(0.02), pytest.approx(0.03)
    )  # fmt: skip
    assert [own.garbled for own in facts] == [1, 1]


def test_in_a_stack_a_row_with_a_garbled_time_is_left_out_of_its_trial(tmp_path):
    values = np.arange(12.0).reshape(2, 6, 1)
    np.savez(tmp_path / "a.npz", X=values, t=[[0, 10, 20, 9000, 30, 40], range(0, 60, 10)])
    (tmp_path / "table.csv").write_text(
        "file,trials,axes,channels,time\na.npz,X,trials rows channels,1[N],from:t[ms]\n"
    )
    with pytest.raises(BadTable, match=r"trial 1, line 4, .* --garbled-times drop"):
        import_table(tmp_path / "table.csv", tmp_path / "out")
    made = import_table(tmp_path / "table.csv", tmp_path / "out", options=DROP_GARBLED)
    first, second = map(read_recording, made)

    assert first.samples.values[:, 0].tolist() == [0, 1, 2, 4, 5]
    assert len(second.samples) == 6


@pytest.mark.parametrize("option", ["--repeated-times", "--garbled-times"])
def test_videos_have_no_times_of_rows(tmp_path, option, capsys):
    (tmp_path / "table.csv").write_text("left,label:object\na.mp4,cup\n")
    words = ["import", str(tmp_path / "table.csv"), "--output", str(tmp_path / "out")]
    with pytest.raises(SystemExit):
        main([*words, option, "drop"])
    assert f"leave {option} out" in capsys.readouterr().err
