"""What a trial is called: session, order of recording, and whatever its file says beside.

A class that was recorded in sessions of its own is predicted by the session; whether by touch as
well, nobody can know. Knows nothing about values.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.audit.case import Case, Reading
from taxel.evaluation.audit.evidence import LabelEvidence, evidence_of, look_up, predict
from taxel.evaluation.audit.finding import Verdict
from taxel.evaluation.audit.touch_set import SESSIONS, TouchSet
from taxel.labels.class_order import in_order
from taxel.labels.trials import OBJECTS

FINGERPRINT = 0.9
"""Accuracy from which a name counts as the label's fingerprint. Our choice, decision 23."""
NUMBERS = ("trial_number", "number", "index", "order", "attempt", "repetition", "rep", "repeat",
           "take")  # fmt: skip
"""Groups that count trials in the order in which they were recorded."""
_UNITS = ("_n", "_mm", "_s", "_c", "_pct", "_hz", "_v", "_g", "_kg", "_deg", "_ppm", "_pf", "_um")


def read_origins(case: Case) -> list[Reading]:
    """Return how well sessions, order and other names predict the label, one reading each."""
    touch = case.touch
    readings = [_read_key(case, key, values) for key, values in _named(case)]
    order = recorded_order(touch)
    if order is not None:
        readings.append(_read_order(case, order))
    return readings


def _named(case: Case) -> list[tuple[str, NDArray[np.str_]]]:
    """Return names shared by trials: groups, other labels, and what the files say.

    A file that holds trials of several sessions says how they are stored, not how recorded.
    """
    touch, found = case.touch, dict[str, NDArray[np.str_]]()
    sessions = case.groups if case.key in SESSIONS else None
    for key in sorted({key for trial in touch.trials for key in trial.groups}):
        values = touch.group(key)
        if values is None or key in NUMBERS or key.endswith(_UNITS):
            continue
        if key not in ("recording", "file") or sessions is None or _nested(sessions, values):
            found[key] = values
    for key in sorted({key for of in touch.files for key in of}):
        found[key] = np.array([of.get(key, "") for of in touch.files])
    limit = len(touch) / 2
    return [(k, v) for k, v in found.items() if 1 < len(set(v)) <= limit and k not in OBJECTS]


def _read_key(case: Case, key: str, values: NDArray[np.str_]) -> Reading:
    touch = case.touch
    y = touch.y
    found = evidence_of(look_up(values, y, case.plain), y, np.arange(len(y)), None, case.plain)
    nested = _nested(y, values)
    session = key in SESSIONS

    def decide(counts: bool) -> tuple[Verdict, str, str]:
        if not counts:
            return "clear", f"{key!r} alone does not predict the label.", ""
        several = f"several {key}s each" if session else "every setting"
        if case.sides is not None:
            verdict: Verdict = "leak" if session or found.accuracy >= FINGERPRINT else "note"
        elif nested and found.accuracy >= FINGERPRINT and _few(y, values):
            verdict = "leak"
        elif session or found.accuracy >= FINGERPRINT:
            verdict = "hazard"
        else:
            verdict = "note"
        if nested:
            said = f"Each {key!r} holds one class only: its name predicts the label, and so may " \
                   "anything that differs between them."  # fmt: skip
        else:
            said = (
                f"Classes are shared out unevenly over {key!r}: its name alone predicts the label."
            )
        return verdict, said, f"record every class in {several}, and hold out whole {key}s"

    examples = [f"{name}: {', '.join(touch.classes[c] for c in sorted(set(y[values == name])))}"
                for name in in_order(values)]  # fmt: skip
    return Reading(kind=f"name: {key}", evidence=found, decide=decide, examples=tuple(examples))


def _nested(inner: NDArray[np.generic], outer: NDArray[np.str_]) -> bool:
    """Return whether each outer name holds one inner value only."""
    return all(len(set(inner[outer == name])) == 1 for name in set(outer))


def _few(y: NDArray[np.intp], values: NDArray[np.str_]) -> bool:
    """Return whether a class has one value only, so that no split can hold it out."""
    return any(len(set(values[y == c])) < 2 for c in set(y))


def recorded_order(touch: TouchSet) -> NDArray[np.float64] | None:
    """Return each trial's place in the order of recording, shape (trials,); None if unknown."""
    several = len({trial.recording for trial in touch.trials}) < len(touch)
    known = all(touch.created) and len(set(touch.created)) > 1
    if known or (several and len({t.recording for t in touch.trials}) == 1):
        pairs = [(made, trial.start_s) for made, trial in zip(touch.created, touch.trials,
                                                              strict=True)]  # fmt: skip
        ranks = {pair: float(i) for i, pair in enumerate(sorted(set(pairs)))}
        return np.array([ranks[pair] for pair in pairs])
    for key in touch.keys(NUMBERS):
        values = touch.group(key)
        try:
            return None if values is None else values.astype(float)
        except ValueError:
            continue
    if several:
        return np.array([trial.start_s for trial in touch.trials])
    return None


def _read_order(case: Case, order: NDArray[np.float64]) -> Reading:
    y = case.touch.y
    predicted = predict(order[:, None], y, case.plain, case.seed)
    found: LabelEvidence = evidence_of(predicted, y, np.arange(len(y)), None, case.plain)

    def decide(counts: bool) -> tuple[Verdict, str, str]:
        if not counts:
            return "clear", "The order of recording does not predict the label.", ""
        return (
            "leak" if case.sides is not None else "hazard",
            "Classes were recorded in blocks or in one order: when a trial was recorded predicts "
            "its label, and so does anything that drifts.",
            "record classes in mixed order, and test on what was recorded later",
        )

    return Reading(kind="order", evidence=found, decide=decide)
