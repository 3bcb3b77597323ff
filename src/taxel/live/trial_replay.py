"""A camera trial that lies in files as a live source: its own images, at its own rate, no loss.

Knows nothing about models or screens.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import islice

from taxel.clock import Clock, SystemClock
from taxel.frame_codec import encode_jpeg, encode_png
from taxel.recordings.imports.videos import QUALITY
from taxel.recordings.manifest import NO_ARRAY
from taxel.signals import CameraInfo, Frame, Mark, Samples
from taxel.sources.paced_source import PacedSource
from taxel.sources.pacing import FrameStream, Pacer, Stretch
from taxel.windows.camera_trials import CameraTrial, Image

LARGEST_LOSSLESS = 2**30
"""Bytes of a trial's pixels up to which its images are kept without loss, 93 s of two cameras of
320 × 240 at 25 Hz; a longer one's are JPEG, as imported ones. Source: our choice."""


class TrialReplay(PacedSource):
    """A camera trial, frame by frame; its labels come with a mark at its end.

    Args:
        trial: What is replayed.
        speed: A factor of real time; infinity gives all that is there.
        clock: The clock to wait on; the host's unless given.
    """

    def __init__(
        self, trial: CameraTrial, speed: float = float("inf"), clock: Clock | None = None
    ) -> None:
        cameras = tuple(
            CameraInfo(
                name=name,
                width=trial.width,
                height=trial.height,
                rate_hz=trial.rate_hz,
                mm_per_px=trial.mm_per_px,
            )
            for name in trial.cameras
        )
        end = Mark(
            start_s=0.0,
            end_s=(trial.frames - 1) / trial.rate_hz,
            labels=dict(trial.labels),
            groups=dict(trial.groups),
        )
        stretches: Iterator[Stretch] = iter([(Samples.empty(0), [end])])
        stream = FrameStream(_frames(trial), together=len(cameras))
        pacer = Pacer(stretches, 0, clock or SystemClock(), speed, stream)
        super().__init__(NO_ARRAY, cameras, pacer)


def _frames(trial: CameraTrial) -> Iterator[Frame]:
    """Yield one frame of each camera at each moment, moment by moment."""
    code = _coding(trial)
    streams = [trial.read(camera) for camera in range(len(trial.cameras))]
    for index, images in enumerate(islice(zip(*streams, strict=False), trial.frames)):
        time_s = index / trial.rate_hz
        for camera, image in enumerate(images):
            yield Frame(
                camera=camera,
                jpeg=code(image),
                counter=index,
                device_s=time_s,
                arrival_s=time_s,
                fitted_s=time_s,
            )


def _coding(trial: CameraTrial) -> Callable[[Image], bytes]:
    pixels = trial.width * trial.height * 3 * trial.frames * len(trial.cameras)
    return encode_png if pixels <= LARGEST_LOSSLESS else partial(encode_jpeg, quality=QUALITY)
