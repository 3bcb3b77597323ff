"""An audit in the terminal: the verdict, what alone gives which accuracy, and what to do.

Knows nothing about how leaks are found.

Background of our choices: docs/decisions/0040.
"""

from __future__ import annotations

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from taxel.evaluation.audit.finding import MEANING, Audit, Finding
from taxel.plain_text import number_of, visible, visible_line, visible_names

_STYLE = {"leak": "bold red", "hazard": "yellow", "note": "cyan", "clear": "green",
          "too few": "magenta", "not checked": "dim"}  # fmt: skip
SHOWN = 12
"""Examples that are shown without --all. Source: our choice."""


def audit_table(found: Audit, *, everything: bool = False) -> RenderableType:
    """Return an audit for the terminal: its verdict, then a table of findings.

    Args:
        found: What `audit` gave.
        everything: Also list what was looked for and not found.
    """
    verdicts = ("leak", "hazard", "note")
    shown = [finding for finding in found.findings if everything or finding.verdict in verdicts]
    parts: list[RenderableType] = [
        Text(visible_line(found.verdict), style="bold red" if found.alarms else "bold green"),
        Text(visible_line(_what(found)), style="dim"),
    ]
    parts += [Text(visible_line(note), style="dim") for note in found.notes]
    if shown:
        parts += [_figures(shown), Text("What was found, and what to do", style="bold")]
        parts += [_in_words(finding, everything) for finding in shown]
    meant = dict.fromkeys(finding.verdict for finding in shown)
    parts += [Text(f"{verdict}: {MEANING[verdict]}", style="dim") for verdict in meant]
    parts += [Text(line, style="dim") for line in (legend(found) if shown else [])]
    if everything:
        parts += [Text(line, style="dim") for line in _groups(found)]
    parts.append(Text(_rest(found, everything), style="dim"))
    return Group(*parts)


def _what(found: Audit) -> str:
    trials = sum(found.classes.values())
    classes = ", ".join(
        f"{visible_names([name])}: {count}" for name, count in found.classes.items()
    )
    split = f"split: {found.split}" if found.split else "no split given"
    return (
        f"{found.data}: {found.kind}, {number_of(trials, 'trial')}, label {found.target!r} "
        f"({classes}); {split}"
    )


def _figures(shown: list[Finding]) -> Table:
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("")
    table.add_column("this alone", no_wrap=True)
    for column in ("accuracy", "majority", "AUC", "p"):
        table.add_column(column, justify="right", no_wrap=True)
    for finding in shown:
        table.add_row(
            Text(finding.verdict, style=_STYLE[finding.verdict]), visible_line(finding.kind),
            *[_share(value) for value in (finding.alone, finding.majority, finding.auc)],
            chance(finding),
        )  # fmt: skip
    return table


def chance(finding: Finding) -> str:
    """Return how easily chance gives a finding; "rule" for a fact, for which it does not matter."""
    if finding.p is None:
        return "–" if finding.alone is None else "rule"
    return "< 0.001" if finding.p < 0.001 else f"{finding.p:.3f}"


def legend(found: Audit) -> list[str]:
    """Return what each column says, a line each."""
    return [
        "accuracy: reached on test parts from this alone; where p is “rule”, by answering with the "
        "label of the piece of the same trial, session or copy that is in the training part, and "
        "with the commonest class where there is none",
        f"found by: small trees and look-ups, {found.read_on}"
        + ("" if found.read_on == found.split else ", since the split divides trials or none is "
           "given") + "; other test parts give other figures",
        "majority: accuracy of always naming the commonest class",
        "AUC: area under the ROC curve, two classes only; 0.5 is chance",
        "p: how often shuffled labels reach as much, corrected for all tests (Holm); a finding "
        "counts below 0.01. “rule” marks a fact, for which a single case is enough",
    ]  # fmt: skip


def _groups(found: Audit) -> list[str]:
    """Return each group with all of its values and their trials."""
    return [
        f"group {visible(key)}: "
        + ", ".join(f"{visible(name)} {count}" for name, count in values.items())
        for key, values in found.groups.items()
    ]


def _in_words(finding: Finding, everything: bool) -> Text:
    text = Text()
    text.append(f"{visible_line(finding.kind)}: ", style=_STYLE[finding.verdict])
    text.append(visible_line(finding.message))
    if finding.examples:
        shown = finding.examples if everything else finding.examples[:SHOWN]
        rest = len(finding.examples) - len(shown)
        more = f" and {rest} more (--all)" if rest else ""
        text.append(f" Such as: {visible_line('; '.join(shown))}{more}.", style="dim")
    if finding.mend:
        text.append(f"\n  → {visible_line(finding.mend)}.")
    return text


def _share(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f}"


def _rest(found: Audit, everything: bool) -> str:
    clear = [finding.kind for finding in found.findings if finding.verdict == "clear"]
    unknown = [finding.kind for finding in found.findings if finding.verdict == "not checked"]
    few = [finding.kind for finding in found.findings if finding.verdict == "too few"]
    lines = [] if everything else [f"looked for and not found: {', '.join(clear) or 'nothing'}"]
    if few and not everything:
        lines.append(f"could not be decided with so few trials: {', '.join(few)}")
    if unknown and not everything:
        lines.append(f"not checked: {', '.join(unknown)}")
    return "\n".join(lines)
