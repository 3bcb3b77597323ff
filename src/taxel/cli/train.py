"""`taxel train`: cross-validate a recipe, then train it on all recordings."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import tyro

from taxel.cli.evaluate_grasps import GraspOptions
from taxel.cli.options import RecipeOptions, check_run_folder
from taxel.cli.printing import console, print_json, progress
from taxel.errors import BadInput, RecordingFailed, TaxelError


@dataclass(frozen=True, kw_only=True)
class Train:
    """Train a recogniser on a folder of recordings; its accuracy is measured first."""

    data: tyro.conf.Positional[Path]
    """A folder of recordings, as taxel simulate, record and import write them."""
    output: Path
    """Folder to write the run to: weights, configuration, accuracy."""
    check: bool = True
    """Cross-validate first, so that the run knows its accuracy."""
    folds: int = 5
    """Folds of the cross-validation."""
    unknown: float | None = None
    """Say UNKNOWN to touch that is unlike anything learned, and to at most this share of known
    touch, 0…1, such as 0.05."""
    resume: bool = False
    """Go on from the checkpoint of a run that was broken off."""
    json: bool = False
    """Print JSON."""
    grasp: str | None = None
    """For recordings of tactile cameras: learn a monitor from these features: gel (what markers
    and imprint do) or a backbone's name; --output is then the bundle itself, NAME.taxel."""
    fine_tune: int = 0
    """With --grasp BACKBONE: instead, train the backbone itself end to end for so many epochs;
    --output is then its weights, NAME.safetensors, for --weights. Runs on any device, and under
    torchrun on several."""
    grasps: Annotated[GraspOptions, tyro.conf.arg(name="")] = field(default_factory=GraspOptions)
    recipe: Annotated[RecipeOptions, tyro.conf.arg(name="")] = field(default_factory=RecipeOptions)

    def run(self) -> None:
        """Check, train and save."""
        if self.fine_tune and self.grasp is None:
            raise BadInput("--grasp BACKBONE beside --fine-tune", "none", "name one")
        if self.grasp is not None:
            from taxel.cli.train_grasps import fine_tune_backbone, train_grasps

            if self.fine_tune:
                fine_tune_backbone(
                    self.grasps, self.grasp, self.data, self.output, self.recipe.seed,
                    self.fine_tune, self.json,
                )  # fmt: skip
                return

            train_grasps(
                self.grasps, self.grasp, self.data, self.output, self.recipe.seed, self.json
            )
            return
        from taxel.evaluation.checked import check_recipe
        from taxel.evaluation.final import train_on_all
        from taxel.models.catalogue import find_network
        from taxel.training.environment import Made
        from taxel.training.run import save_run

        if self.unknown is not None and not 0 < self.unknown < 1:
            raise BadInput("--unknown between 0 and 1", f"{self.unknown:g}", "such as 0.05")
        recipe = self.recipe.resolve()
        find_network(recipe.model)
        check_run_folder(self.output)
        accuracy = {}
        with progress() as bar:
            task = bar.add_task("starting", total=None)

            def on_step(line: str) -> None:
                bar.update(task, description=line, advance=1)

            if self.check:
                checked = check_recipe(
                    self.data, recipe, folds=self.folds, bars=(), on_step=on_step
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
                    "target": recipe.target,
                    "classes": run.contract.classes,
                    "parameters": run.contract.parameters,
                    "accuracy": accuracy,
                    "loss": run.history[-1].loss,
                }
            )
            return
        if self.check:
            from taxel.views.results import checked_table

            console.print(checked_table(checked))
        console.print(
            f"{self.output}: {recipe.model}, {run.contract.parameters:,} parameters, "
            f"tells {recipe.target}: {', '.join(run.contract.classes)}"
        )
        console.print(f"next: taxel bundle {self.output} --output {self.output}.taxel")
        if self.check:
            console.print(f"or:   taxel report {self.output} --output report.html")
