"""`taxel evaluate`: cross-validate a recipe on recordings, or score a bundle on them."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from taxel.bundles.shipped import find_bundle
from taxel.cli.cross_validation import print_checked
from taxel.cli.evaluation.html_pages import older_page, say_page
from taxel.cli.options.arrays import (
    FOLD_COUNT,
    RecipeOptions,
    check_run_folder,
    split_given,
    usual_recipe,
)
from taxel.cli.options.rules import Only
from taxel.cli.options.work import WorkOptions
from taxel.cli.printing import console, print_json, progress, say, say_aside
from taxel.cli.trial_verbs import refuse_other_table
from taxel.errors import BadInput
from taxel.held import only_writer
from taxel.plain_text import number_of

if TYPE_CHECKING:
    from taxel.evaluation.checked import Checked

OF_A_RECIPE = (
    "split", "test", "fold-count", "model", "members", "comparators", "output", "fresh",
    "html", "recipe", "target", "window", "epochs", "seed", "workers", "run-on",
)  # fmt: skip
"""Options that mean nothing for a bundle."""


@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """Cross-validate a recipe on recordings of an array, or score a bundle on them.

    Prints accuracy by window, trial, class and group, with trivial baselines beside it; of a bundle
    that watches grasps, its false alarms, misses and leads.
    """

    data: tyro.conf.Positional[Path]
    """A folder of recordings of an array, a table (CSV) of camera trials, or a bundle: NAME.taxel,
    or slip-both-gels, cup-pour or slip-rule. It runs on the processor, or on the device that
    $TAXEL_DEVICE names, such as cuda."""
    recordings: tyro.conf.Positional[Path | None] = None
    """With a bundle: the recordings to score it on."""
    split: str | None = None
    """Which windows are tested. group:KEY holds out whole groups, such as group:session.
    order:KEY:LAST[:END] trains up to LAST and tests above it, up to END; order:KEY:70% trains on
    the first 70 % and tests the later ones (of each class, where classes follow one another, or
    the first would lack one; always with :by-class behind it). KEY is a group, or time: when a
    trial begins in its recording. random splits windows, which leaks. Unless given: the recipe's,
    if it names one; else sessions are held out, else objects, persons or days, else files."""
    folds: Path | None = None
    """Measure on a published split instead: a table (CSV) with the columns recording (or
    group:KEY), side (train, validation, test) or fold, and optionally start_s, seconds. With a
    bundle: one test part, on which alone it is scored."""
    test: Path | None = None
    """Measure on this folder instead; the whole of the first folder is the training part."""
    fold_count: int = 5
    """Folds of the cross-validation, 2 or more."""
    model: str | None = None
    """Name of the model, such as cnn2d; the recipe's unless given."""
    members: int | None = None
    """Networks whose probabilities are averaged, 1 or more; the recipe's number unless given."""
    comparators: bool = True
    """Also fit library models (MiniRocket, extra-trees) on the same folds, to compare with; their
    results are kept for the same data and split."""
    output: Path | None = None
    """Folder for the result, as a run without weights that can be compared and reported; an older
    run there is replaced. None is written unless given."""
    fresh: bool = False
    """Fit every fold anew. Otherwise the kept results of comparators are used, and with --output
    the folds that an interrupted run left in OUTPUT.folds, where recipe, data and software are
    the same."""
    html: Path | None = None
    """Write a self-contained page with figures to this file."""
    json: bool = False
    """Print JSON."""
    recipe: Annotated[RecipeOptions, tyro.conf.arg(name="")] = field(default_factory=RecipeOptions)
    work: Annotated[WorkOptions, tyro.conf.arg(name="")] = field(default_factory=WorkOptions)

    RULES: ClassVar = (
        Only(
            ("fresh",),
            "--output or comparators, whose folds are kept,",
            lambda o: o.output or o.comparators,
        ),
        Only(
            OF_A_RECIPE,
            "a folder of recordings (a bundle is scored as it is)",
            lambda o: not _is_bundle_file(o.data),
        ),
        FOLD_COUNT,
    )

    def run(self) -> None:
        """Measure and print."""
        from taxel.bundles.envelope import is_grasp_bundle, need_bundle

        bundle = find_bundle(self.data)
        refuse_other_table(bundle)
        if _is_bundle_file(bundle):
            if is_grasp_bundle(bundle):
                from taxel.cli.evaluation.grasp_bundle import evaluate_grasp_bundle

                evaluate_grasp_bundle(bundle, self.recordings, self.folds, as_json=self.json)
                return
            _evaluate_bundle(bundle, self.recordings, self.folds, as_json=self.json)
            return
        if self.recordings is not None:
            if not self.data.exists():
                need_bundle(self.data)
            raise BadInput("a bundle before the recordings to score it on", str(self.data),
                           "name NAME.taxel, or test on another folder with --test")  # fmt: skip
        older = older_page(self.html)
        with nullcontext() if self.output is None else only_writer(self.output):
            self._folder(self.data)
        say_page(self.html, older, silent=self.json)

    def _folder(self, path: Path) -> None:
        from taxel.cli.training.train_expert import replaced_note
        from taxel.evaluation.checked import BARS, check_recipe
        from taxel.evaluation.kept_folds import FoldStore, folds_folder, forget_folds
        from taxel.training.frames.features import default_cache

        given = split_given(self.split, self.folds, self.test)
        recipe = self.recipe.resolve(
            default=usual_recipe(path),
            model=self.model,
            split=self.split,
            members=self.members,
            data=path,
        )
        if self.output is not None:
            check_run_folder(self.output)
            if any(self.output.glob("weights-*.safetensors")):
                say_aside(replaced_note(self.output, "a run with trained weights"))
        with self.work.open(), progress() as bar:
            task = bar.add_task("starting", total=None)
            checked = check_recipe(
                path,
                recipe,
                folds=self.fold_count,
                bars=BARS if self.comparators else (),
                given=given,
                keep=FoldStore(
                    folder=None if self.output is None else folds_folder(self.output),
                    cache=default_cache(),
                    fresh=self.fresh,
                ),
                on_step=lambda line: bar.update(task, description=line, advance=1),
            )
        if self.output is not None:
            from taxel.evaluation.checked import run_of_check
            from taxel.training.run import save_run

            save_run(self.output, run_of_check(path, checked))
            forget_folds(self.output)
        if self.html is not None:
            from taxel.views.report import write_checked_report

            write_checked_report(self.html, checked)
        if self.json:
            print_json(_as_record(checked))
            return
        print_checked(checked)
        if checked.cached:
            folds = number_of(checked.cached, "fold")
            say(f"library models kept for {folds}; --fresh fits them again")


