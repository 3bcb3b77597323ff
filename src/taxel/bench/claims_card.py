"""The card of claims: both papers' numbers beside the stored rows that answer them, as Markdown.

Knows nothing about how rows were measured.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from textwrap import wrap
from typing import Any

from taxel.bench.rows import STORE, Row, stored
from taxel.errors import BadInput
from taxel.evaluation.cards.claims import (
    ABOVE_GATE,
    EVERY_CUP,
    NOT_YET,
    ONE_CUP,
    STEP,
    TRIVIAL,
    Claim,
    ClaimsOfPart,
    Link,
    grasp_row,
    table_row,
)
from taxel.evaluation.cards.grasp_claims import grasp_parts
from taxel.evaluation.cards.thesis_claims import thesis_parts
from taxel.recordings.whole import write_whole
from taxel.training.environment import environment

MEASURED_FOR_CLAIMS = "claims"
"""Name of the store of rows that no bench holds: each value of the papers' tables."""
COMMAND = "taxel report --claims docs/reference/claims.md"
_NONE = "not measured"
_TRAINED_BY = {"taxel train-backbone": "end to end", "taxel distil": "distilled"}
"""What stands before the value of a row whose weights a verb of ours made: the row's note names the
last verb first, then what its weights began with."""
_WIDTH = 110
"""Letters in a line of text."""


def all_parts() -> tuple[ClaimsOfPart, ...]:
    """Return all claims, in the order of the papers."""
    return (*thesis_parts(), *grasp_parts())


def claims_card(rows: Iterable[Row] | None = None) -> str:
    """Return the card as Markdown.

    Args:
        rows: Rows to join with the claims; all that are stored unless given.
    """
    known = {row.name: row for row in (all_stored() if rows is None else rows)}
    parts = all_parts()
    claims = [claim for part in parts for claim in part.claims]
    answered = sum(_answered(claim, known) for claim in claims)
    lines = [
        "# Claims card",
        "",
        *wrap(
            f"Written by `{COMMAND}` from stored rows; do not edit by hand. Every number that the "
            "two papers claim of their own systems (not what they cite of others, nor dimensions "
            "and settings), beside ours under their split and under the honest one. What nobody "
            f"measured here says so, with the reason. {answered} of {len(claims)} claims are "
            "answered.",
            _WIDTH,
            break_on_hyphens=False,
        ),
        "",
        *wrap(
            "All of ours are on simulated recordings of the same kinds: neither paper's "
            "recordings are public. Below each table: commit, data and command of its rows.",
            _WIDTH,
        ),
        "",
    ]
    for part in parts:
        lines += _part(part, known)
    return "\n".join(lines).rstrip() + "\n"


def write_claims_card(path: Path) -> None:
    """Write the card, whole or not at all.

    Raises:
        RecordingFailed: The disk refused.
    """
    write_whole(path, claims_card())


def keep_for_claims(results: Mapping[str, Any]) -> int:
    """Keep each value of saved results as a row that the card can join; return how many.

    Args:
        results: File's name → parsed JSON of `taxel reproduce table-4-1 --json`,
            `transition-tables --json`, `taxel simulate teng --json`, or any `taxel bench … --json`.

    Raises:
        BadInput: A file holds none of these.
        RecordingFailed: The disk refused.
    """
    found = {row.name: row for row in stored(MEASURED_FOR_CLAIMS)}
    added = [row for name, data in results.items() for row in _rows_of(data, name)]
    found |= {row.name: row for row in added}
    text = json.dumps([asdict(row) for row in found.values()], indent=1, ensure_ascii=False)
    write_whole(STORE / f"{MEASURED_FOR_CLAIMS}.json", text + "\n")
    return len(added)


def all_stored() -> list[Row]:
    """Return the rows of all stores; a bench's own row wins over one kept for the card."""
    names = sorted(path.stem for path in STORE.glob("*.json"))
    names.sort(key=lambda name: name != MEASURED_FOR_CLAIMS)
    return [row for name in names for row in stored(name)]


