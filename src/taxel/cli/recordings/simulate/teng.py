"""`taxel simulate teng`: write a data set of the simulated TENG hand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from rich.table import Table

from taxel.cli.options.rules import Only
from taxel.cli.printing import command, console, print_json, progress, say
from taxel.cli.recordings.simulate.need import need_simulators
from taxel.plain_text import number_of
from taxel.sim.teng.contact import HALF_WIDTH_MM
from taxel.windows.config import GATE_V, GRID_RATE_HZ

if TYPE_CHECKING:
    from taxel.sim.teng.hand import TengHandConfig

QUICK_SCANS = 16_000
"""A tenth of the thesis's: enough to see everything work, too few to judge a model."""


@dataclass(frozen=True, kw_only=True)
class Teng:
    """Write a data set of the simulated TENG hand, one recording per session."""

    output: Path
    """Folder to write to; it must not exist yet."""
    preset: Literal["honest", "paper"] = "honest"
    """honest: every session has all classes; paper: each class has its own session (leaks)."""
    seed: int = 0
    """Seed of everything random."""
    scans_per_class: int = 160_000
    """Scans of each shape, and of each material."""
    quick: bool = False
    """A small set: 16,000 scans per class."""
    sessions: int = 6
    """With --preset honest: number of sessions."""
    rate_hz: float = GRID_RATE_HZ
    """Scans a second, Hz; the windows' own grid unless given."""
    wiring: Literal["three-boards", "one-board"] = "three-boards"
    """one-board: all 12 channels on one converter, with hum and ghosting."""
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
    unknown: bool = False
    """Also grasp an elongated prism and a rubber composite, to test models not trained on them."""
    reference_v: float = 3.3
    """The converter's reference, V: 3.3 or 5."""
    size_mm: tuple[float, float] = HALF_WIDTH_MM
    """Half of the object's width from and to, mm."""
    contact_angle_deg: float = 0.0
    """Additional rotation of objects in the hand, beyond their random rotation, °."""
    fatigue: float = 0.0
    """Share of its output that a pad loses in 10,000 full presses, 0…1; 0: no wear."""
    json: bool = False
    """Print the table as JSON."""

    RULES: ClassVar = (
        Only(("scans-per-class",), "no --quick", lambda o: not o.quick),
        Only(("sessions",), "--preset honest", lambda o: o.preset == "honest"),
    )

    def run(self) -> None:
        """Simulate and print what was written."""
        need_simulators()
        from taxel.sources.simulated.data_sets import write_sessions

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
        from taxel.sources.simulated.teng_options import checked_config

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
            unknown=self.unknown,
            size_mm=self.size_mm,
            contact_angle_deg=self.contact_angle_deg,
            fatigue=self.fatigue,
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
        say(
            f"{number_of(len(rows), 'recording')}, {number_of(scans, 'scan', ',')}, "
            f"{gated / scans:.1%} above {GATE_V} V"
        )
        say("look: ", command("taxel", "view", self.output / f"{rows[0]['session']}.mcap"))
        if self.preset == "honest":
            train = ("taxel", "train", self.output, "--target", "shape", "--output", "runs/shape")
            say("next: ", command(*train))
        else:
            say("leaky: each class has a session of its own, so no honest split exists")
