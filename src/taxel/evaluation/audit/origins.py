"""What a trial is called: session, order of recording, and whatever its file says beside.

A class that was recorded in sessions of its own is predicted by the session; whether by touch as
well, nobody can know. Knows nothing about values.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import PurePosixPath

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.audit.case import Case, Reading
from taxel.evaluation.audit.evidence import LabelEvidence, evidence_of, look_up, predict
from taxel.evaluation.audit.finding import Verdict
from taxel.evaluation.audit.trial_order import NUMBERS, recorded_order, tests_later
from taxel.labels.class_order import in_order
from taxel.labels.trials import OBJECTS, SESSIONS, Trial
from taxel.plain_text import several

FINGERPRINT = 0.9
"""Accuracy from which a name counts as the label's fingerprint. Our choice, decision 23."""
_IMPORTED = "detail imported_from"
_FILES = ("recording", "file", _IMPORTED)
"""Names of files: what belongs in them is no setting."""
_NAMED = "Each imported file holds one class only, and has the label in its name. That name is " \
         "nothing that a model sees; but if files were recorded at different times, so may " \
         "anything that differed between them give the label away."  # fmt: skip
_NAME_SESSIONS = "name what was recorded at one time as a group of the import (such as " \
                 "group:session), and hold it out; else say so"  # fmt: skip
_UNITS = ("_n", "_mm", "_s", "_c", "_pct", "_hz", "_v", "_g", "_kg", "_deg", "_ppm", "_pf", "_um")


def read_origins(case: Case) -> list[Reading]:
    """Return how well sessions, order and other names predict the label, one reading each."""
    touch = case.touch
    readings = [_read_key(case, *names) for names in _once(_named(case))]
    order = recorded_order(touch)
    if order is not None:
        readings.append(_read_order(case, order.places))
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
    if _IMPORTED in found:
        found[_IMPORTED] = np.array(list(map(_imported_file, touch.trials, touch.files)))
    limit = len(touch) / 2
    return [(k, v) for k, v in found.items() if 1 < len(set(v)) <= limit and k not in OBJECTS]


def _imported_file(trial: Trial, of: Mapping[str, str]) -> str:
    """Return the file that a trial was imported from, with its folder.

    What the recording says of it has no folder: files of several folders may share that name. The
    group `file` has one, and the trial's key where a file holds many trials.
    """
    name = of.get(_IMPORTED, "")
    key, array = of.get("detail trial", ""), of.get("detail trials", "")
    path = trial.groups.get("file", "")
    path = path.removesuffix(f"[{key}]").removesuffix(f":{array}" if array else "")
    return path if PurePosixPath(path).name == name else name


def _once(
    named: list[tuple[str, NDArray[np.str_]]],
) -> list[tuple[str, NDArray[np.str_], tuple[str, ...]]]:
    """Return each way to share trials out once: its name, values, and other names for the same.

    A session's name stands for a file's and a stream's that are one to one with it; a group, which
    can be held out, for what a file says beside.
    """
    rank = {key: number for number, key in enumerate(SESSIONS)}
    order = sorted(named, key=lambda own: (rank.get(own[0], len(rank)), _is_detail(own[0])))
    found: dict[bytes, tuple[str, NDArray[np.str_], tuple[str, ...]]] = {}
    for key, values in order:
        first = {name: number for number, name in reversed(list(enumerate(values.tolist())))}
        same = np.array([first[name] for name in values.tolist()]).tobytes()
        kept, own, others = found.get(same, (key, values, ()))
        found[same] = (kept, own, others if kept == key else (*others, key))
    return list(found.values())


def _is_detail(key: str) -> bool:
    """Return whether a name is what a file says beside, which no split can hold out."""
    return " " in key or ":" in key


def _words(key: str) -> tuple[str, str]:
    """Return a name in plain words, one and several: what a file says beside is no group."""
    if key == _IMPORTED:
        return "imported file", "files"
    plain = key.removeprefix("detail ").replace("_", " ") if _is_detail(key) else key
    return plain, f"sets of equal {plain}" if _is_detail(key) else several(key)


