"""`taxel train`: find what recognises best, or take a recipe; judge it; train it on all."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import tyro

from taxel.cli.options.arrays import (
    FOLD_COUNT,
    RecipeOptions,
    check_run_folder,
    check_share,
    split_given,
    usual_recipe,
)
from taxel.cli.options.rules import Only
from taxel.cli.options.work import WorkOptions
from taxel.cli.printing import command, console, print_json, progress, say, say_aside
from taxel.errors import BadInput, RecordingFailed, TaxelError
from taxel.held import only_writer
from taxel.plain_text import visible_names

if TYPE_CHECKING:
    from taxel.decisions.unknown import Unknown
    from taxel.evaluation.checked import Checked
    from taxel.training.run import Run


@dataclass(frozen=True, kw_only=True)
class Train:
    """Train a recogniser on recordings of an array, and measure its accuracy.

    Without a recipe, it searches for the best window, features and models, by validation inside the
    training part.
    """

    data: tyro.conf.Positional[Path]
    """A folder of recordings."""
    output: Path | None = None
    """Folder for the run (weights, configuration, accuracy); runs/DATA-TARGET unless given. An
    older run there is replaced."""
    check: bool = True
    """Cross-validate first, so that the run states its accuracy."""
    split: str | None = None
    """How accuracy is measured. group:KEY holds out whole groups, such as group:session.
    order:KEY:LAST[:END] trains up to LAST and tests above it, up to END; order:KEY:70% trains on
    the first 70 % and tests the later ones (of each class, where classes follow one another, or
    the first would lack one). KEY is a group, or time: when a trial begins in its recording. random
    splits single windows, which leaks, and trains the recipe, without a search. Unless given: the
    recipe's, if it names one; else sessions are held out, else objects, persons or days, else
    files."""
    folds: Path | None = None
    """Measure on a published split instead: a table (CSV) with the columns recording (or
    group:KEY), side (train, validation, test) or fold, and optionally start_s, seconds."""
    test: Path | None = None
    """Measure on the recordings of this folder instead; all of PATH is then the training part."""
    fold_count: int = 5
    """Folds of the cross-validation, 2 or more."""
    model: str | None = None
    """Name of the model, such as cnn2d; the recipe's unless given."""
    minutes: float = 5.0
    """Without a recipe: time limit of the search, minutes, above 0."""
    max_mb: float = 20.0
    """Without a recipe: largest size of the bundle, megabytes, above 0."""
    max_us: float = 2000.0
    """Without a recipe: longest time that a window may take live, on one core, microseconds, above
    0."""
    like: Path | None = None
    """Without a recipe: take the window, features and models that an earlier run chose, from its
    expert.json, without a search."""
    reject_novel: float | None = None
    """Also train a novelty test, which answers UNKNOWN to novel touch, with this false rejection
    rate, 0…1, such as 0.05; none unless given."""
    fresh: bool = False
    """With a recipe: start from the beginning. Otherwise folds and checkpoints that an interrupted
    run left beside --output are reused, if recipe, data and software are the same."""
    json: bool = False
    """Print JSON."""
    recipe: Annotated[RecipeOptions, tyro.conf.arg(name="")] = field(default_factory=RecipeOptions)

    RULES: ClassVar = (
        Only(
            ("fold-count", "fresh", "test"), "a cross-validation (no --no-check)", lambda o: o.check
        ),
        FOLD_COUNT,
        Only(
            ("minutes", "max-mb", "max-us", "like"),
            "no recipe, model, window or --split random",
            lambda o: o._free,
            lambda o: o._recipe_typed,
        ),
        Only(("fresh",), "a recipe", lambda o: not o._free),
    )

    @property
    def _free(self) -> bool:
        """Whether the best is to be found: nothing of a recipe is named, nor asked for."""
        named = self.model is not None or self.split == "random"
        return self.recipe.unnamed and not named

    @property
    def _recipe_typed(self) -> str:
        """What was typed that makes it a recipe's training, as it was typed."""
        if self.model is not None:
            return f"--model {self.model}"
        return "--split random" if self.split == "random" else self.recipe.named

    def run(self) -> None:
        """Find or take, judge, train and save."""
        if self._free:
            self._find()
            return
        output = self.output or Path("runs") / f"{self.data.resolve().name}-{self._target()}"
        with only_writer(output):
            self._train(output)

    def _target(self) -> str:
        recipe = self.recipe.resolve(
            default=usual_recipe(self.data), model=self.model, data=self.data
        )
        return recipe.target

    def _find(self) -> None:
        if self.reject_novel is not None:
            check_share("--reject-novel", self.reject_novel)
        from taxel.cli.training.train_expert import ExpertOptions, train_default

        train_default(
            ExpertOptions(
                data=self.data, output=self.output, target=self.recipe.target, split=self.split,
                folds=self.folds, test=self.test, fold_count=self.fold_count,
                usual_folds=type(self).fold_count,
                minutes=self.minutes, max_mb=self.max_mb, max_us=self.max_us, like=self.like,
                reject_novel=self.reject_novel,
                check=self.check, seed=self.recipe.checked_seed(), json=self.json,
            )
        )  # fmt: skip

    def _train(self, output: Path) -> None:
        from taxel.cli.training.train_expert import CHOICE, replaced_note
        from taxel.evaluation.checked import check_recipe
        from taxel.evaluation.kept_folds import Keeping, folds_folder, forget_folds
        from taxel.evaluation.table_split import training_part
        from taxel.models.catalogue import find_network
        from taxel.training.environment import Made
        from taxel.training.final import train_on_all
        from taxel.training.run import save_run

        if self.reject_novel is not None:
            check_share("--reject-novel", self.reject_novel)
        given = split_given(self.split, self.folds, self.test)
        recipe = self.recipe.resolve(
            default=usual_recipe(self.data), model=self.model, split=self.split, data=self.data
        )
        find_network(recipe.model)
        check_run_folder(output)
        older = output.exists()
        if (output / CHOICE).exists():
            say_aside(replaced_note(output, "a run that a search chose"))
        accuracy = {}
        with WorkOptions().open(), progress() as bar:
            task = bar.add_task("starting", total=None)

            def on_step(line: str) -> None:
                bar.update(task, description=line, advance=1)

            if self.check:
                checked = check_recipe(
                    self.data,
                    recipe,
                    folds=self.fold_count,
                    bars=(),
                    given=given,
                    keep=Keeping(folds_folder(output), fresh=self.fresh),
                    on_step=on_step,
                )
                accuracy[checked.pooled.split] = checked.pooled.scores.accuracy
            try:

                def train_all(resume: bool) -> Run:
                    return train_on_all(
                        self.data,
                        recipe,
                        checkpoints=checkpoints,
                        resume=resume,
                        unknown=self.reject_novel,
                        part=lambda all_: training_part(self.data, all_, recipe.target, given),
                        on_epoch=lambda e: on_step(
                            f"all data · epoch {e.number} · loss {e.loss:.4f}"
                        ),
                    )

                checkpoints = output.with_name(output.name + ".checkpoints")
                try:
                    run = train_all(resume=not self.fresh and checkpoints.exists())
                except BadInput:
                    if not checkpoints.exists():
                        raise
                    run = train_all(resume=False)  # checkpoints of another recipe or other data
                contract = replace(run.contract, accuracy=accuracy)
                run = replace(run, contract=contract, made=Made.now())
                if self.check:
                    run = replace(
                        run, predictions=checked.predictions, trivial=checked.trivial,
                        curves=checked.curves,
                    )  # fmt: skip
                save_run(output, run)
                forget_folds(output)
            except TaxelError:
                raise
            except OSError as error:
                raise RecordingFailed(
                    f"needed to write {output}; got {error.strerror or error}; "
                    "choose another place with --output."
                ) from error
        if self.json:
            print_json(
                {
                    "run": str(output),
                    "replaced": older,
                    "target": recipe.target,
                    "classes": run.contract.classes,
                    "parameters": run.contract.parameters,
                    "accuracy": accuracy,
                    "loss": run.history[-1].loss,
                    "result": asdict(checked.pooled) if self.check else None,
                    "trivial": dict(run.trivial),
                    "notes": checked.dataset.notes if self.check else None,
                    "folds_kept": checked.kept if self.check else 0,
                    "warning": warning(checked) if self.check else None,
                }
            )
            return
        if self.check:
            print_checked(checked)
        say(
            f"{output}{', replaced' if older else ''}: {recipe.model}, "
            f"{run.contract.parameters:,} parameters, predicts {recipe.target}: "
            f"{visible_names(run.contract.classes)}"
        )
        if given.table is not None and self.check and len(checked.pooled.fold_accuracies) == 1:
            say(f"trained on the training part of {self.folds} only: its test part stays unseen")
        if run.contract.unknown is not None:
            say(_rejects(run.contract.unknown))
        bundle = command("taxel", "bundle", output, "--output", f"{output}.taxel")
        say(f"next: {bundle}")
        if self.check:
            page = command("taxel", "report", output, "--output", "report.html")
            say(f"or:   {page}")


