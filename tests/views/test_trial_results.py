"""What the terminal says of camera trials that few groups part."""

import io

import pytest
from rich.console import Console

from taxel.evaluation.camera_trials.crossval import OURS, judge_trials
from taxel.evaluation.camera_trials.sides import split_trials
from taxel.views.trial_results import trial_tables

from trial_makers import few_small_members, some_trials  # isort: skip


@pytest.mark.parametrize(("group", "said"), [("object", False), ("turn", True)])
def test_with_few_groups_no_difference_is_claimed(
    monkeypatch: pytest.MonkeyPatch, group: str, said: bool
) -> None:
    """Six objects may show a difference, four turns may not."""
    few_small_members(monkeypatch)
    trials = some_trials()
    split = split_trials(trials.groups, trials.y, f"group:{group}", 6, 0)
    results = judge_trials(trials, split, 0, (OURS,))
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(trial_tables(trials, split, results, []))
    warned = "4 turns no difference can be claimed (smallest possible p 0.12)"
    assert (warned in console.export_text()) == said