def _read_key(
    case: Case, key: str, values: NDArray[np.str_], others: tuple[str, ...] = ()
) -> Reading:
    """Return how well a name predicts the label.

    Args:
        case: What is audited.
        key: The name.
        values: Of each trial, shape (trials,).
        others: Names that share the trials out alike.
    """
    touch = case.touch
    single, many = _words(key)
    like = " and ".join(repr(_words(other)[0]) for other in others)
    too = f" (and so does {like}, one to one with it)" if others else ""
    y = touch.y
    evidence = evidence_of(look_up(values, y, case.plain), y, np.arange(len(y)), None, case.plain)
    nested = _nested(y, values)
    session = key in SESSIONS
    labels = [trial.labels[touch.target] for trial in touch.trials]
    named = key == _IMPORTED and all(map(_holds_word, values, labels))

    def decide(counts: bool) -> tuple[Verdict, str, str]:
        if not counts:
            return "clear", f"{single!r} alone does not predict the label.", ""
        each = f"several {many} each" if session or key in _FILES else "every setting"
        if case.sides is not None:
            verdict: Verdict = "leak" if session or evidence.accuracy >= FINGERPRINT else "note"
        elif nested and evidence.accuracy >= FINGERPRINT and _few(y, values):
            verdict = "leak"
        elif session or evidence.accuracy >= FINGERPRINT:
            verdict = "hazard"
        else:
            verdict = "note"
        if verdict == "leak" and named:
            return "hazard", _NAMED, _NAME_SESSIONS
        if nested:
            message = f"Each {single!r} holds one class only: its name predicts the label{too}, " \
                      "and so may anything that differs between them."  # fmt: skip
        else:
            message = f"Classes are shared out unevenly over {single!r}: its name alone predicts " \
                      f"the label{too}."  # fmt: skip
        return verdict, message, f"record every class in {each}, and hold out whole {many}"

    examples = [f"{name}: {', '.join(touch.classes[c] for c in sorted(set(y[values == name])))}"
                for name in in_order(values)]  # fmt: skip
    return Reading(
        kind=f"name: {single}", evidence=evidence, decide=decide, examples=tuple(examples)
    )


def _holds_word(name: str, word: str) -> bool:
    """Return whether a word or number stands in a name by itself: `cup` or `3` in cup3.csv."""
    before, behind = (r"\d" if end.isdigit() else r"[^\W\d_]" for end in (word[:1], word[-1:]))
    whole = f"(?<!{before}){re.escape(word)}(?!{behind})"
    return bool(word) and re.search(whole, name, re.IGNORECASE) is not None


def _nested(inner: NDArray[np.generic], outer: NDArray[np.str_]) -> bool:
    """Return whether each outer name holds one inner value only."""
    return all(len(set(inner[outer == name])) == 1 for name in set(outer))


def _few(y: NDArray[np.intp], values: NDArray[np.str_]) -> bool:
    """Return whether a class has one value only, so that no split can hold it out."""
    return any(len(set(values[y == c])) < 2 for c in set(y))


def _read_order(case: Case, order: NDArray[np.float64]) -> Reading:
    y = case.touch.y
    predicted = predict(order[:, None], y, case.plain, case.seed)
    found: LabelEvidence = evidence_of(predicted, y, np.arange(len(y)), None, case.plain)

    later = case.sides is not None and tests_later(case.sides, case.pieces, y, order)

    def decide(counts: bool) -> tuple[Verdict, str, str]:
        if not counts:
            return "clear", "The order of recording does not predict the label.", ""
        return (
            "leak" if case.sides is not None else "hazard",
            "Classes were recorded in blocks or in one order: when a trial was recorded predicts "
            "its label, and so does anything that drifts.",
            "record classes in mixed order" + ("" if later else ", and test on what was recorded "
                                               "later"),
        )  # fmt: skip

    return Reading(kind="order", evidence=found, decide=decide)
