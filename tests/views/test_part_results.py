"""Accuracy by part: each way of parting the trials is printed once."""

from __future__ import annotations

import io
import math
from dataclasses import replace
from typing import Any

from rich.console import Console, Group

from taxel.evaluation.bundle_scores import BundleScores
from taxel.evaluation.part_scores import Parts, PartScore
from taxel.views.tables.parts import bundle_score_table, parts_tables


def text_of(parts: Parts) -> str:
    console = Console(file=io.StringIO(), width=100, record=True)
    console.print(Group(*parts_tables(parts)))
    return console.export_text()


def part(name: str, windows: int, accuracy: float) -> PartScore:
    return PartScore(
        name=name, windows=windows, accuracy=accuracy, trials=windows // 10, trial_accuracy=accuracy
    )


def test_groups_that_part_the_trials_alike_share_the_sessions_table():
    two = (part("mon", 100, 0.9), part("tue", 60, 0.7))
    weather = (part("21.5", 60, 0.7), part("18.0", 100, 0.9))
    hands = (part("left", 80, 0.8), part("right", 80, 0.825))
    parts = Parts(
        classes=(part("ball", 160, 0.8),),
        groups={"celsius": weather, "hand": hands, "session": two},
    )

    text = text_of(parts)

    assert "mon" in text
    assert "left" in text
    assert "21.5" not in text
    assert "groups that divide the trials in the same way as session: celsius" in text
    assert "hand" in text


def test_one_value_apart_is_another_parting():
    parts = Parts(
        classes=(),
        groups={"a": (part("x", 100, 0.9), part("y", 60, 0.7)),
                "b": (part("p", 100, 0.9), part("q", 60, 0.6))},
    )  # fmt: skip

    assert "the same trials" not in text_of(parts)


def text_of_score(**changes: Any) -> str:
    """Return what is printed about a bundle that knows a and b, with changes to its score."""
    found = BundleScores(
        target="grit", classes=("a", "b"), split=None, windows=510, trials=510, accuracy=0.0,
        interval=(0.0, 0.0), interval_group="session", interval_groups=5, lone=None, majority=0.5,
        unknown=1.0, unknown_because={"low confidence": 510}, answered_accuracy=math.nan,
        filled=0.0, trial_accuracy=0.0, trial_majority=0.5, trial_unknown=1.0, loss=1.4,
        calibration_error=0.1, parts=Parts(classes=(), groups={}),
        confusion={"a": {"UNKNOWN": 510}}, learned_from=(), learned_is_known=True, notes=(),
    )  # fmt: skip
    console = Console(file=io.StringIO(), width=200, record=True)
    console.print(bundle_score_table(replace(found, **changes), "s4.taxel", "rec"))
    return console.export_text()


def test_a_bundle_that_names_nothing_says_why():
    text = text_of_score()

    assert "no window was answered; UNKNOWN because of: low confidence 510" in text
    assert "accuracy: UNKNOWN counts as wrong; majority" in text
    assert "not known to the bundle" not in text


def test_a_class_that_a_bundle_does_not_know_is_named_with_what_counts_there():
    text = text_of_score(confusion={"a": {"a": 500}, "c": {"UNKNOWN": 8, "b": 2}})

    assert "UNKNOWN counts as wrong but for classes that the bundle does not know; maj" in text
    assert "which knows a, b: c (10 windows); there only UNKNOWN counts as correct" in text
    assert "calibration error 0.1000, of the windows of known classes" in text
