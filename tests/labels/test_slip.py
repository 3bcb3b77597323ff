"""Physics labels follow the truth's thresholds exactly."""

import numpy as np
import pytest

from taxel.errors import BadInput
from taxel.labels.rules import RULES, rule_named
from taxel.labels.slip import label_truth
from taxel.sim.pour.state import TRUTH_CHANNELS


def truth(slip_um: list[float], dropped: list[float] | None = None) -> np.ndarray:
    table = np.zeros((len(slip_um), len(TRUTH_CHANNELS)), np.float32)
    table[:, TRUTH_CHANNELS.index("slip")] = slip_um
    if dropped is not None:
        table[:, TRUTH_CHANNELS.index("dropped")] = dropped
    return table


@pytest.mark.parametrize(
    ("rule", "labels"),
    [
        ("micro-slip", [0, 0, 1, 1, 1, 1]),
        ("slip", [0, 0, 0, 1, 1, 1]),
        ("gross-slip", [0, 0, 0, 0, 0, 1]),
        ("drop", [0, 0, 0, 0, 0, 1]),
    ],
)
def test_each_rule_has_its_threshold(rule: str, labels: list[int]) -> None:
    found = label_truth(truth([0, 20, 20.1, 101, 300, 301], [0, 0, 0, 0, 0, 1]), rule)

    assert found.tolist() == labels


def test_every_truth_rule_names_a_channel_that_exists() -> None:
    for rule in RULES.values():
        assert (rule.channel in TRUTH_CHANNELS) == (rule.needs == "truth")


def test_what_cannot_be_labelled_is_refused() -> None:
    with pytest.raises(BadInput, match="physics truth"):
        label_truth(truth([0.0]), "change")
    with pytest.raises(BadInput, match="among change"):
        rule_named("wobble")
    with pytest.raises(BadInput, match="shape"):
        label_truth(np.zeros((3, 2)), "slip")
    with pytest.raises(BadInput, match="NaN at row 1"):
        label_truth(truth([0.0, np.nan]), "slip")
