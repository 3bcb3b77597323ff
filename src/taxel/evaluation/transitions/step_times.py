"""What one more moment costs: a backbone pass a camera and the head, or the whole window again.

Knows nothing about tables.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from torch import Tensor, nn

from taxel.bundles.engine import Engine, Precision, open_engine
from taxel.evaluation.transitions.limits import ProductLimit
from taxel.models.backbones.catalogue import find_backbone
from taxel.models.export_onnx import export_head
from taxel.models.sequence import find_head
from taxel.models.torch_engine import TorchEngine, device_words
from taxel.models.transition import FRAMES, find_transition
from taxel.training.frames.extractors import BackboneEngine, BackboneExtractor, open_backbone
from taxel.windows.rest import compared
from taxel.windows.sequence import FeatureRing


@dataclass(frozen=True, slots=True, kw_only=True)
class StepTime:
    """Median milliseconds of a step, on this machine."""

    model: str
    frames: int
    engine: str
    threads: int
    stream_ms: float
    """Two new frames through the backbone, the other features from the ring, then the head."""
    window_ms: float
    """All frames of the window through the backbone again, then the head."""
    limit_gflops: float | None = None
    """Of a large matrix product in the same engine, format and threads, 10⁹ operations a second,
    measured just before and after the steps; None for 8-bit numbers, in PyTorch, whose step on a
    graphics card is bound by starting its kernels, and where the weights take images of another
    size than their backbone's."""

    @property
    def ratio(self) -> float:
        """How many times cheaper the stream is."""
        return self.window_ms / self.stream_ms

    @property
    def share(self) -> float | None:
        """Share of that limit which a streaming step's two backbone passes reached, 0…1."""
        if self.limit_gflops is None:
            return None
        operations = 2 * find_backbone(find_transition(self.model).backbone).flops
        return operations / (self.stream_ms * 1e-3) / (self.limit_gflops * 1e9)


def time_step(
    model: str,
    frames: int = FRAMES,
    *,
    engine: BackboneEngine = "onnxruntime",
    precision: Precision = "f32",
    threads: int = 1,
    repeats: int = 15,
    extractor: BackboneExtractor | None = None,
) -> StepTime:
    """Measure a model's step both ways, in turn, after one pass to warm up.

    Args:
        model: backbone+head.
        frames: k.
        engine: Which library runs both networks.
        precision: bf16 needs OpenVINO or PyTorch.
        threads: Threads of the engine.
        repeats: Streaming steps; the whole window is measured a third as often.
        extractor: The backbone where it is open already; its engine is used.
    """
    row = find_transition(model)
    size = find_backbone(row.backbone).features
    backbone = extractor or open_backbone(
        row.backbone, engine=engine, precision=precision, threads=threads
    )
    side_px = backbone.weights.side_px
    module = find_head(row.head).build(size, frames).eval()
    where, limit = "", None
    if isinstance(backbone.engine, TorchEngine):
        head: Engine = TorchEngine(_Flat(module), backbone.engine.device, bf16=precision == "bf16")
        where = f" on {device_words(backbone.engine.device)}"
    else:
        assert engine != "torch", "the extractor given is of another engine"
        head = open_engine(export_head(module, frames, size), threads=threads)
        if precision != "int8" and side_px is None:  # the catalogue's operations are of its size
            limit = ProductLimit(engine, precision, threads)
    before = limit.gflops() if limit else 0.0
    stream, window = _time_both(backbone.engine, head, (frames, size), repeats)
    return StepTime(
        model=model,
        frames=frames,
        engine=f"{engine} {precision}{where}" + (f", images of {side_px} px" if side_px else ""),
        threads=threads,
        stream_ms=float(np.median(stream)) * 1e3,
        window_ms=float(np.median(window)) * 1e3,
        limit_gflops=max(before, limit.gflops()) if limit else None,
    )


class _Flat(nn.Module):
    """A head that takes features of each camera apart, as an exported one does."""

    def __init__(self, head: nn.Module) -> None:
        super().__init__()
        self.head = head

    def forward(self, features: Tensor) -> Tensor:
        logits: Tensor = self.head(features.flatten(2))
        return logits


def _time_both(
    backbone: Engine, head: Engine, shape: tuple[int, int], repeats: int
) -> tuple[list[float], list[float]]:
    """Return the seconds of each streaming step and of each whole window."""
    frames, size = shape
    ring = FeatureRing(frames, 2, size)
    random = np.random.default_rng(0)
    images = random.integers(0, 256, (2 * frames, 240, 320, 3), np.uint8)
    rest = backbone.run(frames=images[:2])[0]

    def features(some: NDArray[np.uint8]) -> NDArray[np.float32]:
        found = backbone.run(frames=some)
        return compared(found, rest) if rest.ndim == 2 else found  # it gives places apart

    for index in range(frames):
        ring.push(features(images[2 * index : 2 * index + 2]))
    features(images)  # a graphics card prepares itself for each number of images
    stream, window = [], []
    for number in range(repeats):
        pair = images[2 * (number % frames) :][:2]
        started = perf_counter()
        whole = ring.push(features(pair))
        if whole is not None:
            head.run(features=whole[None])
        stream.append(perf_counter() - started)
        if number % 3 == 0:
            started = perf_counter()
            head.run(features=features(images).reshape(1, frames, 2, size))
            window.append(perf_counter() - started)
    return stream, window
