"""Conditions, through the simulator: the same hand and grasps, warm, humid, dusty, wet, moving,
at another force, size or contact angle, or worn.

A recogniser that was trained on honest sessions is judged on new ones, simulated at each
condition. Seeds of sessions and grasps are those of the base, so that sensors' gains, forces,
objects and order are the same and what differs is the condition. Each session
starts with its own reference touches, made at that condition. Knows nothing
about how recognisers are trained.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from taxel.decisions.recognition import RecogniseConfig
from taxel.errors import BadDataset, BadInput
from taxel.evaluation.robustness.curve import CLEAN, FaultPoint, mildest_first, point_of
from taxel.evaluation.robustness.touches import ANSWER_ALL, Model, Recorded, judge, recorded
from taxel.recordings.manifest import Manifest
from taxel.sim.teng.hand import sensor_info, simulate_sessions
from taxel.sources.simulated.data_sets import DATA_SET_RATE_HZ
from taxel.sources.simulated.teng_options import checked_config

BASE: Mapping[str, Any] = {
    "temperature_c": (23.0, 23.0),
    "dust": (0.0, 0.0),
    "moisture": (0.0, 0.0),
    "moving": 0.0,
}
"""23 °C, clean, dry, still and new; what is not named is drawn as in training. Source: our choice,
docs/decisions/0029."""
LEVELS: Mapping[str, tuple[str, tuple[float, ...]]] = {
    "temperature": ("°C", (20.0, 25.0, 30.0, 35.0)),
    "humidity": ("% RH", (30.0, 45.0, 55.0, 65.0, 80.0)),
    "dust": ("share of the pads", (0.1, 0.2, 0.3, 0.4, 0.5)),
    "moisture": ("share of the pads", (0.05, 0.1, 0.2, 0.3)),
    "moving": ("share of the grasps", (0.1, 0.3, 0.5, 1.0)),
    "force": ("N", (5.0, 2.0, 1.0, 0.5, 0.25)),
    "size": ("mm, half of the width", (24.0, 28.0, 34.0, 40.0, 48.0)),
    "angle": ("° turned", (5.0, 10.0, 20.0, 30.0)),
    "fatigue": ("full presses", (10_000.0, 30_000.0, 100_000.0)),
}
"""Condition → its unit and levels, the mildest first. Source: thesis, sections 2.5.1, 2.6 and 4.4,
and our choice beyond it, docs/decisions/0029 and 0047."""
WEATHER = ("temperature", "humidity", "dust", "moisture", "moving")
"""Conditions around the hand, as in section 4.4."""
GRASPS = ("force", "size", "angle", "fatigue")
"""Conditions of the grasp and of the pads, as in sections 2.5.1, 2.6 and 2.7."""
_FIELDS = {
    "temperature": "temperature_c",
    "humidity": "humidity_pct",
    "force": "force_n",
    "size": "size_mm",
    "angle": "contact_angle_deg",
    "fatigue": "worn_presses",
}
_NUMBERS = ("moving", "contact_angle_deg", "worn_presses")
"""Fields that are one number, not a range."""
FATIGUE = 0.2
"""Share of its output that a pad loses in 10,000 full presses where fatigue is swept. Source: our
choice, docs/decisions/0047."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NewSessions:
    """Which sessions a recogniser is judged on."""

    seed: int = 6023
    """Of gains, grasps and noise; must not be the training set's."""
    sessions: int = 10
    scans: int = 15_000
    """Scans of each session at 100 Hz: 150 s, about 37 grasps."""
    wider: Mapping[str, Any] = field(default_factory=dict)
    """Fields of `TengHandConfig` for all conditions, such as force_n."""


def plan_conditions(
    names: Sequence[str] = (), levels: Sequence[float] = ()
) -> dict[str, tuple[float, ...]]:
    """Return condition → levels, rising; all conditions, or each one's own levels, unless given.

    Raises:
        BadInput: There is no such condition, or a level lies outside the simulator's limits.
    """
    for name in names:
        if name not in LEVELS:
            raise BadInput(f"conditions among {', '.join(LEVELS)}", repr(name), "name one of them")
        for level in levels:
            settings_at(name, level)
    return {
        name: mildest_first(levels, LEVELS[name][1]) or LEVELS[name][1] for name in names or LEVELS
    }


def sweep_conditions(
    model: Model,
    plan: Mapping[str, Sequence[float]],
    which: NewSessions,
    config: RecogniseConfig = ANSWER_ALL,
    *,
    on_point: Callable[[FaultPoint], None] = lambda _: None,
) -> list[FaultPoint]:
    """Return the point at 23 °C, clean and still, then one a condition and level.

    Args:
        model: What predicts; trained on other sessions than `which`.
        plan: Condition → levels.
        which: Seeds and how many sessions.
        config: When an answer may be given.
        on_point: Called with each point.

    Raises:
        BadInput: A level lies outside the simulator's limits.
        BadBundle, BadDataset: As `judge` says; the latter also where sessions are too short.
    """
    points = []
    for name, level in [(CLEAN, 0.0), *((name, at) for name, own in plan.items() for at in own)]:
        points.append(condition_point(model, name, level, which, config))
        on_point(points[-1])
    return points


def condition_point(
    model: Model, name: str, level: float, which: NewSessions, config: RecogniseConfig
) -> FaultPoint:
    """Return the point of one level of one condition, or at the base.

    Raises:
        BadInput, BadBundle, BadDataset: As `sweep_conditions` says.
    """
    settings, unit = (dict(BASE), "") if name == CLEAN else (settings_at(name, level),
                                                             LEVELS[name][0])  # fmt: skip
    try:
        answers = judge(model, simulate_at(settings, which), config)
    except BadDataset as error:
        raise BadDataset(
            error.needed, f"{error.got}, of {which.scans / DATA_SET_RATE_HZ:g} s",
            "give a longer --session-s, such as 150; recordings with --data for a bundle whose "
            "objects sim://teng does not have",
        ) from error  # fmt: skip
    return point_of(answers, name, level, unit)


def settings_at(condition: str, level: float) -> dict[str, Any]:
    """Return the fields of `TengHandConfig` at one level of one condition.

    Raises:
        BadInput: The level lies outside the simulator's limits.
    """
    name = _FIELDS.get(condition, condition)
    settings = {**BASE, name: level if name in _NUMBERS else (level, level)}
    if condition == "fatigue":
        settings["fatigue"] = FATIGUE
    checked_config(**settings)
    return settings


def simulate_at(settings: Mapping[str, Any], which: NewSessions) -> list[Recorded]:
    """Return new sessions of the simulated hand.

    Args:
        settings: Fields of `TengHandConfig`, such as `settings_at` gives.
        which: Seeds and how many.

    Raises:
        BadInput: A setting lies outside its limits.
    """
    config = checked_config(
        **{
            "seed": which.seed,
            "sessions": which.sessions,
            # The simulator counts scans of each of three classes over all sessions.
            "scans_per_class": which.sessions * which.scans // 3,
            "rate_hz": DATA_SET_RATE_HZ,
            **which.wider,
            **settings,
        }
    )
    recordings = []
    for session in simulate_sessions(config):
        groups = {"session": session.name, **session.details}
        manifest = Manifest(sensor=sensor_info(config), groups=groups)
        file = Path(f"{session.name}.mcap")
        recordings.append(recorded(file, manifest, session.samples, session.marks))
    return recordings
