"""`taxel distil`: train an image network to give a trained one's outputs on touch images."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro
from rich.progress import Progress as Bar

from taxel.cli.options.cameras import EngineOptions
from taxel.cli.printing import command, print_json, progress, say
from taxel.errors import BadInput
from taxel.plain_text import number_of
from taxel.recordings.whole import check_place

if TYPE_CHECKING:
    from taxel.models.students import Student
    from taxel.training.backbones.distilling import Agreement, DistilConfig
    from taxel.training.backbones.fresh_transfer_set import FreshTransferSet
    from taxel.training.backbones.touch_images import ImageSource
    from taxel.training.backbones.transfer_set import TransferConfig, TransferSet
    from taxel.training.frames.extractors import BackboneExtractor

_MOST_EPOCHS, _MOST_FRAMES, _MOST_COPIES, _MOST_BATCH = 1000, 1000, 100, 4096
_TEST_SEED = 0
"""Of the changes to images that are tested, so that files of any seed are judged on the same."""


@dataclass(frozen=True, kw_only=True)
class Distil:
    """Train a backbone (the student) to reproduce a trained one's 1000 outputs on touch images.

    No labels are needed. One object in five is kept out of training, to measure how often both
    name the same class first. The written file states how it was trained. With --engine torch, a
    graphics card is used where there is one, and each pass sees newly augmented images.
    """

    data: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of recordings of tactile cameras, with the group object or cup; the data set
    gelsight-slip is read as it was published."""
    backbone: str
    """The student, such as densenet121."""
    output: Path
    """The weights to write, NAME.safetensors."""
    teacher: str = "resnet50"
    """The trained backbone whose outputs are learned; its weights must be here."""
    start: Path | None = None
    """Weights that the student begins with. Unless given, those of a similar network, where they
    are here (resnet101: resnet50, efficientnet-b0: efficientnet-lite0, densenet121:
    densenet121-typefaces), else random numbers."""
    side_px: tuple[int, ...] = (96,)
    """Height and width of the student's images, pixels; multiples of 32 fit all backbones. Of
    several, each is used for an equal share of the epochs, in this order: smaller images first
    save time. The last is that of the written file."""
    frames: int = 2
    """Images from each video, spread over its whole length."""
    copies: int = 3
    """Versions of each image: itself, the others cropped, turned and changed in colour."""
    epochs: int = 4
    """Passes over all images."""
    batch: int = 32
    """Images per training step; the learning rate grows with the square root of this number."""
    bf16: bool = False
    """Train in 16 bits (bfloat16): faster on graphics cards and on processors that multiply it."""
    resume: bool = False
    """Continue an interrupted training from its last whole epoch; the checkpoint is kept
    beside --output as NAME.safetensors.checkpoint."""
    seed: int = 0
    """Seed of all that training draws. Objects and images that are tested do not depend on it."""
    cache: Path | None = None
    """Folder for the teacher's outputs; $TAXEL_CACHE or ~/.cache/taxel unless given."""
    json: bool = False
    """Print JSON."""
    engine: Annotated[EngineOptions, tyro.conf.arg(name="")] = field(default_factory=EngineOptions)

    def run(self) -> None:
        """Gather images and answers, train, test and write."""
        self._check()  # before PyTorch is loaded: a mistyped option is refused at once

        from taxel.models.backbones.weight_files import save_backbone_weights
        from taxel.models.students import begin_student, check_student
        from taxel.training.backbones.distilling import agreement, distil
        from taxel.training.backbones.fine_tuning import KeptEpochs
        from taxel.training.backbones.touch_images import find_videos, split_objects

        for side_px in self.side_px:
            check_student(self.backbone, self.teacher, side_px)
        if self.start is not None:  # refused before images are read, which can take hours
            begin_student(self.backbone, self.start, self.seed)
        checkpoint = self.output.with_name(f"{self.output.name}.checkpoint")
        with progress() as bar:
            videos = [video for folder in self.data for video in find_videos(folder)]
            learn, kept = split_objects(videos)
            teacher = self._open_teacher()
            largest = max(self.side_px)
            examples = self._gather_fresh(learn, teacher, bar) or self._gather(
                learn, teacher, bar, self._images(largest, self.seed)
            )
            unseen = self._gather(kept, teacher, bar, self._images(self.side_px[-1], _TEST_SEED))
            student = begin_student(self.backbone, self.start, self.seed)
            task = bar.add_task("learning", total=None)
            epochs = distil(
                student.module, examples, self._config(student),
                kept=KeptEpochs(checkpoint, self.resume), start=student.start_digest,
                on_step=lambda step, of, loss: bar.update(
                    task, description=f"learning, loss {loss:.3f}", completed=step, total=of
                ),
                on_fit=lambda done, of: bar.update(
                    task, description="fitting the top", completed=done, total=of
                ),
            )  # fmt: skip
            plain = agreement(student.module, unseen, plain=True, batch=self.batch)
            altered = None
            if self.copies > 1:
                altered = agreement(student.module, unseen, plain=False, batch=self.batch)
            student.module.cpu()
        objects = len({video.object for video in learn})
        seen = f"{number_of(len(examples), 'image')} of {number_of(objects, 'object')}"
        start = student.start
        if any(epoch.norms_kept for epoch in epochs):
            start += ", norms kept, a tenth of the step size"
        about = self._about(teacher, start, seen, altered or plain)
        save_backbone_weights(student.module, self.output, about.head())
        checkpoint.unlink(missing_ok=True)
        self._print(tuple(epoch.loss for epoch in epochs), plain, altered, about.trained)

    def _check(self) -> None:
        """Refuse, before anything is read, what cannot be meant."""
        if not self.data:
            raise BadInput("a folder of images", "none", "make one: taxel simulate cup-pour")
        limits = {"epochs": _MOST_EPOCHS, "frames": _MOST_FRAMES, "copies": _MOST_COPIES,
                  "batch": _MOST_BATCH}  # fmt: skip
        for name, most in limits.items():
            least, given = 2 if name == "batch" else 1, getattr(self, name)
            if not least <= given <= most:
                raise BadInput(f"--{name} within {least} and {most}", f"{given}", "choose another")
        if not 1 <= len(self.side_px) <= self.epochs:
            raise BadInput(
                f"{'one size' if self.epochs == 1 else f'1 to {self.epochs} sizes'} for --side-px, "
                "one epoch each at least", f"{len(self.side_px)}",
                "name fewer, or set more --epochs" if self.side_px else "name one, such as 96",
            )  # fmt: skip
        if self.engine.precision == "int8":
            raise BadInput("--precision f32 or bf16 for a teacher", "int8", "choose another")
        if not 0 <= self.seed < 2**31:
            raise BadInput(f"--seed within 0 and {2**31 - 1}", str(self.seed), "choose another")
        if self.output.is_dir() or not self.output.name.endswith(".safetensors"):
            raise BadInput("--output NAME.safetensors: a backbone's weights", str(self.output),
                           f"name a file such as {self.backbone}.safetensors")  # fmt: skip
        check_place(self.output)
        if self.cache is not None:
            check_place(self.cache / "answers" / self.teacher)

    def _open_teacher(self) -> BackboneExtractor:
        from taxel.models.weights import RANDOM
        from taxel.training.frames.extractors import open_backbone

        teacher = open_backbone(
            self.teacher, engine=self.engine.engine, precision=self.engine.precision
        )
        if teacher.weights.label == RANDOM:
            raise BadInput(
                f"trained weights of the teacher {self.teacher}", "none here",
                f"fetch them: taxel weights fetch {self.teacher}",
            )  # fmt: skip
        return teacher

    def _images(self, side_px: int, seed: int) -> TransferConfig:
        """Return which images of each video are shown, and how large."""
        from taxel.training.backbones.transfer_set import TransferConfig

        return TransferConfig(side_px=side_px, frames=self.frames, copies=self.copies, seed=seed)

    def _gather(
        self, videos: list[ImageSource], teacher: BackboneExtractor, bar: Bar,
        config: TransferConfig,
    ) -> TransferSet:  # fmt: skip
        from taxel.training.backbones.transfer_set import gather_transfer_set
        from taxel.training.frames.features import default_cache

        most = len(videos) * self.frames * self.copies
        task = bar.add_task(f"answers of {self.teacher}", total=most)
        return gather_transfer_set(videos, teacher, config, self.cache or default_cache(),
                              lambda done: bar.update(task, completed=done))  # fmt: skip

    def _gather_fresh(
        self, videos: list[ImageSource], teacher: BackboneExtractor, bar: Bar
    ) -> FreshTransferSet | None:
        """Return a transfer set on a graphics card; None where the teacher runs on a processor."""
        from taxel.models.torch_engine import TorchEngine
        from taxel.training.backbones.fresh_transfer_set import gather_fresh

        engine = teacher.engine
        if not isinstance(engine, TorchEngine) or not engine.on_card:
            return None
        config = self._images(max(self.side_px), self.seed)
        task = bar.add_task("images", total=len(videos) * self.frames * self.copies)
        return gather_fresh(videos, engine, teacher.key, config,
                            lambda done: bar.update(task, completed=done))  # fmt: skip

    def _config(self, student: Student) -> DistilConfig:
        from taxel.training.backbones.distilling import BATCH, DistilConfig

        rate = student.learning_rate * (self.batch / BATCH) ** 0.5
        return DistilConfig(epochs=self.epochs, sides_px=self.side_px, batch=self.batch,
                            learning_rate=rate, bf16=self.bf16, seed=self.seed)  # fmt: skip

    def _about(self, teacher: BackboneExtractor, start: str, seen: str, unseen: Agreement) -> Any:
        """Return the description that the file of weights holds."""
        from taxel.models.backbones.catalogue import find_backbone
        from taxel.models.published.about import About

        usual = find_backbone(self.backbone).height_px
        sides = " then ".join(map(str, self.side_px))
        return About(
            origin="taxel distil",
            trained=f"answers of {self.teacher}, {teacher.weights.words}, learned on touch, "
            f"{seen}, {sides} px, {number_of(self.epochs, 'epoch')}, from {start}; "
            f"same first answer on {'changed ' if self.copies > 1 else ''}images of unseen objects "
            f"{unseen.words}",
            side_px="" if self.side_px[-1] == usual else str(self.side_px[-1]),
        )

    def _print(
        self, losses: tuple[float, ...], plain: Agreement, altered: Agreement | None, words: str
    ) -> None:
        from dataclasses import asdict

        if self.json:
            print_json({"weights": str(self.output), "losses": losses, "unseen": asdict(plain),
                        "unseen_changed": asdict(altered) if altered else None,
                        "trained": words})  # fmt: skip
            return
        say(f"{self.output}: {self.backbone}, {words}")
        say(f"loss of each epoch: {', '.join(f'{loss:.3f}' for loss in losses)}")
        say(f"same first answer on images of unseen objects as they are: {plain.words}")
        further = command("taxel", "reproduce", "transition-tables", "--backbones", self.backbone,
                          "--weights", self.output)  # fmt: skip
        say(f"next: {further}")
