"""`taxel reproduce teng-models`: every model, under random windows and with groups held out."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from taxel.cli.options.arrays import RecipeOptions
from taxel.cli.options.hand_sets import comparison_config, given_or_simulated_hand
from taxel.cli.options.rules import Only
from taxel.cli.printing import console, print_json, progress


@dataclass(frozen=True, kw_only=True)
class TengModels:
    """Print every model's accuracy under random windows and with whole groups held out."""

    data: Path | None = None
    """A folder of recordings of an array; the simulated hand unless given."""
    scans_per_class: int = 160_000
    """Scans a class to simulate."""
    fold_count: int = 5
    """With --data: parts of both splits; simulated sessions are each held out once."""
    model: str | None = None
    """This model alone."""
    json: bool = False
    """Print JSON."""
    recipe: Annotated[RecipeOptions, tyro.conf.arg(name="")] = field(default_factory=RecipeOptions)

    RULES: ClassVar = (
        Only(("scans-per-class",), "no --data", lambda o: o.data is None),
        Only(("fold-count",), "--data", lambda o: o.data is not None),
    )

    def run(self) -> None:
        """Measure and print."""
        from taxel.evaluation.teng.model_comparison import LITERATURE, compare_models

        config = comparison_config(self.data, self.recipe, self.fold_count, self.model)
        seeds = [self.recipe.seed]
        sets = given_or_simulated_hand(self.data, self.scans_per_class, seeds)
        with sets as (folder,), progress() as bar:
            steps = 2 * len(config.targets) * (len(config.models) + 1)
            task = bar.add_task("starting", total=steps)
            results, trivial = compare_models(
                folder, config, lambda line: bar.update(task, description=line, advance=1)
            )
        if self.json:
            print_json(
                {
                    "models": [
                        asdict(row) | {"literature": LITERATURE.get(row.model)} for row in results
                    ],
                    "trivial": [asdict(row) for row in trivial],
                }
            )
            return
        from taxel.views.tables.models import model_tables

        console.print(model_tables(results, trivial))
