"""Rows of section 4.4 in the thesis's own setting: gate 1.55 V, 12 rows, no reference touches.

They stand beside those of `taxel.bench.audit.robustness`, whose recogniser has another gate, a
longer window and three reference touches a session. Same sessions, same conditions. Knows nothing
about how rows are printed.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from taxel.bench.audit.robustness import SCANS, TESTED, TRAIN_SEED, loss_words, points_at
from taxel.bench.rows import Row
from taxel.evaluation.robustness.conditions import BASE, LEVELS, settings_at, simulate_at
from taxel.evaluation.robustness.curve import CLEAN, SessionAnswers, loss_between, point_of
from taxel.evaluation.robustness.touches import judge, train_model
from taxel.jobs.running import side_by_side
from taxel.sources.simulated.data_sets import DATA_SET_RATE_HZ, write_sessions
from taxel.sources.simulated.teng_options import checked_config
from taxel.training.recipes import find_recipe

SETTING = "the thesis's setting, 1.55 V, 12 rows, no reference touches"
TARGETS = ("shape", "material")


def thesis_setting_rows() -> list[Row]:
    """Measure each condition's loss as the thesis gates and windows: minutes on two cores."""
    return [row for rows in side_by_side(_rows, [(target,) for target in TARGETS]) for row in rows]


def _rows(target: str) -> list[Row]:
    """Return one target's rows; runs in a process of its own."""
    config = checked_config(seed=TRAIN_SEED, scans_per_class=SCANS, rate_hz=DATA_SET_RATE_HZ)
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        write_sessions(Path(scratch) / "train", config, lambda _: None)
        recipe = replace(find_recipe("teng"), target=target)
        model = train_model(Path(scratch) / "train", recipe)
    clean = judge(model, simulate_at(dict(BASE), TESTED))
    rows = [_clean_row(target, clean)]
    for condition, (_, levels) in LEVELS.items():
        worse = {
            level: judge(model, simulate_at(settings_at(condition, level), TESTED))
            for level in levels
        }
        rows.append(_condition_row(target, condition, clean, worse))
    return rows


def _clean_row(target: str, clean: SessionAnswers) -> Row:
    point = point_of(clean, CLEAN, 0.0, "")
    majority = np.bincount(clean.y).max() / len(clean.y)
    return Row(
        name=f"sim, new sessions, {target} by windows, {SETTING}: 23 °C, clean and still",
        value=point.accuracy, unit="accuracy",
        note=f"majority {majority:.3f}; grasps with an answer {point.grasps_answered:.3f}",
    )  # fmt: skip


def _condition_row(
    target: str, condition: str, clean: SessionAnswers, worse: dict[float, SessionAnswers]
) -> Row:
    unit, levels = LEVELS[condition]
    each = {level: loss_between(clean, answers, grasps=False) for level, answers in worse.items()}
    worst = max(each, key=lambda level: each[level].points)
    loss = each[worst]
    return Row(
        name=f"sim, new sessions, {target} by windows, {SETTING}: {condition} {levels[0]:g} … "
        f"{levels[-1]:g} {unit}, points lost at worst",
        value=loss.points, unit="points",
        note=f"worst at {worst:g}: {loss_words(loss)}; at {points_at(each)}",
    )  # fmt: skip
