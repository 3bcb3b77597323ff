"""Warnings on unseen cups in the terminal."""

from taxel.evaluation.early_warning.events import RunOutcome, summarise
from taxel.views.tables.grasps import _event_cells


def test_where_no_slip_was_warned_of_there_is_no_lead() -> None:
    """It read nan [nan, nan]."""
    missed = RunOutcome(
        event=True, warned_s=None, delay_s=None, lead_s=None, early=False, false_alarms=0,
        judged_s=3.0, unknown_share=0.0, groups={"cup": "1"},
    )  # fmt: skip
    cells = _event_cells(summarise([missed, missed]))
    assert cells[:3] == ["–", "–", "100"]
    assert "nan" not in " ".join(cells)
