"""`taxel train-trials`: train a recogniser of camera trials; a run with its bundle."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from taxel.bundles.trials import IN_RUN
from taxel.cli.long_work import LongWork
from taxel.cli.options.arrays import check_run_folder
from taxel.cli.options.rules import Only
from taxel.cli.options.trials import FOLDS_IN_TURN, TrialOptions
from taxel.cli.printing import command, console, print_json, progress, say
from taxel.held import only_writer
from taxel.plain_text import number_of, visible, visible_names

if TYPE_CHECKING:
    from taxel.evaluation.camera_trials.crossval import Difference, TrialResult
    from taxel.evaluation.camera_trials.cut_choice import CutTrials
    from taxel.evaluation.camera_trials.sides import TrialSplit


@dataclass(frozen=True, kw_only=True)
class TrainTrials:
    """Train a recogniser of camera trials; its accuracy is measured first.

    PATH is a table (CSV) with one row for each trial, or a folder of recordings of tactile
    cameras. The table's columns: left and right, or camera:NAME for each camera (a video, an
    image or a folder of images); label:NAME; group:NAME; and, where wanted, split.
    """

    trials: tyro.conf.Positional[Path]
    """A table of camera trials, or a folder of recordings."""
    output: Path | None = None
    """Folder to write the run and its bundle to; an older run there is replaced. Named for the
    data unless given."""
    check: bool = True
    """Measure accuracy first, and store it with the run."""
    json: bool = False
    """Print JSON."""
    options: Annotated[TrialOptions, tyro.conf.arg(name="")] = field(default_factory=TrialOptions)

    RULES: ClassVar = (
        Only(("fold-count",), "accuracy measured (no --no-check)", lambda verb: verb.check),
        FOLDS_IN_TURN,
    )

    def run(self) -> None:
        """Check, train and save."""
        output = self.output or _folder_for(self.trials)
        check_run_folder(output)
        with only_writer(output):
            self._train(output)

    def _train(self, output: Path) -> None:
        from taxel.evaluation.camera_trials.contenders import contenders_for
        from taxel.evaluation.camera_trials.crossval import difference, judge_trials, rivals
        from taxel.evaluation.camera_trials.final import fit_final, save_trial_run
        from taxel.views.tables.trials import part_choices, trial_json

        results: list[TrialResult] = []
        differences: list[Difference] = []
        with self.options.work.open(), progress() as bar:
            work = LongWork(bar)
            cut, split, found = self.options.load(self.trials, work, folds=self.check, final=True)
            trials, kept = cut.usual, cut.sides[-1]
            on_step = partial(work.step, "training")
            if self.check:
                seed = self.options.seed
                results = judge_trials(
                    trials, split, seed, contenders_for(trials), on_step, cut.sides[:-1]
                )
                differences = [
                    difference(trials, split, results[0], other) for other in rivals(results)
                ]
            measured = _measured(split, results)
            final = fit_final(kept, found, split, self.options.seed, measured, on_step)
        result = trial_json(trials, split, results, differences, cut) if results else {}
        result |= {  # of the bundle, where folds chose otherwise
            "crop": kept.layout.crop,
            "every": kept.layout.step,
            "of_moving_part": kept.layout.moving,
            "part_chosen": part_choices(cut, split),
        }
        about = save_trial_run(output, final, result)
        if self.json:
            print_json(about)
            return
        self._say(output, about, cut, split, results, differences)

    def _say(
        self,
        output: Path,
        about: dict[str, Any],
        cut: CutTrials,
        split: TrialSplit,
        results: list[TrialResult],
        differences: list[Difference],
    ) -> None:
        from taxel.recordings.imports.spelling import by_numbers
        from taxel.views.tables.trial_notes import control_warnings, cut_line, trial_notes
        from taxel.views.tables.trials import trial_tables

        trials, kept = cut.usual, cut.sides[-1]
        if results:
            console.print(trial_tables(trials, split, results, differences, cut))
        for note in () if results else trial_notes(trials):
            say(f"note: {note}")
        if not results and (line := cut_line(cut)):
            say(line)
        for warning in control_warnings(results):
            say(f"warning: {warning}", style="yellow")
        members = ", ".join(f"{name} {share:.2f}" for name, share in about["members"].items())
        say(f"blend, weights by inner folds: {members}")
        if places := about["crop_weights"]:
            say("crops, likewise: " + ", ".join(f"{name} {w:.2f}" for name, w in places.items()))
        replaced = ", replaced" if about["replaced"] else ""
        ordered = sorted(trials.classes, key=by_numbers)
        classes = visible_names(ordered)
        say(
            f"{output}{replaced}: predicts {visible(trials.target)} ({classes}) from crops of "
            f"{kept.layout.words}{' of the part that moves' * kept.layout.moving}, trained on "
            f"{number_of(about['learned_trials'], 'trial')}; bundle {about['bytes']:,} bytes, "
            f"equal to training within {about['parity']:.1e}"
        )
        live = command("taxel", "live", output / IN_RUN, self.options.test or self.trials)
        say(f"next: {live}")


def _folder_for(trials: Path) -> Path:
    """Return where a run goes that nobody named: for ".", too, it is called after its data."""
    return Path(f"{Path(os.path.abspath(trials)).name.removesuffix('.csv')}-run")


def _measured(split: TrialSplit, results: list[TrialResult]) -> dict[str, float]:
    import math

    if not results:
        return {}
    ours = results[0].whole
    bar = max(result.whole.accuracy for result in results if result.name.startswith("bar:"))
    found = {
        f"accuracy, {split.name}": ours.accuracy,
        f"AUC, {split.name}": ours.auc,
        f"log-loss, {split.name}": ours.loss,
        f"accuracy of the best bar beside it, {split.name}": bar,
    }
    return {key: value for key, value in found.items() if math.isfinite(value)}
