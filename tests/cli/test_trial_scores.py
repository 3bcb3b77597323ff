"""What is said of a bundle's accuracy on camera trials of which some show no crop."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from taxel.cli.evaluation.evaluate_trials import _scores
from taxel.decisions.trial_verdict import Verdict, no_verdict

CLASSES = ("hold", "slip")
CONTRACT: Any = SimpleNamespace(target="end", classes=CLASSES)
SHORT = no_verdict(CLASSES, "3 frames, fewer than a crop")


def trials(*labels: str) -> Any:
    return [SimpleNamespace(name=f"t{i}", labels={"end": own}, groups={"session": f"s{i % 2}"})
            for i, own in enumerate(labels)]  # fmt: skip


def sure_of(label: str) -> Verdict:
    probabilities = np.where(np.array(CLASSES) == label, 0.9, 0.1)
    return Verdict(label, 0.9, probabilities, 0.0, "", 3)


def test_a_trial_without_a_crop_is_an_unknown_that_counts_as_wrong() -> None:
    verdicts = [sure_of("hold"), sure_of("slip"), SHORT, SHORT]
    line, found = _scores(CONTRACT, trials("hold", "slip", "hold", "slip"), verdicts, None)

    assert found["unknown"] == 2
    assert found["scores"]["trials"] == 2
    assert found["scores"]["accuracy"] == 1.0
    assert found["answered_accuracy"] == 0.5
    assert line.endswith("UNKNOWN 2 of 4; accuracy with UNKNOWN counted as wrong 0.500")


def test_a_trial_of_a_class_that_was_never_learned_is_in_no_accuracy() -> None:
    _, found = _scores(CONTRACT, trials("hold", "drop"), [sure_of("hold"), sure_of("slip")], None)
    assert found["answered_accuracy"] == 1.0


@pytest.mark.parametrize(
    ("label", "why"),
    [
        ("hold", "none of those whose end the bundle knows has a probability"),
        ("drop", "none has a end that the bundle knows"),
    ],
)
def test_where_nothing_is_scored_it_is_said_why(label: str, why: str) -> None:
    line, found = _scores(CONTRACT, trials(label, label), [SHORT, SHORT], None)
    assert line == f"2 trials; {why}"
    _, scored = _scores(CONTRACT, trials("hold"), [sure_of("hold")], None)
    assert list(found) == list(scored)
    assert [found[name] for name in ("majority", "scores", "answered_accuracy")] == [None] * 3


def test_an_interval_of_few_groups_is_called_too_narrow() -> None:
    """As `train-trials` does; the interval of a bundle's score stood there without a word."""
    verdicts = [sure_of("hold"), sure_of("slip"), sure_of("hold"), sure_of("hold")]
    line, found = _scores(CONTRACT, trials("hold", "slip", "hold", "slip"), verdicts, None)
    assert "accuracy 0.750 [0.500, 1.000]" in line
    assert found["few_groups"] == (
        "2 sessions: the interval is about their lowest and highest; record more"
    )
    _, alike = _scores(CONTRACT, trials("hold", "slip"), verdicts[:2], None)
    assert alike["few_groups"] is None
