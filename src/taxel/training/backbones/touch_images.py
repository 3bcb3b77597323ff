"""Images of touch without labels, each with the object that was touched, and changed copies.

From recordings of tactile cameras, or from the folder of gelsight-slip as it was published. Objects
are split before any image is read. Knows nothing about networks.

Background of our choices: docs/decisions/0057.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset
from taxel.recordings.imports.footage import Video
from taxel.recordings.imports.known import gelsight_slip_rows
from taxel.windows.camera_recordings import (
    CameraRecording,
    decoded,
    frame_sets,
    read_camera_recordings,
)

GROUPS = ("object", "cup")
"""Groups of a recording that name what was touched; the first that it has counts."""
EVERY = 5
"""Of all objects, one in so many is kept for testing. Source: our choice."""
HEIGHT_PX, WIDTH_PX = 240, 320
"""Of an image that is changed. Source: frames of both sets."""

Image = NDArray[np.uint8]

CUT = (0.3, 1.0)
"""Side of the cut-out, of the image's. Source: our choice, as those below."""
TURN_DEG = 180.0
"""Largest turn either way, degrees."""
GAMMA, LIGHT, COLOUR, CONTRAST = 0.3, 0.15, 0.3, 0.4
"""Deviation of the logarithm of the exponent and factors."""
NEGATIVE = 0.5
"""Share of copies that are negatives."""
BLURRED = 0.3
"""Share of copies that are blurred."""
BLUR_PX = (0.5, 2.0)
"""Deviation of the blur, pixels."""
NOISE = 0.03
"""Largest deviation of a pixel's noise, of white."""


@dataclass(frozen=True, slots=True)
class ImageSource:
    """One recording, or one camera's file: where images come from."""

    name: str
    object: str
    """What was touched, with the folder's name before it: two sets share no object."""
    images: Callable[[int], Iterator[Image]]
    """How many → as many, or fewer, images over its whole time, shape (240, 320, 3)."""


def find_videos(folder: Path) -> list[ImageSource]:
    """Return what a folder holds, in order.

    Args:
        folder: Recordings of tactile cameras, or gelsight-slip with its folder `trials`.

    Raises:
        BadDataset: There is no such folder, or a recording does not say what was touched.
        BadRecording: A recording is damaged.
        BadTable: gelsight-slip lacks its trials.
    """
    if not folder.is_dir():
        got = f"{folder}, which is a file" if folder.exists() else f"no {folder}"
        raise BadDataset("a folder of recordings, or gelsight-slip", got, "check it")
    if (folder / "trials").is_dir():
        return [
            ImageSource(f"{row.name}-{side}", f"{folder.name}/{row.groups['object']}",
                       partial(_of_file, path))
            for row in gelsight_slip_rows(folder)
            for side, path in row.files.items()
        ]  # fmt: skip
    return [
        ImageSource(pour.name, f"{folder.name}/{_object(pour)}", partial(_of_recording, pour))
        for pour in read_camera_recordings(folder)
    ]


