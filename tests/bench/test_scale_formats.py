"""The rows about other people's tools measure what they say."""

import pytest

from taxel.bench.scale import formats as scale_formats


def test_readers_of_others_find_every_message():
    rows = scale_formats.reader_rows()
    assert len(rows) == len(scale_formats.READERS)
    assert all(row.ok or "not installed" in row.note for row in rows)


def test_a_damaged_way_back_would_show(monkeypatch, tmp_path):
    """The row counts differences: none for the same recording, some for another."""
    same = scale_formats._recording(tmp_path / "a.mcap", 1)
    monkeypatch.setattr(scale_formats, "RATE_HZ", 900)
    other = scale_formats._recording(tmp_path / "b.mcap", 1)
    assert scale_formats._differences(same, same) == 0
    assert scale_formats._differences(same, other) >= 3


def test_without_lerobot_the_row_says_so(monkeypatch):
    pytest.importorskip("pyarrow", reason="pyarrow is not installed (taxel[export])")
    monkeypatch.delenv(scale_formats.LEROBOT_PYTHON, raising=False)
    (row,) = scale_formats.loader_rows()
    assert row.value is None
    assert scale_formats.LEROBOT_PYTHON in row.note
    (back,) = scale_formats.lerobot_rows()
    assert back.ok
