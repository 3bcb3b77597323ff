"""Claims about the rows on starts of grasps and on warnings by kind."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.bench.transitions import moving_grasps
from taxel.bench.transitions.grasp_start import Detection, brushed, rows_of, start_runs
from taxel.gel.ring_slip import RING_FEATURES
from taxel.sim.pour.cups import MOVING_KINDS
from taxel.training.slip.cups import TEST_CUPS, GelRows, PourRows, moving_part
from taxel.training.slip.heads import features_of


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


def _slides(kind_number: int, by_mm: float) -> PourRows:
    """Return a grasp whose cup slides evenly from 1 s on."""
    run = moving_part(TEST_CUPS[0])[kind_number]
    taken_s, time_s = np.arange(125) / 25.0, np.arange(300) / 60.0
    moved = np.zeros((125, 3))
    moved[:, 1] = by_mm * np.clip(taken_s - 1.0, 0.0, 1.0)
    gel = GelRows(
        taken_s=taken_s, object=moved, gel=np.zeros((125, 3)), spread=np.zeros((125, 3)),
        seen=np.ones(125, np.bool_), shown=np.minimum(np.arange(300) * 25 // 60, 124),
        rim=np.zeros((125, 3)), rings=np.zeros((125, len(RING_FEATURES))),
    )  # fmt: skip
    slip_um = 1000.0 * by_mm * np.clip(time_s - 1.0, 0.0, 1.0)
    return PourRows(run, time_s, slip_um, np.zeros(300, np.bool_), (gel, gel))


def test_each_kind_has_its_rows_and_slips_are_told_apart_from_holds() -> None:
    pours = [_slides(number, 1.0 if number == 0 else 0.0) for number in range(6)]
    rows = moving_grasps.rows_of([features_of(pour) for pour in pours])
    named = {row.name.removeprefix("slip warning by kind, slip-rule, "): row for row in rows}
    assert all(row.ok is None for row in rows), "no goals"
    assert named["lift: missed"].value == 0.0
    assert (named["lift: median lead before 300 um"].value or 0.0) > 0.05
    for kind in (*MOVING_KINDS[1:], "pour"):
        assert named[f"{kind}: median lead before 300 um"].value is None
        assert named[f"{kind}: false alarms"].value == 0.0
