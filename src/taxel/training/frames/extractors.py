"""What gives features of frames: a backbone in an engine, or quantities of the gel.

What writes a backbone is imported where it is used: a worker that computes features runs what is
written already, or none, and starts without PyTorch. Knows nothing about recordings, caches or
labels.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.engine import Engine, EngineName, Precision, open_engine
from taxel.gel.slip_features import SLIP_FEATURES, SlipFeatures

if TYPE_CHECKING:
    from taxel.models.weights import Weights


@dataclass(frozen=True, slots=True)
class BackboneExtractor:
    """A backbone whose weights are frozen, in the engine that also runs live."""

    backbone: str
    """A name in `BACKBONES`."""
    weights: Weights
    model: bytes
    """The ONNX file."""
    engine: Engine
    key: str
    features: int
    run_by: tuple[EngineName, Precision, int] = ("onnxruntime", "f32", 1)
    """Which library runs it, with which numbers and how many threads."""
    in_order: bool = False

    def of(self, images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        return self.engine.run(frames=np.stack(images))


def open_backbone(
    backbone: str,
    weights: Path | None = None,
    *,
    engine: EngineName = "onnxruntime",
    precision: Precision = "f32",
    threads: int = 1,
    size_px: tuple[int, int] = (240, 320),
    calibration: Sequence[NDArray[np.uint8]] = (),
) -> BackboneExtractor:
    """Return a backbone that is ready to give features.

    Args:
        backbone: A name in `BACKBONES`.
        weights: A file of weights; found as `find_weights` says unless given.
        engine: Which library runs it.
        precision: bf16 needs OpenVINO; int8 needs NNCF, which comes with it.
        threads: Threads of the engine.
        size_px: Height and width of the camera's frames, pixels.
        calibration: Images that set the ranges of 8-bit numbers; for int8.

    Raises:
        BadInput: There is no such backbone, the weights do not fit, or int8 lacks images.
        MissingExtra: The engine, or what makes 8-bit numbers, is not installed.
    """
    from taxel.models.backbones.catalogue import find_backbone
    from taxel.models.export_onnx import export_backbone
    from taxel.models.weights import find_weights
    from taxel.training.frames.quantising import quantise

    row = find_backbone(backbone)
    found = find_weights(backbone, weights)
    module = row.build("logits").eval()
    found.load_into(module)
    model = export_backbone(module, backbone, *size_px, side_px=found.side_px)
    label = "random" if found.path is None else "trained"
    key = f"{backbone}-{label}-{found.digest[:12]}-{engine}-{precision}-{size_px[1]}x{size_px[0]}"
    if precision == "int8":
        model = quantise(model, calibration)
        key += "-" + hashlib.sha256(np.stack(calibration).tobytes()).hexdigest()[:12]
    return BackboneExtractor(
        backbone,
        found,
        model,
        open_engine(model, engine, precision, threads),
        key,
        row.features,
        (engine, precision, threads),
    )


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
