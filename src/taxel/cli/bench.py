"""`taxel bench`: measured figures beside their goals."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Literal

import tyro

from taxel.cli.printing import console, print_json, progress


@dataclass(frozen=True, kw_only=True)
class Bench:
    """Measure what taxel promises, in this run, on this machine."""

    name: tyro.conf.Positional[
        Literal["teng", "transitions", "faults", "closed-loop", "soak", "boards"]
    ]
    """Which figures."""
    full: bool = False
    """Also measure what takes longer than a few minutes, and keep it with a stamp."""
    data: Path | None = None
    """Folder that holds teng-glove/, icub-grasp/ and gelsight-slip/, for --full."""
    json: bool = False
    """Print JSON: a list of {name, value, unit, goal, ok, note, stamp}."""

    def run(self) -> None:
        """Measure and print."""
        from taxel.bench.rows import measure, rows_table, store, stored

        bench = import_module(f"taxel.bench.{self.name.replace('-', '_')}")
        with progress() as bar:
            task = bar.add_task("starting", total=None)

            def on_step(line: str) -> None:
                bar.update(task, description=line, advance=1)

            rows = measure(bench.quick_steps(), on_step)
            if self.full:
                slow = measure(bench.full_steps(self.data), on_step)
                rows += store(self.name, slow, bench.data_digest(self.data))
            else:
                rows += stored(self.name)
        if self.json:
            print_json([asdict(one) for one in rows])
        else:
            console.print(rows_table(rows))
