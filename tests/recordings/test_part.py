"""Claims about a part of an import table: at most so many recordings of each value of a column."""

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.errors import BadInput
from taxel.recordings.imports.part import PART, spread
from taxel.recordings.imports.rows import ImportRow
from taxel.recordings.imports.video_rows import VideoRow
from taxel.recordings.reader import list_recordings, read_recording


def rows(labels: str) -> list[ImportRow]:
    """Return a row for each letter, its label; sessions of four."""
    return [ImportRow(file=Path(f"{number}.csv"), labels={"object": letter},
                      groups={"file": f"{number}.csv", "session": str(number // 4)})
            for number, letter in enumerate(labels)]  # fmt: skip


def kept(found: list[ImportRow]) -> list[int]:
    return [int(row.file.stem) for row in found]


def test_of_each_label_so_many_are_taken_evenly_over_the_order():
    found, line = spread(rows("a" * 10 + "b" * 4 + "ab"), 4)

    # Of a: places 0, 3, 6, 9 of 11; b has five.
    assert kept(found) == [0, 3, 6, 9, 10, 12, 13, 15]
    assert line == ("8 of 16 recordings were left out: at most 4 of each label:object, evenly "
                    "spread over the order of the table")  # fmt: skip
    assert {row.details[PART] for row in found} == {line}


@pytest.mark.parametrize("count", range(1, 30))
def test_each_value_gives_as_many_as_it_may(count: int):
    for most in range(1, 32):
        found, line = spread(rows("a" * count), most)
        assert len(found) == min(count, most)
        assert kept(found)[0] == 0
        assert bool(line) is (most < count)
        steps = np.diff(kept(found))
        assert len(steps) == 0 or steps.max() - steps.min() <= 1


def test_several_columns_count_together_and_none_takes_all_rows():
    found, _ = spread(rows("abababab"), 1, ["label:object", "group:session"])
    assert kept(found) == [0, 1, 4, 5]
    bare = [ImportRow(file=Path(f"{number}.csv")) for number in range(9)]
    assert kept(spread(bare, 3)[0]) == [0, 3, 6]
    videos = [VideoRow(name=str(n), files={}, labels={"object": "ab"[n % 2]}) for n in range(8)]
    assert [row.name for row in spread(videos, 2)[0]] == ["0", "1", "4", "5"]


@pytest.mark.parametrize(
    ("most", "columns", "words"),
    [(0, [], "needed --at-most 1 or more; got 0"),
     (2, ["object"], "needed columns of the table for --of: label:object, group:session; got obj")],
)  # fmt: skip
def test_what_cannot_be_counted_is_refused(most: int, columns: list[str], words: str):
    with pytest.raises(BadInput, match=words):
        spread(rows("aabb"), most, columns)


def test_a_part_keeps_names_and_intervals_and_says_what_was_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """A file that shares its name with another is called by its folder in the part as well."""
    for day in ("day1", "day2", "day3"):
        (tmp_path / day).mkdir()
        np.savetxt(tmp_path / day / "cup.csv", np.arange(40.0).reshape(20, 2), delimiter=",")
    (tmp_path / "table.csv").write_text(
        "file,group:session,channels,time\n"
        + "".join(f"{day}/cup.csv,{day},*[N],rate:10Hz\n" for day in ("day1", "day2", "day3"))
    )
    (tmp_path / "i.csv").write_text(
        "file,start_s,end_s,label:object\n"
        + "".join(f"{day}-cup,0.5,1,cup\n" for day in ("day1", "day2", "day3"))
    )
    main(["import", str(tmp_path / "table.csv"), "--output", str(tmp_path / "out"), "--intervals",
          str(tmp_path / "i.csv"), "--at-most", "1", "--json"])  # fmt: skip

    found = json.loads(capsys.readouterr().out)
    (path,) = list_recordings(tmp_path / "out")
    recording = read_recording(path)
    line = "2 of 3 recordings were left out: at most 1, evenly spread over the order of the table"
    assert path.stem == "day1-cup"
    assert Counter(mark.labels["object"] for mark in recording.marks) == {"cup": 1}
    assert line in found["notes"]
    assert recording.manifest.sensor.details[PART] == line
