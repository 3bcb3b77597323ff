"""`taxel train-backbone`: train a network of images end to end, and write its weights."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import tyro

from taxel.cli.options.cameras import (
    AHEAD,
    GEL,
    EngineOptions,
    FitOptions,
    HeadName,
    HeadOptions,
    LabelOptions,
    WeightOptions,
    extract_features,
    head_config,
    load_set,
    open_features,
)
from taxel.cli.options.work import WorkOptions
from taxel.cli.printing import command, print_json, progress, say
from taxel.errors import BadInput
from taxel.plain_text import number_of
from taxel.recordings.whole import check_place

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from taxel.evaluation.transitions.data import CameraSet
    from taxel.models.published.about import About
    from taxel.models.weights import Weights
    from taxel.training.backbones.fine_tuning import FineTuned
    from taxel.windows.rest import Tare

_MOST_EPOCHS, _MOST_BATCH = 1000, 1000


@dataclass(frozen=True, kw_only=True)
class TrainBackbone:
    """Train a backbone end to end, with heads behind it, on recordings of tactile cameras.

    Runs on any device, and under torchrun on several. Heads are first fitted on the backbone's
    features as they are. With the rule change, the backbone also learns how far each image is from
    that rule's threshold.
    """

    data: tyro.conf.Positional[Path]
    """A folder of recordings of tactile cameras."""
    backbone: str
    """The backbone's name, such as edge."""
    output: Path
    """The weights to write, NAME.safetensors."""
    epochs: int = 3
    """Passes over the recordings; each gives a stretch (consecutive frames that hold 17 windows)
    for every 60 frames, at another place in each pass."""
    batch: int = 4
    """Stretches per training step, over all processes, which share them equally."""
    learning_rate: float = 1e-4
    """Largest step size of Adam; it rises first, then falls to zero."""
    bf16: bool = False
    """Train in 16 bits (bfloat16): faster on graphics cards and on processors that multiply it."""
    resume: bool = False
    """Continue an interrupted training from its last whole epoch; the checkpoint is kept
    beside --output as NAME.safetensors.checkpoint."""
    json: bool = False
    """Print JSON."""
    labels: Annotated[LabelOptions, tyro.conf.arg(name="")] = field(default_factory=LabelOptions)
    head: tuple[HeadName, ...] = ("lstm", "transformer")
    """Networks over the frames of a window, whose losses the backbone lowers together."""
    frames: int = 8
    """Frames in a window, k."""
    fit: Annotated[FitOptions, tyro.conf.arg(name="")] = field(default_factory=FitOptions)
    weights: Annotated[WeightOptions, tyro.conf.arg(name="")] = field(default_factory=WeightOptions)
    work: Annotated[WorkOptions, tyro.conf.arg(name="")] = field(default_factory=WorkOptions)

    RULES: ClassVar = (AHEAD,)

    def run(self) -> None:
        """Train and write."""
        from taxel.models.backbones.weight_files import save_backbone_weights
        from taxel.training.backbones.fine_tuning import (
            HEAD_RECORDINGS,
            FineTuneConfig,
            KeptEpochs,
            begin_end_to_end,
            fine_tune,
        )
        from taxel.training.frames.extractors import BackboneExtractor

        self._check()
        configs = [
            head_config(self.labels.rule, self.fit, HeadOptions(head=head, frames=self.frames),
                        features=self.backbone)
            for head in self.head
        ]  # fmt: skip
        tare = configs[0].tare
        checkpoint = self.output.with_name(f"{self.output.name}.checkpoint")
        with self.work.open(), progress() as bar:
            pours = load_set(self.labels, self.data, bar)
            extractor = open_features(self.backbone, pours, self.weights, self._engine(), tare)
            assert isinstance(extractor, BackboneExtractor)
            head_pours = pours.some(HEAD_RECORDINGS)
            features = extract_features(
                extractor, self.backbone, head_pours, self.labels.folder(), bar
            )
            network = begin_end_to_end(extractor, features, head_pours.labels, configs,
                                       self._excess(head_pours, tare))  # fmt: skip
            start = extractor.weights
            del extractor  # and what it holds of a card's memory
            task = bar.add_task("end to end", total=None)
            done = fine_tune(
                network, pours.pours, pours.labels,
                FineTuneConfig(epochs=self.epochs, batch=self.batch, seed=self.fit.seed,
                               learning_rate=self.learning_rate,
                               precision="bf16-mixed" if self.bf16 else "32-true",
                               kept=KeptEpochs(checkpoint, self.resume)),
                excess=self._excess(pours, tare),
                on_step=lambda step, of, loss: bar.update(
                    task, description=f"end to end, loss {loss:.3f}", completed=step, total=of
                ),
            )  # fmt: skip
        if not done.first:
            return
        about = self._about(len(pours.pours), start)
        save_backbone_weights(network.features.backbone, self.output, about.head())
        checkpoint.unlink(missing_ok=True)
        self._print(done)

    def _excess(self, pours: CameraSet, tare: Tare) -> list[NDArray[np.float32]] | None:
        """Return each frame's change over its threshold; None where labels are not made by it."""
        from taxel.labels.rules import rule_named
        from taxel.training.frames.labels import frame_excess

        if rule_named(self.labels.rule).needs != "images" or tare not in ("size", "local-size"):
            return None
        return frame_excess(pours.pours, pours.signals)

    def _engine(self) -> EngineOptions:
        """Return what computes the features that the head is first fitted on."""
        from taxel.models.torch_engine import best_device

        if best_device().type == "cpu":
            return EngineOptions()
        return EngineOptions(engine="torch", precision="bf16" if self.bf16 else "f32")

    def _check(self) -> None:
        """Refuse, before anything is read, what cannot be meant."""
        if self.backbone == GEL:
            raise BadInput("a backbone to train end to end", GEL, "name one, such as edge")
        if not self.head:
            raise BadInput("a --head", "none", "name one or more, such as lstm transformer")
        for name, most in {"epochs": _MOST_EPOCHS, "batch": _MOST_BATCH}.items():
            if not 1 <= getattr(self, name) <= most:
                raise BadInput(
                    f"--{name} within 1 and {most}", str(getattr(self, name)), "choose another"
                )
        if not 0 < self.learning_rate <= 1:
            raise BadInput(
                "--learning-rate above 0, at most 1", str(self.learning_rate), "choose another"
            )
        if self.output.is_dir() or not self.output.name.endswith(".safetensors"):
            raise BadInput("--output NAME.safetensors: a backbone's weights", str(self.output),
                           f"name a file such as {self.backbone}.safetensors")  # fmt: skip
        check_place(self.output)

    def _about(self, recordings: int, start: Weights) -> About:
        """Return the description that the file of weights holds."""
        from taxel.models.published.about import About

        return About(
            origin="taxel train-backbone",
            trained=f"end to end with {' and '.join(self.head)}, "
            f"{number_of(self.epochs, 'epoch')}, {number_of(recordings, 'recording')}, "
            f"rule {self.labels.rule}, from {start.words}",
            side_px=str(start.side_px or ""),
        )

    def _print(self, done: FineTuned) -> None:
        if self.json:
            print_json({"weights": str(self.output), "losses": done.losses, "device": done.device,
                        "processes": done.processes})  # fmt: skip
            return
        say(
            f"{self.output}: {self.backbone} after {number_of(self.epochs, 'epoch')} on "
            f"{done.device}, {number_of(done.processes, 'process')}; loss "
            f"{', '.join(f'{loss:.3f}' for loss in done.losses)}"
        )
        rule = [] if self.labels.rule == LabelOptions().rule else ["--rule", self.labels.rule]
        frames = [] if self.frames == HeadOptions().frames else ["--frames", self.frames]
        further = command("taxel", "train-monitor", self.data, "--features", self.backbone,
                          "--weights", self.output, "--head", self.head[-1], *rule, *frames,
                          "--output", "grasp.taxel")  # fmt: skip
        say(f"next: {further}")
