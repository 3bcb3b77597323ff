"""Changes to a window in words: steps=50 stride=25 grid=own gate=none.

Knows nothing about recipes, verbs or what is done with a window.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taxel.errors import BadInput

if TYPE_CHECKING:
    from taxel.windows.config import WindowConfig

_TRUTHS = {"yes": True, "no": False}
_LAYOUTS = ("A", "B")


def changed_window(window: WindowConfig, words: Mapping[str, str]) -> WindowConfig:
    """Return a window with changes made; windows do not overlap where only `steps` is given.

    Args:
        window: The recipe's.
        words: Name of a change → its value as text.

    Raises:
        BadInput: There is no such change, or it does not fit.
    """
    for name in words:
        if name not in _READ:
            raise BadInput(f"--window with {', '.join(_READ)}", repr(name), "mend the name")
    changes: dict[str, Any] = {
        _FIELDS.get(name, name): _READ[name](f"--window {name}=", text)
        for name, text in words.items()
        if name != "gate"
    }
    if "gate" in words:
        changes["gate"] = _gate(words["gate"], changes.get("channels"))
    follow = changes.get("gate_follow_s", window.gate_follow_s)
    if follow is not None and not (changes.get("gate", window.gate) or 0.0) > 0.0:
        raise BadInput("a gate above 0 beside --window follow=", "none", "give one with gate=1.55")
    if "steps" in changes:
        changes.setdefault("stride", changes["steps"])
    _check_layout(window, changes)
    _check_levels(window, changes)
    return replace(window, **changes)


def _check_layout(window: WindowConfig, changes: Mapping[str, Any]) -> None:
    if changes.get("layout", window.layout) != "A":
        return
    if changes.get("gate", window.gate) is None:
        raise BadInput("a gate for layout A", "none", "give one with --window gate=1.55")
    if changes.get("wavelet", window.wavelet) is not None:
        raise BadInput("layout B for a wavelet", "layout A", "leave one of them out")


def _check_levels(window: WindowConfig, changes: Mapping[str, Any]) -> None:
    if changes.get("level_follow", window.level_follow) is None:
        return
    if changes.get("layout", window.layout) == "A":
        raise BadInput("layout B for levels that follow", "layout A", "leave one of them out")
    if (reference := changes.get("reference", window.reference)) is not None:
        raise BadInput("no reference touches beside levels that follow", repr(reference),
                       "add reference=none, or leave level= out")  # fmt: skip


def _count(option: str, text: str) -> int:
    if not re.fullmatch(r"0*[1-9][0-9]{0,8}", text):
        raise BadInput(
            f"{option}COUNT, a whole number of 1 to 999999999",
            repr(text),
            f"for example {option}12",
        )
    return int(text)


def _number(option: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadInput(f"a finite number for {option}", repr(text), f"for example {option}1.55")
    return value


def _number_or_none(option: str, text: str) -> float | None:
    return None if text == "none" else _number(option, text)


def _rate(option: str, text: str) -> float | None:
    value = None if text == "own" else _number(option, text)
    if value is not None and value <= 0:
        raise BadInput(f"{option}RATE above 0 Hz, or own", text, f"for example {option}100")
    return value


def _share(option: str, text: str) -> float:
    value = _number(option, text)
    if not 0 <= value < 1:
        raise BadInput(f"{option}SHARE of at least 0 and below 1", text, f"for example {option}0.1")
    return value


def _truth(option: str, text: str) -> bool:
    if text not in _TRUTHS:
        raise BadInput(f"{option}yes or {option}no", repr(text), "write one of them")
    return _TRUTHS[text]


def _layout(option: str, text: str) -> str:
    if text not in _LAYOUTS:
        raise BadInput(f"{option}A or {option}B", repr(text), "write one of them")
    return text


def _names(option: str, text: str) -> tuple[str, ...]:
    names = tuple(name for name in text.split(",") if name)
    if not names:
        raise BadInput(f"names for {option}", repr(text), f"for example {option}thumb,index")
    return names


def _text_or_none(option: str, text: str) -> str | None:
    return None if text == "none" else text


def _reference(option: str, text: str) -> str | None:
    from taxel.windows.reference import parse_reference

    if text == "none":
        return None
    parse_reference(text)
    return text


def _level(option: str, text: str) -> str | None:
    from taxel.windows.level_follow import parse_level_follow

    if text == "none":
        return None
    parse_level_follow(text)
    return text


def _gate(text: str, channels: tuple[str, ...] | None) -> float | None:
    """Return a gate given as a number, or measured from a recording of the array at rest.

    The recording is no part of the data set, so that nothing is measured on a test fold.
    """
    if not text.endswith(".mcap"):
        return _number_or_none("--window gate=", text)
    from taxel.recordings.reader import read_recording
    from taxel.windows.gate import noise_gate

    recording = read_recording(Path(text))
    samples, sensor = recording.samples, recording.manifest.sensor
    if channels is not None:
        try:
            samples = samples.only(sensor.indices(channels))
        except ValueError as error:
            raise BadInput(f"the channels of {text}", str(error), "mend channels=") from error
    try:
        return noise_gate(samples.values, samples.usable)
    except ValueError as error:
        raise BadInput(
            "a recording of the array at rest for --window gate=",
            f"{text}: {error}",
            "record some seconds without contact",
        ) from error


def _seconds_or_none(option: str, text: str) -> float | None:
    value = _number_or_none(option, text)
    if value is not None and value <= 0:
        raise BadInput(f"{option}SECONDS above 0, or none", repr(text), f"for example {option}30")
    return value


_FIELDS = {"grid": "grid_hz", "follow": "gate_follow_s", "level": "level_follow"}
"""Name of a change → the window's field, where it has another name."""
_READ: dict[str, Callable[[str, str], Any]] = {
    "steps": _count,
    "stride": _count,
    "grid": _rate,
    "gate": _number_or_none,
    "layout": _layout,
    "channels": _names,
    "pad": _truth,
    "tare": _truth,
    "wavelet": _text_or_none,
    "segment": _number_or_none,
    "reference": _reference,
    "level": _level,
    "fill": _share,
    "follow": _seconds_or_none,
    "subtract": _text_or_none,
}
"""Name of a change → what reads its value."""
