"""The demo's main path, as the README shows it, with one epoch of its table."""

import io
import json
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import pytest

from taxel.bundles.shipped import BOTH_GELS, DEFAULT_WARNING, shipped_bundle
from taxel.cli.demo import Demo
from taxel.cli.main import main
from taxel.errors import BadInput
from taxel.sim.teng.constants import MATERIALS, SHAPES


@pytest.mark.slow
def test_the_demo_leaves_a_report_recordings_and_recognisers_that_run(demo_made_once: Path) -> None:
    text = (demo_made_once / "printed.txt").read_text("utf-8")
    flat, out = " ".join(text.split()), demo_made_once / "demo"

    steps = [line[0] for line in text.splitlines() if line[1:3] == ". " and " · " in line]
    assert steps == ["1", "2", "3", "4", "5"]
    for split in ("random windows (leaks)", "session held out"):
        for task in ("shape", "material"):
            assert f"Table 4.1 · {task} · preset honest · split: {split}" in flat
    assert "channel gain is" in flat
    assert "Table 4.1" in (out / "report.html").read_text()
    names = sorted(path.name for path in (out / "honest").glob("*.mcap"))
    assert names == [f"session-{number}.mcap" for number in range(1, 7)]
    for task, answers in (("shape", set(SHAPES)),
                          ("material", set(MATERIALS))):  # fmt: skip
        with redirect_stdout(io.StringIO()) as printed:
            main(["live", str(out / f"{task}.taxel"), "sim://teng?seed=1&rate_hz=500&speed=max",
                  "--seconds", "6", "--json"])  # fmt: skip
        (found,) = json.loads(printed.getvalue())
        assert found["windows"] > 3
        assert set(found["answers"]) <= answers | {"UNKNOWN"}


def test_a_folder_that_holds_something_else_is_left_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("mine")
    with pytest.raises(BadInput, match="an earlier demo's"):
        Demo(output=tmp_path).run()
    assert (tmp_path / "precious").read_text() == "mine"


def test_an_earlier_demo_s_folder_is_replaced(tmp_path: Path) -> None:
    old = Demo(output=tmp_path / "demo")
    old._clear()
    (tmp_path / "demo" / "report.html").write_text("old")
    old._clear()
    assert [path.name for path in (tmp_path / "demo").iterdir()] == ["made-by-taxel-demo"]


@pytest.mark.parametrize("seconds", [-1.0, float("nan")])
def test_a_page_for_less_than_no_time_is_refused_before_anything_is_written(
    seconds: float, tmp_path: Path
) -> None:
    with pytest.raises(BadInput, match="--seconds of at least 0"):
        Demo(output=tmp_path / "demo", seconds=seconds).run()
    assert not (tmp_path / "demo").exists()


def test_the_page_and_the_command_to_try_next_run_the_default_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ran: list[Any] = []
    monkeypatch.setattr("taxel.cli.live.station.live_station", ran.append)
    demo = Demo(output=tmp_path / "demo")
    demo._page([], 1.0)
    demo._what_to_look_at(1.0)

    assert DEFAULT_WARNING == BOTH_GELS
    assert ran[0].bundles == (shipped_bundle(BOTH_GELS),)
    assert f"taxel live {BOTH_GELS} sim://cup-pour --page" in capsys.readouterr().out