def split_objects(
    videos: Sequence[ImageSource],
) -> tuple[list[ImageSource], list[ImageSource]]:
    """Return videos to learn from and those of objects that are kept for testing.

    The same objects are kept whatever the seed of a training: a student that goes on from a file
    is never tested on objects that this file learned from.

    Raises:
        BadDataset: There are fewer objects than one in `EVERY` can be kept of.
    """
    objects = sorted({video.object for video in videos})
    if len(objects) < EVERY:
        raise BadDataset(f"at least {EVERY} objects", f"{len(objects)}", "give more recordings")
    held_out: set[str] = set()
    for folder in sorted({name.partition("/")[0] for name in objects}):
        in_folder = [name for name in objects if name.partition("/")[0] == folder]
        order = np.random.default_rng([17, 0]).permutation(len(in_folder))
        held_out |= {in_folder[i] for i in order[: len(in_folder) // EVERY]}
    if not held_out:
        raise BadDataset(
            f"at least {EVERY} objects in one of the folders", f"{len(objects)} over several",
            "put recordings of one kind in one folder",
        )  # fmt: skip
    learn = [video for video in videos if video.object not in held_out]
    return learn, [video for video in videos if video.object in held_out]


def changed(image: Image, draw: np.random.Generator) -> Image:
    """Return a strongly changed copy: cut, turned, mirrored, other light and colours, noise.

    Colours also change places, and half of all copies are negatives: a teacher that was trained
    on photographs gives one and the same answer to nearly all images of a gel as they are.

    Args:
        image: Shape (240, 320, 3), R G B.
        draw: What is drawn from.
    """
    size = draw.uniform(*CUT)
    turn = np.radians(draw.uniform(-TURN_DEG, TURN_DEG))
    mirror = np.where(draw.random(2) < 0.5, -1.0, 1.0)
    cos, sin = size * np.cos(turn), size * np.sin(turn)
    matrix = np.array([[cos * mirror[0], -sin * mirror[1]], [sin * mirror[0], cos * mirror[1]]])
    middle = np.array([WIDTH_PX, HEIGHT_PX]) / 2
    slack = (1.0 - size) * middle
    centre = middle + draw.uniform(-1.0, 1.0, 2) * slack
    place = np.column_stack([matrix, centre - matrix @ middle]).astype(np.float32)
    moved = cv2.warpAffine(
        image, place, (WIDTH_PX, HEIGHT_PX),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderMode=cv2.BORDER_REFLECT_101,
    )  # fmt: skip
    moved = moved[..., draw.permutation(3)]
    if draw.random() < NEGATIVE:
        moved = 255 - moved
    values = (moved.astype(np.float32) / 255) ** np.exp(draw.normal(0, GAMMA))
    gain = np.exp(draw.normal(0, LIGHT) + draw.normal(0, COLOUR, 3)).astype(np.float32)
    middle_grey = values.mean()
    contrast = np.exp(draw.normal(0, CONTRAST))
    values = ((values - middle_grey) * contrast + middle_grey) * gain
    if draw.random() < BLURRED:
        values = cv2.GaussianBlur(values, (0, 0), draw.uniform(*BLUR_PX))
    values = values + draw.normal(0, draw.uniform(0, NOISE), values.shape).astype(np.float32)
    return np.asarray((values * 255).clip(0, 255), np.uint8)


def _object(pour: CameraRecording) -> str:
    for key in GROUPS:
        if key in pour.groups:
            return pour.groups[key]
    raise BadDataset(
        f"the group {' or '.join(GROUPS)} on every recording",
        f"{pour.path} with {', '.join(sorted(pour.groups)) or 'none'}",
        f"import again with a column group:{GROUPS[0]} in the table, or record again with "
        f"--group {GROUPS[0]}=NAME",
    )


def _of_recording(pour: CameraRecording, count: int) -> Iterator[Image]:
    """Yield so many of a recording's different images, over all cameras and its whole time."""
    wanted = set(np.linspace(0, pour.images - 1, count).astype(int).tolist())
    for found, row in zip(frame_sets(pour.path, len(pour.cameras)), pour.image, strict=True):
        for frame, number in zip(found.frames, row, strict=True):
            if int(number) in wanted:
                wanted.discard(int(number))
                yield _sized(decoded(frame.jpeg, pour.cameras[frame.camera], pour.path))


def _of_file(path: Path, count: int) -> Iterator[Image]:
    video = Video(path)
    try:
        numbers = np.unique(np.linspace(0, video.count - 1, count).astype(int))
        yield from map(_sized, video.frames_at(numbers.tolist()))
    finally:
        video.close()


def _sized(image: Image) -> Image:
    if image.shape[:2] == (HEIGHT_PX, WIDTH_PX):
        return image
    return np.asarray(cv2.resize(image, (WIDTH_PX, HEIGHT_PX)), np.uint8)
