"""Claims about the rows on starts of grasps."""

from dataclasses import replace

import pytest

from taxel.bench.transitions.grasp_start import Detection, brushed, rows_of, start_runs
from taxel.training.slip.cups import TEST_CUPS


def detection(settled_s: float | None, *starts_s: float) -> Detection:
    return Detection(kind="lift", settled_s=settled_s, starts_s=starts_s, seconds=60.0)


def test_a_start_that_is_late_or_found_again_is_false_and_one_in_time_is_found() -> None:
    found, delay, false = rows_of(
        [
            detection(1.0, 1.2),
            detection(1.0, 1.4, 5.0),
            detection(2.0, 3.5),
            detection(None, 1.0),
            detection(2.0),
        ]
    )
    assert found.value == 2 / 4
    assert delay.value == pytest.approx(0.3)
    assert false.value == 3 / 5
    assert (found.ok, delay.ok, false.ok) == (False, True, False)


def test_nothing_simulated_is_no_row_with_a_value() -> None:
    (row,) = rows_of([])
    assert row.value is None


def test_every_cup_is_grasped_and_every_third_is_brushed() -> None:
    runs = list(start_runs())
    brushes = [name for name, _ in runs if "brush" in name]
    assert len(runs) - len(brushes) == len(TEST_CUPS)
    assert len(brushes) == len(TEST_CUPS) // 3
    first = runs[0][1]
    assert first.approach is not None
    never = brushed(first).approach
    assert never == replace(first.approach, lag_s=1e6, settled_s=1e6)