def find(link: Link, known: Mapping[str, Row]) -> Row | None:
    """Return the row that a link names, or the first that fits where it holds a "*"."""
    if "*" not in link.row:
        return known.get(link.row)
    pattern = re.compile(".*".join(map(re.escape, link.row.split("*"))))
    return next((known[name] for name in sorted(known) if pattern.fullmatch(name)), None)


def _rows_of(data: Any, name: str) -> list[Row]:
    day = datetime.now(UTC).strftime("%Y-%m-%d")
    stamp = f"kept at commit {environment().get('commit', 'unknown')}, {day}, "
    try:
        if isinstance(data, dict) and {"rows", "baselines", "steps"} <= set(data):
            return _transition_rows(data, stamp + "taxel reproduce transition-tables")
        if isinstance(data, list) and data and {"columns", "preset"} <= set(data[0]):
            return _table_rows(data, stamp + "taxel reproduce table-4-1")
        if isinstance(data, list) and data and {"scans", "gated"} <= set(data[0]):
            share = sum(entry["gated"] for entry in data) / sum(entry["scans"] for entry in data)
            return [Row(name=ABOVE_GATE, value=share, unit="share",
                        note=f"{len(data)} sessions",
                        stamp=stamp + "taxel simulate teng")]  # fmt: skip
        if isinstance(data, list) and data and {"name", "value", "goal"} <= set(data[0]):
            rows = [Row(**entry) for entry in data]
            return [row if row.stamp else replace(row, stamp=stamp + "taxel bench")
                    for row in rows if row.value is not None]  # fmt: skip
    except (KeyError, TypeError) as error:
        raise BadInput(f"a whole result in {name}", f"one that lacks {error}", "write it again") \
            from error  # fmt: skip
    raise BadInput(
        f"what taxel reproduce table-4-1, transition-tables or taxel bench prints with --json in "
        f"{name}",
        "something else",
        "write it again",
    )


def _table_rows(sections: Sequence[Mapping[str, Any]], stamp: str) -> list[Row]:
    rows = []
    for section in sections:
        where = section["preset"], section["task"], section["split"]
        best = max(section["trivial"], key=lambda name: section["trivial"][name])
        rows.append(Row(name=table_row(*where, *TRIVIAL), value=section["trivial"][best],
                        unit="of 1", note=best, stamp=stamp))  # fmt: skip
        for model, column in section["columns"].items():
            values = dict(column["rows"]) | {
                "all sessions tested once": column["pooled"]["scores"]["accuracy"]
            }
            low, high = column["pooled"]["interval"]
            for row, value in values.items():
                if value is None:
                    continue
                unit = "ms" if "ms" in row else "nats" if "Loss" in row else "of 1"
                has_interval = row == "all sessions tested once" and low is not None
                note = f"95 % by session {low:.3f} … {high:.3f}" if has_interval else ""
                rows.append(Row(name=table_row(*where, model, row), value=value, unit=unit,
                                note=note, stamp=stamp))  # fmt: skip
    return rows


def _transition_rows(data: Mapping[str, Any], stamp: str) -> list[Row]:
    rows = []
    ran = f"; features by {data['features']}" if data.get("features") else ""
    for row in data["rows"]:
        if row["weights"] == "RANDOM":
            continue  # its accuracy says nothing of a trained backbone
        seen = f"; seen as {row['tare']}" if row.get("tare") else ""
        for what, scores in ((ONE_CUP, row["single"]), (EVERY_CUP, row["every_cup"])):
            if scores is not None:
                low, high = scores["interval"]
                rows.append(Row(name=grasp_row(row["plan"]["model"], row["plan"]["frames"], what),
                                value=scores["accuracy"], unit="accuracy",
                                note=f"95 % {low:.3f} … {high:.3f}; rule {data['rule']}; weights "
                                f"{row['weights']} {row.get('origin', '')}".rstrip() + ran + seen,
                                stamp=stamp))  # fmt: skip
    for step in data["steps"]:
        rows.append(Row(name=grasp_row(step["model"], step["frames"], STEP),
                        value=step["stream_ms"], unit="ms",
                        note=f"{step['engine']}, {step['threads']} thread(s){_limit(step)}",
                        stamp=stamp))  # fmt: skip
    return rows


