"""`taxel simulate`: write recordings of a simulated sensor."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tyro
from rich.table import Table

from taxel.cli.printing import command, console, print_json, progress, say
from taxel.errors import BadInput, MissingExtra
from taxel.windows.config import GATE_V, GRID_RATE_HZ

if TYPE_CHECKING:
    from taxel.sim.teng_hand import TengHandConfig

QUICK_SCANS = 16_000
"""A tenth of the thesis's: enough to see everything work, too few to judge a model."""


@dataclass(frozen=True, kw_only=True)
class Simulate:
    """Write a data set of a simulated sensor.

    teng: the TENG hand, one recording a session. cup-pour: two tactile cameras hold a cup that
    is filled, one recording a pour.
    """

    what: tyro.conf.Positional[Literal["teng", "cup-pour"]]
    """What to simulate."""
    output: Path
    """Folder to write to; it must not exist yet."""
    preset: Literal["honest", "paper"] = "honest"
    """teng: honest: sessions shared by all classes; paper: one session a class (leaky)."""
    seed: int = 0
    """Seed of everything random."""
    scans_per_class: int = 160_000
    """Scans of each shape, and of each material."""
    quick: bool = False
    """A small set: 16,000 scans a class, or 2 cups × 2 forces, whatever else is said."""
    cups: int = 5
    """cup-pour: how many cups (the paper: 5)."""
    first_cup: int = 0
    """cup-pour: number of the first cup; sets with other numbers share no cup."""
    repetitions: int = 1
    """cup-pour: pours of each cup, position and force."""
    negatives: float = 0.0
    """cup-pour: bumps, grip drops, pours without slip and slips after the pour, as a share of
    the pours, 0…1."""
    forces_n: tuple[float, ...] = (15.0, 25.0, 40.0, 50.0)
    """cup-pour: commanded grip forces, N."""
    duration_s: float = 6.0
    """cup-pour: length of a recording, s."""
    camera_hz: float = 25.0
    """cup-pour: images a second that the cameras take, Hz; the video has 60 frames a second
    and repeats them, as real ones do."""
    gel: Literal[1, 2] = 1
    """cup-pour: how the gels shear: 1 each as one rigid piece, 2 as an elastic layer whose rim
    slips first; the cups move alike in both."""
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
    unknown: bool = False
    """teng: among the rest an elongated prism and a rubber composite, for objects that a
    recogniser has never learned."""
    reference_v: float = 3.3
    """The converter's reference, V: 3.3 or 5."""
    json: bool = False
    """Print the table as JSON."""

    def run(self) -> None:
        """Simulate and print what was written."""
        _need_simulators()
        if self.what == "cup-pour":
            self._pours()
            return
        from taxel.sources.data_sets import write_sessions

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
            unknown=self.unknown,
        )

    def _pours(self) -> None:
        from taxel.sim.cup_pour import CupPourConfig, list_runs
        from taxel.sources.pour_sets import write_pours

        try:
            config = CupPourConfig(
                seed=self.seed,
                cups=2 if self.quick else self.cups,
                first_cup=self.first_cup,
                forces_n=(15.0, 50.0) if self.quick else self.forces_n,
                repetitions=self.repetitions,
                negatives=self.negatives,
                duration_s=self.duration_s,
                gel=self.gel,
            )
            if not 1.0 <= self.camera_hz <= 60.0:
                raise ValueError(f"needed --camera-hz within 1 and 60; got {self.camera_hz:g}")
        except ValueError as error:
            raise BadInput("a set that can be simulated", str(error), "mend the option") from error
        with progress() as bar:
            task = bar.add_task("simulating", total=len(list_runs(config)))
            rows = write_pours(
                self.output,
                config,
                lambda row: bar.update(task, description=row["run"], advance=1),
                camera_hz=self.camera_hz,
            )
        if self.json:
            print_json(rows)
            return
        table = Table(title=f"{self.output}", title_justify="left")
        for column in ("force", "pours", "hold", "gross slip", "drop", "median slip"):
            table.add_column(column, justify="right")
        for force_n in config.forces_n:
            own = [row for row in rows if row["force_n"] == force_n]
            counts = [sum(row["outcome"] == name for row in own)
                      for name in ("hold", "gross slip", "drop")]  # fmt: skip
            slip_um = sorted(row["slip_um"] for row in own)[len(own) // 2]
            table.add_row(f"{force_n:g} N", str(len(own)), *map(str, counts), f"{slip_um:.0f} µm")
        console.print(table)
        say(f"{len(rows)} recordings of {self.duration_s:g} s, two cameras each")
        say("look: ", command("taxel", "view", self.output / f"{rows[0]['run']}.mcap"))
        say("next: ", command("taxel", "evaluate", "transition-tables", "--data", self.output))

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
        say(f"{len(rows)} recordings, {scans:,} scans, {gated / scans:.1%} above {GATE_V} V")
        say("look: ", command("taxel", "view", self.output / f"{rows[0]['session']}.mcap"))
        if self.preset == "honest":
            train = ("taxel", "train", self.output, "--target", "shape", "--output", "runs/shape")
            say("next: ", command(*train))
        else:
            say("leaky: each class has a session of its own, so no honest split exists")


def _need_simulators() -> None:
    try:
        import scipy  # noqa: F401
    except ModuleNotFoundError as error:
        raise MissingExtra("scipy", "sim", "the simulators") from error
