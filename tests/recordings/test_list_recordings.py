"""A folder without recordings says what to do with what it holds."""

from pathlib import Path

import pytest

from taxel.errors import BadRecording
from taxel.recordings.reader import list_recordings


@pytest.mark.parametrize(
    ("files", "mend"),
    [
        ((), "taxel simulate"),
        (("trials.csv", "other.csv", "a.avi"), "trials.csv; videos can be trained on"),
        (("table.csv",), "taxel import"),
        (("a.csv", "b.csv"), "taxel simulate"),
    ],
)
def test_a_folder_without_recordings(tmp_path: Path, files: tuple[str, ...], mend: str):
    for name in files:
        (tmp_path / name).touch()
    with pytest.raises(BadRecording, match=mend):
        list_recordings(tmp_path)
