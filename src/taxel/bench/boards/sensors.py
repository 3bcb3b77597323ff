"""Sensor boards' firmware, measured on emulated boards: from the converter to the recording.

Waveforms are those of the simulated hand. Virtual time: figures do not depend on how busy
this machine is. Knows nothing about motors.

Background of our choices: docs/decisions/0020.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.bench.boards.emulator import (
    PINS,
    BoardSetup,
    EmulatedBoards,
    Firmware,
    VirtualClock,
)
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import iterate_samples
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, Validity
from taxel.sources.boards.source import SerialBoards
from taxel.sources.opening import open_source
from taxel.wire.framing import FrameDecoder
from taxel.wire.messages import Data, Heartbeat, Message, unpack

CHANNELS = (1, 4, 7, 10)
"""The analog pins of a board's four sensors. Source: Balapan 2025, section 3.2."""
_SLICE_S = 0.005
_UNEVEN_S = 0.002
"""How long the boards run between two looks of the host, more or less, virtual seconds. Uneven, as
on a real machine: evenly, arrivals would show resonators' errors in whole ticks only. Our choice.
"""
_SETTLE_S = 1.0
_OF_ROWS = ("early", "late", "repeated", "skipped")
_CATCH_UP_S = 30.0
"""How long the host may take to read what was sent, real seconds. Our choice."""
_REFERENCE_MV = 5000
_TURNS = (1, 0, 2, *(turn for far in range(3, 13) for turn in (far, 2 - far)))
"""Which scan may come next, the likeliest first. Our choice: twelve scans are 12 ms."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainResult:
    """Counts of all scans between the converters and the file: recorded, lost and wrong."""

    boards: list[dict[str, Any]]
    """One ledger a board, as `serial://` says."""
    scans: int
    """Scans that the boards began and ended."""
    frames: int
    """Of these, frames on the wire."""
    frame_values: int
    """Converter values in these frames."""
    wrong_values: int
    """Of these, values that differ from what the waveform gives."""
    rows: int
    """Rows in the recording."""
    wrong_rows: int
    """Rows whose values are not those of a scan at their place, bit for bit."""
    missing: int
    """Values in the recording that are flagged missing."""
    sent: bytes
    """All bytes of all boards, one board after another."""


def teng_volts(seconds: float, boards: int, seed: int = 0) -> list[NDArray[np.float64]]:
    """Return waveforms of the simulated hand for the pins of some boards.

    Args:
        seconds: How long.
        boards: How many boards, at most three; four of the hand's twelve sensors each.
        seed: Chooses the grasps.

    Returns:
        One array a board, shape (n, 16) at 1 kHz, volts; pins without a sensor are at 0 V.
    """
    with open_source(f"sim://teng?seed={seed}&rate_hz=1000&speed=max") as source:
        parts, rows = [], 0
        while rows < seconds * 1000:
            samples = source.read()
            parts.append(samples.values)
            rows += len(samples)
    values = np.concatenate(parts)[: round(seconds * 1000)]
    found = []
    for board in range(boards):
        volts = np.zeros((len(values), PINS))
        volts[:, CHANNELS] = values[:, 4 * board : 4 * board + 4]
        found.append(volts)
    return found


def run_chain(firmware: Firmware, seconds: float, ppm: tuple[float, ...]) -> ChainResult:
    """Run a board for each resonator error through UART, port, `serial://`, clock fit and recorder.

    Args:
        firmware: As built.
        seconds: Virtual time, seconds.
        ppm: How much faster than true time each board's resonator is.
    """
    volts = teng_volts(seconds + _SETTLE_S + 1.0, len(ppm))
    setups = [
        BoardSetup(elf=firmware.elf(f"teng_daq_{n}"), volts=volts[n], ppm=ppm[n])
        for n in range(len(ppm))
    ]
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        path = Path(scratch) / "boards.mcap"
        with EmulatedBoards(firmware, setups) as boards:
            ledgers = _record(boards, path, seconds, len(ppm))
            chains = [_frames_against_waveform(boards, n) for n in range(len(ppm))]
            sent = b"".join(boards.bytes_sent(n) for n in range(len(ppm)))
            expected = [chain[0] for chain in chains]
        rows, wrong_rows, missing = _rows_against_scans(path, expected)
    return ChainResult(
        boards=ledgers,
        scans=sum(len(scans) for scans in expected),
        frames=sum(chain[1] for chain in chains),
        frame_values=sum(chain[1] for chain in chains) * len(CHANNELS),
        wrong_values=sum(chain[2] for chain in chains),
        rows=rows,
        wrong_rows=wrong_rows,
        missing=missing,
        sent=sent,
    )


def _record(boards: EmulatedBoards, path: Path, seconds: float, count: int) -> list[dict[str, Any]]:
    """Record through the real source for some time; return its ledgers.

    What concerns rows (`_OF_ROWS`) is counted from the recording's beginning on: a second
    goes before it, in which the clocks' fit learns from ports that are just being opened.
    """
    clock = VirtualClock(boards, readers=True)
    ports = ",".join(str(boards.port(n)) for n in range(count))
    random = np.random.default_rng(0)
    with SerialBoards(ports, {}, clock) as source:
        _run_to(_SETTLE_S, source, boards, random, lambda _: None)
        before = source.boards()
        manifest = Manifest.started_now(source.info, {}, {}, now_s=clock.now_s())
        with Recorder(path, manifest) as recorder:
            # The last rows are given when they are old enough.
            end_s = boards.now_s + seconds + 0.1
            _run_to(end_s, source, boards, random, recorder.write)
        after = source.boards()
    return [
        {k: v - old[k] if k in _OF_ROWS else v for k, v in new.items()}
        for old, new in zip(before, after, strict=True)
    ]


def read_for(
    until_s: float,
    source: SerialBoards,
    boards: EmulatedBoards,
    write: Callable[[Samples], None],
) -> None:
    """Let the boards run until a virtual time, and hand on the rows that the host completes."""
    _run_to(until_s, source, boards, np.random.default_rng(0), write)


def _run_to(
    until_s: float,
    source: SerialBoards,
    boards: EmulatedBoards,
    random: np.random.Generator,
    write: Callable[[Samples], None],
) -> None:
    while boards.now_s < until_s:
        boards.run(float(random.uniform(_SLICE_S - _UNEVEN_S, _SLICE_S + _UNEVEN_S)))
        _catch_up(source, boards, write)


def _catch_up(
    source: SerialBoards, boards: EmulatedBoards, write: Callable[[Samples], None]
) -> None:
    """Read until the host has all that was sent, and hand on the rows that it completes."""
    until_s = time.monotonic() + _CATCH_UP_S
    while True:
        write(source.read(0.0))
        received = [board["received_bytes"] for board in source.boards()]
        if received == boards.sent:
            return
        if time.monotonic() > until_s:
            raise TimeoutError(f"the host has read {received} of {boards.sent} bytes")
        time.sleep(0.0002)


def messages_of(sent: bytes) -> list[Message]:
    """Return what a board said; raises AssertionError where a byte of it is damaged."""
    decoder = FrameDecoder()
    found = [unpack(payload) for payload in decoder.feed(sent)]
    assert not decoder.bad.total
    return [message for message in found if message is not None]


def expected_scans(
    boards: EmulatedBoards, board: int, channels: tuple[int, ...] = CHANNELS
) -> NDArray[np.int64]:
    """Return the counts that a board's scans should hold, shape (n, channels), whole scans only.

    From the waveform and the moments of the samples; what the firmware said is not looked at.
    """
    found = boards.conversions(board)
    kept = boards.counts(board, _REFERENCE_MV)[np.isin(found["pin"], channels)]
    whole = len(kept) // len(channels) * len(channels)
    return kept[:whole].reshape(-1, len(channels))


def _frames_against_waveform(
    boards: EmulatedBoards, board: int
) -> tuple[NDArray[np.int64], int, int]:
    """Return the expected scans, how many frames came, and how many values differ."""
    scans = expected_scans(boards, board)
    frames = [m for m in messages_of(boards.bytes_sent(board)) if isinstance(m, Data)]
    seq = np.array([frame.seq for frame in frames])
    inside = seq < len(scans)
    values = np.array([frame.values for frame in frames])[inside]
    wrong = int((values != scans[seq[inside]]).sum())
    return scans, len(frames), wrong


def _rows_against_scans(path: Path, expected: list[NDArray[np.int64]]) -> tuple[int, int, int]:
    """Return the recording's rows, those that are not the scans in order, and missing values.

    A board whose resonator is faster or slower than the first one's has a scan left out or
    repeated now and then; the source's ledger counts those.
    """
    blocks = list(iterate_samples(path))
    samples = _joined(blocks)
    missing = (samples.validity & Validity.MISSING) != 0
    wrong = first = 0
    scale = np.float32(_REFERENCE_MV / 1000.0 / 1024)
    for board, scans in enumerate(expected):
        columns = slice(4 * board, 4 * board + 4)
        there = ~missing[:, columns].any(axis=1)
        wanted = scans.astype(np.float32) * scale
        first = round(float(samples.device_s[0]) * 1000.0) - 1 if board == 0 else first
        wrong += _out_of_order(samples.values[there, columns], wanted, first)
    return len(samples), wrong, int(missing.sum())


def _out_of_order(rows: NDArray[np.float32], wanted: NDArray[np.float32], first: int) -> int:
    """Return how many rows are none of the scans next in turn from the first on, bit for bit.

    In turn is the next one; the same or the one after that where a scan was repeated or left out;
    and any of `_TURNS` about it, since a hand at rest gives equal scans, which hide their place.
    """
    at, wrong = first - 1, 0
    for row in rows:
        for turn in _TURNS:
            if 0 <= at + turn < len(wanted) and np.array_equal(row, wanted[at + turn]):
                at += turn
                break
        else:
            wrong += 1
            at += 1
    return wrong


def _joined(blocks: list[Samples]) -> Samples:
    names = ("counter", "device_s", "arrival_s", "fitted_s", "values", "validity")
    return Samples(**{n: np.concatenate([getattr(b, n) for b in blocks]) for n in names})


@dataclass(frozen=True, slots=True, kw_only=True)
class WideResult:
    """Sixteen channels on one board."""

    rate_hz: float
    """Scans a second that arrived whole."""
    lost: int
    """Scans that were due and did not arrive, and that the board says it dropped."""
    wrong_values: int
    scan_us: float
    """From the first sample of a scan to the last, microseconds."""


def run_wide(firmware: Firmware, name: str, seconds: float) -> WideResult:
    """Run the 16-channel firmware of this name for some virtual seconds on random voltages."""
    volts = np.random.default_rng(16).uniform(0.0, 5.0, (round(seconds * 1000) + 1, PINS))
    setup = BoardSetup(elf=firmware.elf(name), volts=volts)
    with EmulatedBoards(firmware, [setup]) as boards:
        boards.run(seconds)
        heard = messages_of(_whole_frames(boards.bytes_sent(0)))
        scans = expected_scans(boards, 0, tuple(range(PINS)))
        cycles = boards.conversions(0)["cycle"].astype(np.int64)
    frames = [message for message in heard if isinstance(message, Data)]
    dropped = max(message.dropped for message in heard if isinstance(message, Heartbeat))
    seq = np.array([frame.seq for frame in frames])
    values = np.array([frame.values for frame in frames])
    began = cycles[: len(cycles) // PINS * PINS].reshape(-1, PINS)
    took_s = (frames[-1].t_us - frames[0].t_us) * 1e-6
    wrong = values != scans[seq] if len(scans) > seq[-1] else np.ones(1)
    return WideResult(
        rate_hz=(len(frames) - 1) / took_s,
        lost=int(seq[-1] - seq[0]) + 1 - len(seq) + dropped,
        wrong_values=int(wrong.sum()),
        scan_us=float((began[:, -1] - began[:, 0]).mean()) / 16,
    )


def naive_rate_hz(firmware: Firmware, seconds: float) -> float:
    """Return the scans a second of a sketch that reads 16 pins in its loop and prints them."""
    volts = np.random.default_rng(16).uniform(0.0, 5.0, (round(seconds * 1000) + 1, PINS))
    setup = BoardSetup(elf=firmware.elf("naive_print"), volts=volts)
    with EmulatedBoards(firmware, [setup]) as boards:
        boards.run(seconds)
        return boards.bytes_sent(0).count(b"\n") / seconds


def _whole_frames(sent: bytes) -> bytes:
    return sent[: sent.rfind(b"\x00") + 1]


@dataclass(frozen=True, slots=True, kw_only=True)
class DamageResult:
    """Single faults on the wire."""

    faults: int
    most_lost: int
    """The most frames that one fault took."""
    lost: int
    """Frames that all faults took together."""
    invented: int
    """Frames that were accepted and differ from what was sent."""


def run_damage(sent: bytes, faults: int, seed: int = 0) -> DamageResult:
    """Flip a bit of, drop, or insert a byte, each alone, in what boards have sent.

    Args:
        sent: Bytes as they left the firmware, without damage.
        faults: How many; a third of each kind, anywhere.
        seed: Chooses where.
    """
    sent = _whole_frames(sent)
    ends = np.flatnonzero(np.frombuffer(sent, np.uint8) == 0)
    random = np.random.default_rng(seed)
    places = random.integers(ends[4], ends[-5], faults)
    kinds = random.integers(0, 3, faults)
    extra = random.integers(0, 256, faults)
    most = lost = invented = 0
    for place, kind, byte in zip(places.tolist(), kinds.tolist(), extra.tolist(), strict=True):
        at = int(np.searchsorted(ends, place))
        low, high = int(ends[at - 4]), int(ends[min(at + 4, len(ends) - 1)]) + 1
        frames = sent[low:high]
        here = place - low
        if kind == 0:
            damaged = frames[:here] + bytes((frames[here] ^ 1 << byte % 8,)) + frames[here + 1 :]
        elif kind == 1:
            damaged = frames[:here] + frames[here + 1 :]
        else:
            damaged = frames[:here] + bytes((byte,)) + frames[here:]
        before, after = FrameDecoder().feed(frames), FrameDecoder().feed(damaged)
        new = [payload for payload in after if payload not in before]
        gone = sum(payload not in after for payload in before)
        most, lost, invented = max(most, gone), lost + gone, invented + len(new)
    return DamageResult(faults=faults, most_lost=most, lost=lost, invented=invented)
