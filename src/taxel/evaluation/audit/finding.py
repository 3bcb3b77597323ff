"""What an audit says: findings, each with its verdict, its accuracy and what to do.

Knows nothing about how leaks are found.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Verdict = Literal["leak", "hazard", "note", "clear", "too few", "not checked"]
"""leak: must be mended, whatever is claimed; hazard: becomes a leak under a split that allows it,
or if trials begin before contact, which recordings do not say; note: worth a sentence beside the
result; clear: looked for and not found, though it would have been seen; too few: could not be
decided with so few trials, which is not the same."""

UNSURE = "first frame"
"""The kind whose hazard waits for an answer of the reader's, not for a split."""
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
        leaks = sum(finding.verdict == "leak" for finding in self.findings)
        waiting = [finding.kind for finding in self.findings if finding.verdict == "hazard"]
        unsure = UNSURE in waiting
        hazards = len(waiting) - unsure
        where = f"under the split {self.split!r}" if self.split else "in these recordings"
        if leaks:
            more = f", and {hazards} more would leak under a careless split" if hazards else ""
            more += f", and the {UNSURE} leaks if trials begin before contact" if unsure else ""
            return f"{leaks} leak{'s' * (leaks > 1)} {where}{more}: do not publish yet."
        less = f", unless trials begin before contact ({UNSURE})" if unsure else ""
        if hazards:
            turned = f"{hazards} hazards into leaks" if hazards > 1 else "1 hazard into a leak"
            return f"No leak {where}{less}; a careless split would turn {turned}{self._few}."
        return f"No leak found {where}{less}{self._few}."

    @property
    def _few(self) -> str:
        """What could not be found out, as the end of a sentence; empty where there is none."""
        kinds = [finding.kind for finding in self.findings if finding.verdict == "too few"]
        return f"; could not be decided with so few trials: {', '.join(kinds)}" if kinds else ""


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
