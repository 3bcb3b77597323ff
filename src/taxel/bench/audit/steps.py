"""`taxel bench audit`: whether results can be believed, and whether models keep learning.

Knows nothing about how rows are printed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

from taxel.bench.audit.adapt import (
    adapt_time_rows,
    new_class_rows,
    online_rows,
    pad_rows,
    unknown_object_rows,
)
from taxel.bench.audit.gap import baseline_rows, gap_rows
from taxel.bench.audit.leaks import planted_leaks, real_leaks
from taxel.bench.audit.models import cleaning_rows, model_rows
from taxel.bench.audit.robustness import camera_rows, condition_rows, fault_rows
from taxel.bench.audit.teng import across_rows, follow_rows, grasp_rows, reference_rows
from taxel.bench.audit.thesis_setting import thesis_setting_rows
from taxel.bench.audit.unknown import unknown_rows
from taxel.bench.rows import Row

Measure = Callable[[], list[Row]]
_SETS = ("gelsight-slip", "icub-grasp", "teng-glove")


def quick_steps() -> list[tuple[str, Measure]]:
    """Return the measurements of a normal run: (what, how)."""
    return [("time to adapt", adapt_time_rows)]


def full_steps(data: Path | None) -> list[tuple[str, Measure]]:
    """Return the measurements that take longer than a few minutes."""
    return [
        ("planted leaks", planted_leaks),
        ("leaks of real recordings", lambda: real_leaks(data)),
        ("gap between the splits", gap_rows),
        ("baselines of the gap", baseline_rows),
        ("conditions", condition_rows),
        ("setting of the thesis", thesis_setting_rows),
        ("faults", fault_rows),
        ("cameras", camera_rows),
        ("unknown objects", lambda: unknown_rows(data)),
        ("new classes", new_class_rows),
        ("prism and rubber learned", unknown_object_rows),
        ("changed pads", pad_rows),
        ("corrections", online_rows),
        ("material across shapes", across_rows),
        ("grasps and wear", grasp_rows),
        ("gate that follows", follow_rows),
        ("untouched channel", reference_rows),
        ("models", model_rows),
        ("cleaning", cleaning_rows),
    ]


def data_digest(data: Path | None) -> str:
    """Return a digest over the names and sizes of the recordings used."""
    digest = hashlib.sha256()
    for folder in [data / name for name in _SETS] if data is not None else []:
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                digest.update(f"{file.relative_to(folder)} {file.stat().st_size}".encode())
    return digest.hexdigest()
