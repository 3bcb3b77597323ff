"""`replay://FILE`: a recording as a live source, in constant memory.

Knows nothing about models.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final

from taxel.clock import Clock
from taxel.errors import BadRecording, BadSource
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import (
    iterate_blocks,
    iterate_frames,
    iterate_tactile,
    read_manifest,
)
from taxel.signals import Mark, Samples
from taxel.sources.paced_source import PacedSource
from taxel.sources.pacing import FrameStream, Pacer, Stretch, read_speed

_AHEAD_S: Final = 5.0
"""How far marks are looked for ahead of the scans, seconds: a recorder writes a simulated grasp's
when the next one begins. Source: our choice, docs/decisions/0006."""


class Replay(PacedSource):
    """A recording, scan by scan, with its own spacing, arrivals and marks.

    As in training, the recording's labels hold for each of its marks, and one
    without marks is a single mark, which comes at its end.

    Args:
        path: The recording.
        options: `speed`: a factor of real time, or max. `scene=yes`: cameras that look on, too;
            models are not made for them, so they are left out unless asked for.
        clock: The clock to wait on.

    Raises:
        BadSource: An option is unknown, or the path is a folder.
        BadRecording: The recording cannot be read; of one that is damaged further on,
            `read` raises this when it gets there.
    """

    def __init__(self, path: Path, options: dict[str, str], clock: Clock) -> None:
        options = dict(options)
        speed = read_speed(options)
        scene = options.pop("scene", "no")
        if options or scene not in ("yes", "no"):
            raise BadSource(
                "no option of replay:// but speed and scene=yes",
                ", ".join(sorted(options)) or f"scene={scene}", "mend the address",
            )  # fmt: skip
        if path.is_dir():
            raise BadSource("one recording", f"the folder {path}", "name one of its files")
        manifest = read_manifest(path)
        cameras = manifest.cameras if scene == "yes" else manifest.tactile
        read_frames = iterate_frames if scene == "yes" else iterate_tactile
        stretches = _stretches(path, manifest)
        # Frames are read on their own: a recording's scans and frames lie in different
        # chunks, and neither may wait for the other.
        frames = read_frames(path) if cameras else iter(())
        pacer = Pacer(
            stretches, len(manifest.sensor.channels), clock, speed, FrameStream(frames), ahead=True
        )
        super().__init__(manifest.sensor, cameras, pacer)


def _stretches(path: Path, manifest: Manifest) -> Iterator[Stretch]:
    """Yield a recording's scans, and its marks `_AHEAD_S` before them: a mark is written once it is
    over, behind scans that are of the next trial.

    Where the recording's clock jumps, in either direction, no scans are held across the jump.
    """
    first_s, last_s, newest_s = math.inf, -math.inf, math.nan
    marked = not manifest.labels
    held: deque[tuple[float, Samples]] = deque()
    channels = len(manifest.sensor.channels)
    none = Samples.empty(channels)
    try:
        for block in iterate_blocks(path):
            times_s = [frame.fitted_s for frame in block.frames]
            if len(block.samples):
                times_s += [float(block.samples.fitted_s[0]), float(block.samples.fitted_s[-1])]
            first_s, last_s = min([first_s, *times_s]), max([last_s, *times_s])
            marked = marked or bool(block.marks)
            newest_s = max(times_s, default=newest_s)
            while held and not abs(newest_s - held[0][0]) < _AHEAD_S:
                yield held.popleft()[1], []
            if block.marks or not channels:
                yield none, [_labelled(mark, manifest) for mark in block.marks]
            if len(block.samples):
                held.append((newest_s, block.samples))
    except BadRecording:  # what lies before the damage is given first
        yield from ((samples, []) for _, samples in held)
        raise
    yield from ((samples, []) for _, samples in held)
    if last_s >= first_s and not marked:
        whole = Mark(start_s=first_s, end_s=last_s, labels={})
        yield none, [_labelled(whole, manifest)]


def _labelled(mark: Mark, manifest: Manifest) -> Mark:
    return replace(
        mark,
        labels={**manifest.labels, **mark.labels},
        groups={**manifest.groups, **mark.groups},
    )
