"""Data sets of simulated sensors: a folder with one recording a session.

Knows nothing about windows, models or the command line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from taxel.recordings.manifest import Manifest
from taxel.recordings.whole import fresh_folder
from taxel.recordings.writer import Recorder
from taxel.sim.teng.hand import (
    SimulatedSession,
    TengHandConfig,
    sensor_info,
    simulate_sessions,
)
from taxel.sources.simulated.teng_options import checked_config

DATA_SET_RATE_HZ = 100.0
"""Scans a second of the data sets: the windows' own grid (docs/decisions/0003)."""
_CONTACT_V = 1.55
"""Counted for the reader. Source: TENG thesis, section 3.5.1."""


def simulate_presets(folder: Path | str, presets: tuple[str, ...], scans: int, seed: int) -> None:
    """Write folder/PRESET for each preset.

    Args:
        folder: Where to.
        presets: "honest", "paper".
        scans: Scans a class.
        seed: Seed of everything random.
    """
    for preset in presets:
        config = checked_config(
            preset=preset, seed=seed, scans_per_class=scans, rate_hz=DATA_SET_RATE_HZ
        )
        write_sessions(Path(folder) / preset, config, lambda _: None)


def simulate_unknown(folder: Path, scans: int, seed: int) -> None:
    """Write the honest preset with an elongated prism and a rubber composite among the rest.

    Args:
        folder: Where to; it must not exist yet.
        scans: Scans a class.
        seed: Seed of everything random.
    """
    config = checked_config(
        seed=seed, scans_per_class=scans, rate_hz=DATA_SET_RATE_HZ, unknown=True
    )
    write_sessions(folder, config, lambda _: None)


def write_sessions(
    output: Path | str, config: TengHandConfig, on_session: Callable[[str], None]
) -> list[dict[str, Any]]:
    """Write one recording a session into a new folder, whole or not at all.

    Args:
        output: The folder; it must not exist yet.
        config: What is simulated.
        on_session: Called with each session's name before it is written.

    Returns:
        A row a session: its name, scans, scans above the gate, grasps and nuisances.

    Raises:
        BadInput: The folder exists.
        RecordingFailed: The disk refused.
    """
    with fresh_folder(Path(output)) as made:
        return [_write_session(made, session, config) for session in _announced(config, on_session)]


def _announced(
    config: TengHandConfig, on_session: Callable[[str], None]
) -> Iterator[SimulatedSession]:
    for session in simulate_sessions(config):
        on_session(session.name)
        yield session


def _write_session(
    folder: Path, session: SimulatedSession, config: TengHandConfig
) -> dict[str, Any]:
    manifest = Manifest.started_now(
        sensor_info(config),
        groups={"session": session.name, **session.details},
        now_s=0.0,
    )
    with Recorder(folder / f"{session.name}.mcap", manifest) as recorder:
        written = 0
        for mark in session.marks:  # each behind its scans, so that a replay knows it in time
            end = int(np.searchsorted(session.samples.fitted_s, mark.end_s, side="right"))
            recorder.write(session.samples[written:end])
            recorder.mark(mark)
            recorder.flush()
            written = end
        recorder.write(session.samples[written:])
    return {
        "session": session.name,
        "scans": len(session.samples),
        "gated": int((session.samples.values > _CONTACT_V).any(axis=1).sum()),
        "grasps": len(session.marks),
        **session.details,
    }
