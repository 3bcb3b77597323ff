"""Leaks planted in simulated recordings of both systems, and those of real ones: are they found?

Knows nothing about how leaks are planted or found.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from taxel.bench.audit.plants import PLANTS, named
from taxel.bench.rows import Row, missing, row
from taxel.evaluation.audit.audit import audit
from taxel.evaluation.audit.finding import ALARMS, Audit, Verdict
from taxel.evaluation.audit.reading import read_touch
from taxel.evaluation.audit.touch_set import TouchSet
from taxel.sim.pour.cup_pour import CupPourConfig
from taxel.sources.simulated.data_sets import simulate_presets
from taxel.sources.simulated.pour_folder import write_pours


def planted_leaks() -> list[Row]:
    """Return how many planted leaks are found, and how often clean splits raise an alarm.

    A plant is found where its verdict is an alarm, and worse than any that the clean recordings
    got, by themselves or split.
    """
    found_leaks: list[str] = []
    lost: list[str] = []
    false: list[str] = []
    waiting: list[str] = []
    clean = 0
    with tempfile.TemporaryDirectory(prefix="taxel-audit-") as scratch:
        for system, touch, key in _clean_sets(Path(scratch)):
            before: list[Audit] = []
            for split in (None, named(touch, f"group:{key}")):
                result = audit(touch, system, split)
                clean += 1
                false += [f"{system}: {alarm.kind}" for alarm in result.alarms
                          if alarm.verdict == "leak" or split is not None]  # fmt: skip
                waiting += [f"{system}: {alarm.kind}" for alarm in result.alarms
                            if alarm.verdict == "hazard" and split is None]  # fmt: skip
                before.append(result)
            for plant in PLANTS if not system.endswith("shape") else ():
                if plant.arrays_only and touch.kind != "array":
                    continue
                spoilt, sides, run = plant.make(touch, Path(scratch))
                got = new_alarms(audit(spoilt, system, sides, run=run), before)
                for kind in plant.kinds:
                    (found_leaks if kind in got else lost).append(f"{system}: {kind}")
    kinds = {name.partition(": ")[2] for name in found_leaks + lost}
    note = f"{len(kinds)} kinds" + (f"; not found: {', '.join(lost)}" if lost else "")
    row_name = f"{clean} audits, by themselves and split by session or cup"
    return [
        row("leaks found of those planted, both systems", len(found_leaks), "leaks", ">=",
            len(found_leaks) + len(lost), note),
        row("alarms on clean splits, both systems", len(false), "alarms", "<=", 0,
            row_name + (f": {', '.join(false)}" if false else "")
            + "; hazards by themselves, not counted: " + (", ".join(waiting) or "none")),
    ]  # fmt: skip


REAL: dict[str, tuple[str, str]] = {
    "gelsight-slip": ("length leak", "length"),
    "icub-grasp": ("first-frame leak", "first frame"),
    "teng-glove": ("window leak", "window leak"),
}
"""Real data set → what the audit must find by itself: for people, and its kind."""


def real_leaks(data: Path | None) -> list[Row]:
    """Return what the audit finds by itself in the real recordings.

    Args:
        data: The folder that holds them; None where there is none.
    """
    rows = []
    for name, (leak, kind) in REAL.items():
        title = f"{name}: {leak}, accuracy it alone gives"
        if data is None or not (data / name).is_dir():
            rows.append(missing(title, "1", "found", "needs --data FOLDER"))
            continue
        began_s = time.monotonic()
        result = audit(read_touch(data / name, None, lambda *_: None), name)
        took_s = time.monotonic() - began_s
        finding = next(finding for finding in result.findings if finding.kind == kind)
        rows.append(
            Row(name=title, value=finding.alone, unit="1", goal="found", ok=finding.alarm,
                note=f"{finding.verdict}: {finding.message} Majority {finding.majority or 0.0:.3f}"
                     f"; {result.read_on}; {took_s:.0f} s")
        )  # fmt: skip
    return rows


def new_alarms(spoilt: Audit, clean: Sequence[Audit]) -> set[str]:
    """Return the kinds of the alarms that are worse than in each audit of the clean recordings."""
    before = [(finding.kind, finding.verdict) for audit in clean for finding in audit.findings]
    return {
        alarm.kind for alarm in spoilt.alarms
        if all(_worse(alarm.verdict, verdict) for kind, verdict in before if kind == alarm.kind)
    }  # fmt: skip


def _worse(verdict: Verdict, before: Verdict) -> bool:
    return before not in ALARMS or ALARMS.index(verdict) < ALARMS.index(before)


def _clean_sets(folder: Path) -> list[tuple[str, TouchSet, str]]:
    """Simulate both systems; return name, recordings and the group to hold out."""
    simulate_presets(folder, ("honest",), 12_000, 0)
    cups = CupPourConfig(cups=8, forces_n=(12.0, 25.0), duration_s=2.4, frame_hz=20.0)
    write_pours(folder / "cups", cups, camera_hz=10.0)
    sets = []
    for name, at, target, key in (
        ("TENG hand, material", "honest", "material", "session"),
        ("TENG hand, shape", "honest", "shape", "session"),
        ("pours", "cups", "outcome", "cup"),
    ):
        touch = read_touch(folder / at, target, lambda *_: None)
        enough = np.bincount(touch.y) >= 6  # a cup is rarely dropped
        sets.append((name, touch.only(np.flatnonzero(enough[touch.y])), key))
    return sets
