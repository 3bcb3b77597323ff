"""The page of figures: each stored row once, missed goals first, nothing measured."""

import json
from pathlib import Path

import pytest

from taxel.bench import rows as bench_rows
from taxel.bench.figure_page import TITLES, figure_page, write_figure_page
from taxel.bench.rows import Row
from taxel.cli.main import main

MET = Row(name="shape, session held out", value=0.8, unit="accuracy", goal=">= 0.7", ok=True,
          note="majority 0.36", stamp="commit abc, taxel bench teng --full")  # fmt: skip
MISSED = Row(name="lead | median", value=-0.25, unit="s", goal=">= 0.15", ok=False)
PLAIN = Row(name="messages", value=181141.0, unit="messages", goal="", ok=None)


def test_a_missed_goal_stands_first_and_again_in_its_place():
    page = figure_page({"teng": [MET], "transitions": [MISSED]})
    line = "| lead \\| median | -0.25 | s | ≥ 0.15 | **missed** |  |"

    assert page.count(line) == 2
    assert page.index("## Missed goals (1)") < page.index(line) < page.index("## The TENG hand")
    assert "2 stored figures, 2 of them with a goal: 1 met, 1 missed" in page


def test_a_row_keeps_its_note_and_its_command():
    page = figure_page({"teng": [MET, PLAIN]})

    assert "| shape, session held out | 0.8 | accuracy | ≥ 0.7 | met | majority 0.36 |" in page
    assert "- commit abc, taxel bench teng --full" in page
    assert "| messages | 181,141 | messages |  |  |  |" in page


def test_no_goal_missed_is_said():
    assert "## Missed goals (0)\n\nNone.\n" in figure_page({"soak": [PLAIN]})


def test_every_store_of_a_bench_has_a_heading():
    """The papers' own tables have a page of their own, claims.md."""
    named = {path.stem for path in bench_rows.STORE.glob("*.json")} - {"claims"}

    assert named <= set(TITLES)


def test_the_command_writes_every_stored_row_and_measures_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(bench_rows, "measure", lambda *_: pytest.fail("measured"))
    main(["bench", "--page", str(tmp_path / "figures.md")])
    page = (tmp_path / "figures.md").read_text("utf-8")

    for bench in TITLES:
        path = bench_rows.STORE / f"{bench}.json"
        for row in json.loads(path.read_text("utf-8")) if path.exists() else []:
            assert f"| {row['name'].replace('|', chr(92) + '|').replace('<', '&lt;')} |" in page


def test_nothing_to_do_is_refused(capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["bench"])
    assert "--page" in capsys.readouterr().err


def test_the_page_in_the_repository_is_the_stored_rows(tmp_path):
    """A figure that was measured again must be written again: taxel bench --page …"""
    write_figure_page(tmp_path / "figures.md")
    kept = Path(__file__).parents[2] / "docs/reference/figures.md"

    assert (tmp_path / "figures.md").read_text("utf-8") == kept.read_text("utf-8")
