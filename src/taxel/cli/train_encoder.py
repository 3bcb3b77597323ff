"""`taxel train-encoder`: pretrain the touch encoder on videos of touch, without labels."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from taxel.cli.printing import command, print_json, progress, say
from taxel.errors import BadFile, BadInput

if TYPE_CHECKING:
    from torch import Tensor

    from taxel.training.encoder.videos import TouchVideo

_MOST_EPOCHS = 1000


@dataclass(frozen=True, kw_only=True)
class TrainEncoder:
    """Pretrain the backbone touch: it learns to predict what changes between two images of a gel.

    Labels are not looked at; where a simulator wrote how far the object slipped, that is predicted
    too. A card beside the weights lists all that was seen.
    """

    folders: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of camera trials or recordings of tactile cameras; each is drawn from as often."""
    output: Path
    """The weights to write, NAME.safetensors; the card is NAME.json."""
    without: tuple[str, ...] = ()
    """Values of groups, such as objects, of which no image may be seen."""
    start: Path | None = None
    """Weights of this backbone to begin from; drawn anew unless given."""
    epochs: int = 4
    """Epochs of --steps steps."""
    steps: int = 100
    """Steps of an epoch, 48 pairs of images each."""
    seed: int = 0
    """Seed of everything random."""
    resume: bool = False
    """Continue an interrupted training from its last whole epoch; the checkpoint is kept beside
    --output as NAME.safetensors.checkpoint."""
    json: bool = False
    """Print the card as JSON."""

    def run(self) -> None:
        """Read, pretrain and write."""
        from taxel.models.backbones.weight_files import save_tensors
        from taxel.training.encoder.card import write_card
        from taxel.training.encoder.fit import EncoderConfig, fit_encoder
        from taxel.training.encoder.stored import halved

        self._check()
        start, begun = self._begin()
        config = EncoderConfig(epochs=self.epochs, steps=self.steps, seed=self.seed)
        checkpoint = self.output.with_name(f"{self.output.name}.checkpoint")
        with progress() as bar:
            videos = self._videos(bar)
            task = bar.add_task("pretraining", total=self.epochs * self.steps)
            encoder, losses = fit_encoder(
                videos, config, start=start, checkpoint=checkpoint, resume=self.resume,
                on_step=lambda step, of, loss: bar.update(
                    task, description=f"pretraining, loss {loss:.3f}", completed=step, total=of
                ),
            )  # fmt: skip
        tensors, about = halved(encoder, videos, config)
        save_tensors(self.output, tensors, about.head())
        card = write_card(self.output.with_suffix(".json"), videos, config, losses, begun)
        checkpoint.unlink(missing_ok=True)
        if self.json:
            print_json(card)
            return
        say(f"{self.output}: touch after {self.epochs} epochs on {len(videos)} videos; loss "
            f"{', '.join(f'{loss:.3f}' for loss in losses)}")  # fmt: skip
        say("next: ", command("taxel", "train-monitor", self.folders[0], "--features", "touch",
                              "--weights", self.output, "--output", "grasp.taxel"))  # fmt: skip

    def _check(self) -> None:
        """Refuse, before anything is read, what cannot be meant."""
        if not self.folders:
            raise BadInput("a folder to learn from", "none", "name one or more")
        names = [folder.resolve().name for folder in self.folders]
        if len(set(names)) < len(names):
            raise BadInput("folders of different names", " ".join(names), "rename one: the card "
                           "lists them by name")  # fmt: skip
        for name, value, most in (("epochs", self.epochs, _MOST_EPOCHS), ("steps", self.steps, 10**6)):
            if not 1 <= value <= most:
                raise BadInput(f"--{name} within 1 and {most}", str(value), "choose another")
        if not 0 <= self.seed < 2**31:
            raise BadInput("a --seed of at least 0", str(self.seed), "choose another")
        if self.output.is_dir() or self.output.suffix != ".safetensors":
            raise BadInput("--output NAME.safetensors: the encoder's weights", str(self.output),
                           "name a file such as touch.safetensors")  # fmt: skip

    def _begin(self) -> tuple[dict[str, Tensor] | None, dict[str, Any] | None]:
        """Return the tensors to begin from and the card beside them."""
        if self.start is None:
            return None, None
        from taxel.foreign.files import MIB, read_text
        from taxel.foreign.json_text import parse_json
        from taxel.models.backbones.touch import TouchEncoder
        from taxel.models.backbones.weight_files import backbone_tensors, load_backbone_weights

        module = TouchEncoder()
        load_backbone_weights(module, "touch", self.start)
        card = self.start.with_suffix(".json")
        try:
            begun = parse_json(read_text(card, MIB))
        except (OSError, BadFile) as error:
            raise BadInput(
                f"the card of {self.start.name}, which says what it saw",
                f"none that can be read in {card}", "give weights that train-encoder wrote",
            ) from error  # fmt: skip
        return backbone_tensors(module), begun if isinstance(begun, dict) else None

    def _videos(self, bar: Any) -> list[TouchVideo]:
        from taxel.training.encoder.videos import read_touch_videos, without

        videos: list[TouchVideo] = []
        for folder in self.folders:
            task = bar.add_task(f"reading {folder.name}", total=None)
            videos += read_touch_videos(
                folder.resolve(), lambda done, of, task=task: bar.update(task, completed=done, total=of)  # type: ignore[misc]
            )
        known = {value for video in videos for value in video.groups.values()}
        if unknown := sorted(set(self.without) - known):
            raise BadInput("--without of groups that are there", unknown[0], "check its spelling")
        return without(videos, self.without)
