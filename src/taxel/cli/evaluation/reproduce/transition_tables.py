"""`taxel reproduce transition-tables`: Tables 1 to 3 of the grasp-transition paper."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from taxel.cli.options.cameras import (
    AHEAD,
    GEL,
    THREADS,
    EngineOptions,
    FitOptions,
    LabelOptions,
    WeightOptions,
    backbone_names,
    extract_features,
    given_or_simulated,
    head_config,
    load_set,
    open_features,
)
from taxel.cli.printing import console, print_json, progress, say
from taxel.errors import BadInput
from taxel.plain_text import number_of

if TYPE_CHECKING:
    pass


@dataclass(frozen=True, kw_only=True)
class TransitionTables:
    """Print Tables 1 to 3 of the grasp-transition paper (Sensors 2024, 24, 5080) with ours beside.

    Every row is measured with each cup held out in turn, on recordings of five simulated cups
    unless others are given. A folder of weights may also hold a backbone that one model alone uses,
    trained end to end with its head: resnet50+transformer.safetensors.
    """

    data: Path | None = None
    """A folder of recordings of tactile cameras; simulated unless given."""
    backbones: tuple[str, ...] = ("efficientnet-lite0",)
    """Names of backbones, or "paper" for the paper's four."""
    single_split: bool = False
    """Only the paper's split, one cup held out."""
    steps: bool = True
    """Time a step of each model too."""
    json: bool = False
    """Print JSON."""
    labels: Annotated[LabelOptions, tyro.conf.arg(name="")] = field(default_factory=LabelOptions)
    fit: Annotated[FitOptions, tyro.conf.arg(name="")] = field(default_factory=FitOptions)
    weights: Annotated[WeightOptions, tyro.conf.arg(name="")] = field(default_factory=WeightOptions)
    engine: Annotated[EngineOptions, tyro.conf.arg(name="")] = field(default_factory=EngineOptions)

    RULES: ClassVar = (AHEAD, THREADS)

    def run(self) -> None:
        """Measure and print."""
        from taxel.evaluation.transitions.step_times import time_step
        from taxel.evaluation.transitions.tables import (
            BackboneSeen,
            measure_rows,
            plan_rows,
            trivial_rows,
        )
        from taxel.models.transition import FRAMES, find_transition

        self.engine.check()
        backbones = backbone_names(self.backbones)
        if GEL in backbones:
            raise BadInput("backbones for the tables", GEL, "name others with --backbones")
        config = head_config(self.labels.rule, self.fit, features=backbones[0])
        with progress() as bar, given_or_simulated(self.data, self.fit.seed, bar) as folder:
            pours = load_set(self.labels, folder, bar)
            seen: dict[str, BackboneSeen] = {}
            times = {}
            plans = plan_rows(backbones)
            for name, models in self._sources([plan.model for plan in plans]).items():
                backbone = find_transition(models[0]).backbone
                tare = head_config(self.labels.rule, self.fit, features=backbone).tare
                extractor = open_features(
                    backbone, pours, self._weights_of(name), self.engine, tare
                )
                found = extract_features(extractor, backbone, pours, self.labels.folder(), bar)
                weights = extractor.weights  # type: ignore[union-attr]
                seen[name] = BackboneSeen(weights.label, found, weights.origin, tare)
                timed = [plan.model for plan in plans if self.steps and plan.frames == FRAMES]
                for model in timed:
                    if model in models:
                        times[model] = time_step(
                            model, extractor=extractor,  # type: ignore[arg-type]
                            engine=self.engine.engine, precision=self.engine.precision,
                            threads=self.weights.threads,
                        )  # fmt: skip
            task = bar.add_task("training", total=len(plans))
            rows = measure_rows(
                pours, seen, plans, config,
                every_cup=not self.single_split,
                on_row=lambda name: bar.update(task, description=name, advance=1),
            )  # fmt: skip
            baselines = trivial_rows(pours)
        self._print(rows, baselines, times, pours.unstable_share())

    def _sources(self, models: list[str]) -> dict[str, list[str]]:
        """Return which models a backbone serves, by its name, or by that of the only model."""
        from taxel.models.weights import model_weights

        sources: dict[str, list[str]] = {}
        for model in models:
            own = model_weights(model, self.weights.weights)
            sources.setdefault(model if own else model.partition("+")[0], []).append(model)
        return sources

    def _weights_of(self, name: str) -> WeightOptions:
        """Return where the weights of a source are."""
        from taxel.models.weights import model_weights

        own = model_weights(name, self.weights.weights) if "+" in name else None
        return replace(self.weights, weights=own) if own else self.weights

    def _print(
        self, rows: list[Any], baselines: list[Any], times: dict[str, Any], unstable: float
    ) -> None:
        rule, engine = self.labels.rule, self.engine
        if self.json:
            print_json(
                {
                    "rule": rule,
                    "features": f"{engine.engine} {engine.precision}",
                    "unstable": unstable,
                    "rows": [asdict(row) for row in rows],
                    "baselines": [asdict(row) for row in baselines],
                    "steps": [asdict(step) | {"share": step.share} for step in times.values()],
                }
            )
            return
        from taxel.views.tables.grasps import transition_tables

        console.print(transition_tables(rows, baselines, times, rule, unstable))
        say(
            f"training of all rows: {sum(row.training_s for row in rows):.0f} s of processor time; "
            f"steps: {engine.engine} {engine.precision}, "
            f"{number_of(self.weights.threads, 'thread')}."
        )
        if rule == "change":
            say(
                "This rule compares images with the first ones, so a difference of pixels solves "
                "it too: read the tables as parity with the paper, not as a warning of slip."
            )
