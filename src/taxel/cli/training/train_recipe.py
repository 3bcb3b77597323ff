"""What `taxel train` does where a recipe is named: judge it, train it on all data, keep it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taxel.cli.cross_validation import print_checked, warning
from taxel.cli.options.arrays import check_run_folder
from taxel.cli.options.work import WorkOptions
from taxel.cli.printing import command, print_json, progress, say, say_aside
from taxel.errors import BadInput, TaxelError, not_written
from taxel.plain_text import number_of, visible_line, visible_names

if TYPE_CHECKING:
    from taxel.decisions.unknown import Unknown
    from taxel.evaluation.checked import Checked
    from taxel.evaluation.table_split import GivenSplit
    from taxel.training.recipes import Recipe
    from taxel.training.run import Run
    from taxel.windows.dataset import Dataset


@dataclass(frozen=True, kw_only=True)
class RecipeTraining:
    """What `taxel train` was asked for, where a recipe is named."""

    data: Path
    """A folder of recordings."""
    output: Path
    """The run's folder."""
    recipe: Recipe
    given: GivenSplit
    """A split from a table or a folder of tests, if there is one."""
    folds: int | None
    """Folds of the cross-validation; None leaves it out."""
    reject_novel: float | None
    """False rejection rate of a novelty test, 0…1; None trains none."""
    fresh: bool
    """Start from the beginning: no folds or checkpoints of an interrupted run."""
    json: bool
    """Print the result as JSON."""


def train_recipe(training: RecipeTraining) -> None:
    """Cross-validate a recipe, train it on all data, write the run and print the result."""
    from taxel.cli.training.train_expert import CHOICE, replaced_note
    from taxel.evaluation.kept_folds import forget_folds
    from taxel.models.catalogue import find_network
    from taxel.training.run import save_run

    output = training.output
    find_network(training.recipe.model)
    check_run_folder(output)
    replaced = output.exists()
    if (output / CHOICE).exists():
        say_aside(replaced_note(output, "a run that a search chose"))
    with WorkOptions().open(), progress() as bar:
        task = bar.add_task("starting", total=None)

        def on_step(line: str) -> None:
            bar.update(task, description=line, advance=1)

        checked = None if training.folds is None else _cross_validate(training, on_step)
        try:
            run, notes = _train_on_all(training, on_step)
            run = _with_scores(run, checked)
            save_run(output, run)
            forget_folds(output)
        except TaxelError:
            raise
        except OSError as error:
            raise not_written(output, error, "choose another place with --output") from error
    if training.json:
        print_json(_as_json(training, run, checked, notes) | {"replaced": replaced})
    else:
        for note in notes if checked is None else ():  # else they stand below the table
            say(f"note: {visible_line(note)}")
        _print(training, run, checked, replaced=replaced)


def _cross_validate(training: RecipeTraining, on_step: Callable[[str], None]) -> Checked:
    """Return the recipe's cross-validation; finished folds are kept beside the run until then."""
    from taxel.evaluation.checked import check_recipe
    from taxel.evaluation.kept_folds import FoldStore, folds_folder

    assert training.folds is not None
    return check_recipe(
        training.data,
        training.recipe,
        folds=training.folds,
        bars=(),
        given=training.given,
        keep=FoldStore(folds_folder(training.output), fresh=training.fresh),
        on_step=on_step,
    )


def _train_on_all(
    training: RecipeTraining, on_step: Callable[[str], None]
) -> tuple[Run, tuple[str, ...]]:
    """Return the recipe trained on all data, and notes on the data.

    It goes on from checkpoints where they still fit.
    """
    from taxel.evaluation.table_split import training_part
    from taxel.training.final import train_on_all

    checkpoints = training.output.with_name(training.output.name + ".checkpoints")
    notes: tuple[str, ...] = ()

    def part(dataset: Dataset) -> Dataset:
        nonlocal notes
        notes = dataset.notes
        return training_part(training.data, dataset, training.recipe.target, training.given)

    def train(resume: bool) -> Run:
        return train_on_all(
            training.data,
            training.recipe,
            checkpoints=checkpoints,
            resume=resume,
            unknown=training.reject_novel,
            part=part,
            on_epoch=lambda epoch: on_step(
                f"all data · epoch {epoch.number} · loss {epoch.loss:.4f}"
            ),
        )

    try:
        return train(resume=not training.fresh and checkpoints.exists()), notes
    except BadInput:
        if not checkpoints.exists():
            raise
        return train(resume=False), notes  # checkpoints of another recipe, other data or software


def _with_scores(run: Run, checked: Checked | None) -> Run:
    """Return the run as it is kept: with its accuracy and predictions, and how it was made."""
    from taxel.training.environment import Provenance

    contract = replace(run.contract, accuracy=_accuracy(checked))
    run = replace(run, contract=contract, made=Provenance.now())
    if checked is None:
        return run
    return replace(
        run, predictions=checked.predictions, trivial=checked.trivial, curves=checked.curves
    )


def _accuracy(checked: Checked | None) -> dict[str, float]:
    """Return split → accuracy, 0…1; empty without a cross-validation."""
    return {} if checked is None else {checked.pooled.split: checked.pooled.scores.accuracy}


def _as_json(
    training: RecipeTraining, run: Run, checked: Checked | None, notes: tuple[str, ...]
) -> dict[str, Any]:
    """Return what --json prints."""
    return {
        "run": str(training.output),
        "target": training.recipe.target,
        "classes": run.contract.classes,
        "parameters": run.contract.parameters,
        "accuracy": _accuracy(checked),
        "loss": run.history[-1].loss,
        "result": asdict(checked.pooled) if checked is not None else None,
        "trivial": dict(run.trivial),
        "notes": notes,
        "folds_kept": checked.kept if checked is not None else 0,
        "warning": warning(checked) if checked is not None else None,
    }


def _print(training: RecipeTraining, run: Run, checked: Checked | None, *, replaced: bool) -> None:
    """Print the cross-validation, what was written where, and the commands that may follow."""
    from taxel.bundles.writer import refuse_large

    output, table = training.output, training.given.table
    if checked is not None:
        print_checked(checked)
    say(
        f"{output}{', replaced' if replaced else ''}: {training.recipe.model}, "
        f"{run.contract.parameters:,} parameters, predicts {training.recipe.target}: "
        f"{visible_names(run.contract.classes)}"
    )
    if table is not None and checked is not None and len(checked.pooled.fold_accuracies) == 1:
        say(f"trained on the training part of {table} only: its test part stays unseen")
    if run.contract.unknown is not None:
        say(_novelty_line(run.contract.unknown))
    try:
        refuse_large(run.networks)
    except BadInput as error:
        say(f"warning: it can be neither bundled nor reported: {error}", style="yellow")
        return
    say(f"next: {command('taxel', 'bundle', output, '--output', f'{output}.taxel')}")
    if checked is not None:
        say(f"or:   {command('taxel', 'report', output, '--output', 'report.html')}")


def _novelty_line(unknown: Unknown) -> str:
    """Return what is rejected as novel, and how much known touch is rejected with it."""
    windows = min(len(density.windows) for density in unknown.densities)
    return (
        f"rejects novel touch (UNKNOWN): expected false rejection rate {unknown.rejected:.3g} on "
        f"known touch, from {number_of(windows, 'window', ',')} of held-out sessions; higher "
        "in sessions unlike those"
    )
