"""`taxel reproduce table-4-1`: Table 4.1 of the TENG thesis."""

from __future__ import annotations

import tempfile
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

from taxel.cli.evaluation.html_pages import older_page, say_page
from taxel.cli.options.rules import Only
from taxel.cli.printing import console, print_json, progress, say
from taxel.errors import BadInput

if TYPE_CHECKING:
    from taxel.evaluation.teng.table_4_1 import Section, TengTableConfig


@dataclass(frozen=True, kw_only=True)
class Table41:
    """Print Table 4.1 of the TENG thesis, with our 2D and 1D CNN on the simulated hand beside it.

    Each network under both splits: random windows, as in the thesis, and sessions held out.
    """

    preset: Literal["honest", "paper", "both"] = "both"
    """Simulated data sets: honest (sessions shared by all classes), paper (one session a class)."""
    data: Path | None = None
    """A folder that holds honest/ and paper/; simulated unless given."""
    scans_per_class: int = 160_000
    """Scans a class to simulate (the thesis: about 160,000)."""
    epochs: int | None = None
    """Passes over the training windows; as the thesis unless given."""
    seed: int = 0
    """Seed of simulation, weights, order and folds."""
    html: Path | None = None
    """Write a self-contained page with figures to this file."""
    json: bool = False
    """Print JSON."""

    RULES: ClassVar = (Only(("scans-per-class",), "no --data", lambda o: o.data is None),)

    def run(self) -> None:
        """Measure and print."""
        from taxel.evaluation.teng.table_4_1 import TengTableConfig
        from taxel.training.loop import TrainConfig

        if self.epochs is not None and self.epochs < 1:
            raise BadInput("--epochs of at least 1", str(self.epochs), "give a larger number")
        older = older_page(self.html)
        train = TrainConfig(seed=self.seed)
        if self.epochs is not None:
            train = replace(train, epochs=self.epochs)
        sections = self._sections(TengTableConfig(train=train, seed=self.seed))
        if self.json:
            print_json([asdict(section) for section in sections])
            return
        from taxel.views.tables.results import teng_sections

        console.print(teng_sections(sections))
        training_s = sum(c.training_s for s in sections for c in s.columns.values()
                         if c.model != "minirocket")  # fmt: skip
        say(
            f"training of both networks, all of the above: {training_s:.0f} s. "
            "95 % CI, bootstrapped over sessions."
        )
        say_page(self.html, older, silent=False)

    def _sections(self, config: TengTableConfig) -> list[Section]:
        from taxel.evaluation.teng.table_4_1 import section_plan, teng_table
        from taxel.sources.simulated.data_sets import simulate_presets

        presets = ("honest", "paper") if self.preset == "both" else (self.preset,)
        with tempfile.TemporaryDirectory(prefix="taxel-") as scratch, progress() as bar:
            folder = self.data or Path(scratch)
            if self.data is None:
                simulate_presets(folder, presets, self.scans_per_class, self.seed)
            folders = {preset: folder / preset for preset in presets}
            task = bar.add_task("starting", total=len(section_plan(presets)))
            sections = teng_table(
                folders, config, lambda line: bar.update(task, description=line, advance=1)
            )
            if self.html is not None:
                from taxel.views.report import write_teng_report

                write_teng_report(self.html, sections, folders)
        return sections
