"""Keep the figures of a run with its command and commit, and show them on a page of the docs.

Knows nothing about how mutants are made or tried.
"""

from __future__ import annotations

import json
import subprocess
from collections import Counter
from collections.abc import Mapping
from typing import Any

from mutants.places import COUNT, EXPLAINED, GOAL, PLACES, ROOT, SEED, STORED, WORK, key_of

_PAGE = ROOT / "docs" / "reference" / "tests.md"
_HEAD = """# What the tests are worth

A line that a test runs may still be wrong: a *mutant* is the same program with one small change,
and tests that notice it *kill* it. The score is the share of mutants that are killed. Branch
coverage is the share of branches that the tests take, in subprocesses too. How both are measured,
and why so: [decision 0049](../decisions/0049-mutants.md).

*This page is written by `make mutants` and `make coverage`.*
"""


def store_mutants() -> None:
    """Store the verdicts of all places that were tried, and write the page."""
    stored = _read()
    for name, place in PLACES.items():
        drawn_file, verdicts_file = WORK / f"{name}.drawn.json", WORK / f"{name}.verdicts.json"
        if not (drawn_file.exists() and verdicts_file.exists()):
            continue
        drawn = json.loads(drawn_file.read_text())
        known = json.loads(verdicts_file.read_text())
        counts = Counter(known[key_of(mutant)]["verdict"] for mutant in drawn)
        stored["mutants"][name] = {
            "mutants": len(drawn), "survived": counts["survived"], "endless": counts["endless"],
            "score": round(1 - counts["survived"] / len(drawn), 4), "tests": list(place.tests),
            "survivors": [_shown(mutant) for mutant in drawn
                          if known[key_of(mutant)]["verdict"] == "survived"],
            "command": f"python -m mutants {name} --store", "commit": _commit(),
        }  # fmt: skip
    _write(stored)


def store_branches(found: Mapping[str, tuple[int, int]], command: str) -> None:
    """Store each part's branches, taken and of how many, and write the page.

    Args:
        found: Of the parts that were measured; what is stored of others stays.
        command: What measured them.
    """
    stored = _read()
    stored["branches"] |= {
        name: {"taken": taken, "of": of, "command": command, "commit": _commit()}
        for name, (taken, of) in found.items()
    }
    _write(stored)


def explained() -> list[dict[str, str]]:
    """Return the survivors that no test can kill: file, before, after, reason."""
    found: list[dict[str, str]] = json.loads(EXPLAINED.read_text())
    return found


def page(stored: Mapping[str, Any]) -> str:
    """Return the page, as Markdown."""
    lines = [_HEAD, "## Mutants", "",
             f"{COUNT} a place, seed {SEED}, goal {GOAL:.2f}.", "",
             "| place | mutants | survived | score | command | commit |",
             "|---|---:|---:|---:|---|---|"]  # fmt: skip
    lines += [
        f"| {name} | {row['mutants']} | {row['survived']} | {row['score']:.3f} "
        f"| `{row['command']}` | {row['commit']} |"
        for name, row in stored["mutants"].items()
    ]
    lines += ["", "## Branches", "", "| part | branches | taken | share | command | commit |",
              "|---|---:|---:|---:|---|---|"]  # fmt: skip
    lines += [
        f"| {name} | {row['of']} | {row['taken']} | {row['taken'] / row['of']:.1%} "
        f"| `{row['command']}` | {row['commit']} |"
        for name, row in stored["branches"].items()
    ]
    lines += ["", "## Survivors", "", "| file | line of the program | mutant | why it survives |",
              "|---|---|---|---|"]  # fmt: skip
    reasons = {(row["file"], row["before"], row["after"]): row["reason"] for row in explained()}
    lines += [
        f"| {row['file']} | {_code(row['before'])} | {_code(row['after'])} "
        f"| {reasons.get((row['file'], row['before'], row['after']), 'no test kills it yet')} |"
        for place in stored["mutants"].values()
        for row in place["survivors"]
    ]
    return "\n".join([*lines, ""])


def _code(text: str) -> str:
    words = " ".join(text.split()).replace("|", "\\|")
    return f"`{words}`" if words else "(removed)"


def _shown(mutant: Mapping[str, str]) -> dict[str, str]:
    return {name: mutant[name] for name in ("file", "before", "after")}


def _read() -> dict[str, Any]:
    if not STORED.exists():
        return {"mutants": {}, "branches": {}}
    found: dict[str, Any] = json.loads(STORED.read_text())
    return found


def _write(stored: dict[str, Any]) -> None:
    STORED.write_text(json.dumps(stored, indent=1, ensure_ascii=False) + "\n")
    _PAGE.write_text(page(stored))


def _commit() -> str:
    found = subprocess.run(
        ["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    return found.stdout.strip()
