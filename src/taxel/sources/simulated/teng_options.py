"""What may be asked of the simulated hand: options as text, and the limits of its settings.

Knows nothing about streams, clocks or files.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin, get_type_hints

from taxel.errors import BadInput, BadSource
from taxel.plain_text import number_of
from taxel.sim.teng.constants import MATERIALS, SHAPES
from taxel.sim.teng.hand import TengHandConfig
from taxel.sim.teng.unknown_objects import UNKNOWN_MATERIALS, UNKNOWN_SHAPES

_OF_DATA_SETS = ("scans_per_class", "sessions")
"""Fields of `TengHandConfig` that mean nothing to a stream without end."""
OPTIONS: dict[str, Any] = {
    **{k: v for k, v in get_type_hints(TengHandConfig).items() if k not in _OF_DATA_SETS},
    "shape": Literal[SHAPES + UNKNOWN_SHAPES],
    "material": Literal[MATERIALS + UNKNOWN_MATERIALS],
    "seconds": float,
}
"""Option of the address → its type; `speed` comes on top."""

_TRUTHS = {"yes": True, "no": False}

LIMITS: dict[str, tuple[float, float]] = {
    "seed": (0, 1_000_000_000),
    # A grasp lasts seconds: below 1 Hz it holds no scans, above 100 kHz it fills the memory.
    "rate_hz": (1, 100_000),
    "scans_per_class": (1, 100_000_000),
    "sessions": (1, 10_000),
    "force_n": (0.001, 100),
    "temperature_c": (-40, 85),
    "humidity_pct": (0, 100),
    "dust": (0, 1),
    "moisture": (0, 1),
    "moving": (0, 1),
    "reference_v": (1, 5),
    "size_mm": (10, 100),
    "contact_angle_deg": (0, 40),
    "fatigue": (0, 0.999),
    "worn_presses": (0, 1e9),
    "pickup_v": (0, 3.3),
}
"""Field → its smallest and largest value, in its own unit. Source: shares and percentages by
definition, temperatures of industrial parts, the rest our choice (docs/decisions/0006)."""


@dataclass(frozen=True, slots=True)
class StreamChoice:
    """What an address may ask beside the simulator's settings."""

    shape: str | None = None
    material: str | None = None
    seconds: float = math.inf
    """Length of the stream, seconds."""


def parse_options(options: Mapping[str, str]) -> tuple[TengHandConfig, StreamChoice]:
    """Return the settings that an address asks for.

    Raises:
        BadSource: An option is unknown, of the wrong kind or outside its limits.
    """
    chosen = {key: _parse(key, text) for key, text in options.items()}
    own = {key: chosen.pop(key) for key in ("shape", "material", "seconds") if key in chosen}
    choice = StreamChoice(**own)
    if not choice.seconds > 0:
        raise _bad("seconds", "a time above 0 s", f"{choice.seconds:g}")
    try:
        return checked_config(**chosen), choice
    except BadInput as error:
        raise BadSource(f"{error.needed} in the address", error.got, error.mend) from error


def checked_config(**settings: Any) -> TengHandConfig:
    """Return the simulator's settings, each within its limits.

    Args:
        settings: Fields of `TengHandConfig`.

    Raises:
        BadInput: One lies outside, or is none of the names that there are.
    """
    for name, value in settings.items():
        low, high = LIMITS.get(name, (-math.inf, math.inf))
        ends = value if isinstance(value, tuple) else (value,)
        if isinstance(value, str):
            if value not in (known := get_args(OPTIONS.get(name))):
                raise BadInput(
                    f"{name} among {', '.join(known)}", repr(value), "choose one of them"
                )
            continue
        if not all(low <= end <= high for end in ends) or ends[0] > ends[-1]:
            order = ", the smaller first" if len(ends) > 1 else ""
            got = " to ".join(f"{end:g}" for end in ends)
            raise BadInput(f"{name} within {low:g} and {high:g}{order}", got, "choose another")
    config = TengHandConfig(**settings)
    scans = len(config.shapes) * config.scans_per_class
    if config.preset == "honest" and scans < config.sessions:
        raise BadInput(
            f"a scan for each of {number_of(config.sessions, 'session')}",
            f"{scans}",
            "simulate more a class",
        )
    return config


def _parse(key: str, text: str) -> Any:
    """Return an option's value by the type of its field."""
    if key not in OPTIONS:
        raise BadSource(
            f"options of sim://teng among {', '.join([*OPTIONS, 'speed'])}",
            repr(key),
            "mend the address",
        )
    kind = OPTIONS[key]
    if get_origin(kind) is Literal:
        if text not in get_args(kind):
            raise _bad(key, f"one of {', '.join(get_args(kind))}", repr(text))
        return text
    if kind is bool:
        if text not in _TRUTHS:
            raise _bad(key, f"one of {', '.join(_TRUTHS)}", repr(text))
        return _TRUTHS[text]
    try:
        if get_origin(kind) is tuple:
            low, _, high = text.partition("..")
            return float(low), float(high or low)
        return int(text) if kind is int else float(text)
    except ValueError as error:
        forms = {int: "a whole number", float: "a number"}
        raise _bad(key, forms.get(kind, "a number, or a range such as 1..5"), repr(text)) from error


def _bad(key: str, needed: str, got: str) -> BadSource:
    return BadSource(f"{key} of sim://teng as {needed}", got, "mend the address")