def _limit(step: Mapping[str, Any]) -> str:
    """Return the share of the measured limit that a step reached, where it was measured."""
    share = step.get("share")
    return f", {share:.0%} of this machine's matrix product" if share else ""


def _part(part: ClaimsOfPart, known: Mapping[str, Row]) -> list[str]:
    lines = [f"## {part.title}", "", *wrap(part.about, _WIDTH), ""]
    lines += ["| where | claim | claimed | ours, their split | ours, honest split | command |",
              "|---|---|---:|---:|---:|---|"]  # fmt: skip
    stamps: dict[str, None] = {}
    for claim in part.claims:
        used = [row for link in (*claim.theirs, *claim.honest) if (row := find(link, known))]
        stamps |= dict.fromkeys(row.stamp for row in used if row.stamp)
        commands = dict.fromkeys(_ran(row.stamp)[1] for row in used if row.stamp)
        command = " ".join(f"`{each}`" for each in commands) or _default(claim, part)
        theirs, honest = _cells(claim, known)
        cells = claim.where, claim.what, claim.claimed, theirs, honest, command
        lines.append(f"| {' | '.join(cells)} |")
    lines += ["", *(f"- {_command(stamp)}" for stamp in stamps)]
    return [*lines, ""] if stamps else lines


def _default(claim: Claim, part: ClaimsOfPart) -> str:
    if claim.ours:
        return "`taxel models`"
    if not claim.theirs and not claim.honest and claim.why not in ("", NOT_YET):
        return "–"
    return f"`{claim.command or part.command}`"


def _cells(claim: Claim, known: Mapping[str, Row]) -> tuple[str, str]:
    if claim.ours:
        return claim.ours, "the same"
    theirs, honest = _values(claim.theirs, known), _values(claim.honest, known)
    if not theirs and not honest:
        return f"{_NONE}: {claim.why}" if claim.why else _NONE, "–"
    if claim.theirs == claim.honest:
        return theirs, "the same"
    return theirs or "–", honest or "–"


def _values(links: Sequence[Link], known: Mapping[str, Row]) -> str:
    figures = []
    for link in links:
        row = find(link, known)
        if row is not None and row.value is not None:
            shown = f"{100 * row.value:.1f} %" if link.percent else _value(row)
            label = link.label or _trained_by(row.note)
            figures.append(f"{label} {shown}".strip())
    return ", ".join(figures)


def _trained_by(note: str) -> str:
    places = {note.find(verb): label for verb, label in _TRAINED_BY.items() if verb in note}
    return places[min(places)] if places else ""


def _value(row: Row) -> str:
    assert row.value is not None
    if row.unit in ("accuracy", "share"):
        return f"{100 * row.value:.1f} %"
    if row.unit == "of 1":
        return f"{row.value:.4f}"
    digits = 1 if row.unit == "points" else 2 if abs(row.value) < 100 else 0
    unit = f" {row.unit}" if row.unit not in ("nats",) else ""
    return f"{row.value:.{4 if row.unit == 'nats' else digits}f}{unit}"


def _answered(claim: Claim, known: Mapping[str, Row]) -> bool:
    links = (*claim.theirs, *claim.honest)
    return bool(claim.ours) or any(find(link, known) for link in links)


def _command(stamp: str) -> str:
    """Return a stamp with its command as code."""
    before, command = _ran(stamp)
    return f"{before}`{command}`"


def _ran(stamp: str) -> tuple[str, str]:
    """Return a stamp's words before its command, and the command, which may hold commas."""
    before, found, command = stamp.rpartition("taxel ")
    return before, found + command
