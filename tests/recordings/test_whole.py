"""Files that are there as a whole or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from taxel.errors import RecordingFailed
from taxel.recordings.whole import whole_file, whole_folder


def test_two_writers_of_one_file_do_not_meet(tmp_path: Path) -> None:
    """Two commands that share a cache write the same file at once: each whole, neither refused."""
    path = tmp_path / "features.npy"

    with whole_file(path) as first:
        first.write_bytes(b"first")
        with whole_file(path) as second:
            second.write_bytes(b"sec")
            assert first.read_bytes() == b"first"
        assert path.read_bytes() == b"sec"

    assert path.read_bytes() == b"first"
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_cannot_take_its_name_is_one_plain_line(tmp_path, monkeypatch):
    """As where the older folder is a mount point."""

    def busy(old: Path, new: Path) -> None:
        raise OSError(errno.EBUSY, "Device or resource busy")

    (tmp_path / "run").mkdir()
    refused = pytest.raises(RecordingFailed, match=r"needed to write .*run; got Device")
    with refused, whole_folder(tmp_path / "run"):
        monkeypatch.setattr(os, "replace", busy)
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
