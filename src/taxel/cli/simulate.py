"""`taxel simulate`: write recordings of a simulated sensor."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import tyro
from rich.table import Table

from taxel.cli.printing import console, print_json, progress
from taxel.errors import BadInput
from taxel.windows.config import GATE_V, GRID_RATE_HZ


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
    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Simulate and print what was written."""
        from taxel.sim.teng_hand import TengHandConfig

        try:
            config = TengHandConfig(
                preset=self.preset,
                seed=self.seed,
                wiring=self.wiring,
                rate_hz=self.rate_hz,
                scans_per_class=self.scans_per_class,
                sessions=self.sessions,
                force_n=self.force_n,
                temperature_c=self.temperature_c,
                humidity_pct=self.humidity_pct,
                dust=self.dust,
                moisture=self.moisture,
                moving=self.moving,
            )
        except ValueError as error:
            raise BadInput("settings that fit", str(error), "mend the options") from error
        with progress() as bar:
            task = bar.add_task("simulating", total=None)
            rows = write_sessions(
                self.output, config, lambda name: bar.update(task, description=name, advance=1)
            )
        if self.json:
            print_json(rows)
            return
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
        console.print(f"next: taxel train {self.output} --target shape --output runs/shape")


def simulate_presets(folder: Path, presets: tuple[str, ...], scans: int, seed: int) -> None:
    """Write folder/PRESET for each preset.

    Args:
        folder: Where to.
        presets: "honest", "paper".
        scans: Scans a class.
        seed: Seed of everything random.
    """
    from taxel.sim.teng_hand import TengHandConfig

    for preset in presets:
        config = TengHandConfig(
            preset="paper" if preset == "paper" else "honest",
            seed=seed,
            scans_per_class=scans,
            rate_hz=GRID_RATE_HZ,
        )
        write_sessions(folder / preset, config, lambda _: None)


def write_sessions(output: Path, config: Any, on_session: Any) -> list[dict[str, Any]]:
    """Write one recording a session into a new folder, whole or not at all.

    Args:
        output: The folder; it must not exist yet.
        config: A `TengHandConfig`.
        on_session: Called with each session's name.

    Raises:
        BadInput: The folder exists.
    """
    from taxel.recordings.manifest import Manifest
    from taxel.recordings.writer import Recorder
    from taxel.sim.teng_hand import sensor_info, simulate_sessions

    if output.exists():
        raise BadInput(
            "a folder that does not exist yet for --output", str(output), "choose another"
        )
    temporary = output.with_name(output.name + ".part")
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir(parents=True)
    rows = []
    try:
        for session in simulate_sessions(config):
            on_session(session.name)
            manifest = Manifest.started_now(
                sensor_info(config),
                groups={"session": session.name, **session.details},
                now_s=0.0,
            )
            with Recorder(temporary / f"{session.name}.mcap", manifest) as recorder:
                recorder.write(session.samples)
                for mark in session.marks:
                    recorder.mark(mark)
            rows.append(
                {
                    "session": session.name,
                    "scans": len(session.samples),
                    "gated": int((session.samples.values > GATE_V).any(axis=1).sum()),
                    "grasps": len(session.marks),
                    **session.details,
                }
            )
        temporary.rename(output)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return rows
