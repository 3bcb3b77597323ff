"""Tables of onsets that a person saw: read whole, or refused by line before anything is written."""

from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadTable
from taxel.labels.onset_table import read_onsets

TIMES = {"mug-1": 100.0 + np.arange(50) / 25, "mug-2": np.arange(75) / 25}


def read(folder: Path, text: str) -> dict[str, float | None]:
    path = folder / "onsets.csv"
    path.write_text(text)
    return {name: found.onset_s for name, found in read_onsets(path, "slip", TIMES).items()}


def test_seconds_frames_and_nothing_are_an_onset_or_none(tmp_path: Path):
    by_second = read(tmp_path, "# who saw it\nfile,onset_s\nmug-1.mcap,1.2\nmug-2,\n")
    by_frame = read(tmp_path, "frame,file\n30,mug-1\n,mug-2.mcap\n")

    assert by_second == {"mug-1": 1.2, "mug-2": None}
    assert by_frame == pytest.approx(by_second)


def test_who_and_why_are_kept(tmp_path: Path):
    path = tmp_path / "onsets.csv"
    path.write_text("file,onset_s,note,author\nmug-2,0.5,by the thumb,Ada\n")
    (found,) = read_onsets(path, "gross-slip", TIMES).values()

    assert (found.rule, found.author, found.note) == ("gross-slip", "Ada", "by the thumb")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "a first line file,onset_s"),
        ("file,onset_s,frame\nmug-1,1,2\n", "a first line file,onset_s"),
        ("file,onset\nmug-1,1\n", "a first line file,onset_s"),
        ("file,onset_s\n", "at least one line"),
        ("file,onset_s\nmug-1\n", "2 cells; got 1 in line 2"),
        ("file,onset_s\nmug-9,1\n", "'mug-9' in line 2 of .*, which is not there"),
        ("file,onset_s\nmug-1,1\nmug-1.mcap,1\n", "'mug-1.mcap' in line 3 of .*, a second time"),
        ("file,onset_s\nmug-1,soon\n", "'soon' in line 2"),
        ("file,onset_s\nmug-1,nan\n", "'nan' in line 2"),
        ("file,onset_s\nmug-1,9\n", "from 0 to 1.96 s, inside the video; got 9 s in line 2"),
        ("file,frame\nmug-1,2.5\n", "'2.5' in line 2"),
        ("file,frame\nmug-1,50\n", "a frame from 0 to 49; got 50 in line 2"),
    ],
)
def test_what_cannot_be_meant_is_refused_by_its_line(tmp_path: Path, text: str, words: str):
    with pytest.raises(BadTable, match=words):
        read(tmp_path, text)
