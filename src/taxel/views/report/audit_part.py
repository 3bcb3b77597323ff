"""An audit as part of a page: its verdict, each alarm and note, and what was not found.

Knows nothing about how leaks are found.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from taxel.errors import BadInput
from taxel.evaluation.audit.finding import MEANING, Audit, Finding
from taxel.plain_text import number_of
from taxel.views.report.page import Html, join, percent, split_name, table, tag
from taxel.views.tables.audit import chance, legend

_KIND = {"leak": "bad", "hazard": "bad", "note": "", "clear": "good", "too few": "quiet",
         "not checked": "quiet"}  # fmt: skip


def audit_part(audit: Audit) -> Html:
    """Return the verdict, a table of what was found, and the names of what was not."""
    bad = [finding for finding in audit.findings if finding.verdict in ("leak", "hazard", "note")]
    clear = [finding.kind for finding in audit.findings if finding.verdict == "clear"]
    unchecked = [finding for finding in audit.findings if finding.verdict == "not checked"]
    leaks = any(finding.verdict == "leak" for finding in audit.findings)
    parts: list[object] = [
        tag("p", audit.verdict, "note leaks" if leaks else "note"),
        tag(
            "p",
            join(
                [
                    f"{audit.data}: {number_of(sum(audit.classes.values()), 'trial')}, label "
                    f"{audit.target}",
                    join([", split: ", split_name(audit.split)]) if audit.split else "",
                    ".",
                ]
            ),
        ),
    ]
    if bad:
        parts.append(
            table(
                [
                    "verdict",
                    "this alone",
                    "accuracy",
                    "majority",
                    "p",
                    "what was found, and what to do",
                ],
                [_row(finding) for finding in bad],
                kind="findings",
            )
        )
        each = [f"{line[0].upper()}{line[1:]}." for line in legend(audit) if line[:3] != "AUC"]
        parts.append(tag("p", tag("small", " ".join(each))))
    if clear:
        parts.append(tag("p", f"Looked for and not found: {', '.join(clear)}."))
    few = [finding for finding in audit.findings if finding.verdict == "too few"]
    parts += [
        tag("p", f"Could not be decided, {finding.kind}: {finding.message}", "quiet")
        for finding in few
    ]
    parts += [
        tag("p", f"Not checked, {finding.kind}: {finding.message}", "quiet")
        for finding in unchecked
    ]
    parts += [tag("p", note, "quiet") for note in audit.notes]
    return join(parts)


def _row(finding: Finding) -> list[object]:
    message = join([finding.message, f" To mend: {finding.mend}." if finding.mend else ""])
    examples = tag("small", f" ({'; '.join(finding.examples)})") if finding.examples else ""
    shown = Html(f'<span class="{_KIND[finding.verdict]}" title="{MEANING[finding.verdict]}">')
    return [
        join([shown, finding.verdict, Html("</span>")]),
        finding.kind,
        percent(finding.alone),
        percent(finding.majority),
        chance(finding),
        join([Html('<span class="said">'), message, examples, Html("</span>")]),
    ]


def read_audit(data: Any, name: str) -> Audit:
    """Return the audit that `taxel audit --json` printed.

    Args:
        data: The parsed JSON.
        name: The file's name, for the message.

    Raises:
        BadInput: It is something else.
    """
    try:
        known = {field.name for field in fields(Audit)} & set(data)
        own = {key: data[key] for key in known - {"findings"}}
        findings = tuple(_finding(entry) for entry in data["findings"])
        if not all(finding.verdict in MEANING for finding in findings):
            raise ValueError("an unknown verdict")
        found = Audit(**own | {"findings": findings, "notes": tuple(data.get("notes", ()))})
        audit_part(found)  # a value of another kind shows here
    except (TypeError, KeyError, ValueError, AttributeError) as error:
        raise BadInput(
            f"what taxel audit --json prints in {name}", "something else",
            "write it again with: taxel audit … --json",
        ) from error  # fmt: skip
    return found


def _finding(entry: dict[str, Any]) -> Finding:
    inside = {field.name for field in fields(Finding)} & set(entry)
    own: dict[str, Any] = {key: entry[key] for key in inside}
    return Finding(**own | {"examples": tuple(entry.get("examples", ()))})
