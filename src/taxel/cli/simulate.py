"""`taxel simulate`: write recordings of a simulated sensor."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import tyro
from rich.table import Table

from taxel.cli.printing import console, print_json, progress
from taxel.errors import BadInput, MissingExtra, RecordingFailed
from taxel.windows.config import GATE_V, GRID_RATE_HZ

if TYPE_CHECKING:
    from taxel.sim.teng_hand import SimulatedSession, TengHandConfig

QUICK_SCANS = 16_000
"""A tenth of the thesis's: enough to see everything work, too few to judge a model."""


@dataclass(frozen=True, kw_only=True)
class Simulate:
    """Write a data set of the simulated TENG hand: one recording a session."""

    what: tyro.conf.Positional[Literal["teng"]]
    """What to simulate."""
    output: Path
    """Folder to write to; it must not exist yet."""
    preset: Literal["honest", "paper"] = "honest"
    """honest: sessions shared by all classes; paper: one session a class (leaky)."""
    seed: int = 0
    """Seed of everything random."""
    scans_per_class: int = 160_000
    """Scans of each shape, and of each material."""
    quick: bool = False
    """A small set: 16,000 scans a class, whatever --scans-per-class says."""
    sessions: int = 6
    """Sessions of the honest preset."""
    rate_hz: float = GRID_RATE_HZ
    """Scans a second, Hz; the windows' own grid unless given."""
    wiring: Literal["three-boards", "one-board"] = "three-boards"
    """one-board: all 12 channels on one converter, with hum and ghosts."""
    force_n: tuple[float, float] = (0.5, 5.0)
    """Grip force from and to, N."""
    temperature_c: tuple[float, float] = (20.0, 35.0)
    """Temperature from and to, °C."""
    humidity_pct: tuple[float, float] = (30.0, 65.0)
    """Relative humidity from and to, %."""
    dust: tuple[float, float] = (0.0, 0.3)
    """Share of the pads covered with dust, from and to, 0…1."""
    moisture: tuple[float, float] = (0.0, 0.1)
    """Share of the pads that is wet, from and to, 0…1."""
    moving: float = 0.1
    """Share of grasps whose object moves, 0…1."""
    reference_v: float = 3.3
    """The converter's reference, V: 3.3 or 5."""
    json: bool = False
    """Print the table as JSON."""

    def run(self) -> None:
        """Simulate and print what was written."""
        config = self._config()
        with progress() as bar:
            task = bar.add_task("simulating", total=None)
            rows = write_sessions(
                self.output, config, lambda name: bar.update(task, description=name, advance=1)
            )
        if self.json:
            print_json(rows)
        else:
            self._print(rows)

    def _config(self) -> TengHandConfig:
        _need_simulators()
        from taxel.sources.teng_options import checked_config

        return checked_config(
            preset=self.preset,
            seed=self.seed,
            wiring=self.wiring,
            rate_hz=self.rate_hz,
            scans_per_class=QUICK_SCANS if self.quick else self.scans_per_class,
            sessions=self.sessions,
            force_n=self.force_n,
            temperature_c=self.temperature_c,
            humidity_pct=self.humidity_pct,
            dust=self.dust,
            moisture=self.moisture,
            moving=self.moving,
            reference_v=self.reference_v,
        )

    def _print(self, rows: list[dict[str, Any]]) -> None:
        table = Table(title=f"{self.output}, preset {self.preset}", title_justify="left")
        for column in ("session", "scans", f"above {GATE_V} V", "grasps", "°C", "% RH"):
            table.add_column(column, justify="left" if column == "session" else "right")
        for row in rows:
            table.add_row(
                row["session"],
                f"{row['scans']:,}",
                f"{row['gated'] / row['scans']:.1%}",
                str(row["grasps"]),
                row["temperature_c"],
                row["humidity_pct"],
            )
        console.print(table)
        scans, gated = sum(row["scans"] for row in rows), sum(row["gated"] for row in rows)
        print(f"{len(rows)} recordings, {scans:,} scans, {gated / scans:.1%} above {GATE_V} V")
        print(f"look:  taxel view {self.output / rows[0]['session']}.mcap")
        if self.preset == "honest":
            print(f"next:  taxel train {self.output} --target shape --output runs/shape")
        else:
            print("leaky: each class has a session of its own, so no honest split exists")


def simulate_presets(folder: Path, presets: tuple[str, ...], scans: int, seed: int) -> None:
    """Write folder/PRESET for each preset.

    Args:
        folder: Where to.
        presets: "honest", "paper".
        scans: Scans a class.
        seed: Seed of everything random.
    """
    _need_simulators()
    from taxel.sources.teng_options import checked_config

    for preset in presets:
        config = checked_config(
            preset=preset, seed=seed, scans_per_class=scans, rate_hz=GRID_RATE_HZ
        )
        write_sessions(folder / preset, config, lambda _: None)


def write_sessions(
    output: Path, config: TengHandConfig, on_session: Callable[[str], None]
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
    if output.exists():
        raise BadInput(
            "a folder that does not exist yet for --output", str(output), "choose another"
        )
    temporary = output.with_name(f".{output.name}.{os.getpid()}.part")
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        temporary.mkdir()
    except OSError as error:
        raise _refused(output, error) from error
    try:
        rows = [
            _write_session(temporary, session, config) for session in _announced(config, on_session)
        ]
        os.rename(temporary, output)
    except RecordingFailed:
        raise
    except OSError as error:
        raise _refused(output, error) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return rows


def _announced(
    config: TengHandConfig, on_session: Callable[[str], None]
) -> Iterator[SimulatedSession]:
    from taxel.sim.teng_hand import simulate_sessions

    for session in simulate_sessions(config):
        on_session(session.name)
        yield session


def _write_session(
    folder: Path, session: SimulatedSession, config: TengHandConfig
) -> dict[str, Any]:
    from taxel.recordings.manifest import Manifest
    from taxel.recordings.writer import Recorder
    from taxel.sim.teng_hand import sensor_info

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
        "gated": int((session.samples.values > GATE_V).any(axis=1).sum()),
        "grasps": len(session.marks),
        **session.details,
    }


def _need_simulators() -> None:
    try:
        from taxel.sim import teng_hand  # noqa: F401 (only whether its packages are there)
    except ModuleNotFoundError as error:
        raise MissingExtra(error.name or "scipy", "sim", "the simulators") from error


def _refused(path: Path, error: OSError) -> RecordingFailed:
    return RecordingFailed(
        f"needed to write {path}; got {error.strerror or error}; choose another place."
    )
