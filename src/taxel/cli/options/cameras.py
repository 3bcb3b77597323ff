"""Options of recordings of tactile cameras that several verbs share, and what they open.

Knows nothing about what is learned from the features.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from rich.progress import Progress as Bar

from taxel.cli.options.rules import Only
from taxel.errors import BadInput

if TYPE_CHECKING:
    from taxel.evaluation.transitions.data import CameraSet
    from taxel.training.frames.extractors import BackboneExtractor, SlipExtractor
    from taxel.training.frames.features import FrameFeatures, Progress
    from taxel.training.frames.heads import HeadConfig
    from taxel.windows.camera_recordings import CameraRecording
    from taxel.windows.rest import Tare

PAPER_BACKBONES = ("densenet121", "efficientnet-b0", "resnet50", "resnet101")
GEL = "gel"
"""Name of the features that markers and imprint give, beside the backbones."""
BACKBONE_ONLY = ("weights", "threads", "engine", "precision")
"""Options that change nothing for `GEL`."""


@dataclass(frozen=True, kw_only=True)
class LabelOptions:
    """How frames are labelled."""

    rule: str = "change"
    """Rule of the labels: change (the paper's), micro-slip, slip, gross-slip or drop."""
    cache: Path | None = None
    """Folder for labels and features; $TAXEL_CACHE or ~/.cache/taxel unless given."""

    def folder(self) -> Path:
        """Return the folder for labels and features."""
        from taxel.training.frames.features import default_cache

        return self.cache or default_cache()


HeadName = Literal["lstm", "lstm2", "lstm4", "transformer"]


@dataclass(frozen=True, kw_only=True)
class HeadOptions:
    """The network behind the features."""

    head: HeadName = "lstm"
    """Network over the frames of a window."""
    frames: int = 8
    """Frames in a window, k."""


@dataclass(frozen=True, kw_only=True)
class FitOptions:
    """How a head is trained."""

    ahead: int = 0
    """Frames by which training labels run ahead, so that a head learns to warn; never across an
    outage of the cameras."""
    paper_settings: bool = False
    """Train as the paper did: batch 4, 100 epochs, constant step size, features not scaled."""
    seed: int = 0
    """Seed of everything random."""


@dataclass(frozen=True, kw_only=True)
class WeightOptions:
    """Backbones and how they run."""

    weights: Path | None = None
    """A file or folder of backbone weights; see also the variable TAXEL_WEIGHTS."""
    threads: int = 1
    """Threads of the engine; more than one helps on an idle machine only."""


@dataclass(frozen=True, kw_only=True)
class EngineOptions:
    """What computes a backbone."""

    engine: Literal["onnxruntime", "openvino", "torch"] = "onnxruntime"
    """Which library runs backbones; torch uses a graphics card where there is one, and one process
    in any case."""
    precision: Literal["f32", "bf16", "int8"] = "f32"
    """Number format within the backbone; bf16 needs --engine openvino or torch, int8 the extra
    openvino and frames of the recordings for calibration."""

    def check(self) -> None:
        """Refuse, before anything is read, what cannot be.

        Raises:
            BadInput: PyTorch is to run 8-bit numbers.
        """
        if (self.engine, self.precision) == ("torch", "int8"):
            raise BadInput(
                "--engine onnxruntime or openvino for --precision int8", "--engine torch",
                "choose another",
            )  # fmt: skip


THREADS = Only(("threads",), "--engine onnxruntime or openvino",
               lambda verb: verb.engine.engine != "torch")  # fmt: skip
"""PyTorch takes the threads that the process has."""
AHEAD = Only(("ahead",), "no --paper-settings", lambda verb: not verb.fit.paper_settings)
"""The paper's settings take labels as they are."""


def head_config(
    rule: str, fit: FitOptions, head: HeadOptions | None = None, *, features: str
) -> HeadConfig:
    """Return how a head is trained.

    Args:
        rule: Rule of the labels; it says how features are taken relative to rest.
        fit: Settings and seed.
        head: Head and frames; where a table sets both, None.
        features: Name of a backbone, or "gel".

    Raises:
        BadInput: An option lies outside its limits.
    """
    from taxel.training.frames.heads import PAPER, HeadConfig

    if not 0 <= fit.seed < 2**31:
        raise BadInput("a --seed of at least 0", str(fit.seed), "choose another")
    if not 0 <= fit.ahead <= 600:
        raise BadInput("--ahead within 0 and 600", str(fit.ahead), "choose another")
    chosen: dict[str, Any] = {"seed": fit.seed}
    if head is not None:
        if not 2 <= head.frames <= 64:
            raise BadInput("--frames within 2 and 64", str(head.frames), "choose another")
        chosen |= {"head": head.head, "frames": head.frames}
    if fit.paper_settings:
        return replace(PAPER, **chosen)
    return HeadConfig(tare=_tare(rule, features), ahead=fit.ahead, **chosen)


def _tare(rule: str, features: str) -> Tare:
    """Return how features are taken relative to rest. Source: docs/decisions/0013."""
    from taxel.models.backbones.catalogue import find_backbone

    if rule != "change":
        return "change"
    return "local-size" if features != GEL and find_backbone(features).places else "size"


def backbone_names(given: Sequence[str], option: str = "--backbones") -> tuple[str, ...]:
    """Return names, each once, "paper" standing for the paper's four.

    Raises:
        BadInput: There is none.
    """
    names: list[str] = []
    for name in given:
        names += PAPER_BACKBONES if name == "paper" else [name]
    if not names:
        raise BadInput("at least one name", "none", f"name one with {option}")
    return tuple(dict.fromkeys(names))


@contextmanager
def given_or_simulated(data: Path | None, seed: int, bar: Bar) -> Iterator[Path]:
    """Give a folder of recordings, or where none is given a simulated one of the paper's size."""
    if data is not None:
        yield data
        return
    from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
    from taxel.sources.simulated.pour_folder import write_pours

    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        config = CupPourConfig(seed=seed)
        task = bar.add_task("simulating", total=len(list_runs(config)))
        write_pours(Path(scratch) / "cups", config, lambda _: bar.update(task, advance=1))
        yield Path(scratch) / "cups"


def load_set(labels: LabelOptions, folder: Path, bar: Bar) -> CameraSet:
    """Read and label a folder of recordings."""
    from taxel.evaluation.transitions.data import load_camera_set

    task = bar.add_task("labels", total=None)
    return load_camera_set(folder, labels.rule, labels.folder(), shown(bar, task, "labels"))


def open_features(
    name: str, pours: CameraSet, weights: WeightOptions, engine: EngineOptions, tare: Tare
) -> BackboneExtractor | SlipExtractor:
    """Return what gives features, by name: a backbone, or "gel"; `tare` is the head's."""
    from taxel.training.frames.extractors import SlipExtractor
    from taxel.windows.rest import SETTLE

    if name == GEL:
        return SlipExtractor(SETTLE)
    return open_backbone(name, pours.pours, weights, engine, tare)


def open_backbone(
    name: str,
    pours: Sequence[CameraRecording],
    weights: WeightOptions,
    engine: EngineOptions,
    tare: Tare,
) -> BackboneExtractor:
    """Open a backbone for the cameras of some recordings, whose images may calibrate it.

    Raises:
        BadInput: An option lies outside its limits.
        BadDataset: The cameras' images are not of one size.
    """
    from taxel.training.frames.extractors import CameraImages
    from taxel.training.frames.extractors import open_backbone as open_named
    from taxel.training.frames.quantising import calibration_frames
    from taxel.windows.camera_recordings import image_size

    if not 1 <= weights.threads <= 64:
        raise BadInput("1 to 64 --threads", str(weights.threads), "choose another")
    width_px, height_px = image_size(pours)
    frames = calibration_frames(pours) if engine.precision == "int8" else ()
    return open_named(
        name, weights.weights, engine=engine.engine, precision=engine.precision,
        threads=weights.threads,
        images=CameraImages(height_px=height_px, width_px=width_px, calibration=frames),
        places=tare == "local-size",
    )  # fmt: skip


def extract_features(
    extractor: BackboneExtractor | SlipExtractor,
    name: str,
    pours: CameraSet,
    cache: Path,
    bar: Bar,
) -> list[FrameFeatures]:
    """Return the features of a set's frames, from the cache where it has them."""
    from taxel.training.frames.features import extract
    from taxel.training.frames.jobs import fill_cache

    task = bar.add_task(f"features of {name}", total=len(pours.pours))
    show = shown(bar, task, f"features, {name}")
    fill_cache(pours.pours, [extractor] * len(pours.pours), cache, show)
    return extract(pours.pours, extractor, cache, show)


def shown(bar: Bar, task: Any, what: str) -> Callable[[Progress], None]:
    """Return what shows progress over recordings on a bar."""

    def show(done: Progress) -> None:
        speed = f", {done.frames_hz:.0f} frames/s" if done.frames else ""
        bar.update(task, description=what + speed, completed=done.recordings, total=done.of)

    return show
