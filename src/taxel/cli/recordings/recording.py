"""Record an open source to a file: with progress, until its time is over or a signal ends it.

What `taxel record` and the verbs that record on the way share. Knows nothing about options.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

from taxel.cli.printing import progress, say_aside
from taxel.errors import BadSource
from taxel.plain_text import number_of
from taxel.recordings.manifest import Manifest
from taxel.recordings.tally import camera_line
from taxel.recordings.writer import Recorder
from taxel.signals import Frame, Mark, Samples
from taxel.sources.contract import Source

SILENCE_S = 5.0
"""A source that delivers nothing for so long is given up."""
LATE_S = 0.5
"""Fitted time that the slower of array and cameras may lag at the end. Source: our choice,
docs/decisions/0012."""
SUMMARY_FOLLOWS = "the summary follows"
"""What a verb that writes no file says after the first signal."""
TOGETHER_S = 1.0
"""Signals within so many seconds of the first are one request to stop: a service manager may send
it to a process and to its group, and the second would end what the first began to complete. Source:
our choice, docs/decisions/0019."""
_ARRAY = -1
"""Stands for the array among the cameras' numbers."""


def record_source(
    source: Source,
    output: Path,
    seconds: float,
    *,
    labels: dict[str, str],
    groups: dict[str, str],
    overwrite: bool = False,
    stopped: Callable[[], bool] = lambda: False,
) -> dict[str, Any]:
    """Record an open source and return the ledger.

    Args:
        source: The open source.
        output: The recording to be.
        seconds: How much of the source's fitted time to record, seconds.
        labels: What holds for the whole recording.
        groups: What the recording belongs to.
        overwrite: Replace an existing recording.
        stopped: True once it shall end early; the recording is then complete in itself.

    Raises:
        BadSource: The source delivers nothing.
        BadInput: The output exists.
        RecordingFailed: The disk refused.
    """
    samples, frames = _wait_for_first(source, stopped)
    span = _Span(source, samples, frames, seconds)
    manifest = Manifest.started_now(
        source.info, labels, groups, now_s=_latest_arrival_s(samples, frames),
        cameras=source.cameras,
    )  # fmt: skip
    ended = "cleanly"
    with (
        Recorder(output, manifest, overwrite=overwrite) as recorder,
        progress() as bars,
    ):
        bar = bars.add_task(f"recording {output.name}", total=seconds)
        heard = time.monotonic()
        while True:
            scans, inside = span.take(samples, frames)
            recorder.write(scans)
            for frame in inside:
                recorder.frame(frame)
            for mark in source.marks():
                if span.holds(mark):
                    recorder.mark(mark.within(groups))
            if len(samples) or frames:
                heard = time.monotonic()
                bars.update(bar, completed=span.done_s)
            if span.over or stopped() or source.ended:
                break
            if time.monotonic() - heard > SILENCE_S:
                ended = f"the source fell silent for {SILENCE_S:g} s"
                break
            samples, frames = source.read(0.1), source.frames()
        recorder.close("stopped" if stopped() else ended)
    return {
        "recording": str(output),
        "bytes": output.stat().st_size,
        "nominal_rate_hz": source.info.rate_hz,
        "ended": "stopped" if stopped() else ended,
        **recorder.statistics(),
    }


class _Span:
    """The stretch of fitted time that is recorded, the same for the array and every camera.

    Args:
        source: What is recorded.
        samples: The first scans, where there are any.
        frames: The first frames, where there are any.
        seconds: Its length, seconds.
    """

    def __init__(
        self, source: Source, samples: Samples, frames: list[Frame], seconds: float
    ) -> None:
        self._start_s = min(
            [float(time_s) for time_s in samples.fitted_s[:1]] + [f.fitted_s for f in frames]
        )
        self._end_s = self._start_s + seconds
        self._newest_s = self._start_s
        self._waited_for = set(range(len(source.cameras)))
        if source.info.channels:
            self._waited_for.add(_ARRAY)

    @property
    def done_s(self) -> float:
        """How much of the recording's time has passed, seconds."""
        return self._newest_s - self._start_s

    @property
    def over(self) -> bool:
        """True once the array and each camera are past its end, or one of them far past it."""
        return not self._waited_for or self._newest_s >= self._end_s + LATE_S

    def holds(self, mark: Mark) -> bool:
        """Return whether any of a mark's time is recorded: one read may give far more than that."""
        return mark.start_s < self._end_s

    def take(self, samples: Samples, frames: list[Frame]) -> tuple[Samples, list[Frame]]:
        """Return the scans and frames that lie inside."""
        scans = samples[samples.fitted_s < self._end_s]
        if len(scans) < len(samples):
            self._waited_for.discard(_ARRAY)
        if len(samples):
            self._newest_s = max(self._newest_s, float(samples.fitted_s[-1]))
        inside = []
        for frame in frames:
            self._newest_s = max(self._newest_s, frame.fitted_s)
            if frame.fitted_s < self._end_s:
                inside.append(frame)
            else:
                self._waited_for.discard(frame.camera)
        return scans, inside


def ledger_line(ledger: dict[str, Any]) -> str:
    """Return the ledger as one line for a person."""
    rate = ledger["rate_hz"]
    measured = "rate unknown" if rate is None else f"{rate:.1f} scans/s measured"
    parts = [
        f"{number_of(ledger['scans'], 'scan')} in {ledger['duration_s']:.2f} s",
        f"{measured} ({ledger['nominal_rate_hz']:g} nominal)",
        f"{ledger['lost_scans']} lost",
        f"{ledger['unusable_values']} unusable and "
        f"{number_of(ledger['saturated_values'], 'saturated value')}",
    ]
    cameras = ledger.get("cameras", {})
    parts = (parts if ledger["scans"] or not cameras else []) + [
        f"camera {name}: {camera_line(camera)}" for name, camera in cameras.items()
    ]
    parts += [number_of(ledger["marks"], "mark"), f"{ledger['bytes'] / 1e6:.1f} MB"]
    return f"{ledger['recording']}: {', '.join(parts)}, ended: {ledger['ended']}"


@contextmanager
def stop_signals(
    follows: str = "completing the file", clock: Callable[[], float] = time.monotonic
) -> Iterator[Callable[[], bool]]:
    """Turn SIGINT, SIGTERM and SIGHUP into a question that a loop can ask; a second one kills.

    Those that come within `TOGETHER_S` of the first are the same request.

    Args:
        follows: What is still done after the first, for the line that says so.
        clock: Monotonic seconds.
    """
    received_s: list[float] = []

    def note(number: int, _frame: FrameType | None) -> None:
        if received_s and clock() - received_s[0] < TOGETHER_S:
            return
        if received_s:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
        received_s.append(clock())
        say_aside(f"stopping: {follows}")

    names = [name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {name: signal.signal(getattr(signal, name), note) for name in names}
    try:
        yield lambda: bool(received_s)
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)


def _wait_for_first(source: Source, stopped: Callable[[], bool]) -> tuple[Samples, list[Frame]]:
    started = time.monotonic()
    while not stopped() and not source.ended and time.monotonic() - started < SILENCE_S:
        samples, frames = source.read(0.1), source.frames()
        if len(samples) or frames:
            return samples, frames
    raise BadSource(
        "a source that delivers scans or frames",
        "none before it was stopped" if stopped()
        else "none before it ended" if source.ended
        else f"none in {SILENCE_S:g} s",
        "check the cable, the address and the device's power",
    )  # fmt: skip


def _latest_arrival_s(samples: Samples, frames: list[Frame]) -> float:
    return max([float(s) for s in samples.arrival_s[-1:]] + [f.arrival_s for f in frames])
