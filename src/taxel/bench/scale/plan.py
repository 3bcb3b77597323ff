"""From two workers to 32 cores and 8 cards, on paper: Amdahl's law on stored rows.

The share of the work that cannot be divided is taken from how much faster two workers were than
one. Starting the workers counts as such, so the figures err towards slow. Knows nothing about how
rows are measured.

Sources: Amdahl, AFIPS 1967 (the law); Karp and Flatt, CACM 33(5), 1990 (the share from a measured
ratio). Background: docs/explanation/scaling.md.
"""

from __future__ import annotations

from collections.abc import Sequence

from taxel.bench.rows import Row

GOAL = 1.8
"""Ratio of two workers to one that must be reached. Source: issue 19."""
CORES, CARDS = 32, 8
"""What is planned for. Source: issue 19."""
WORKS = {
    "simulation": ("two cores against one, simulation (54 pours)", "cores"),
    "folds": ("two cores against one, folds (12 folds of touchnet)", "cores"),
    "extraction": ("two cores against one, extraction (54 pours)", "cores"),
    "camera trials": ("two cores against one, camera trials (18 pours)", "cores"),
    "training": ("two processes against one, training end to end (edge, 18 pours)", "cards"),
}
"""Work → the name of its row, and what is planned: cores, or graphics cards, a process each."""
_HEAD = [
    f"| work | two against one | share not divided | with {CARDS} | with {CORES} | at most |",
    "|---|---:|---:|---:|---:|---:|",
]


def serial_share(ratio: float, workers: int = 2) -> float:
    """Return the share of work that is not divided, within 0 and 1.

    Args:
        ratio: How many times faster so many workers were than one.
        workers: How many.
    """
    return min(max((workers / ratio - 1) / (workers - 1), 0.0), 1.0)


def speedup(share: float, workers: int) -> float:
    """Return how many times faster workers are than one, if a share is not divided."""
    return 1 / (share + (1 - share) / workers)


def plan_lines(rows: Sequence[Row]) -> list[str]:
    """Return the plan as lines of Markdown; a row that is missing is said to be."""
    measured = {row.name: row.value for row in rows}
    lines = [
        f"### Planned to {CORES} cores and {CARDS} cards, on paper",
        "",
        "Times faster than one worker, by Amdahl's law from the rows above; nothing here was "
        "measured with more than two. What it assumes: [scaling](../explanation/scaling.md).",
        "",
        *_HEAD,
    ]
    for work, (name, kind) in WORKS.items():
        lines.append(_line(f"{work}, {kind}", measured.get(name), kind))
    return [*lines, _line(f"what the goal of {GOAL:g} would give, not measured", GOAL, "cores")]


def _line(work: str, ratio: float | None, kind: str) -> str:
    if ratio is None:
        return f"| {work} | not measured | – | – | – | – |"
    share = serial_share(ratio)
    many = f"{speedup(share, CORES):.1f}" if kind == "cores" else "–"
    most = f"{1 / share:.1f}" if share else "no limit seen"
    few = speedup(share, CARDS)
    return f"| {work} | {ratio:.2f} | {100 * share:.1f} % | {few:.1f} | {many} | {most} |"
