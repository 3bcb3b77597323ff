"""`taxel train`: cross-validate a recipe, then train it on all recordings."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from taxel.cli.evaluate_grasps import GraspOptions
from taxel.cli.options import RecipeOptions, check_run_folder
from taxel.cli.printing import command, console, print_json, progress, say
from taxel.errors import BadInput, RecordingFailed, TaxelError
from taxel.held import only_writer
from taxel.plain_text import visible

if TYPE_CHECKING:
    from taxel.decisions.unknown import Unknown
    from taxel.evaluation.checked import Checked


@dataclass(frozen=True, kw_only=True)
class Train:
    """Train a recogniser on a folder of recordings; its accuracy is measured first."""

    data: tyro.conf.Positional[Path]
    """A folder of recordings, as taxel simulate, record and import write them."""
    output: Path
    """Folder to write the run to: weights, configuration, accuracy; an older run there is
    replaced."""
    check: bool = True
    """Cross-validate first, so that the run knows its accuracy."""
    folds: int = 5
    """Folds of the cross-validation."""
    unknown: float | None = None
    """Say UNKNOWN to touch that is unlike anything learned, and to at most this share of known
    touch, 0…1, such as 0.05."""
    resume: bool = False
    """Go on from the checkpoint of a run that was broken off."""
    fresh: bool = False
    """Fit every fold, also those that a run that was broken off had finished: they are kept
    beside --output as OUTPUT.folds, and used where recipe, data and software are the same."""
    json: bool = False
    """Print JSON."""
    grasp: str | None = None
    """For recordings of tactile cameras: learn a monitor from these features: gel (what markers
    and imprint do) or a backbone's name; --output is then the bundle itself, NAME.taxel. "slip"
    learns a slip warning from simulated cups instead, whose poses are kept in DATA."""
    false_alarms: float = 0.3
    """With --grasp slip: false alarms a minute of grasps that hold which are promised; the
    threshold that keeps it comes from training cups held out."""
    fine_tune: int = 0
    """With --grasp BACKBONE: instead, train the backbone itself end to end for so many epochs;
    --output is then its weights, NAME.safetensors, for --weights. Runs on any device, and under
    torchrun on several."""
    grasps: Annotated[GraspOptions, tyro.conf.arg(name="")] = field(default_factory=GraspOptions)
    recipe: Annotated[RecipeOptions, tyro.conf.arg(name="")] = field(default_factory=RecipeOptions)

    def run(self) -> None:
        """Check, train and save."""
        if self.fresh and not self.check:
            raise BadInput("--fresh with a cross-validation", "--no-check", "leave one out")
        if self.fine_tune and self.grasp is None:
            raise BadInput("--grasp BACKBONE beside --fine-tune", "none", "name one")
        if self.grasp == "slip":
            from taxel.cli.train_slip import train_slip

            train_slip(
                self.data, self.output, self.grasps.head, self.false_alarms, self.recipe.seed,
                as_json=self.json,
            )  # fmt: skip
            return
        if self.grasp is not None:
            from taxel.cli.train_grasps import fine_tune_backbone, train_grasps

            if self.fine_tune:
                fine_tune_backbone(
                    self.grasps, self.grasp, self.data, self.output, self.recipe.seed,
                    self.fine_tune, self.json,
                )  # fmt: skip
                return

            with only_writer(self.output):
                train_grasps(
                    self.grasps, self.grasp, self.data, self.output, self.recipe.seed, self.json
                )
            return
        with only_writer(self.output):
            self._train()

    def _train(self) -> None:
        from taxel.evaluation.checked import check_recipe
        from taxel.evaluation.final import train_on_all
        from taxel.evaluation.kept_folds import folds_folder, forget_folds
        from taxel.models.catalogue import find_network
        from taxel.training.environment import Made
        from taxel.training.run import save_run

        if self.unknown is not None and not 0 < self.unknown < 1:
            raise BadInput("--unknown between 0 and 1", f"{self.unknown:g}", "such as 0.05")
        recipe = self.recipe.resolve()
        find_network(recipe.model)
        check_run_folder(self.output)
        older = self.output.exists()
        accuracy = {}
        with progress() as bar:
            task = bar.add_task("starting", total=None)

            def on_step(line: str) -> None:
                bar.update(task, description=line, advance=1)

            if self.check:
                checked = check_recipe(
                    self.data,
                    recipe,
                    folds=self.folds,
                    bars=(),
                    keep_in=folds_folder(self.output),
                    fresh=self.fresh,
                    on_step=on_step,
                )
                accuracy[checked.pooled.split] = checked.pooled.scores.accuracy
            try:
                run = train_on_all(
                    self.data,
                    recipe,
                    accuracy,
                    checkpoints=self.output.with_name(self.output.name + ".checkpoints"),
                    resume=self.resume,
                    unknown=self.unknown,
                    on_epoch=lambda e: on_step(f"all data · epoch {e.number} · loss {e.loss:.4f}"),
                )
                run = replace(run, made=Made.now())
                if self.check:
                    run = replace(run, predictions=checked.predictions, trivial=checked.trivial)
                save_run(self.output, run)
                forget_folds(self.output)
            except TaxelError:
                raise
            except OSError as error:
                raise RecordingFailed(
                    f"needed to write {self.output}; got {error.strerror or error}; "
                    "choose another place with --output."
                ) from error
        if self.json:
            print_json(
                {
                    "run": str(self.output),
                    "replaced": older,
                    "target": recipe.target,
                    "classes": run.contract.classes,
                    "parameters": run.contract.parameters,
                    "accuracy": accuracy,
                    "loss": run.history[-1].loss,
                    "trivial": dict(run.trivial),
                    "notes": checked.dataset.notes if self.check else None,
                    "folds_kept": checked.kept if self.check else 0,
                    "warning": warning(checked) if self.check else None,
                }
            )
            return
        if self.check:
            from taxel.views.results import checked_table, confusion_table

            console.print(checked_table(checked))
            if checked.kept:
                say(kept_line(checked))
            if said := warning(checked):
                say(f"warning: {said}", style="yellow")
            classes = checked.dataset.classes(recipe.target)
            console.print(confusion_table(classes, checked.pooled.scores.confusion))
        say(
            f"{self.output}{', replaced' if older else ''}: {recipe.model}, "
            f"{run.contract.parameters:,} parameters, tells {recipe.target}: "
            f"{', '.join(map(visible, run.contract.classes))}"
        )
        if run.contract.unknown is not None:
            say(_rejects(run.contract.unknown))
        bundle = command("taxel", "bundle", self.output, "--output", f"{self.output}.taxel")
        say(f"next: {bundle}")
        if self.check:
            page = command("taxel", "report", self.output, "--output", "report.html")
            say(f"or:   {page}")


def kept_line(checked: Checked) -> str:
    """Return what must be said where folds were not fitted by this run."""
    folds = f"{checked.kept} fold{'s' if checked.kept > 1 else ''}"
    return f"{folds} kept from a run that was broken off; --fresh fits all of them again"


def warning(checked: Checked) -> str | None:
    """Return what must be said where it cannot be claimed that touch was told; else nothing."""
    from taxel.evaluation.run_scores import GroupInterval, beside_baselines

    pooled, model = checked.pooled, checked.recipe.model
    accuracy, interval = pooled.scores.accuracy, pooled.interval
    standing, said = beside_baselines(
        f"{model} ({accuracy:.1%})".replace("%", " %"),
        accuracy,
        GroupInterval(*interval, pooled.interval_groups),
        pooled.interval_group,
        checked.trivial,
    )
    more = f"record more {pooled.interval_group}s"
    mend = {
        "behind": f"do not claim what it tells; train longer, or {more}",
        "near": f"the difference may be chance; {more}",
        "few": "record more of them",
    }
    return f"{said}: {mend[standing]}" if standing in mend else None


def _rejects(unknown: Unknown) -> str:
    """Return what is called unknown, and how much usual touch is turned away with it."""
    share, windows = unknown.rejected, min(len(one.windows) for one in unknown.densities)
    return (
        f"says UNKNOWN to touch that is stranger than {100 * (1 - share):g} % of known touch in "
        f"sessions held out ({windows:,} windows); so it turns away at most about {100 * share:g} "
        "% of usual windows, more in a session unlike those"
    )
