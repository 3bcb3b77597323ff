"""Features of many recordings at a time: each a job that leaves its file in the cache.

A job carries the recording's path and what computes features: settings, or the path of a
backbone's file beside the cache. Its features travel through the cache, a folder that all workers
see. Knows nothing about labels or heads.

Source: docs/decisions/0050.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.engine import Engine, Precision, open_engine
from taxel.errors import BadInput
from taxel.jobs.running import as_done, shared_out
from taxel.training.frames.extractors import BackboneEngine, BackboneExtractor
from taxel.training.frames.features import (
    Extractor,
    Progress,
    extract,
    kept_path,
    load_kept,
    save_bytes,
)
from taxel.windows.camera_recordings import CameraRecording, read_camera_recording


@dataclass(frozen=True, slots=True)
class StoredBackbone:
    """A backbone as a job carries it: a file and how it is run."""

    model: Path
    """The ONNX file."""
    run_by: tuple[BackboneEngine, Precision, int]
    key: str
    features: int
    in_order: bool = False
    places: bool = False

    def of(self, images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        return _opened(self.model, self.run_by).run(frames=np.stack(images))


def fill_cache(
    pours: Sequence[CameraRecording],
    extractors: Sequence[Extractor],
    cache: Path,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> None:
    """Compute side by side what the cache lacks; nothing where no engine is in use.

    Args:
        pours: The recordings.
        extractors: What computes features of each; may be the same for all.
        cache: Folder to keep them in, which all workers see.
        on_progress: Called after each recording.

    Raises:
        BadInput: A worker's features are not in the cache: it has another disk.
    """
    if not shared_out():
        return
    missing = [
        (pour, extractor) for pour, extractor in zip(pours, extractors, strict=True)
        if not _in_this_process(extractor)
        and load_kept(kept_path(cache, extractor, pour), extractor.features) is None
    ]  # fmt: skip
    missing.sort(key=lambda each: -len(each[0]))  # the longest last would keep one worker alone
    jobs = [(pour.path.absolute(), portable(own, cache), cache.absolute()) for pour, own in missing]
    frames, seconds, known = 0, 0.0, len(pours) - len(missing)
    for number, found in as_done(extract_one, jobs, names=[pour.name for pour, _ in missing]):
        pour, extractor = missing[number]
        if not kept_path(cache, extractor, pour).exists():
            raise other_disk(cache)
        known, frames, seconds = known + 1, frames + found.frames, seconds + found.seconds
        on_progress(Progress(known, len(pours), frames, seconds))


def other_disk(cache: Path) -> BadInput:
    """Return what to raise where a worker's features are not in the cache."""
    return BadInput(
        f"one cache for all workers, {cache}", "a worker that keeps its own",
        "name a folder on a shared disk with --cache or $TAXEL_CACHE",
    )  # fmt: skip


def _in_this_process(extractor: Extractor) -> bool:
    """Return whether no other process can run it: one graphics card serves one."""
    return isinstance(extractor, BackboneExtractor) and extractor.run_by[0] == "torch"


def extract_one(path: Path, extractor: Extractor, cache: Path) -> Progress:
    """Leave one recording's features in the cache; a job for any worker."""
    done: list[Progress] = []
    extract([read_camera_recording(path)], extractor, cache, done.append)
    return done[-1]


def portable(extractor: Extractor, cache: Path) -> Extractor:
    """Return an extractor that a job can carry; a backbone's file is written into the cache."""
    if not isinstance(extractor, BackboneExtractor):
        return extractor
    path = cache.absolute() / "backbones" / f"{extractor.key}.onnx"
    if not path.exists() or path.stat().st_size != len(extractor.model):
        save_bytes(path, extractor.model)
    return StoredBackbone(
        path, extractor.run_by, extractor.key, extractor.features, places=extractor.places
    )


@lru_cache(maxsize=1)
def _opened(model: Path, run_by: tuple[BackboneEngine, Precision, int]) -> Engine:
    engine, precision, threads = run_by
    assert engine != "torch", "is not carried to other processes"
    return open_engine(model.read_bytes(), engine, precision, threads)
