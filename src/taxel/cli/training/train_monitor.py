"""`taxel train-monitor`: learn a grasp monitor from tactile cameras, and write its bundle."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import tyro

from taxel.cli.options.cameras import (
    AHEAD,
    BACKBONE_ONLY,
    GEL,
    THREADS,
    EngineOptions,
    FitOptions,
    HeadOptions,
    LabelOptions,
    WeightOptions,
    extract_features,
    head_config,
    load_set,
    open_features,
)
from taxel.cli.options.rules import Only
from taxel.cli.options.work import WorkOptions
from taxel.cli.printing import command, print_json, progress, say
from taxel.errors import BadInput
from taxel.held import only_writer

if TYPE_CHECKING:
    from taxel.bundles.grasp import GraspContract
    from taxel.evaluation.early_warning.learn_monitor import LearntMonitor
    from taxel.windows.camera_recordings import CameraRecording


@dataclass(frozen=True, kw_only=True)
class TrainMonitor:
    """Train a monitor that warns before a grasp turns unstable, from tactile cameras.

    The last cups are held out if there are enough. Writes the bundle that runs live.
    """

    data: tyro.conf.Positional[Path]
    """A folder of recordings of tactile cameras."""
    output: Path
    """The bundle to write, NAME.taxel; an older one there is replaced."""
    features: str = GEL
    """Features of each frame: gel (from markers and imprint), or the name of a backbone."""
    json: bool = False
    """Print JSON."""
    labels: Annotated[LabelOptions, tyro.conf.arg(name="")] = field(default_factory=LabelOptions)
    head: Annotated[HeadOptions, tyro.conf.arg(name="")] = field(default_factory=HeadOptions)
    fit: Annotated[FitOptions, tyro.conf.arg(name="")] = field(default_factory=FitOptions)
    weights: Annotated[WeightOptions, tyro.conf.arg(name="")] = field(default_factory=WeightOptions)
    engine: Annotated[EngineOptions, tyro.conf.arg(name="")] = field(default_factory=EngineOptions)
    work: Annotated[WorkOptions, tyro.conf.arg(name="")] = field(default_factory=WorkOptions)

    RULES: ClassVar = (
        AHEAD,
        THREADS,
        Only(BACKBONE_ONLY, "--features BACKBONE", lambda o: o.features != GEL),
    )

    def run(self) -> None:
        """Train, write the bundle and print what it is worth."""
        if self.output.is_dir() or not self.output.name.endswith(".taxel"):
            raise BadInput(
                "--output NAME.taxel: a monitor is written as the bundle that runs live",
                str(self.output), "name a file such as grasp.taxel",
            )  # fmt: skip
        self.engine.check()
        with only_writer(self.output):
            self._train()

    def _train(self) -> None:
        from taxel.evaluation.early_warning.learn_monitor import (
            check_alike,
            learn_monitor,
            write_monitor,
        )
        from taxel.training.frames.extractors import BackboneExtractor

        config = head_config(self.labels.rule, self.fit, self.head, features=self.features)
        with self.work.open(), progress() as bar:
            pours = load_set(self.labels, self.data, bar)
            check_alike(pours.pours)
            extractor = open_features(self.features, pours, self.weights, self.engine, config.tare)
            features = extract_features(extractor, self.features, pours, self.labels.folder(), bar)
            task = bar.add_task("training", total=None)
            learnt = learn_monitor(
                pours, features, config,
                on_step=lambda line: bar.update(task, description=f"training, {line}", advance=1),
            )  # fmt: skip
        backbone = extractor if isinstance(extractor, BackboneExtractor) else None
        contract, parity = write_monitor(
            self.output, learnt, pours, features, self.features, backbone
        )
        self._print(contract, parity, learnt, pours.pours[0])

    def _print(
        self, contract: GraspContract, parity: float, learnt: LearntMonitor, first: CameraRecording
    ) -> None:
        from taxel.sim.pour.state import has_truth

        measured = dict(contract.measured)
        if self.json:
            from taxel.training.curves import curves_to_json

            print_json({"bundle": str(self.output), "parity": parity, "measured": measured,
                        "parameters": contract.parameters,
                        "curves": curves_to_json(learnt.curves)})  # fmt: skip
            return
        say(
            f"{self.output}: {self.features} + {contract.head}, {contract.parameters:,} "
            f"parameters, warns of {contract.rule}; probabilities differ from the trained "
            f"model's by at most {parity:.1e}"
        )
        if measured:
            say("on cups held out: " + ", ".join(f"{k} {v:.3g}" for k, v in measured.items()))
        simulated = has_truth(first.sensor.channels)
        source = ["sim://cup-pour", "--seconds", "20"] if simulated else [f"replay://{first.path}"]
        say(f"next: {command('taxel', 'live', self.output, *source)}")
