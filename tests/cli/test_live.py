"""`taxel live`: what it is given is what it runs."""

from pathlib import Path
from typing import Any

import pytest
import tyro

from taxel.cli import live
from taxel.errors import BadBundle


def test_a_runs_folder_is_refused_with_the_verb_that_bundles_it(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(BadBundle, match=f"a run; write one with: taxel bundle {tmp_path}"):
        tyro.cli(live.Live, args=[str(tmp_path), "sim://teng"]).run()


def test_a_second_bundle_beside_one_of_cameras_is_not_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ran: list[Any] = []
    monkeypatch.setattr("taxel.cli.live_station.live_station", ran.append)
    words = ["cup-pour", "sim://cup-pour", "--also", "cup-pour"]
    tyro.cli(live.Live, args=words).run()
    assert len(ran[0].bundles) == 2
