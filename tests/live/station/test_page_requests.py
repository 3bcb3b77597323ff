"""What a station does with a page's order to record."""

from datetime import datetime
from pathlib import Path
from types import SimpleNamespace

import pytest

from taxel.live.station import page_requests
from taxel.live.station.page_requests import fulfil

AT = datetime(2026, 11, 27, 16, 33, 1)


def test_recordings_that_begin_within_one_second_take_names_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before, the second was refused with "add --overwrite", which a page does not have."""
    asked: list[str] = []

    def record(path: Path, *_: object) -> None:
        asked.append(path.name)
        path.with_name(f"{path.name}{'.part' if len(asked) == 2 else ''}").touch()

    monkeypatch.setattr(page_requests, "datetime", SimpleNamespace(now=lambda: AT))
    config = SimpleNamespace(groups={}, labels={}, recordings=tmp_path)
    station = SimpleNamespace(config=config, record=record)
    for _ in range(3):
        fulfil(station, {"do": "record", "labels": {}})  # type: ignore[arg-type]

    assert asked == [f"2026-11-27_16-33-01{number}.mcap" for number in ("", "-2", "-3")]
