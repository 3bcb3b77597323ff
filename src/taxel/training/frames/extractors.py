"""What gives features of frames: a backbone in an engine, or quantities of the gel.

What writes a backbone is imported where it is used: a worker that computes features runs what is
written already, or none, and starts without PyTorch. Knows nothing about recordings, caches or
labels.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.engine import Engine, EngineName, Precision, open_engine
from taxel.errors import BadInput
from taxel.gel.slip_features import SLIP_FEATURES, SlipFeatures
from taxel.training.frames.features import BATCH
from taxel.windows.rest import SETTLE

if TYPE_CHECKING:
    from torch import nn

    from taxel.models.torch_engine import TorchEngine
    from taxel.models.weights import Weights


BackboneEngine = Literal[EngineName, "torch"]
"""Engines of exported models, and PyTorch, which is for computing features on a graphics card."""


@dataclass(frozen=True, slots=True)
class BackboneExtractor:
    """A backbone whose weights are frozen, in the engine that also runs live."""

    backbone: str
    """A name in `BACKBONES`."""
    weights: Weights
    written: bytes | Callable[[], bytes]
    """The ONNX file, or what writes it, where PyTorch runs the module itself."""
    engine: Engine
    key: str
    features: int
    run_by: tuple[BackboneEngine, Precision, int] = ("onnxruntime", "f32", 1)
    """Which library runs it, with which numbers and how many threads."""
    in_order: bool = False
    places: bool = False

    @property
    def model(self) -> bytes:
        """The ONNX file."""
        return self.written if isinstance(self.written, bytes) else self.written()

    @property
    def at_once(self) -> int:
        """Images that are best given to it together: many where a graphics card computes."""
        return 64 if getattr(self.engine, "on_card", False) else BATCH

    def of(self, images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        return self.engine.run(frames=np.stack(images))


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraImages:
    """Images that a backbone will see."""

    height_px: int = 240
    width_px: int = 320
    calibration: Sequence[NDArray[np.uint8]] = ()
    """Some that set the ranges of 8-bit numbers; for int8."""


USUAL_IMAGES = CameraImages()


def open_backbone(
    backbone: str,
    weights: Path | None = None,
    *,
    engine: BackboneEngine = "onnxruntime",
    precision: Precision = "f32",
    threads: int = 1,
    images: CameraImages = USUAL_IMAGES,
    places: bool = False,
) -> BackboneExtractor:
    """Return a backbone that is ready to give features.

    Args:
        backbone: A name in `BACKBONES`.
        weights: A file of weights; found as `find_weights` says unless given.
        engine: Which library runs it; torch on a graphics card where there is one.
        precision: bf16 needs OpenVINO or PyTorch; int8 needs NNCF, which comes with it.
        threads: Threads of the engine.
        images: Of the camera.
        places: Give the features of each place of an image, which are compared with those of the
            grasp at rest before their mean is taken.

    Raises:
        BadInput: There is no such backbone, the weights do not fit, int8 lacks images, or the
            backbone cannot give places apart.
        MissingExtra: The engine, or what makes 8-bit numbers, is not installed.
    """
    from taxel.models.backbones.catalogue import find_backbone
    from taxel.models.export_onnx import export_backbone
    from taxel.models.frame_network import FrameNetwork
    from taxel.models.weights import find_weights
    from taxel.training.frames.quantising import quantise

    row = find_backbone(backbone)
    if places and not row.places:
        raise BadInput(
            "a backbone whose features are means over places", backbone, "choose another"
        )
    stored = find_weights(backbone, weights)
    module = row.build("places" if places else "logits").eval()
    stored.load_into(module)
    label = "random" if stored.path is None else "trained"
    size_px = images.height_px, images.width_px
    key = f"{backbone}-{label}-{stored.digest[:12]}-{engine}-{precision}-{size_px[1]}x{size_px[0]}"
    key += f"-places-{SETTLE.start}-{SETTLE.stop}" if places else ""
    write = partial(export_backbone, module, backbone, *size_px, side_px=stored.side_px)
    if engine == "torch":
        ready = _in_torch(FrameNetwork(deepcopy(module), backbone, stored.side_px), precision)
        run_by: tuple[BackboneEngine, Precision, int] = (engine, precision, threads)
        key += f"-{ready.device.type}"
        return BackboneExtractor(
            backbone, stored, write, ready, key, row.features, run_by, places=places
        )
    model = write()
    if precision == "int8":
        model = quantise(model, images.calibration)
        key += "-" + hashlib.sha256(np.stack(images.calibration).tobytes()).hexdigest()[:12]
    return BackboneExtractor(
        backbone,
        stored,
        model,
        open_engine(model, engine, precision, threads),
        key,
        row.features,
        (engine, precision, threads),
        places=places,
    )


def _in_torch(module: nn.Module, precision: Precision) -> TorchEngine:
    """Return a module run by PyTorch, on a graphics card where there is one.

    Raises:
        BadInput: PyTorch is to run 8-bit numbers.
    """
    from taxel.models.torch_engine import TorchEngine, best_device

    if precision == "int8":
        raise BadInput("--precision f32 or bf16 for PyTorch", "int8", "choose another --engine")
    return TorchEngine(module, best_device(), bf16=precision == "bf16")


@dataclass(frozen=True, slots=True)
class SlipExtractor:
    """Quantities of the gel: what markers and imprint do since the settled frames.

    Frames before the end of the settled stretch get rows too, which the live path
    does not have: it starts when the stretch is over.
    """

    settled: slice
    """Which frames are the reference."""
    features: int = len(SLIP_FEATURES)
    in_order: bool = True
    places: bool = False

    @property
    def key(self) -> str:
        """Name for the cache."""
        names = hashlib.sha256(",".join(SLIP_FEATURES).encode()).hexdigest()[:8]
        return f"gel-slip-2-{names}-{self.settled.start}-{self.settled.stop}"

    def of(self, images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        reference = images[self.settled] or images[:1]
        stream = SlipFeatures([image for i, image in enumerate(reference)
                               if i == 0 or image is not reference[i - 1]])  # fmt: skip
        rows: list[NDArray[np.float32]] = []
        for index, image in enumerate(images):
            repeated = index > 0 and image is images[index - 1]
            rows.append(rows[-1] if repeated else stream.push(image))
        return np.stack(rows)
