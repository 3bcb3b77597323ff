"""`taxel reproduce teng-cleaning`: what denoising, segmentation and augmentation give."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from taxel.cli.options.arrays import RecipeOptions
from taxel.cli.options.hand_sets import comparison_config, given_or_simulated_hand
from taxel.cli.options.rules import Only
from taxel.cli.printing import console, print_json, progress

RUNS = 3
"""Runs of each way of cleaning: simulated data sets, or seeds where a folder is given."""


@dataclass(frozen=True, kw_only=True)
class TengCleaning:
    """Print what denoising, segmentation and augmentation give cnn2d, groups held out.

    Three runs: three simulated data sets, or three seeds on the recordings given.
    """

    data: Path | None = None
    """A folder of recordings of an array; the simulated hand unless given."""
    scans_per_class: int = 160_000
    """Scans a class to simulate."""
    fold_count: int = 5
    """With --data: parts of the split; simulated sessions are each held out once."""
    json: bool = False
    """Print JSON."""
    recipe: Annotated[RecipeOptions, tyro.conf.arg(name="")] = field(default_factory=RecipeOptions)

    RULES: ClassVar = (
        Only(("scans-per-class",), "no --data", lambda o: o.data is None),
        Only(("fold-count",), "--data", lambda o: o.data is not None),
    )

    def run(self) -> None:
        """Measure and print."""
        from taxel.evaluation.teng.cleaning_gains import compare_cleaning

        config = comparison_config(self.data, self.recipe, self.fold_count)
        seeds = [self.recipe.seed + run for run in range(RUNS)]
        sets = given_or_simulated_hand(self.data, self.scans_per_class, seeds)
        with sets as folders, progress() as bar:
            task = bar.add_task("starting", total=None)
            gains, trivial = compare_cleaning(
                list(zip(folders, seeds, strict=True)),
                config,
                lambda line: bar.update(task, description=line, advance=1),
            )
        if self.json:
            print_json(
                {
                    "gains": [{**asdict(row), "verdict": row.verdict} for row in gains],
                    "trivial": [asdict(row) for row in trivial],
                }
            )
            return
        from taxel.views.tables.models import cleaning_tables

        console.print(cleaning_tables(gains, trivial))
