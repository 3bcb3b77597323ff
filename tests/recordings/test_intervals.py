"""Claims about tables of intervals: each line becomes a mark, or one line says why not."""

from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadTable
from taxel.recordings.imports.intervals import Interval, marks_of, read_intervals

HEADER = "file,start_s,end_s,label:object\n"
TWO = [(1.0, 2.5, {"object": "cup"}), (3.0, 4.0, {"object": "egg"})]


def read(path: Path, text: str, *names: str) -> dict:
    path.write_text(text, "utf-8")
    found = read_intervals(path, names or ("long",))
    return {
        name: [(interval.start_s, interval.end_s, dict(interval.labels)) for interval in own]
        for name, own in found.items()
    }


@pytest.mark.parametrize(
    "text",
    [
        HEADER + "long.csv,3,4,egg\nlong.csv,1,2.5,cup\n",
        HEADER.replace(",", ";") + "long;1;2.5;cup\n;;;\nday1/long.csv.gz;3;4;egg\n",
        "recording\tonset\tduration\tlabel:object\nlong.mcap\t1\t1.5\tcup\nlong\t3\t1\tegg\n",
        "start_s,duration_s,label:object\n1,1.5,cup\n3,1,egg\n",
    ],
)
def test_a_table_gives_the_intervals_of_its_files_in_the_order_of_time(tmp_path, text):
    assert read(tmp_path / "t.csv", text) == {"long": TWO}


def test_label_tracks_of_audacity_and_annotations_of_mne_are_read_as_they_are(tmp_path):
    audacity = "1.000000\t2.500000\tcup\n\\\t100.0\t200.0\n3.0\t4.0\tegg\n"
    mne = "# MNE-Annotations\n# onset, duration, description\n1,1.5,cup\n3,1,egg\n"

    for text, label in ((audacity, "label"), (mne, "description")):
        (own,) = read(tmp_path / "t.txt", text).values()
        assert own == [(start, end, {label: interval["object"]}) for start, end, interval in TWO]


def test_labels_groups_and_file_names_are_one_however_their_accents_were_typed(tmp_path):
    table = tmp_path / "t.csv"
    table.write_text(
        "file,start_s,end_s,label:a,group:who\ncafe\u0301.csv,0,1,cafe\u0301,e\u0301\n"
    )

    (interval,) = read_intervals(table, ["caf\u00e9"])["caf\u00e9"]
    assert (interval.labels, interval.groups) == ({"a": "caf\u00e9"}, {"who": "\u00e9"})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEADER, "at least one interval"),
        (HEADER + "long,2,1,cup\n", "an end after the start; got 2 to 1 s in .*line 2"),
        (HEADER + "long,2,2,cup\n", "an end after the start"),
        (HEADER + "long,0,2,cup\nlong,1.5,3,egg\n", "overlap; got 1.5 s in .*line 3.*line 2"),
        (HEADER + "long,0,151.345002,cup\nlong,151.345,160,egg\n",
         r"overlap; got 151\.345 s in .*line 3, before the 151\.345002 s"),
        (HEADER + "other.csv,0,2,cup\n", "a file among long; got 'other.csv' in .*line 2"),
        (HEADER + "long,0,two,cup\n", "seconds as a number; got 'two'"),
        (HEADER + "long,0,nan,cup\n", "seconds as a number; got .nan. .*; mend the file"),
        (HEADER.replace(",", ";") + "long;0,5;2,5;cup\n", "decimal points, not commas"),
        (HEADER + "long,0,2,\n", "'label:object'"),
        (HEADER + "long,0,2\n", "4 cells"),
        ("file,start_s,end_s,fold\nlong,0,2,1\n", "got 'fold'"),
        ("file,start_s,label:object\nlong,0,cup\n", "end_s or duration_s"),
        ("file,start_s,end_s,duration_s\nlong,0,1,1\n", "end_s or duration_s"),
    ],
)  # fmt: skip
def test_a_wrong_table_is_one_plain_line(tmp_path, text, words):
    with pytest.raises(BadTable, match=words) as caught:
        read(tmp_path / "t.csv", text)
    assert "\n" not in str(caught.value)


def test_a_table_without_files_is_of_the_only_recording(tmp_path):
    with pytest.raises(BadTable, match="a column 'file', as there are 2"):
        read(tmp_path / "t.csv", "start_s,end_s,label:a\n0,1,b\n", "one", "two")


def test_neighbouring_intervals_share_no_scan_and_lose_none():
    """Times count from the first scan, on whatever clock; an end is the next one's start."""
    time_s = 1.7e9 + np.arange(300) / 100.0
    intervals = [Interval(start_s=a, end_s=a + 1.0) for a in (0.0, 1.0, 2.0)]

    marks = marks_of(intervals, time_s, 100.0)

    inside = [(time_s >= mark.start_s) & (time_s <= mark.end_s) for mark in marks]
    assert [int(mask.sum()) for mask in inside] == [100, 100, 100]
    assert int(np.any(inside, axis=0).sum()) == 300


def test_an_end_that_was_rounded_up_to_half_a_scan_late_is_the_recordings_end():
    """Tables hold a few decimals; the mark ends with the last scan."""
    time_s = 1.7e9 + np.arange(300) / 100.0
    for end_s in (3.0, 3.000002, 3.004):
        (mark,) = marks_of([Interval(start_s=2.0, end_s=end_s)], time_s, 100.0)
        assert (mark.start_s, mark.end_s) == (time_s[200], time_s[-1])


def test_an_interval_that_is_refused_shows_how_its_figures_differ():
    """At 1 MHz, 2 µs are too late; six digits would look alike."""
    interval = Interval(start_s=146.834, end_s=151.345002, where="t.csv, line 171")
    with pytest.raises(BadTable, match=r"0 and 151\.345 s, .*got 146\.834 to 151\.345002 s in t"):
        marks_of([interval], np.array([0.0, 151.344999]), 1e6)


@pytest.mark.parametrize(
    ("start_s", "end_s", "words"),
    [
        (-0.1, 1.0, "within 0 and 3 s"),
        (2.0, 3.1, "within 0 and 3 s"),
        (2.0, 3.0051, "within 0 and 3 s, .*; got 2 to 3.0051 s"),
        (1.001, 1.009, "with a scan in it"),
    ],
)
def test_an_interval_outside_the_recording_or_between_scans_is_refused(start_s, end_s, words):
    interval = Interval(start_s=start_s, end_s=end_s, where="t.csv, line 7")
    with pytest.raises(BadTable, match=f"{words}.*t.csv, line 7"):
        marks_of([interval], np.arange(300) / 100.0, 100.0)
