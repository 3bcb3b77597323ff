"""The image network that camera trials are looked at through, where its weights are at hand.

It is written as ONNX once a run, and what looks offline is that very model, which a bundle holds
too. Imports what needs PyTorch only when it is used. Knows nothing about trials or models behind
it.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.engine import Engine, open_engine
from taxel.training.frames.features import save_bytes

if TYPE_CHECKING:
    from taxel.models.weights import Weights


class AnyNetwork(Protocol):
    """Images, shape (n, 224, 224, 3), red first → features, shape (n, 3120)."""

    @property
    def key(self) -> str:
        """Name for the cache."""
        ...

    def __call__(self, images: NDArray[np.uint8]) -> NDArray[np.float32]: ...


@dataclass(frozen=True)
class ImageNetwork:
    """Images, shape (n, 224, 224, 3), red first → features, shape (n, 3120)."""

    weights: Weights

    @property
    def key(self) -> str:
        """Name for the cache."""
        return f"{self.weights.backbone}-{self.weights.digest[:12]}"

    @property
    def words(self) -> str:
        """What it is and where its weights come from, for people."""
        return f"{self.weights.backbone}, {self.weights.words}"

    @cached_property
    def model(self) -> bytes:
        """The ONNX file."""
        from taxel.models.stage_looks import export_stage_looks

        return export_stage_looks(self.weights)

    def __call__(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        return self._engine.run(frames=images)

    @cached_property
    def _engine(self) -> Engine:
        return open_engine(self.model, threads=1)


@dataclass(frozen=True, slots=True)
class StoredNetwork:
    """The same network, as a job carries it."""

    file: Path
    """The ONNX file."""
    key: str

    def __call__(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        return _opened(self.file).run(frames=images)


@lru_cache(maxsize=1)
def _opened(file: Path) -> Engine:
    return open_engine(file.read_bytes(), threads=1)


def stored_network(network: AnyNetwork, cache: Path) -> AnyNetwork:
    """Return a network that other processes can open.

    Args:
        network: One that was found here, which is written into the cache; any other is returned as
            it is.
        cache: A folder that all of them see.

    Raises:
        RecordingFailed: The disk refused.
    """
    if not isinstance(network, ImageNetwork):
        return network
    file = cache.absolute() / "networks" / f"{network.key}.onnx"
    if not file.exists() or file.read_bytes() != network.model:
        save_bytes(file, network.model)
    return StoredNetwork(file, network.key)


def find_image_network() -> ImageNetwork | None:
    """Return the network with its published weights; None where none are on this machine.

    The variable TAXEL_WEIGHTS, which backbones of monitors follow, is not looked at: what is judged
    here was chosen with these weights.
    """
    from taxel.models.stage_looks import NETWORK
    from taxel.models.weights import find_weights

    weights = find_weights(NETWORK, environment={})
    return None if weights.path is None else ImageNetwork(weights)
