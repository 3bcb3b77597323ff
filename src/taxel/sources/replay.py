"""`replay://FILE`: a recording as a live source, in constant memory.

Knows nothing about models.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

from taxel.clock import Clock
from taxel.errors import BadSource
from taxel.recordings.reader import Block, iterate_blocks, read_manifest
from taxel.signals import Mark, Samples, SensorInfo
from taxel.sources.opening import read_speed
from taxel.sources.pacing import Pacer


class Replay:
    """A recording, scan by scan, with its own spacing.

    Args:
        path: The recording.
        options: `speed`: a factor of real time, or max.
        clock: The clock to wait on.

    Raises:
        BadSource: An option is unknown.
        BadRecording: The recording cannot be read.
    """

    def __init__(self, path: Path, options: dict[str, str], clock: Clock) -> None:
        options = dict(options)
        speed = read_speed(options)
        if options:
            raise BadSource("no option but speed", ", ".join(options), "mend the address")
        self._info = read_manifest(path).sensor
        self._blocks: Iterator[Block] = iterate_blocks(path)
        self._pacer = Pacer(clock, speed, len(self._info.channels))
        self._over = False
        self._refill()

    @property
    def info(self) -> SensorInfo:
        return self._info

    @property
    def ended(self) -> bool:
        return self._over and self._pacer.empty

    def read(self, timeout_s: float = 0.1) -> Samples:
        if self._pacer.empty:
            self._refill()
        samples = self._pacer.take(timeout_s)
        if self._pacer.empty:
            self._refill()
        return samples

    def marks(self) -> list[Mark]:
        return self._pacer.marks()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._over = True

    def _refill(self) -> None:
        while self._pacer.empty and not self._over:
            block = next(self._blocks, None)
            if block is None:
                self._over = True
                return
            self._pacer.put(block.samples, block.marks)