def print_checked(checked: Checked) -> None:
    """Print a cross-validation: accuracies, warnings, confusions, each class and group."""
    from taxel.evaluation.run_scores import unnamed_line
    from taxel.views.tables.parts import parts_tables
    from taxel.views.tables.results import checked_table, confusion_table

    pooled = checked.pooled
    console.print(checked_table(checked))
    if checked.kept:
        say(_kept_line(checked))
    if said := warning(checked):
        say(f"warning: {said}", style="yellow")
    if said := unnamed_line(checked.predictions):
        say(said, style="yellow" if said.startswith("warning") else "")
    classes = checked.dataset.classes(checked.recipe.target)
    console.print(confusion_table(classes, pooled.scores.confusion, console.width))
    for table in parts_tables(pooled.parts) if pooled.parts is not None else ():
        console.print(table)


def _kept_line(checked: Checked) -> str:
    """Return what must be said where folds were not fitted by this run."""
    folds = f"{checked.kept} fold{'s' if checked.kept > 1 else ''}"
    return f"{folds} kept from a run that was broken off; --fresh fits all of them again"


def warning(checked: Checked) -> str | None:
    """Return a warning where accuracy is no better than a trivial baseline; else nothing."""
    from taxel.evaluation.run_scores import GroupInterval, baseline_warning

    pooled = checked.pooled
    return baseline_warning(
        checked.recipe.model,
        pooled.scores.accuracy,
        GroupInterval(*pooled.interval, pooled.interval_groups),
        pooled.interval_group,
        checked.trivial,
    )


def _rejects(unknown: Unknown) -> str:
    """Return what is rejected as novel, and how much known touch is rejected with it."""
    windows = min(len(density.windows) for density in unknown.densities)
    return (
        f"rejects novel touch (UNKNOWN): expected false rejection rate {unknown.rejected:.3g} on "
        f"known touch, from {windows:,} windows of held-out sessions; higher in sessions unlike "
        "those"
    )
