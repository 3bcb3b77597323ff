"""Small images of tactile videos, a few of each: what the touch encoder is pretrained on.

Each video gives three stretches (first, middle, last) of eight images, 0.24 s apart. Labels are not
looked at. Knows nothing about networks.

Background of our choices: docs/decisions/0058.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadDataset, BadInput
from taxel.models.backbones.touch import HEIGHT_PX, WIDTH_PX
from taxel.windows.camera_trials import CameraTrial, read_camera_trials

STRETCHES = 3
"""First, middle and last of the whole video; camera trials take their crops from the part in which
something moves (decision 0041)."""
IMAGES = 8
"""Of a stretch."""
APART_S = 0.24
"""Between two images of a stretch: 6 frames at 25 a second. Source: our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchVideo:
    """Some images of one camera of one trial."""

    folder: str
    """Name of the folder that it came from."""
    trial: str
    groups: Mapping[str, str]
    digest: str
    """Of the whole trial's images."""
    images: NDArray[np.uint8]
    """Shape (stretches, images, 120, 160, 3), red first."""
    slip_um: NDArray[np.float32]
    """Shape (stretches, images): how far the object has slipped, where a simulator knows it;
    NaN elsewhere."""


def read_touch_videos(
    folder: Path, on_trial: Callable[[int, int], None] = lambda done, of: None
) -> list[TouchVideo]:
    """Return the videos of a folder of camera trials or recordings, a camera each.

    Raises:
        BadDataset: A trial is too short.
        BadTable: A table or a video is not as it should be.
        BadRecording: A recording is damaged.
    """
    trials = read_camera_trials(folder)
    found: list[TouchVideo] = []
    for done, trial in enumerate(trials, start=1):
        found += _videos_of(folder.name, trial)
        on_trial(done, len(trials))
    return found


def read_folders(
    folders: Sequence[Path],
    left_out: Sequence[str] = (),
    on_trial: Callable[[int, int], None] = lambda done, of: None,
) -> list[TouchVideo]:
    """Return the videos of several folders.

    Args:
        folders: Of different names.
        left_out: Values of groups, such as objects, whose videos are left out.
        on_trial: Called with trials done and in all, of each folder.

    Raises:
        BadInput: Two folders have one name, or nothing is called like what is left out.
        BadDataset: A trial is too short.
    """
    names = [folder.resolve().name for folder in folders]
    if len(set(names)) < len(names):
        raise BadInput("folders of different names", " ".join(names),
                       "rename one: the card lists them by name")  # fmt: skip
    videos: list[TouchVideo] = []
    for folder in folders:
        videos += read_touch_videos(folder.resolve(), on_trial)
    known = {value for video in videos for value in video.groups.values()}
    if unknown := sorted(set(left_out) - known):
        raise BadInput("--without of groups that are there", unknown[0], "check its spelling")
    return without(videos, left_out)


def chosen_frames(frames: int, rate_hz: float, trial: str = "") -> NDArray[np.intp]:
    """Return the numbers of the frames that are looked at, shape (stretches, images).

    Args:
        frames: Of the video.
        rate_hz: Of the video, frames a second.
        trial: Its name, for the message.

    Raises:
        BadDataset: A stretch is longer than the video.
    """
    apart = max(1, round(APART_S * rate_hz))
    length = apart * IMAGES
    if frames < length:
        raise BadDataset(
            f"videos of at least {length} frames ({APART_S * IMAGES:.2g} s)",
            f"{frames}{f' in {trial}' if trial else ''}",
            "leave shorter ones out",
        )  # fmt: skip
    last = frames - length
    starts = np.linspace(0, last, STRETCHES).astype(np.intp)
    return starts[:, None] + apart * np.arange(IMAGES)


def small(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return an image at 120×160 pixels; of one twice as large each is the mean of four.

    Args:
        image: Shape (height, width, 3) or (height, width), uint8.
    """
    return np.asarray(cv2.resize(image, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_AREA))


def data_digest(videos: Iterable[TouchVideo]) -> str:
    """Return the SHA-256 over the trials that videos are of, hexadecimal."""
    trials = sorted({f"{video.folder} {video.trial} {video.digest}" for video in videos})
    return hashlib.sha256("\n".join(trials).encode()).hexdigest()


def seen_digest(videos: Iterable[TouchVideo]) -> str:
    """Return the SHA-256 over what a network is shown, in order: images, and slip where known.

    Which images of a video these are depends on its rate, too, which a table may correct.
    """
    whole = hashlib.sha256()
    for video in videos:
        whole.update(f"{video.folder} {video.trial} {video.images.shape}\n".encode())
        whole.update(np.ascontiguousarray(video.images).data)
        whole.update(np.ascontiguousarray(video.slip_um).data)
    return whole.hexdigest()


def without(videos: Sequence[TouchVideo], values: Sequence[str]) -> list[TouchVideo]:
    """Return the videos none of whose groups has one of these values."""
    return [video for video in videos if not set(video.groups.values()) & set(values)]


def _videos_of(folder: str, trial: CameraTrial) -> list[TouchVideo]:
    chosen = chosen_frames(trial.frames, trial.rate_hz, trial.name)
    slip_um = np.full(chosen.shape, np.nan, np.float32)
    if trial.slip_um is not None:
        slip_um = trial.slip_um[chosen].astype(np.float32)
    videos = []
    for camera in range(len(trial.cameras)):
        images = trial.images(camera, chosen.ravel().tolist())
        each = np.stack([small(images[at]) for at in chosen.ravel().tolist()])
        videos.append(
            TouchVideo(
                folder=folder,
                trial=trial.name,
                groups=trial.groups,
                digest=trial.digest,
                images=each.reshape(*chosen.shape, HEIGHT_PX, WIDTH_PX, 3),
                slip_um=slip_um,
            )
        )
    return videos
