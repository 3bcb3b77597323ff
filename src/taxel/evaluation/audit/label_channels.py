"""Channels that hold a label: one value in each trial, which follows the class or names it.

Columns of labels beside those of sensors are imported as channels where all columns are. Knows
nothing about splits.

Background of our choices: docs/decisions/0023.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.audit.case import Case, Reading
from taxel.evaluation.audit.evidence import evidence_of, look_up
from taxel.evaluation.audit.finding import Finding, Verdict
from taxel.evaluation.audit.touch_set import LEAST_ROWS, TouchSet
from taxel.plain_text import visible_names

KIND = "label channels"
CLEAR = Finding(kind=KIND, verdict="clear", message="No channel holds the label.")


def label_channels(touch: TouchSet) -> NDArray[np.intp]:
    """Return the channels that hold a label, shape (n,); none of cameras or single readings.

    Such a channel has one value in each trial, and either one in all trials of a class, though not
    the same for all classes, or values of which each stands in one class only, half as many as
    trials at most: each trial's own offset would name its class, too.
    """
    none = np.zeros(0, np.intp)
    if touch.kind == "camera" or min(map(len, touch.rows)) < LEAST_ROWS:
        return none
    first = np.stack([rows[0] for rows in touch.rows])
    still = np.all([(rows == rows[0]).all(axis=0) for rows in touch.rows], axis=0)
    found = [channel for channel in np.flatnonzero(still) if _follows(first[:, channel], touch.y)]
    return np.array(found, np.intp) if len(found) < first.shape[1] else none


def _follows(values: NDArray[np.float32], y: NDArray[np.intp]) -> bool:
    """Return whether trials' values follow their class, or name it."""
    pairs = len(set(zip(values.tolist(), y.tolist(), strict=True)))
    distinct = len(set(values.tolist()))
    one_a_class = pairs == len(set(y.tolist()))
    return distinct > 1 and (one_a_class or (pairs == distinct and 2 * distinct <= len(y)))


def read_label_channels(case: Case, found: NDArray[np.intp]) -> Reading:
    """Return how well channels that hold a label predict the one that is audited.

    Args:
        case: What is audited.
        found: Indices of those channels, shape (m,).
    """
    touch = case.touch
    names = touch.channels or tuple(f"channel {i + 1}" for i in range(touch.rows[0].shape[1]))
    own = visible_names([names[channel] for channel in found])
    several = len(found) > 1
    values = np.array([" ".join(map(str, rows[0, found])) for rows in touch.rows])
    y = touch.y
    evidence = evidence_of(look_up(values, y, case.plain), y, np.arange(len(y)), None, case.plain)

    def decide(counts: bool) -> tuple[Verdict, str, str]:
        return (
            "leak" if counts else "note",
            f"The channel{'s' * several} {own} {'have' if several else 'has'} one value in each "
            "trial, and the values follow the label: they are labels, not touch. All other checks "
            f"leave {'them' if several else 'it'} out.",
            f"leave {own} out of the import: name the others in the table's column 'channels', and "
            "import again",
        )

    examples = [f"{' '.join(map(str, own))}: {touch.classes[c]}" for c in range(len(touch.classes))
                for own in sorted({tuple(rows[0, found].tolist()) for rows, label in
                                   zip(touch.rows, y, strict=True) if label == c})]  # fmt: skip
    return Reading(kind=KIND, evidence=evidence, decide=decide, examples=tuple(examples))


def without_channels(touch: TouchSet, left_out: NDArray[np.intp]) -> TouchSet:
    """Return the trials without some of their channels.

    Args:
        touch: The trials.
        left_out: Indices of those channels, shape (m,).
    """
    kept = np.setdiff1d(np.arange(touch.rows[0].shape[1]), left_out)
    return replace(
        touch,
        rows=tuple(rows[:, kept] for rows in touch.rows),
        views=tuple(touch.views[channel] for channel in kept),
        channels=tuple(touch.channels[channel] for channel in kept) if touch.channels else (),
        scans={name: own[:, kept] for name, own in touch.scans.items()},
    )
