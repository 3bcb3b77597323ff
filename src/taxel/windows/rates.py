"""The recordings' own rates: one grid where they differ, and when a scan is too old for a row.

Knows nothing about how windows are cut.

Background of our choices: docs/decisions/0003.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median_low

from taxel.recordings.reader import list_recordings, read_manifest
from taxel.windows.config import MOST_RATE_CHANGE, WindowConfig, largest_age_s

PAUSE_ROWS = 10
"""Lost rows after which a new stretch begins. Source: our choice, docs/decisions/0039."""


def rates_of(paths: Sequence[Path]) -> list[float]:
    """Return the own rate of each recording that states one, hertz.

    Args:
        paths: Recordings; of each, the head alone is read.

    Raises:
        BadRecording: A head is damaged.
    """
    rates = [read_manifest(path).sensor.rate_hz for path in paths]
    return [rate_hz for rate_hz in rates if rate_hz > 0]


def differ(rates_hz: Sequence[float]) -> bool:
    """Return whether rates are too far from the first one for own scans to be rows.

    Args:
        rates_hz: Each recording's own, hertz, above 0.
    """
    return any(max(own, rates_hz[0]) > MOST_RATE_CHANGE * min(own, rates_hz[0]) for own in rates_hz)


def with_common_grid(config: WindowConfig, *folders: Path) -> WindowConfig:
    """Return a window on a common grid where the recordings' own rates differ; else as it is.

    The grid has the median recording's rate, to three digits: half of the recordings are slower.

    Args:
        config: One that takes the sensor's own scans as rows, or is on a grid already.
        folders: Recordings: those to learn from; then those to test on alone, if there are any.

    Raises:
        BadRecording: A recording's head is damaged.
        BadDataset: There is no recording.
    """
    if config.grid_hz is not None:
        return config
    rates_hz = [rates_of(list_recordings(folder)) for folder in folders]
    if not rates_hz[0] or not any(map(differ, rates_hz)):
        return config
    return replace(config, grid_hz=float(f"{median_low(rates_hz[0]):.3g}"))


def fit_age(config: WindowConfig, rates_hz: Sequence[float]) -> WindowConfig:
    """Return a window that states when a value is too old; as it is where it does already.

    It is stored with what learns from these windows, so that the same holds live.

    Args:
        config: A window.
        rates_hz: The recordings' own, hertz.
    """
    if config.max_age_s is not None:
        return config
    usual_hz = median_low(rates_hz) if rates_hz else 0.0
    return replace(config, max_age_s=largest_age_s(usual_hz))


def fit_gap(config: WindowConfig, rates_hz: Sequence[float]) -> WindowConfig:
    """Return a window that a slow sensor's own scans do not end; as it is where scans are quick.

    Where two periods are longer than the pause that ends a window, each scan would be one alone.

    Args:
        config: A window.
        rates_hz: The recordings' own, hertz.
    """
    slowest_hz = min([*rates_hz, *([config.grid_hz] if config.grid_hz else [])], default=0.0)
    if slowest_hz <= 0 or config.max_gap_s >= 2.0 / slowest_hz:
        return config
    return replace(config, max_gap_s=PAUSE_ROWS / slowest_hz)


def rates_note(config: WindowConfig, rates_hz: Sequence[float]) -> list[str]:
    """Return a note where a grid lies amid the recordings' own rates, which differ.

    Args:
        config: How windows are cut.
        rates_hz: The recordings' own, hertz.
    """
    low_hz, high_hz = min(rates_hz, default=0.0), max(rates_hz, default=0.0)
    if config.grid_hz is None or not low_hz <= config.grid_hz <= high_hz or not differ(rates_hz):
        return []
    return [
        f"the recordings' own rates go from {low_hz:.3g} to {high_hz:.3g} scans/s: put on one grid "
        f"of {config.grid_hz:g} rows/s, each row the latest scan"
    ]
