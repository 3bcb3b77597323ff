"""`taxel learning-curve`: accuracy against the amount of data, beside trivial baselines."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar

import tyro

from taxel.cli.options.arrays import OWN_FOLD_COUNT, RecipeOptions, usual_recipe
from taxel.cli.printing import console, print_json, progress
from taxel.errors import BadInput


@dataclass(frozen=True, kw_only=True)
class LearningCurve:
    """Measure accuracy against the amount of training data: would more data help?

    The test parts stay the same; whole groups (sessions, where there are several) are added to
    the training parts, and each amount contains the smaller ones.
    """

    data: tyro.conf.Positional[Path]
    """A folder of recordings of an array."""
    split: str | None = None
    """Which windows are tested: group:KEY (whole groups held out, such as group:session) or
    order:KEY:LAST[:END] (train up to LAST, test above it, up to END) or order:KEY:70% (train on the
    first 70 %, test the later ones; :by-class behind it: of each class). Unless given: the
    recipe's, if it names one; else sessions are held out, else objects, persons or days, else
    files."""
    fold_count: int = 5
    """Folds of the cross-validation, 2 or more."""
    model: str | None = None
    """Name of the model, such as cnn2d; the recipe's unless given."""
    steps: int = 6
    """Number of amounts, 2 or more, from one group to all in equal ratios."""
    json: bool = False
    """Print JSON, which a report can draw."""
    recipe: Annotated[RecipeOptions, tyro.conf.arg(name="")] = field(default_factory=RecipeOptions)

    RULES: ClassVar = (OWN_FOLD_COUNT,)

    def run(self) -> None:
        """Measure and print."""
        from taxel.evaluation.learning_curve import learning_curve
        from taxel.views.tables.learning_curve import learning_curve_table

        if self.steps < 2:
            raise BadInput("--steps of at least 2", str(self.steps), "give a larger number")
        recipe = self.recipe.resolve(
            default=usual_recipe(self.data),
            model=self.model,
            split=self.split,
            data=self.data,
        )
        with progress() as bar:
            task = bar.add_task("starting", total=None)
            found = learning_curve(
                self.data, recipe, folds=self.fold_count, steps=self.steps,
                on_step=lambda line: bar.update(task, description=line, advance=1),
            )  # fmt: skip
        if self.json:
            print_json(asdict(found))
            return
        console.print(learning_curve_table(found))
