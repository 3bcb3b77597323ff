"""`taxel tune`: search the settings of a recipe, with an outer score that the search never saw."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from taxel.cli.options.arrays import (
    OWN_FOLD_COUNT,
    RecipeOptions,
    check_run_folder,
    usual_recipe,
)
from taxel.cli.options.rules import Only
from taxel.cli.options.work import WorkOptions
from taxel.cli.printing import command, console, print_json, progress, say
from taxel.errors import BadInput
from taxel.held import only_writer
from taxel.plain_text import finite
from taxel.recordings.whole import write_whole

if TYPE_CHECKING:
    from taxel.evaluation.tune.nested import Tuned
    from taxel.training.run import Run

_MOST_TRIALS = 100_000


@dataclass(frozen=True, kw_only=True)
class Tune:
    """Search a recipe's settings on recordings of an array, and train with the best.

    Accuracy is measured on outer folds, each with settings found without it (nested
    cross-validation). Finished trials are kept in a database; the same command continues an
    interrupted search.
    """

    data: tyro.conf.Positional[Path]
    """A folder of recordings."""
    output: Path | None = None
    """Folder for the run; runs/DATA-TARGET-tuned unless given. An older run there is replaced."""
    trials: int = 30
    """Trials (settings tried) in each search, pruned ones included."""
    settings: tuple[str, ...] | None = None
    """Settings to search, of learning-rate, epochs, batch, weight-decay, label-smoothing, noise,
    gain and offset; all but batch and offset unless given, and without epochs beside --epochs."""
    models: tuple[str, ...] = ()
    """Names of the networks to choose among; the recipe's own unless given."""
    split: str | None = None
    """How accuracy is measured: group:KEY (whole groups held out), order:KEY:LAST[:END] (train up
    to LAST, test above it, up to END) or order:KEY:70% (train on the first 70 %; :by-class behind
    it: of each class). Unless given: the recipe's, if it names one; else sessions are held out,
    else objects, persons or days, else files."""
    fold_count: int = 5
    """Outer folds, 2 or more."""
    check: bool = True
    """Search in each outer fold too, so that the run states its accuracy."""
    storage: str | None = None
    """URL of the database for the trials; the SQLite file OUTPUT.tune.db unless given. With
    postgresql+pg8000://USER@HOST/NAME several machines share a search."""
    json: bool = False
    """Print JSON."""
    recipe: Annotated[RecipeOptions, tyro.conf.arg(name="")] = field(default_factory=RecipeOptions)
    work: Annotated[WorkOptions, tyro.conf.arg(name="")] = field(default_factory=WorkOptions)

    RULES: ClassVar = (
        Only(("fold-count",), "an outer score (no --no-check)", lambda o: o.check),
        OWN_FOLD_COUNT,
        Only(
            ("epochs",),
            "--settings without epochs",
            lambda o: "epochs" not in (o.settings or ()),
            against=lambda o: "epochs in --settings",
        ),
    )

    def run(self) -> None:
        """Search, train and save."""
        from taxel.evaluation.tune.nested import Extent, tune
        from taxel.evaluation.tune.space import USUAL, Space
        from taxel.evaluation.tune.study import open_store

        if not 1 <= self.trials <= _MOST_TRIALS:
            raise BadInput(f"--trials within 1 and {_MOST_TRIALS}", str(self.trials), "give others")
        recipe = self.recipe.resolve(
            default=usual_recipe(self.data), split=self.split, data=self.data
        )
        usual = tuple(name for name in USUAL if name != "epochs" or self.recipe.epochs is None)
        space = Space(usual if self.settings is None else self.settings, self.models)
        space.check()
        output = self.output or Path("runs") / f"{self.data.resolve().name}-{recipe.target}-tuned"
        check_run_folder(output)
        url = self.storage or f"sqlite:///{output.with_name(output.name + '.tune.db')}"
        with only_writer(output), open_store(url) as store, self.work.open(), progress() as bar:
            task = bar.add_task("searching", total=None)

            def on_step(line: str) -> None:
                bar.update(task, description=line, advance=1)

            tuned = tune(
                store, self.data, recipe, space,
                Extent(trials=self.trials, folds=self.fold_count, nested=self.check),
                on_step=on_step,
            )  # fmt: skip
            run = _trained(self.data, tuned, output, on_step)
            about = _about(tuned, output, url)
            _save(output, run, about)  # before anybody else may write there
        if self.json:
            print_json(about)
            return
        self._print_result(tuned, output, url)

    def _print_result(self, found: Tuned, output: Path, url: str) -> None:
        from taxel.views.tables.tune import tune_table

        console.print(tune_table(found))
        say(f"{output}: {found.recipe.model}, predicts {found.recipe.target}; {_words(found)}")
        say("watch:", command("optuna-dashboard", url, "--host", "127.0.0.1"))
        say("next: ", command("taxel", "report", output, "--output", f"{output.name}.html"))


def _trained(data: Path, found: Tuned, output: Path, on_step: Callable[[str], None]) -> Run:
    """Train the settings that were found on all recordings."""
    from taxel.training.environment import Provenance
    from taxel.training.final import train_on_all

    outer = found.outer
    accuracy = {outer.tuned.split: outer.tuned.scores.accuracy} if outer else {}
    checkpoints = output.with_name(output.name + ".checkpoints")
    run = train_on_all(
        data, found.recipe, checkpoints=checkpoints,
        on_epoch=lambda e: on_step(f"all data · epoch {e.number} · loss {e.loss:.4f}"),
    )  # fmt: skip
    run = replace(run, made=Provenance.now(), contract=replace(run.contract, accuracy=accuracy))
    if outer:
        run = replace(run, predictions=outer.predictions, trivial=outer.trivial)
    return run


def _save(output: Path, run: Run, about: dict[str, Any]) -> None:
    from taxel.training.run import save_run

    save_run(output, run)
    text = json.dumps(finite(about), indent=1, default=str, allow_nan=False) + "\n"
    write_whole(output / "tune.json", text.encode())


def _about(found: Tuned, output: Path, url: str) -> dict[str, Any]:
    outer = found.outer
    return {
        "run": str(output),
        "storage": url,
        "target": found.recipe.target,
        "model": found.recipe.model,
        "settings": found.found.values,
        "search": asdict(found.found),
        "inner_accuracy": found.found.accuracy,
        "outer_accuracy": outer.tuned.scores.accuracy if outer else None,
        "outer": asdict(outer.tuned) if outer else None,
        "outer_as_is": asdict(outer.as_is) if outer else None,
        "outer_searches": [asdict(search) for search in outer.found] if outer else None,
        "trivial": outer.trivial if outer else None,
    }


def _words(found: Tuned) -> str:
    values = found.found.values
    if not values:
        return "the recipe as it is was best"
    return ", ".join(
        f"{name} {value:.3g}" if isinstance(value, float) else f"{name} {value}"
        for name, value in values.items()
    )
