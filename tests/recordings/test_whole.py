"""Files that are there as a whole or not at all."""

from __future__ import annotations

from pathlib import Path

from taxel.recordings.whole import whole_file


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
