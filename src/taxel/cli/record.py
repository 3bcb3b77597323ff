"""`taxel record`: write what a source delivers to a recording."""

from __future__ import annotations

import json
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import tyro
from rich.console import Console
from rich.progress import Progress

from taxel.cli.pairs import Pairs, parse_pairs
from taxel.errors import BadInput, BadSource
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Samples
from taxel.sources.contract import Source

SILENCE_S = 5.0
"""A source that delivers nothing for so long is given up."""


@dataclass(frozen=True)
class Record:
    """Record a source to an MCAP file; Ctrl-C or SIGTERM ends it properly.

    While it runs, the file is called FILE.part; if the recorder is killed,
    `taxel recover FILE.part --output FILE` saves all but the last 0.1 s.
    """

    source: tyro.conf.Positional[str]
    """Address of the source, such as sim://teng or serial:///dev/ttyUSB0."""
    output: Path
    """The recording to be, ending in .mcap."""
    seconds: float
    """How long to record, seconds of the source's time."""
    label: Pairs = ()
    """What may be learned and holds for the whole recording, as in shape=sphere material=glass."""
    group: Pairs = ()
    """What the recording belongs to and must not be split, as in session=3 object=cup."""
    overwrite: bool = False
    """Replace an existing recording."""
    json: bool = False
    """Print the ledger as JSON."""

    def run(self) -> None:
        """Record, then print what was recorded and what was lost."""
        from taxel.sources.opening import open_source

        if not self.seconds > 0:
            raise BadInput("--seconds above 0", f"{self.seconds:g}", "name a duration")
        labels = parse_pairs(self.label, "--label")
        groups = parse_pairs(self.group, "--group")
        with stop_signals() as stopped, open_source(self.source) as source:
            ledger = record_source(
                source,
                self.output,
                self.seconds,
                labels=labels,
                groups=groups,
                overwrite=self.overwrite,
                stopped=stopped,
            )
        if self.json:
            print(json.dumps(ledger))
        else:
            Console().print(ledger_line(ledger), highlight=False, soft_wrap=True)


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
    first = _wait_for_scans(source, stopped)
    manifest = Manifest.started_now(source.info, labels, groups, now_s=float(first.arrival_s[-1]))
    end_s = float(first.fitted_s[0]) + seconds
    ended = "cleanly"
    with (
        Recorder(output, manifest, overwrite=overwrite) as recorder,
        Progress(console=Console(stderr=True), transient=True) as progress,
    ):
        bar = progress.add_task(f"recording {output.name}", total=seconds)
        samples, heard = first, time.monotonic()
        while True:
            inside = samples[samples.fitted_s < end_s]
            recorder.write(inside)
            for mark in source.marks():
                recorder.mark(mark)
            if len(samples):
                heard = time.monotonic()
                progress.update(bar, completed=float(samples.fitted_s[-1]) - end_s + seconds)
            if len(inside) < len(samples) or stopped() or source.ended:
                break
            if time.monotonic() - heard > SILENCE_S:
                ended = f"the source fell silent for {SILENCE_S:g} s"
                break
            samples = source.read(0.1)
        recorder.close("stopped" if stopped() else ended)
    return {
        "recording": str(output),
        "bytes": output.stat().st_size,
        "nominal_rate_hz": source.info.rate_hz,
        "ended": "stopped" if stopped() else ended,
        **recorder.statistics(),
    }


def ledger_line(ledger: dict[str, Any]) -> str:
    """Return the ledger as one line for a person."""
    rate = ledger["rate_hz"]
    measured = "rate unknown" if rate is None else f"{rate:.1f} scans/s measured"
    return (
        f"{ledger['recording']}: {ledger['scans']} scans in {ledger['duration_s']:.2f} s, "
        f"{measured} ({ledger['nominal_rate_hz']:g} nominal), {ledger['lost_scans']} lost, "
        f"{ledger['unusable_values']} unusable and {ledger['saturated_values']} saturated values, "
        f"{ledger['marks']} marks, {ledger['bytes'] / 1e6:.1f} MB, ended: {ledger['ended']}"
    )


@contextmanager
def stop_signals() -> Iterator[Callable[[], bool]]:
    """Turn SIGINT, SIGTERM and SIGHUP into a question that a loop can ask; a second one kills."""
    received: list[int] = []

    def note(number: int, _frame: FrameType | None) -> None:
        if received:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
        received.append(number)
        print("stopping: completing the file", file=sys.stderr)

    names = [name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {name: signal.signal(getattr(signal, name), note) for name in names}
    try:
        yield lambda: bool(received)
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)


def _wait_for_scans(source: Source, stopped: Callable[[], bool]) -> Samples:
    started = time.monotonic()
    while not stopped() and not source.ended and time.monotonic() - started < SILENCE_S:
        samples = source.read(0.1)
        if len(samples):
            return samples
    raise BadSource(
        "a source that delivers scans",
        "none before it ended" if source.ended else f"none in {SILENCE_S:g} s",
        "check the cable, the address and the device's power",
    )
