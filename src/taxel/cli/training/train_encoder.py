"""`taxel train-encoder`: pretrain the touch encoder on videos of touch, without labels."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from taxel.cli.printing import command, print_json, progress, say
from taxel.errors import BadInput
from taxel.plain_text import number_of
from taxel.recordings.whole import check_place, write_whole

_MOST_EPOCHS, _MOST_STEPS = 1000, 1_000_000


@dataclass(frozen=True, kw_only=True)
class TrainEncoder:
    """Pretrain the touch encoder, the backbone touch, on videos of gels.

    It learns to predict what changes between two images. Labels are not used; where a simulator
    recorded how far the object slipped, that is predicted too. A card beside the weights lists
    all that was trained on.
    """

    folders: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of camera trials or recordings of tactile cameras; each gets an equal
    share of training."""
    output: Path
    """The weights to write, NAME.safetensors; beside them NAME.onnx, and the card, NAME.json."""
    without: tuple[str, ...] = ()
    """Values of groups, such as names of objects, that are left out of training."""
    start: Path | None = None
    """Weights of this backbone to begin with, or touch for those that come with taxel; random
    numbers unless given."""
    epochs: int = 4
    """Number of epochs, each of --steps steps."""
    steps: int = 100
    """Steps in an epoch, each on 48 pairs of images."""
    learning_rate: float = 2e-3
    """Largest step size of the optimiser."""
    bf16: bool = False
    """Train in 16 bits (bfloat16): faster on processors that multiply bfloat16."""
    seed: int = 0
    """Seed of everything random."""
    resume: bool = False
    """Continue an interrupted training from its last whole epoch; the checkpoint is kept beside
    --output as NAME.safetensors.checkpoint."""
    json: bool = False
    """Print the card as JSON."""

    def run(self) -> None:
        """Read, pretrain and write."""
        self._check()  # before PyTorch is loaded: a mistyped option is refused at once

        from taxel.models.backbones.weight_files import save_tensors
        from taxel.training.backbones.fine_tuning import KeptEpochs
        from taxel.training.encoder.card import write_card
        from taxel.training.encoder.fit import EncoderConfig, fit_encoder
        from taxel.training.encoder.stored import encoder_onnx, halved, read_encoder
        from taxel.training.encoder.videos import read_folders

        begun = read_encoder(self.start) if self.start else None
        config = EncoderConfig(
            epochs=self.epochs,
            steps=self.steps,
            learning_rate=self.learning_rate,
            bf16=self.bf16,
            seed=self.seed,
        )
        checkpoint = self.output.with_name(f"{self.output.name}.checkpoint")
        with progress() as bar:
            task = bar.add_task("reading", total=None)
            videos = read_folders(
                self.folders, self.without,
                lambda done, of: bar.update(task, completed=done, total=of),
            )  # fmt: skip
            fitted = fit_encoder(
                videos, config, start=begun.tensors if begun else None,
                kept=KeptEpochs(checkpoint, self.resume),
                on_step=lambda step, of, loss: bar.update(
                    task, description=f"pretraining, loss {loss:.3f}", completed=step, total=of
                ),
            )  # fmt: skip
        stored = halved(fitted.encoder, videos, config)
        save_tensors(self.output, stored.tensors, stored.about.head())
        write_whole(self.output.with_suffix(".onnx"), encoder_onnx(stored.tensors))
        card = write_card(
            self.output.with_suffix(".json"),
            videos,
            config,
            fitted.losses,
            begun.card if begun else None,
        )
        checkpoint.unlink(missing_ok=True)
        if self.json:
            print_json(card)
            return
        say(f"{self.output}: touch after {number_of(self.epochs, 'epoch')} on "
            f"{number_of(len(videos), 'video')}; loss "
            f"{', '.join(f'{loss:.3f}' for loss in fitted.losses)}")  # fmt: skip
        say("next: ", command("taxel", "train-monitor", self.folders[0], "--features", "touch",
                              "--weights", self.output, "--output", "grasp.taxel"))  # fmt: skip

    def _check(self) -> None:
        """Refuse, before anything is read, what cannot be meant."""
        if not self.folders:
            raise BadInput("a folder to learn from", "none", "name one or more")
        for name, value, most in (
            ("epochs", self.epochs, _MOST_EPOCHS), ("steps", self.steps, _MOST_STEPS)
        ):  # fmt: skip
            if not 1 <= value <= most:
                raise BadInput(f"--{name} within 1 and {most}", str(value), "choose another")
        if not 0 < self.learning_rate <= 1:
            raise BadInput("a --learning-rate above 0, at most 1", f"{self.learning_rate:g}",
                           "choose another, such as 0.001")  # fmt: skip
        if not 0 <= self.seed < 2**31:
            raise BadInput(f"--seed within 0 and {2**31 - 1}", str(self.seed), "choose another")
        if self.output.is_dir() or self.output.suffix != ".safetensors":
            raise BadInput("--output NAME.safetensors: the encoder's weights", str(self.output),
                           "name a file such as touch.safetensors")  # fmt: skip
        for suffix in (".safetensors", ".onnx", ".json"):
            check_place(self.output.with_suffix(suffix))
