"""Claims about equal trials in which hardly anything changes, and about rows shared in part."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.evaluation.audit import copy_findings
from taxel.evaluation.audit.audit import audit, make_case
from taxel.evaluation.audit.constant_rows import constant_rows
from taxel.evaluation.audit.finding import Finding
from taxel.evaluation.audit.sides import named_sides
from taxel.evaluation.audit.touch_set import TouchSet, usual_steps

Make = dict[str, Callable[..., TouchSet]]
Rows = NDArray[np.float32]
STILL = np.full((40, 6), 0.5, np.float32)
TICKED = np.where(np.arange(40)[:, None] == 20, np.float32(0.501), STILL)
"""One count more in one row."""


def with_rows(touch: TouchSet, changed: Mapping[int, Rows]) -> TouchSet:
    """Return the set with other rows in some trials."""
    return replace(
        touch, rows=tuple(changed.get(trial, own) for trial, own in enumerate(touch.rows))
    )


def found_in(touch: TouchSet, split: str | None = None) -> dict[str, Finding]:
    """Return the findings by their kind."""
    sides = named_sides(touch, split, usual_steps(touch), 5, 0) if split else None
    return {finding.kind: finding for finding in audit(touch, "x", sides).findings}


def test_equal_trials_of_constant_rows_are_counted_and_not_denied(make_set: Make) -> None:
    """Three of two classes: no proof of a copy, but no "no two trials" either."""
    found = found_in(with_rows(make_set["array"](), {0: STILL, 1: STILL, 5: STILL}))

    assert found["duplicates"].verdict == "clear"
    assert found["duplicates"].message == (
        "No two trials share a fifth or more of the rows that change."
    )
    still = found["constant rows"]
    assert still.verdict == "note"
    assert still.message.startswith(
        "3 trials hold the same constant rows as another, which is no proof of a copy"
    )
    assert "They have several labels" in still.message
    assert still.examples == ("r00#0, r01#0 and 1 more",)


def test_under_a_split_it_is_stated_how_many_have_a_counterpart_in_training(make_set: Make) -> None:
    """Of a session two, in another one: all three are tested, each beside one at least."""
    touch = make_set["array"]()
    apart = found_in(with_rows(touch, {0: STILL, 5: STILL, 1: STILL}), "group:session")
    together = found_in(with_rows(touch, {0: STILL, 5: STILL}), "group:session")

    counterpart = "Tested trials with such a counterpart in training: "
    assert f"{counterpart}3." in apart["constant rows"].message
    assert f"{counterpart}0." in together["constant rows"].message


def test_equal_trials_that_seldom_change_are_counted_apart(make_set: Make) -> None:
    """Beside two constant ones; two labels in one of the two sets."""
    changed = {0: STILL, 1: STILL, 2: TICKED, 7: TICKED}
    message = found_in(with_rows(make_set["array"](), changed))["constant rows"].message

    assert message.startswith(
        "2 trials hold the same constant rows as another and 2 trials the same seldom changing rows"
    )
    assert "1 of 2 sets of them have several labels" in message


def test_what_is_reported_as_a_copy_is_not_counted_again(make_set: Make) -> None:
    """Equal trials that change, and a step that is found as a near copy."""
    touch = make_set["array"]()
    step = np.repeat(np.array([0, 1], np.float32), 20)[:, None] * np.ones(6, np.float32)
    found = found_in(with_rows(touch, {5: touch.rows[0], 3: step, 7: step}))

    assert found["duplicates"].verdict == "hazard"
    assert found["near-duplicates"].alarm
    assert found["constant rows"].verdict == "clear"


@pytest.mark.parametrize("rows", [12, 14])
def test_rows_shared_in_part_are_called_so_with_their_share(make_set: Make, rows: int) -> None:
    """As much a leak as before; the share is that of the shorter trial's rows."""
    touch = make_set["array"]()
    part = touch.rows[1].copy()
    part[10 : 10 + rows] = touch.rows[0][4 : 4 + rows]
    share = f"{100 * rows / 40:.0f} % of the shorter one's"

    alone = found_in(with_rows(touch, {1: part}))["duplicates"]
    assert alone.verdict == "leak"
    assert alone.message.startswith(
        f"1 pair of trials (2 of 60 trials) hold in part the same rows, {share}"
    )
    assert f"({100 * rows / 40:.1f} % of the rows in common)" in alone.examples[0]
    assert alone.mend.startswith("find out how rows of one trial came into another; ")

    beside = found_in(with_rows(touch, {1: part, 7: touch.rows[2]}))["duplicates"]
    assert f"hold the same rows, 1 of 2 pairs only in part, {share}" in beside.message


@pytest.mark.parametrize(
    ("share", "words", "example"),
    [
        (0.996, "99.6 %", "99.6 %"),
        (0.99996, "99.9 %", "99.9 %"),
        (0.9944, "99 %", "99.4 %"),
        (0.004, "0.4 %", "0.4 %"),
        (0.0004, "0.1 %", "0.1 %"),
    ],
)
def test_no_part_is_rounded_to_all_or_to_nothing(
    make_set: Make, monkeypatch: pytest.MonkeyPatch, share: float, words: str, example: str
) -> None:
    monkeypatch.setattr(copy_findings, "rows_in_common", lambda *_: {(0, 1): share})
    case = make_case(make_set["array"](), None, 10, 0)
    found = copy_findings.shared_rows(case, {(0, 1): 1.0})

    assert f"hold in part the same rows, {words} of the shorter one's" in found.message
    assert f"({example} of the rows in common" in found.examples[0]


def test_what_each_side_holds_is_looked_up_once_a_fold(make_set: Make) -> None:
    """Not once for each set of equal trials, of which there may be thousands."""
    touch = make_set["array"]()
    changed = {trial: np.full((40, 6), trial // 2, np.float32) for trial in range(20)}
    pieces, sides = named_sides(touch, "group:session", 10, 5, 0)
    read = []

    class Counted(np.ndarray):  # type: ignore[type-arg]
        def __getitem__(self, index):  # type: ignore[no-untyped-def]
            read.append(index)
            return super().__getitem__(index)

    case = make_case(with_rows(touch, changed), (pieces, sides), 10, 0)
    counted = replace(pieces, trial=pieces.trial.view(Counted))
    found = constant_rows(replace(case, pieces=counted), [])

    assert "20 trials hold the same constant rows" in found.message
    assert len(read) == 2 * len(sides.folds)


def test_all_rows_of_the_shorter_trial_are_the_same_rows(make_set: Make) -> None:
    """A copy of the second half of a trial."""
    touch = make_set["array"]()
    alone = found_in(with_rows(touch, {1: touch.rows[0][20:]}))["duplicates"]

    assert "hold the same rows" in alone.message
    assert "part" not in alone.message
