"""Replay a pour with images in it that lie about their size, or are of a kind that is not read.

Knows nothing about goals.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

from taxel.bench.faults.watched_commands import peak_mb
from taxel.bundles.grasp import read_grasp_bundle
from taxel.bundles.shipped import CUP_POUR, shipped_bundle
from taxel.decisions.reasons import kind_of
from taxel.decisions.stability import Stability
from taxel.live.grasp_session import run_grasp_session
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.reader import iterate_frames, read_manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Frame
from taxel.sources.opening import open_source

PIXELS = 20_000
"""Width and height that they say to have: 1.2 GB of colours. Source: issue of hostile input."""
_BASELINE, _PROGRESSIVE = b"\xff\xc0", b"\xff\xc2"
"""How the part of a JPEG begins that holds its size. Source: ITU-T T.81, table B.1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Replayed:
    """What a monitor made of a recording."""

    bad: tuple[str, ...]
    """Reasons of the moments that were UNKNOWN because of an image."""
    after: int
    """Moments after the last of those."""
    decided: int
    """How many of these had a state."""
    moments: int
    memory_mb: float
    """Largest memory of the process."""


def hostile_image(jpeg: bytes, progressive: bool) -> bytes:
    """Return an image whose head says 20,000 × 20,000 px, or also that it is progressive."""
    at = jpeg.index(_BASELINE)
    mark = _PROGRESSIVE if progressive else _BASELINE
    size = struct.pack(">HH", PIXELS, PIXELS)
    return jpeg[:at] + mark + jpeg[at + 2 : at + 5] + size + jpeg[at + 9 :]


def with_hostile_images(frames: Iterable[Frame], first: int, count: int) -> list[Frame]:
    """Return frames of which some of the second camera are hostile, the later half progressive.

    Args:
        frames: Of two cameras in turn, from 0.
        first: The first frame that may be hostile.
        count: So many frames from there; every second is the second camera's.
    """
    changed = []
    for number, frame in enumerate(frames):
        if first <= number < first + count and frame.camera == 1:
            jpeg = hostile_image(frame.jpeg, progressive=number > first + count // 2)
            changed.append(replace(frame, jpeg=jpeg))
        else:
            changed.append(frame)
    return changed


def write_hostile_replay(source: Path, path: Path, first: int, count: int) -> list[Frame]:
    """Write a recording of two cameras again, some images hostile; return its frames."""
    frames = with_hostile_images(iterate_frames(source), first, count)
    cameras = tuple(replace(camera, serial="") for camera in read_manifest(source).cameras)
    with Recorder(path, Manifest(sensor=NO_ARRAY, cameras=cameras)) as recorder:
        for frame in frames:
            recorder.frame(frame)
    return frames


def replay(path: Path) -> Replayed:
    """Let the shipped bundle watch a recording as fast as it can, in this process."""
    decided: list[tuple[Stability, str]] = []
    with open_source(f"replay://{path}?speed=max") as source:
        tally = run_grasp_session(
            source, read_grasp_bundle(shipped_bundle(CUP_POUR)),
            on_answer=lambda answer, _: decided.append(
                (answer.decision.state, answer.decision.reason)
            ),
        )  # fmt: skip
    bad = [number for number, (_, reason) in enumerate(decided) if kind_of(reason) == "bad image"]
    later = decided[bad[-1] + 1 :] if bad else decided
    return Replayed(
        bad=tuple(decided[number][1] for number in bad), after=len(later),
        decided=sum(state is not Stability.UNKNOWN for state, _ in later),
        moments=tally.moments, memory_mb=peak_mb(),
    )  # fmt: skip


def replay_in_process(path: Path) -> Replayed:
    """Do the same in a process of its own, whose memory is measured."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(replay, path).result()
