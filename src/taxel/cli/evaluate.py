"""`taxel evaluate`: a published table, or a recipe on one's own data set."""

from __future__ import annotations

import tempfile
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import tyro

from taxel.cli.evaluate_grasps import GraspOptions, run_precisions, run_tables, run_warnings
from taxel.cli.options import RecipeOptions, check_run_folder
from taxel.cli.printing import console, print_json, progress, say
from taxel.errors import BadInput
from taxel.held import only_writer


@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """Print a published table with ours beside it, or cross-validate a recipe on recordings."""

    what: tyro.conf.Positional[str]
    """"teng-table" for Table 4.1 of the TENG thesis, "teng-models" for every model under both
    splits, "teng-cleaning" for what denoising and augmentation give, "unknown" for how well objects
    that were never learned are told from the known, "transition-tables" for
    Tables 1 to 3 of the grasp-transition paper, "grasp-warnings" for leads and false alarms on
    unseen cups, "precisions" for what engines and number formats of a backbone cost and lose,
    "slip-trials" for slip on unseen objects of gelsight-slip, or a folder of recordings of an
    array."""
    preset: Annotated[str, tyro.conf.arg(metavar="{honest,paper,both}")] = "both"
    """teng-table: which simulated data sets to use."""
    data: Path | None = None
    """teng-table: a folder that holds honest/ and paper/; teng-models, teng-cleaning, unknown: a
    folder of recordings of an array; transition-tables, grasp-warnings: a folder of pours; as
    taxel simulate writes them. All but slip-trials simulate their own unless given."""
    never: tuple[str, ...] = ()
    """unknown, with --data: values of the label that are never learned, instead of each in turn."""
    rejected: float = 0.05
    """unknown: share of known touch that may be called unknown, 0…1."""
    scans_per_class: int = 160_000
    """teng-table: scans a class to simulate (the thesis: about 160,000)."""
    folds: int = 5
    """Folders: how many folds."""
    output: Path | None = None
    """Folders: keep the result as a run without weights, for taxel compare and taxel report."""
    fresh: bool = False
    """Folders with --output: fit every fold, also those that a run that was broken off had
    finished: they are kept beside it as OUTPUT.folds, and used where recipe, data and software
    are the same."""
    html: Path | None = None
    """Write a self-contained page with figures to this file."""
    json: bool = False
    """Print JSON."""
    crop: int = 48
    """slip-trials: frames in a crop."""
    plot: Path | None = None
    """grasp-warnings: write a figure of probability over time with the true events (PNG)."""
    grasps: Annotated[GraspOptions, tyro.conf.arg(name="")] = field(default_factory=GraspOptions)
    recipe: Annotated[RecipeOptions, tyro.conf.arg(name="")] = field(default_factory=RecipeOptions)

    def run(self) -> None:
        """Measure and print."""
        if self.fresh and self.output is None:
            raise BadInput("--output with --fresh", "none", "without it no folds are kept")
        older = self._older_page()
        if self.what == "teng-table":
            self._teng_table()
            self._say_page(older)
        elif self.what in ("teng-models", "teng-cleaning"):
            from taxel.cli.evaluate_models import run_cleaning, run_models

            measure = run_models if self.what == "teng-models" else run_cleaning
            measure(self.data, self.recipe, self.scans_per_class, self.folds, self.json)
        elif self.what == "unknown":
            from taxel.cli.evaluate_unknown import run_unknown

            run_unknown(
                self.data, self.recipe, self.scans_per_class, self.folds, self.json, self.never,
                self.rejected,
            )  # fmt: skip
        elif self.what == "transition-tables":
            run_tables(self.grasps, self.data, self.recipe.seed, self.json)
        elif self.what == "grasp-warnings":
            run_warnings(self.grasps, self.data, self.recipe.seed, self.json, self.plot)
        elif self.what == "precisions":
            run_precisions(self.grasps, self.data, self.recipe.seed, self.json)
        elif self.what == "slip-trials":
            from taxel.cli.evaluate_slips import run_slip_trials

            run_slip_trials(
                self.data, self.recipe.seed, self.json, self.grasps.cache, self.crop, self.folds
            )
        else:
            with nullcontext() if self.output is None else only_writer(self.output):
                self._folder(Path(self.what))
            self._say_page(older)

    def _older_page(self) -> bool:
        """Return whether the page takes an older one's place; refuse one that cannot be."""
        if self.html is None:
            return False
        from taxel.views.report.page import check_page

        if not _may_hold(self.html.parent):
            raise BadInput("a file for --html", str(self.html), "name one such as report.html")
        return check_page(self.html)

    def _say_page(self, older: bool) -> None:
        if self.html is not None and not self.json:
            said = f"page with figures: {self.html}{', replaced' if older else ''}"
            say(said)

    def _teng_table(self) -> None:
        from taxel.evaluation.teng_table import TengTableConfig, section_plan, teng_table
        from taxel.sources.data_sets import simulate_presets
        from taxel.training.loop import TrainConfig

        presets = {"both": ("honest", "paper")}.get(self.preset, (self.preset,))
        if not set(presets) <= {"honest", "paper"}:
            raise BadInput("--preset honest, paper or both", repr(self.preset), "name one of them")
        train = TrainConfig(seed=self.recipe.seed)
        if self.recipe.epochs is not None:
            train = replace(train, epochs=self.recipe.epochs)
        config = TengTableConfig(train=train, seed=self.recipe.seed)
        with tempfile.TemporaryDirectory(prefix="taxel-") as scratch, progress() as bar:
            folder = self.data or Path(scratch)
            if self.data is None:
                simulate_presets(folder, presets, self.scans_per_class, self.recipe.seed)
            folders = {preset: folder / preset for preset in presets}
            task = bar.add_task("starting", total=len(section_plan(presets)))

            def on_step(line: str) -> None:
                bar.update(task, description=line, advance=1)

            sections = teng_table(folders, config, on_step)
            if self.html is not None:
                from taxel.views.report import write_teng_report

                write_teng_report(self.html, sections, folders)
        if self.json:
            print_json([asdict(section) for section in sections])
            return
        from taxel.views.results import teng_sections

        console.print(teng_sections(sections))
        training_s = sum(c.training_s for s in sections for c in s.columns.values()
                         if c.model != "minirocket")  # fmt: skip
        say(
            f"training of both networks, all of the above: {training_s:.0f} s. "
            "Intervals: 95 %, whole sessions resampled."
        )

    def _folder(self, path: Path) -> None:
        from taxel.evaluation.checked import check_recipe
        from taxel.evaluation.kept_folds import folds_folder, forget_folds

        recipe = self.recipe.resolve()
        if self.output is not None:
            check_run_folder(self.output)
        with progress() as bar:
            task = bar.add_task("starting", total=None)
            checked = check_recipe(
                path,
                recipe,
                folds=self.folds,
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


def _may_hold(folder: Path) -> bool:
    """Return whether a file can lie there: it is a folder, or could become one."""
    return folder.is_dir() if folder.exists() else _may_hold(folder.parent)
