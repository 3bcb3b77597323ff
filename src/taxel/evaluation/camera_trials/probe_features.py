"""Features of camera trials' crops by several image networks and by plainer things, for a probe.

Eight images of each crop, 0.24 s apart, the same for all: those that the touch encoder is
pretrained on (`taxel.training.encoder.videos`). Kept on disk, a file a trial. Knows nothing about
labels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from taxel.training.encoder.videos import IMAGES, STRETCHES, TouchVideo, chosen_frames
from taxel.training.frames.extractors import SlipExtractor
from taxel.training.frames.features import Extractor, load_kept, save_kept
from taxel.windows.camera_trials import CameraTrial

Image = NDArray[np.uint8]
_THUMB: Final = (12, 16)
"""Rows and columns of the grey image whose differences are the plainest features."""


@dataclass(frozen=True, slots=True)
class GreyThumbs:
    """Small grey images: pixels as features."""

    key: str = f"grey-{_THUMB[0]}x{_THUMB[1]}"
    features: int = _THUMB[0] * _THUMB[1]
    in_order: bool = False
    places: bool = False

    def of(self, images: Sequence[Image]) -> NDArray[np.float32]:
        greys = [cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32) for image in images]
        size = _THUMB[1], _THUMB[0]
        return np.stack([cv2.resize(g, size, interpolation=cv2.INTER_AREA).ravel() for g in greys])


def gel_features() -> SlipExtractor:
    """Return quantities of the gel, each crop's first image the reference."""
    return SlipExtractor(slice(0, 1))


def crop_features(
    trials: Sequence[CameraTrial],
    extractors: Sequence[Extractor],
    cache: Path,
) -> list[NDArray[np.float32]]:
    """Return each extractor's features, shape (trials, cameras, crops, images, features).

    Args:
        trials: As many cameras each.
        extractors: What looks at the images; each trial is decoded once for all.
        cache: Folder to keep files in.
    """
    features: list[list[NDArray[np.float32]]] = [[] for _ in extractors]
    for trial in trials:
        shape = len(trial.cameras), STRETCHES, IMAGES
        rate = f"{trial.rate_hz:.4g}"  # which decides which images are looked at
        files = [cache / "probe" / f"{e.key}-{rate}" / f"{trial.digest[:32]}.npy"
                 for e in extractors]  # fmt: skip
        stored = [load_kept(f, e.features) for f, e in zip(files, extractors, strict=True)]
        lacking = [at for at, values in enumerate(stored) if values is None]
        images = crop_images(trial) if lacking else []
        for at in lacking:
            rows = np.concatenate(
                [_look(extractors[at], own) for camera in images for own in camera]
            )
            save_kept(files[at], rows.astype(np.float32))
            stored[at] = rows
        for at, values in enumerate(stored):
            assert values is not None
            features[at].append(values.reshape(*shape, -1))
    return [np.stack(each) for each in features]


def network_features(module: nn.Module, videos: Sequence[TouchVideo]) -> NDArray[np.float32]:
    """Return a network's features of videos, shape (videos, crops, images, features).

    Args:
        module: Images (n, 3, 120, 160) → features.
        videos: All alike in shape.
    """
    found = []
    with torch.inference_mode():
        for video in videos:
            pixels = torch.from_numpy(video.images.reshape(-1, *video.images.shape[2:]))
            own = module(pixels.permute(0, 3, 1, 2).float().contiguous(
                memory_format=torch.channels_last))  # fmt: skip
            found.append(own.numpy().reshape(*video.images.shape[:2], -1))
    return np.stack(found)


def crop_images(trial: CameraTrial) -> list[list[list[Image]]]:
    """Return the images that are looked at: a list a camera, in it one a crop."""
    chosen = chosen_frames(trial.frames, trial.rate_hz, trial.name)
    found = []
    for camera in range(len(trial.cameras)):
        images = trial.images(camera, chosen.ravel().tolist())
        found.append([[images[at] for at in own] for own in chosen.tolist()])
    return found


def _look(extractor: Extractor, images: list[Image]) -> NDArray[np.float32]:
    return np.asarray(extractor.of(images), np.float32)
