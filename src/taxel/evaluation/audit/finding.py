"""What an audit says: findings, each with its verdict, its accuracy and what to do.

Knows nothing about how leaks are found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from taxel.plain_text import number_of

Verdict = Literal["leak", "hazard", "note", "clear", "too few", "not checked"]
"""leak: must be mended, whatever is claimed; hazard: becomes a leak under a split that allows it,
or if trials begin before contact, which recordings do not say; note: worth a sentence beside the
result; clear: looked for and not found, though it would have been seen; too few: could not be
decided with so few trials, which is not the same."""

UNSURE = "first frame"
"""The kind whose hazard waits for an answer of the reader's, not for a split."""
UNLESS = {
    UNSURE: "trials begin before contact",
    "near-duplicates": "trials were copied",
    "augmented copies": "trials were copied",
    "name: imported file": "each file was recorded at another time",
}
"""Kinds whose hazard under a split waits for an answer, too → under which condition it leaks."""
LITTLE = 0.01
"""Change of the accuracy, 0…1, below which leaks are no reason to hold a result back. Source: our
choice, docs/decisions/0023."""
ALARMS: tuple[Verdict, ...] = ("leak", "hazard")
MEANING: dict[Verdict, str] = {
    "leak": "an accuracy measured here is not to be believed until this is mended",
    "hazard": "becomes a leak under a split that allows it, or if its condition holds",
    "note": "state it beside the result",
    "clear": "looked for, not found",
    "too few": "could not be decided: with so few trials even a large leak would not have counted",
    "not checked": "the recordings lack what this check needs, or are too many for it",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One kind of leak, looked for."""

    kind: str
    """Short name, the same in every audit; listed in docs/how-to/audit.md."""
    verdict: Verdict
    message: str
    """What was found, in plain words, one sentence."""
    mend: str = ""
    """What to do about it; empty where nothing is to be done."""
    alone: float | None = None
    """Accuracy that the leak alone gives, 0…1: nothing else was seen."""
    majority: float | None = None
    """Share of the commonest class in the same test parts: the best single answer."""
    auc: float | None = None
    """Area under the ROC curve of the leak alone, where there are two classes."""
    p: float | None = None
    """Chance of so high a figure where labels are dealt out anew, after Holm's correction; None
    for a fact, which counts by rule: one piece is enough."""
    examples: tuple[str, ...] = ()
    """What was found, by name: all of it, or the most important."""
    left: float | None = None
    """Accuracy that cheap trees still reach on touch once this is tared or cropped away, 0…1; None
    where no such mending is known."""
    at_most: float | None = None
    """Share of the tested items that a fact concerns, 0…1: it can change the accuracy by no more;
    None where that is not known."""

    @property
    def alarm(self) -> bool:
        """Whether it is more than a note."""
        return self.verdict in ALARMS


@dataclass(frozen=True, slots=True, kw_only=True)
class Audit:
    """All that was looked for in one data set, under one split or none."""

    data: str
    kind: str
    """array or camera."""
    target: str
    classes: dict[str, int]
    """Class → trials."""
    split: str
    """The split's name; empty where the recordings were audited by themselves."""
    read_on: str
    """How nuisances were cross-validated, such as "object held out"."""
    findings: tuple[Finding, ...]
    """Alarms first."""
    notes: tuple[str, ...] = field(default=())
    groups: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    """Group that trials share → each of its values, in full → trials."""

    @property
    def alarms(self) -> tuple[Finding, ...]:
        """Leaks and hazards."""
        return tuple(finding for finding in self.findings if finding.alarm)

    @property
    def verdict(self) -> str:
        """One sentence for a reader in a hurry."""
        leaks = [finding for finding in self.findings if finding.verdict == "leak"]
        waiting = [finding.kind for finding in self.findings if finding.verdict == "hazard"]
        asked = [kind for kind in waiting if kind == UNSURE or (self.split and kind in UNLESS)]
        hazards = len(waiting) - len(asked)
        where = f"under the split {self.split!r}" if self.split else "in these recordings"
        if leaks:
            more = f", and {hazards} more would leak under a careless split" if hazards else ""
            more += "".join(f", and the {kind} leaks if {UNLESS[kind]}" if kind == UNSURE else
                            f", and {kind} if {UNLESS[kind]}" for kind in asked)  # fmt: skip
            return f"{number_of(len(leaks), 'leak')} {where}{more}: {_weight(leaks)}."
        less = "".join(f", unless {UNLESS[kind]} ({kind})" for kind in asked)
        if hazards:
            turned = f"{hazards} hazards into leaks" if hazards > 1 else "1 hazard into a leak"
            return f"No leak {where}{less}; a careless split would turn {turned}{self._few}."
        return f"No leak found {where}{less}{self._few}."

    @property
    def _few(self) -> str:
        """What could not be found out, as the end of a sentence; empty where there is none."""
        kinds = [finding.kind for finding in self.findings if finding.verdict == "too few"]
        return f"; could not be decided with so few trials: {', '.join(kinds)}" if kinds else ""


def _weight(leaks: Sequence[Finding]) -> str:
    """Return what leaks mean for a result: not much where they concern hardly any of the tests."""
    shares = [leak.at_most for leak in leaks if leak.at_most is not None]
    if len(shares) < len(leaks) or sum(shares) >= LITTLE:
        return "do not publish yet"
    they = "it" if len(leaks) == 1 else "together they"
    return f"{they} can change the accuracy by {sum(shares):.3f} at most; mend it, or state it " \
           "beside the result"  # fmt: skip


ORDER: tuple[Verdict, ...] = ("leak", "hazard", "note", "too few", "clear", "not checked")


def sort_findings(findings: list[Finding]) -> tuple[Finding, ...]:
    """Return findings by verdict, and among equals the more important ones first."""
    return tuple(
        sorted(
            findings,
            key=lambda finding: (
                ORDER.index(finding.verdict),
                -(finding.alone or 0.0),
                finding.kind,
            ),
        )
    )


def holm(p: list[float]) -> list[float]:
    """Return p values after Holm's correction for as many tests as there are.

    Source: S. Holm, "A simple sequentially rejective multiple test procedure", 1979.
    """
    order = sorted(range(len(p)), key=lambda i: p[i])
    found, least = [1.0] * len(p), 0.0
    for rank, index in enumerate(order):
        least = max(least, min(1.0, (len(p) - rank) * p[index]))
        found[index] = least
    return found
