"""What the terminal says of camera trials that few groups part."""

import io

import numpy as np
import pytest
from rich.console import Console

from taxel.decisions.recognition import UNKNOWN
from taxel.decisions.trial_verdict import Verdict
from taxel.evaluation.camera_trials.crossval import OURS, judge_trials
from taxel.evaluation.camera_trials.sides import split_trials
from taxel.views.trial_results import trial_tables, unknown_line

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


def test_reasons_of_unknown_are_counted_and_unlike_images_are_said() -> None:
    """One reason is one reason, whatever its score; most of all trials is told as such."""

    def verdict(reason: str) -> Verdict:
        return Verdict(UNKNOWN if reason else "a", 0.9, np.array([0.9, 0.1]), 1.0, reason, 3)

    novel = [verdict(f"novel touch (novelty score {score}, limit 3.5)") for score in (3.7, 4.2)]
    unsure, sure = verdict("confidence 0.40 is below 0.50"), verdict("")
    assert unknown_line([sure]) == ""
    few = unknown_line([*novel, unsure, sure, sure, sure])
    assert few == "UNKNOWN because of: novel touch (2), confidence 0.40 is below 0.50 (1)"
    most = unknown_line([*novel, unsure, sure])
    assert "the first: novelty score 3.7, limit 3.5" in most
    assert "how videos are compressed" in most
