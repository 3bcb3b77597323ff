"""The page of faults shows every row, and says where a fault was not measured or a goal missed."""

from pathlib import Path

import pytest

from taxel.bench.faults.catalogue import FAULTS
from taxel.bench.faults.page import fault_page, write_fault_page
from taxel.bench.rows import Row, row
from taxel.cli.bench import Bench
from taxel.errors import BadInput

KILLED = row("monitor killed while armed: STOP", 20, "of 20", ">=", 20, "longest 18 ms")
FROZEN = row("camera frozen: frames until the watcher doubts it (UNKNOWN)", 4, "frames", "<=", 3)
OTHER = Row(name="a | b", value=None, unit="ms", goal="", ok=None)


def line_of(page: str, start: str) -> str:
    """Return the one line of a page that begins so."""
    (found,) = [line for line in page.splitlines() if line.startswith(start)]
    return found


def test_a_fault_stands_beside_the_rows_that_measure_it() -> None:
    page = fault_page([KILLED, FROZEN])

    assert "| 20 of 20 | – | STOP" in line_of(page, "| monitor killed while armed | ")


def test_a_missed_goal_says_so() -> None:
    assert "4 frames (**missed**)" in line_of(fault_page([FROZEN]), "| a camera repeats one image")


def test_a_fault_without_a_row_is_not_measured() -> None:
    assert "not measured" in line_of(fault_page([FROZEN]), "| monitor killed while armed | ")


def test_every_row_stands_on_the_page_once_also_one_of_no_fault() -> None:
    page = fault_page([KILLED, OTHER])
    figures = page.split("## The figures")[1]

    assert figures.count("longest 18 ms") == 1
    assert "| a \\| b | – |" in figures


def test_each_fault_names_a_row_and_what_is_shown() -> None:
    assert len({fault.what for fault in FAULTS}) == len(FAULTS)
    assert all(fault.shown and (fault.found or fault.lost) for fault in FAULTS)


def test_the_page_is_written_whole(tmp_path: Path) -> None:
    write_fault_page(tmp_path / "faults.md", [KILLED])

    assert [path.name for path in tmp_path.iterdir()] == ["faults.md"]


@pytest.mark.parametrize(
    "bench",
    [Bench(name="teng", page=Path("x")), Bench(name="faults", only="boards", page=Path("x"))],
)
def test_a_page_of_a_part_is_refused_before_anything_is_measured(bench: Bench) -> None:
    with pytest.raises(BadInput, match="--page"):
        bench.run()
