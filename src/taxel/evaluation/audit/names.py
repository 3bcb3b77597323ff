"""Names that are probably one name, spelt twice: a misspelt object is held out beside its twin.

Two values of a group or label are near where they differ in case, blanks, underscores or hyphens
only, or by one typing error in a word, in a short one by a doubled letter. Numbers must agree:
cup_1 and cup_2 are two cups, -40 and 40 two angles, x+ and x- two directions. Knows nothing about
touch.

Background of our choices: docs/decisions/0040.
"""

from __future__ import annotations

import re
import unicodedata
from itertools import combinations

from taxel.evaluation.audit.case import Case
from taxel.evaluation.audit.finding import Finding
from taxel.labels.class_order import in_order
from taxel.labels.trials import OBJECTS, SESSIONS

KIND = "near-duplicate names"
LEAST_LETTERS = 5
"""Letters of a word that one typing error still leaves recognisable: "cup" and "cap" are two
words. Source: our choice, docs/decisions/0040."""
MOST_VALUES = 500
"""Values of a group that are compared, each with each; more are no names. Source: our choice."""


def near_names(case: Case) -> Finding:
    """Return the finding on values that may be one, spelt twice."""
    pair_lines: list[str] = []
    heavy = False
    trials = case.touch.trials
    for what, sets in (
        ("label", [t.labels for t in trials]),
        ("group", [t.groups for t in trials]),
    ):
        for key in sorted({key for own in sets for key in own}):
            if what == "group" and key in ("trial", "recording", "file"):
                continue
            values = in_order(own[key] for own in sets if key in own)
            pairs = [(a, b) for a, b in combinations(values, 2) if near(a, b)] \
                if len(values) <= MOST_VALUES else []  # fmt: skip
            pair_lines += [f"{what} {key}: {a} and {b}" for a, b in pairs]
            heavy |= bool(pairs) and (key == case.touch.target or key in OBJECTS + SESSIONS)
    if not pair_lines:
        message = "No two values of a label or group look like one, misspelt."
        return Finding(kind=KIND, verdict="clear", message=message)
    return Finding(
        kind=KIND, verdict="hazard" if heavy else "note", examples=tuple(pair_lines),
        message=f"{len(pair_lines)} pair{'s' * (len(pair_lines) > 1)} of names may be one name, "
                "spelt twice: they count as two, and one can be trained on while the other is "
                "held out.",
        mend="if they are one, mend the import table and import again; if they are two, name them "
             "further apart",
    )  # fmt: skip


def _is_negative(name: str) -> bool:
    """Return whether a name is, or begins with, a number below zero: -40 is no 40 spelt twice."""
    return re.match(r"[-\u2212]\.?\d", name) is not None


def near(a: str, b: str) -> bool:
    """Return whether two different names are probably one."""
    if a == b or _is_negative(a) != _is_negative(b):
        return False
    words = [_words(name) for name in (a, b)]
    if "".join(words[0]) == "".join(words[1]):
        return True
    if len(words[0]) != len(words[1]):
        return False
    changed = [pair for pair in zip(*words, strict=True) if pair[0] != pair[1]]
    if len(changed) != 1 or not all(word.isalpha() for word in changed[0]):
        return False
    long = all(len(word) >= LEAST_LETTERS for word in changed[0])
    return one_slip(*changed[0]) if long else _doubled(*changed[0])


def _words(name: str) -> list[str]:
    """Return a name's words, numbers and plus signs, folded: "Big Cup_12" is big, cup, 12.

    A plus is no blank, so that x+ and x- are two directions.
    """
    folded = unicodedata.normalize("NFKC", name).casefold()
    return re.findall(r"\d+(?:\.\d+)?|[^\W\d_]+|\+", folded)


def _doubled(a: str, b: str) -> bool:
    """Return whether one word is the other with a letter doubled: "mug" and "mugg"."""
    short, long = sorted((a, b), key=len)
    return len(long) == len(short) + 1 and any(
        long == short[: place + 1] + short[place:] for place in range(len(short))
    )


def one_slip(a: str, b: str) -> bool:
    """Return whether one letter was added, left out or changed, or two neighbours swapped."""
    short, long = sorted((a, b), key=len)
    start = next((i for i, (x, y) in enumerate(zip(short, long, strict=False)) if x != y),
                 len(short))  # fmt: skip
    rest_short, rest_long = short[start:], long[start:]
    if len(long) - len(short) == 1:
        return rest_short == rest_long[1:]
    if len(long) > len(short):
        return False
    swapped = rest_short[:2] == rest_long[1::-1] and rest_short[2:] == rest_long[2:]
    return rest_short[1:] == rest_long[1:] or swapped
