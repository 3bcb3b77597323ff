"""An audit as part of a page: its verdict, each alarm and note, and what was looked for in vain.

Knows nothing about how leaks are found.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from taxel.errors import BadInput
from taxel.evaluation.audit.finding import MEANING, Audit, Finding
from taxel.views.audit_table import chance, legend
from taxel.views.report.page import Html, join, percent, split_name, table, tag

_KIND = {"leak": "bad", "hazard": "bad", "note": "", "clear": "good", "too few": "quiet",
         "not checked": "quiet"}  # fmt: skip


def audit_part(audit: Audit) -> Html:
    """Return the verdict, a table of what was found, and the names of what was not."""
    told = [one for one in audit.findings if one.verdict in ("leak", "hazard", "note")]
    clear = [one.kind for one in audit.findings if one.verdict == "clear"]
    unchecked = [one for one in audit.findings if one.verdict == "not checked"]
    leaks = any(one.verdict == "leak" for one in audit.findings)
    parts: list[object] = [
        tag("p", audit.verdict, "note leaks" if leaks else "note"),
        tag(
            "p",
            join(
                [
                    f"{audit.data}: {sum(audit.classes.values())} trials, told apart by "
                    f"{audit.target}",
                    join([", split: ", split_name(audit.split)]) if audit.split else "",
                    ".",
                ]
            ),
        ),
    ]
    if told:
        parts.append(
            table(
                [
                    "verdict",
                    "this alone",
                    "accuracy",
                    "one answer",
                    "by chance",
                    "what was found, and what to do",
                ],
                [_row(one) for one in told],
                kind="findings",
            )
        )
        each = [f"{line[0].upper()}{line[1:]}." for line in legend(audit) if line[:3] != "AUC"]
        parts.append(tag("p", tag("small", " ".join(each))))
    if clear:
        parts.append(tag("p", f"Looked for and not found: {', '.join(clear)}."))
    few = [one for one in audit.findings if one.verdict == "too few"]
    parts += [tag("p", f"Could not be decided, {one.kind}: {one.said}", "quiet") for one in few]
    parts += [tag("p", f"Not checked, {one.kind}: {one.said}", "quiet") for one in unchecked]
    parts += [tag("p", note, "quiet") for note in audit.notes]
    return join(parts)


def _row(one: Finding) -> list[object]:
    said = join([one.said, f" To mend: {one.mend}." if one.mend else ""])
    examples = tag("small", f" ({'; '.join(one.examples)})") if one.examples else ""
    shown = Html(f'<span class="{_KIND[one.verdict]}" title="{MEANING[one.verdict]}">')
    return [
        join([shown, one.verdict, Html("</span>")]),
        one.kind,
        percent(one.alone),
        percent(one.majority),
        chance(one),
        join([Html('<span class="said">'), said, examples, Html("</span>")]),
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
        findings = tuple(_finding(one) for one in data["findings"])
        if not all(one.verdict in MEANING for one in findings):
            raise ValueError("an unknown verdict")
        found = Audit(**own | {"findings": findings, "notes": tuple(data.get("notes", ()))})
        audit_part(found)  # a value of another kind shows here
    except (TypeError, KeyError, ValueError, AttributeError) as error:
        raise BadInput(
            f"what taxel audit --json prints in {name}", "something else",
            "write it again with: taxel audit … --json",
        ) from error  # fmt: skip
    return found


def _finding(one: dict[str, Any]) -> Finding:
    inside = {field.name for field in fields(Finding)} & set(one)
    own: dict[str, Any] = {key: one[key] for key in inside}
    return Finding(**own | {"examples": tuple(one.get("examples", ()))})
