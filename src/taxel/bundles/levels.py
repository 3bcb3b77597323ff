"""The level of a sensor pad or session, from a few touches of a known object.

What a changed pad, gel layer, gain or humidity does to each channel, beside what the bundle
was trained with. NumPy only. Knows nothing about networks or versions.

Background of our choices: docs/decisions/0026.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.contract import Contract
from taxel.errors import BadBundle, BadDataset
from taxel.labels.trials import order_in_time
from taxel.name_order import counting_order
from taxel.plain_text import visible_names
from taxel.windows.dataset import Dataset, load_dataset
from taxel.windows.reference import NOTHING, parse_reference, touch_level

LARGE_CHANGE = 3.0
"""A channel that changed by this factor or more, either way, is warned of. Source: our choice,
docs/decisions/0028: gains of pads differ by 0.5 to 2."""

MOST_SATURATED = 0.1
"""Share of a channel's rows at the converter's limit above which it is warned of: its level is
then larger than what was measured. Source: our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchLevel:
    """Each channel's level, measured by a few touches."""

    level: NDArray[np.float32]
    """Shape (channels,), in the channels' units; a silent channel keeps its old level."""
    change: NDArray[np.float32]
    """Shape (channels,): the level over the one that the bundle holds for."""
    silent: NDArray[np.bool_]
    """Shape (channels,): True where the touches gave nothing."""
    touches: int
    """How many trials were used."""
    windows: int
    sessions: frozenset[str]
    """Names of the touches' sessions; empty where they name none."""
    digest: str
    """SHA-256 over the recordings' values, hexadecimal."""
    warnings: tuple[str, ...]
    """What a reader must know, a line each."""


def measure_level(path: Path | str, contract: Contract, *, count: int | None = None) -> TouchLevel:
    """Return the level of a recording's touches under a bundle's own window.

    Where trials carry the key that the bundle's reference names, those of its value are used;
    where none does, all are, as touches of the known object and nothing else.

    Args:
        path: A recording, or a folder of one session.
        contract: What the bundle or run says of itself.
        count: Only the first so many touches; all unless given.

    Raises:
        BadBundle: It was trained without reference touches, or for another sensor.
        BadDataset: There is no such touch.
        BadRecording: A recording is damaged.
    """
    if contract.reference is None:
        raise BadBundle(
            "a bundle trained with reference touches", "one without",
            "train it with --recipe teng-referenced, or with --window reference=…",
        )  # fmt: skip
    path = Path(path)
    dataset = load_dataset(path, replace(contract.window, reference=None))
    contract.check_sensor(dataset.sensor)
    reference = parse_reference(contract.reference.touches)
    named = [reference.key in {**trial.groups, **trial.labels} for trial in dataset.trials]
    chosen = [
        i for i, trial in enumerate(dataset.trials) if not any(named) or reference.matches(trial)
    ]
    chosen = sorted(chosen, key=lambda i: order_in_time(dataset.trials[i]))
    chosen = chosen[:count]
    if not chosen:
        raise BadDataset(
            f"touches of {reference.key}={reference.value} in {path}", "other objects only",
            "touch the known object a few times, or record it alone without labels",
        )  # fmt: skip
    used = np.isin(dataset.trial, chosen)
    values, mask = dataset.windows.values[used], dataset.windows.mask[used]
    measured = touch_level(values, mask)
    old = contract.reference.level
    silent = ~(values[mask] != 0).any(axis=0) | (measured < NOTHING * old)
    level = np.where(silent, old, measured).astype(np.float32)
    change = (level / old).astype(np.float32)
    sessions = frozenset(
        dataset.trials[i].groups["session"] for i in chosen if "session" in dataset.trials[i].groups
    )
    return TouchLevel(
        level=level,
        change=change,
        silent=silent,
        touches=len(chosen),
        windows=int(used.sum()),
        sessions=sessions,
        digest=dataset.digest,
        warnings=_warnings(contract.channels, change, silent)
        + _saturated(path, dataset, np.array(chosen), contract.channels)
        + _mixed(sessions),
    )


def _mixed(sessions: frozenset[str]) -> tuple[str, ...]:
    """Return a line where touches of several sessions make one level, which is none of theirs."""
    if len(sessions) < 2:
        return ()
    names = sorted(sessions, key=counting_order)
    return (
        f"touches of {len(names)} sessions ({visible_names(names)}) give one level together: "
        "name the recordings of one session",
    )


def _warnings(
    channels: tuple[str, ...], change: NDArray[np.float32], silent: NDArray[np.bool_]
) -> tuple[str, ...]:
    lines = [
        f"{name} gives nothing: look at its wire; its level is left as it was"
        for name, quiet in zip(channels, silent, strict=True)
        if quiet
    ]
    lines += [
        f"{name} changed by a factor of {factor:.2f}: clean or change its pad, or touch again"
        for name, factor in zip(channels, change, strict=True)
        if not 1.0 / LARGE_CHANGE < factor < LARGE_CHANGE
    ]
    return tuple(lines)


def _saturated(
    path: Path, dataset: Dataset, own: NDArray[np.intp], channels: tuple[str, ...]
) -> tuple[str, ...]:
    """Return a line for each channel that stood at the converter's limit in the touches."""
    full = dataset.sensor.full_scale
    used = np.isin(dataset.trial, own)
    if full is None or not (dataset.windows.saturated[used] > 0).any():
        return ()
    if dataset.config.tare or dataset.config.wavelet:  # the limit cannot be read off such values
        dataset = load_dataset(path, replace(dataset.config, tare=False, wavelet=None))
    rows = dataset.windows.values[used][dataset.windows.mask[used]]
    shares = (rows >= np.float32(full)).mean(axis=0)
    return tuple(
        f"{name} stood at the converter's limit in {share:.0%} of the rows: "
        "its level is too low; touch more softly"
        for name, share in zip(channels, shares, strict=True)
        if share > MOST_SATURATED
    )
