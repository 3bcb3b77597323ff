"""A backbone in 8-bit numbers, calibrated on frames of the cameras it will see.

Knows nothing about labels, caches or heads.
"""

from __future__ import annotations

import io
import logging
import os
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadInput, MissingExtra
from taxel.windows.camera_recordings import CameraRecording, decoded, frame_sets

CALIBRATION_FRAMES = 64
"""Images that set the ranges of the 8-bit numbers. Source: our choice; noise will not do
(docs/decisions/0013)."""


def quantise(model: bytes, frames: Sequence[NDArray[np.uint8]]) -> bytes:
    """Return an ONNX model whose convolutions run in 8 bits, on either engine.

    Args:
        model: The ONNX file of a backbone, as `export_backbone` writes it.
        frames: Images, shape (height, width, 3), red first; at least one.

    Raises:
        MissingExtra: NNCF is not installed.
        BadInput: There are no frames.
    """
    if not frames:
        raise BadInput("frames to calibrate 8-bit numbers on", "none", "give recordings")
    os.environ.setdefault("NNCF_CI", "1")  # its own switch against sending usage statistics
    try:
        import nncf
    except ModuleNotFoundError as error:
        raise MissingExtra("nncf", "openvino", "8-bit numbers") from error
    import onnx

    logging.getLogger("nncf").setLevel(logging.ERROR)
    data = nncf.Dataset([{"frames": frame[None]} for frame in frames])
    with redirect_stdout(io.StringIO()):  # its progress bars would stand in --json's output
        small = nncf.quantize(onnx.load_from_string(model), data, subset_size=len(frames))
    return bytes(small.SerializeToString())


def calibration_frames(
    pours: Sequence[CameraRecording], count: int = CALIBRATION_FRAMES
) -> list[NDArray[np.uint8]]:
    """Return images drawn evenly from recordings and, within each, over its time.

    Only images are looked at, never labels.

    Args:
        pours: Recordings; those that models are judged on should not be among them.
        count: How many images, at most.

    Raises:
        BadRecording: One is damaged.
    """
    chosen = [pours[i] for i in np.unique(np.linspace(0, len(pours) - 1, 16).astype(int))]
    each = -(-count // len(chosen))
    return [image for pour in chosen for image in _spread(pour, each)][:count]


def _spread(pour: CameraRecording, count: int) -> Iterator[NDArray[np.uint8]]:
    """Yield images over a recording's whole time, the cameras in turn."""
    cameras = len(pour.cameras)
    wanted = {int(moment): turn % cameras
              for turn, moment in enumerate(np.linspace(0, len(pour) - 1, count))}  # fmt: skip
    for index, found in enumerate(frame_sets(pour.path, cameras)):
        if index in wanted:
            frame = found.frames[wanted[index]]
            yield decoded(frame.jpeg, pour.cameras[frame.camera], pour.path)
