"""Rows on gelsight-slip: slip by trial on objects never seen, with learning and without any label.

Knows nothing about how rows are printed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from taxel.bench.rows import Row, missing, row

NAME = "gelsight-slip by object, three crops of 48 frames a trial"
UNLEARNED = "gelsight-slip, slip signal without any label, the same crops"
LEAST_ACCURACY, LEAST_AUC, LEAST_UNLEARNED = 0.93, 0.988, 0.90
"""Goals. Source: issues 15 and 16."""


def missing_rows(why: str) -> list[Row]:
    """Return the rows that could not be measured."""
    return [
        missing(f"{NAME}: accuracy", "accuracy", f">= {LEAST_ACCURACY}", why),
        missing(f"{NAME}: AUC", "AUC", f">= {LEAST_AUC}", why),
    ]


def missing_signal_rows(why: str) -> list[Row]:
    """Return the slip signal's row where it could not be measured."""
    return [missing(f"{UNLEARNED}: AUC", "AUC", f">= {LEAST_UNLEARNED}", why)]


def slip_rows(found: dict[str, Any]) -> list[Row]:
    """Return ours with the others in the note, and the difference to the bar.

    Args:
        found: What `taxel evaluate-trials --json` printed.
    """
    ours, *others = found["rows"]
    less = found["differences"][0]
    rows = []
    limits = (("accuracy", "accuracy", LEAST_ACCURACY), ("auc", "AUC", LEAST_AUC))
    for key, unit, limit in limits:
        beside = "; ".join(f"{other['name']} {other['trials'][key]:.3f}" for other in others)
        low, high = less[f"{key}_interval"]
        note = f"{beside}; less the bar {less[key]:+.3f} [{low:+.3f}, {high:+.3f}]"
        rows.append(row(f"{NAME}: {unit}", ours["trials"][key], unit, ">=", limit, note))
    return rows


def signal_rows(folder: Path) -> list[Row]:
    """Measure the slip signal alone: nothing is learned, labels are only used to score.

    The formula was chosen on half of the objects; the others have a row of their own.
    """
    from taxel.evaluation.camera_trials.slip_signal import signal_auc
    from taxel.training.frames.features import default_cache

    scores = signal_auc(folder, default_cache())
    others = "; ".join(f"{name} {value:.3f}" for name, value in scores.others.items())
    low, high = scores.interval
    least, most = scores.apart_interval
    objects, trials = scores.apart
    note = (
        f"{scores.name}, chosen among some on the labels of every other object; 95 % CI over "
        f"objects [{low:.3f}, {high:.3f}]; {others}"
    )
    apart = (
        f"{trials} trials of {objects} objects; 95 % CI over objects [{least:.3f}, {most:.3f}]; "
        "an earlier formula of this form had been chosen on all objects (decision 41)"
    )
    return [
        row(f"{UNLEARNED}: AUC", scores.auc, "AUC", ">=", LEAST_UNLEARNED, note),
        row(f"{UNLEARNED}, the objects that no formula was chosen on: AUC", scores.apart_auc, "AUC",
            ">=", LEAST_UNLEARNED, apart),
    ]  # fmt: skip
