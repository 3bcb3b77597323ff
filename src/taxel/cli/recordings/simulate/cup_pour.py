"""`taxel simulate cup-pour`: two tactile cameras hold a cup that is filled."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Annotated, ClassVar, Literal

import tyro
from rich.table import Table

from taxel.cli.options.rules import Only
from taxel.cli.options.work import WorkOptions
from taxel.cli.printing import command, console, print_json, progress, say
from taxel.cli.recordings.simulate.need import need_simulators
from taxel.errors import BadInput
from taxel.plain_text import number_of

SimulatedKind = Literal[
    "pour", "still", "no-slip-pour", "bump", "grip-drop", "late-slip",
    "lift", "tilt", "carry", "hand-over", "collision",
]  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class CupPour:
    """Write recordings of two simulated tactile cameras that hold a cup while it is filled.

    One recording per pour. The same command continues an interrupted set.
    """

    output: Path
    """Folder to write to; it must not exist yet."""
    seed: int = 0
    """Seed of everything random."""
    quick: bool = False
    """A small set: 2 cups × 2 forces."""
    cups: int = 5
    """How many cups (the paper: 5)."""
    first_cup: int = 0
    """Number of the first cup; sets with other numbers share no cup."""
    repetitions: int = 1
    """Pours of each cup, position and force."""
    negatives: float = 0.0
    """Bumps, grip drops, pours without slip and slips after the pour, as a share of the pours,
    0…1."""
    kinds: tuple[SimulatedKind, ...] = ()
    """Trials of these kinds for each cup, position and force, instead of the paper's pours."""
    approach: bool = False
    """Begin each recording with open jaws about a cup that stands on a table."""
    forces_n: tuple[float, ...] = (15.0, 25.0, 40.0, 50.0)
    """Commanded grip forces, N."""
    duration_s: float = 6.0
    """Length of a recording, s."""
    camera_hz: float = 25.0
    """Images a second that the cameras take, Hz; the video has 60 frames a second and repeats
    them, as real ones do."""
    gel: Literal[1, 2] = 1
    """How the gels shear: 1 each as one rigid piece, 2 as an elastic layer whose rim slips first;
    the cups move alike in both."""
    json: bool = False
    """Print the table as JSON."""
    work: Annotated[WorkOptions, tyro.conf.arg(name="")] = field(default_factory=WorkOptions)

    RULES: ClassVar = (
        Only(("cups", "forces-n"), "no --quick", lambda o: not o.quick),
        Only(("negatives",), "no --kinds", lambda o: not o.kinds),
    )

    def run(self) -> None:
        """Simulate and print what was written."""
        need_simulators()
        from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
        from taxel.sim.pour.cups import kind_named
        from taxel.sources.simulated.pour_folder import write_pours

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
                kinds=tuple(kind_named(kind) for kind in self.kinds),
                approach=self.approach,
            )
            if not 1.0 <= self.camera_hz <= 60.0:
                raise ValueError(f"needed --camera-hz within 1 and 60; got {self.camera_hz:g}")
        except ValueError as error:
            raise BadInput("a set that can be simulated", str(error), "mend the option") from error
        with self.work.open(), progress() as bar:
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
            at_force = [row for row in rows if row["force_n"] == force_n]
            counts = [sum(row["outcome"] == name for row in at_force)
                      for name in ("hold", "gross slip", "drop")]  # fmt: skip
            slip_um = median(row["slip_um"] for row in at_force)
            table.add_row(
                f"{force_n:g} N", str(len(at_force)), *map(str, counts), f"{slip_um:.0f} µm"
            )
        console.print(table)
        say(f"{number_of(len(rows), 'recording')} of {self.duration_s:g} s, two cameras each")
        say("look: ", command("taxel", "view", self.output / f"{rows[0]['run']}.mcap"))
        say("next: ", self._next())

    def _next(self) -> str:
        words = ("taxel", "reproduce", "transition-tables", "--data", self.output)
        return command(*words)
