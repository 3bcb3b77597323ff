"""What faults of sensor boards cost, measured: cables pulled, bytes damaged, clocks that drift.

Boards are emulated (`taxel.sources.boards.emulation`); ports are pseudo-terminals. The
decoder, the fit and the source are those that run live. Knows nothing about cameras.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.bench.rows import Row, row
from taxel.sources.boards.emulation import EmulatedBoard, RunningBoard
from taxel.sources.contract import Source
from taxel.sources.fitted_time import FittedTime
from taxel.sources.opening import open_source
from taxel.wire.framing import FrameDecoder

_CHANNELS = 4
_CHANCE = 2.0**-16
"""What a check of 16 bits lets pass of random damage."""
_DELIMITER_AND_CHECK = 4
_ROUNDS = 10
_LONGEST_S = 5.0
"""What is waited for at most: a board that never returns shows as this."""
_FRAMES = 20_000
_DAMAGED = 1_000_000
_NOISE = 1_000_000
_CLOCK_S = 60.0
_LEARN_S = 10.0


def board_rows() -> list[Row]:
    """Measure all of them; about 20 seconds."""
    return [
        _replugged(),
        _kept(),
        _bursts(),
        _damage(),
        _noise(),
        _drift(),
    ]


def _replugged() -> Row:
    took_s, shown = [], set()
    with (
        tempfile.TemporaryDirectory() as folder,
        RunningBoard(EmulatedBoard(), Path(folder) / "board") as board,
        open_source(f"serial://{board.port.path}") as source,
    ):
        for _ in range(_ROUNDS):
            _read_until(source, _good)
            board.unplug()
            shown |= set(np.unique(_read_until(source, _away)[-1]).tolist())
            back_s = board.replug()
            _read_until(source, _good)
            took_s.append(time.monotonic() - back_s)
    return row(
        "board unplugged and replugged: data again after its return",
        max(took_s),
        "s",
        "<=",
        0.1,
        f"worst of {_ROUNDS}, median {float(np.median(took_s)):.3f}; away, its values are flagged "
        f"{sorted(shown)} (1 missing + 8 reconnecting)",
    )


def _read_until(source: Source, right: Callable[[NDArray[np.uint8]], bool]) -> NDArray[np.uint8]:
    """Read on until the flags of what came are right, or for `_LONGEST_S`; return them."""
    end_s = time.monotonic() + _LONGEST_S
    flags = source.read().validity
    while not right(flags) and time.monotonic() < end_s:
        flags = source.read().validity
    return flags


def _good(flags: NDArray[np.uint8]) -> bool:
    return bool(len(flags)) and not flags[-1].any()


def _away(flags: NDArray[np.uint8]) -> bool:
    return bool(len(flags)) and bool(flags[-1].all())


def _kept() -> Row:
    random = np.random.default_rng(0)
    stream = _frames(_FRAMES).reshape(-1)
    hit = random.random(len(stream)) < 1e-3
    stream[hit] ^= random.integers(1, 256, int(hit.sum()), np.uint8)
    decoder = FrameDecoder()
    got = len(decoder.feed(stream.tobytes()))
    return row(
        f"1 corrupt byte in 1,000: frames of {_CHANNELS} channels kept",
        got / _FRAMES,
        "share",
        ">=",
        0.97,
        f"{int(hit.sum())} bytes hit, {_FRAMES - got} of {_FRAMES} frames lost, "
        f"{decoder.bad.total} bad pieces counted",
    )


def _bursts() -> Row:
    """Feed every burst of up to 16 bits that one frame can take."""
    (frame,) = _frames(1)
    accepted = tried = 0
    for damaged in _all_bursts(frame[:-1]):
        tried += len(damaged)
        accepted += len(FrameDecoder().feed(damaged.tobytes()))
    return row(
        "bursts of up to 16 bits in a frame: accepted",
        accepted,
        "frames",
        "<=",
        0,
        f"all {tried:,} bursts, fed through the decoder",
    )


def _all_bursts(frame: NDArray[np.uint8]) -> Iterator[NDArray[np.uint8]]:
    """Yield the damaged frames of each first bit, delimiter and all; bits counted from the top."""
    bits = 8 * len(frame)
    for first in range(bits):
        width = min(16, bits - first)
        patterns = np.arange(1 << (width - 1), 1 << width, dtype=np.uint32)  # first bit set
        placed = patterns << (16 - width) << 8 >> first % 8  # of 24 bits, from the first's byte on
        damaged = np.zeros((len(patterns), len(frame) + 1), np.uint8)
        damaged[:, :-1] = frame
        for i in range(3):
            if first // 8 + i < len(frame):
                damaged[:, first // 8 + i] ^= (placed >> (16 - 8 * i) & 0xFF).astype(np.uint8)
        yield damaged


def _damage() -> Row:
    """Replace 3 to 20 bytes of sound frames by others."""
    random = np.random.default_rng(1)
    sound, accepted = _frames(10_000), 0
    for _ in range(_DAMAGED // len(sound)):
        frames = sound.copy()
        size = frames.shape[1] - 1
        count = random.integers(3, 21, len(frames))
        order = random.random((len(frames), size)).argsort(axis=1)
        noise = random.integers(1, 256, (len(frames), size), np.uint8)
        frames[:, :-1] ^= np.where(order < count[:, None], noise, 0).astype(np.uint8)
        accepted += len(FrameDecoder().feed(frames.tobytes()))
    return row(
        "random damage (3 to 20 bytes of a frame): accepted",
        accepted / _DAMAGED,
        "share",
        "<=",
        _CHANCE,
        f"{accepted} of {_DAMAGED:,}; the check alone promises 2⁻¹⁶ = {_CHANCE:.2g}",
    )


def _noise() -> Row:
    """Give noise a well-formed check, the worst case: only the CRC itself can reveal it."""
    random = np.random.default_rng(2)
    frames, accepted = _frames(10_000), 0
    for _ in range(_NOISE // len(frames)):
        frames[:, 1:-_DELIMITER_AND_CHECK] = random.integers(
            1, 256, (len(frames), frames.shape[1] - _DELIMITER_AND_CHECK - 1), np.uint8
        )
        frames[:, 0] = frames.shape[1] - _DELIMITER_AND_CHECK
        accepted += len(FrameDecoder().feed(frames.tobytes()))
    expected = _NOISE * _CHANCE
    limit = (expected + 4.0 * expected**0.5) / _NOISE
    return row(
        "noise under a well-formed check: accepted",
        accepted / _NOISE,
        "share",
        "<=",
        limit,
        f"{accepted} of {_NOISE:,}; {expected:.0f} are expected of 2⁻¹⁶, the goal adds 4 sigma",
    )


def _drift() -> Row:
    errors_ms = [_drift_ms(ppm, seed) for seed, ppm in enumerate((40.0, -40.0))]
    bias_ms = [abs(float(np.mean(errors))) for errors in errors_ms]
    spread_ms = max(float(np.std(errors)) for errors in errors_ms)
    return row(
        "clock drift of ±40 ppm with USB stalls: fitted time's bias",
        max(bias_ms),
        "ms",
        "<=",
        0.5,
        f"spread {spread_ms:.3f} ms; {_CLOCK_S:.0f} s at 1 kHz, 0.25 ms of transfer, exponential "
        "jitter of 1 ms, a stall of 10 to 50 ms about every 0.7 s",
    )


def _drift_ms(ppm: float, seed: int) -> NDArray[np.float64]:
    """Return fitted minus true time of each scan once the fit has learned, milliseconds."""
    random = np.random.default_rng(seed)
    true_s = np.arange(int(_CLOCK_S * 1000), dtype=np.float64) * np.float64(1e-3)
    arrival_s = true_s + 0.25e-3 + random.exponential(1e-3, len(true_s))
    start_s = 0.0
    while start_s < _CLOCK_S:
        start_s += random.exponential(0.7)
        end_s = start_s + random.uniform(0.01, 0.05)
        arrival_s[(arrival_s > start_s) & (arrival_s < end_s)] = end_s
    arrival_s = np.maximum.accumulate(arrival_s)
    device_s = true_s * (1.0 + ppm * 1e-6) + 7.0
    fit = FittedTime()
    fitted_s = [fit.of(device_s[i : i + 5], arrival_s[i : i + 5]) for i in range(0, len(true_s), 5)]
    errors: NDArray[np.float64] = (np.concatenate(fitted_s) - true_s) * 1e3
    return errors[true_s > _LEARN_S]


def _frames(count: int) -> NDArray[np.uint8]:
    """Return frames as a board sends them, one a row; ticks without zero bytes: equal lengths."""
    board = EmulatedBoard(channels=_CHANNELS, first_tick=0x01010101)
    rows = [board.scan() for _ in range(count)]
    length = len(rows[0])
    return np.frombuffer(b"".join(rows), np.uint8).reshape(count, length).copy()
