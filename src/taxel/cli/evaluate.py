"""`taxel evaluate`: cross-validate a recipe on one's own recordings of an array."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar

import tyro

from taxel.cli.html_pages import older_page, say_page
from taxel.cli.option_rules import Only
from taxel.cli.options import FOLD_COUNT, RecipeOptions, check_run_folder
from taxel.cli.printing import console, print_json, progress, say
from taxel.held import only_writer


@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """Cross-validate a recipe on recordings of an array, with trivial baselines beside it."""

    data: tyro.conf.Positional[Path]
    """A folder of recordings of an array."""
    split: str | None = None
    """Which windows are tested: random (leaks), group:KEY or
    order:KEY:LAST[:END] (train up to LAST, test above it, up to END)."""
    fold_count: int = 5
    """How many folds."""
    model: str | None = None
    """Model's name."""
    members: int | None = None
    """Networks whose probabilities are averaged."""
    output: Path | None = None
    """Keep the result here as a run without weights, to be compared and reported."""
    fresh: bool = False
    """With --output: fit every fold, also those that a run that was broken off had finished: they
    are kept beside it as OUTPUT.folds, and used where recipe, data and software are the same."""
    html: Path | None = None
    """Write a self-contained page with figures to this file."""
    json: bool = False
    """Print JSON."""
    recipe: Annotated[RecipeOptions, tyro.conf.arg(name="")] = field(default_factory=RecipeOptions)

    RULES: ClassVar = (
        Only(("fresh",), "--output, beside which folds are kept,", lambda o: o.output),
        FOLD_COUNT,
    )

    def run(self) -> None:
        """Measure and print."""
        older = older_page(self.html)
        with nullcontext() if self.output is None else only_writer(self.output):
            self._folder(self.data)
        say_page(self.html, older, silent=self.json)

    def _folder(self, path: Path) -> None:
        from taxel.evaluation.checked import check_recipe
        from taxel.evaluation.kept_folds import folds_folder, forget_folds

        recipe = self.recipe.resolve(model=self.model, split=self.split, members=self.members)
        if self.output is not None:
            check_run_folder(self.output)
        with progress() as bar:
            task = bar.add_task("starting", total=None)
            checked = check_recipe(
                path,
                recipe,
                folds=self.fold_count,
                keep_in=None if self.output is None else folds_folder(self.output),
                fresh=self.fresh,
                on_step=lambda line: bar.update(task, description=line, advance=1),
            )
        if self.output is not None:
            from taxel.evaluation.checked_run import run_of_check
            from taxel.training.run import save_run

            save_run(self.output, run_of_check(path, checked))
            forget_folds(self.output)
        if self.html is not None:
            from taxel.views.report import write_checked_report

            write_checked_report(self.html, checked)
        if self.json:
            result: dict[str, Any] = {
                "target": recipe.target,
                "model": recipe.model,
                "classes": checked.dataset.classes(recipe.target),
                "windows": len(checked.dataset),
                "trials": len(checked.dataset.trials),
                "notes": checked.dataset.notes,
                "result": asdict(checked.pooled),
                "bars": {name: asdict(bar_) for name, bar_ in checked.bars.items()},
                "trivial": checked.trivial,
                "folds_kept": checked.kept,
            }
            print_json(result)
            return
        from taxel.cli.train import kept_line, warning
        from taxel.views.results import checked_table, confusion_table

        console.print(checked_table(checked))
        if checked.kept:
            say(kept_line(checked))
        if said := warning(checked):
            say(f"warning: {said}", style="yellow")
        classes = checked.dataset.classes(recipe.target)
        console.print(confusion_table(classes, checked.pooled.scores.confusion))
