"""The plan to many cores and cards: Amdahl's law on stored rows, never a figure without a row."""

from dataclasses import replace

import pytest

from taxel.bench.figure_page import figure_page
from taxel.bench.rows import Row
from taxel.bench.scale.plan import WORKS, plan_lines, serial_share, speedup


def row(work: str, value: float | None) -> Row:
    return Row(name=WORKS[work][0], value=value, unit="ratio", goal=">= 1.8", ok=None)


def line(lines: list[str], start: str) -> list[str]:
    (found,) = [line for line in lines if line.startswith(f"| {start}")]
    return [cell.strip() for cell in found.strip("|").split("|")]


@pytest.mark.parametrize("share", [0.0, 0.03, 0.5, 1.0])
@pytest.mark.parametrize("workers", [2, 8])
def test_the_share_comes_back_from_the_speed_that_it_gives(share, workers):
    assert serial_share(speedup(share, workers), workers) == pytest.approx(share)


@pytest.mark.parametrize(("ratio", "share"), [(2.1, 0.0), (0.7, 1.0)])
def test_more_than_twice_or_less_than_once_as_fast_is_no_share_beyond_its_bounds(ratio, share):
    assert serial_share(ratio) == share


def test_a_stored_ratio_is_planned_to_32_cores():
    """1.8: a ninth is not divided, so 8 cores give 4.5, 32 give 7.2, and no number more than 9."""
    found = line(plan_lines([row("simulation", 1.8)]), "simulation, cores")
    assert found[1:] == ["1.80", "11.1 %", "4.5", "7.2", "9.0"]


def test_cards_are_planned_to_eight_only():
    found = line(plan_lines([row("training", 1.6)]), "training, cards")
    assert found[1:] == ["1.60", "25.0 %", "2.9", "–", "4.0"]


@pytest.mark.parametrize("rows", [[], [row("folds", None)]])
def test_what_was_not_measured_has_no_figures(rows):
    lines = plan_lines(rows)
    for work in WORKS:
        assert line(lines, f"{work}, ")[1:] == ["not measured", "–", "–", "–", "–"]
    assert line(lines, "what the goal")[1] == "1.80"


def test_twice_as_fast_shows_no_limit():
    assert line(plan_lines([row("folds", 2.0)]), "folds")[2:] == ["0.0 %", "8.0", "32.0",
                                                                   "no limit seen"]  # fmt: skip


def test_the_plan_stands_on_the_page_below_its_rows():
    page = figure_page({"scale": [replace(row("extraction", 1.9), stamp="commit abc")]})
    assert page.index("commit abc") < page.index("### Planned to 32 cores and 8 cards")
    assert "| extraction, cores | 1.90 | 5.3 % |" in page
    assert "Planned" not in figure_page({"teng": [row("folds", 1.9)]})