def _as_record(checked: Checked) -> dict[str, Any]:
    """Return a cross-validation as plain values, for --json."""
    recipe = checked.recipe
    return {
        "target": recipe.target,
        "model": recipe.model,
        "classes": checked.dataset.classes(recipe.target),
        "windows": len(checked.dataset),
        "trials": len(checked.dataset.trials),
        "notes": checked.dataset.notes,
        "result": asdict(checked.pooled),
        "bars": {name: asdict(bar) for name, bar in checked.bars.items()},
        "trivial": checked.trivial,
        "folds_kept": checked.kept,
        "comparator_folds_kept": checked.cached,
    }


def _is_bundle_file(path: Path) -> bool:
    """Return whether a path is a file that a bundle could be, and no recording, or the name of a
    bundle that comes with taxel.
    """
    return find_bundle(path).is_file() and path.suffix != ".mcap"


def _evaluate_bundle(
    bundle: Path, folder: Path | None, folds: Path | None, *, as_json: bool
) -> None:
    """Score a bundle on recordings and print it.

    Args:
        bundle: The bundle's file.
        folder: Recordings with its label.
        folds: A table whose one test part alone is scored; all of them without.
        as_json: Print JSON instead of tables.

    Raises:
        BadInput: No folder is named, or $TAXEL_DEVICE is not there.
        BadBundle: The bundle cannot be used, or is of another array.
        BadDataset: The recordings hold no window with the bundle's label.
        BadTable: The table cannot be read, has several folds, or tests what is not there.
        BadSplit: It puts a trial on both sides, or there is nothing to test.
    """
    from taxel.bundles.reader import read_bundle
    from taxel.evaluation.bundle_scores import score_bundle
    from taxel.models.devices import asked_device

    if folder is None:
        raise BadInput(
            f"recordings to score {bundle} on", "none", f"taxel evaluate {bundle} RECORDINGS"
        )
    device = asked_device()
    with progress() as bar:
        bar.add_task(f"scoring {bundle.name}", total=None)
        score = score_bundle(read_bundle(bundle, device=device), folder, folds=folds)
    from taxel.views.tables.parts import bundle_score_table
    from taxel.views.tables.trained_on import trained_on_line

    warning = trained_on_line(score.learned_from, "recordings", known=score.learned_is_known)
    if as_json:
        print_json(
            {"bundle": str(bundle), "data": str(folder)} | asdict(score) | {"warning": warning}
        )
        return
    console.print(bundle_score_table(score, bundle.name, str(folder)))
    if warning is not None:
        say(f"warning: {warning}", style="yellow")
