"""A folder without recordings says what to do with what it holds."""

from pathlib import Path

import pytest

from taxel.errors import BadRecording
from taxel.recordings.reader import list_recordings

VIDEOS = "left,right,label:y"


@pytest.mark.parametrize(
    ("files", "mend"),
    [
        ({}, "taxel simulate"),
        ({"trials.csv": VIDEOS, "other.csv": VIDEOS}, "trials.csv, where .*taxel train-trials"),
        ({"mine.csv": VIDEOS, "other.csv": "file,label:y"}, "mine.csv, where .*taxel train-trials"),
        ({"mine.tsv": VIDEOS.replace(",", "\t")}, "mine.tsv, where .*taxel train-trials"),
        ({"mine.csv": VIDEOS}, "import .*mine.csv --output RECORDINGS, then taxel train-monitor"),
        ({"one.csv": VIDEOS, "two.csv": VIDEOS}, "taxel simulate"),
        ({"table.csv": "file,label:y"}, "taxel import .*table.csv --output RECORDINGS"),
        ({"table.csv": ""}, "taxel import .*table.csv --output RECORDINGS"),
        ({"a.csv": "1,2", "b.csv": "1,2"}, "taxel simulate"),
    ],
)
def test_a_folder_without_recordings(tmp_path: Path, files: dict[str, str], mend: str):
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    with pytest.raises(BadRecording, match=mend):
        list_recordings(tmp_path)
