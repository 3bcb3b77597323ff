"""Taps on an emulated sensor board: found, counted and measured as on the gauge itself.

The simulated gauge taps a pad; its voltages are laid on the pins of a board whose firmware,
converter, serial line and host driver are the real ones. Knows nothing about how rows are printed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.bench.boards.emulator import (
    PINS,
    BoardSetup,
    EmulatedBoards,
    Firmware,
    VirtualClock,
)
from taxel.bench.boards.sensors import CHANNELS, read_for
from taxel.bench.rows import Row, row
from taxel.calibration.durability import Durability, durability_of
from taxel.calibration.taps import PAUSE_S, TapMeter
from taxel.signals import Samples, Validity
from taxel.sim.teng.force_gauge import ForceGauge, GaugeConfig
from taxel.sim.teng.hand import TengHandConfig
from taxel.sources.boards.source import SerialBoards

RATE_HZ = 1000.0
PLAN = ((2.0, 60), (0.5, 10), (8.0, 40))
"""(taps a second, taps). Source: our choice, docs/decisions/0047."""
SEED = 1
_SETTLE_S = 1.0
"""Before the taps, seconds: the clocks' fit learns. Our choice, docs/decisions/0047."""


def tap_rows(firmware: Firmware) -> list[Row]:
    """Tap one pad; compare what the board's scans say with what the gauge's own do."""
    volts = _tapped()
    straight = _measured([_as_samples(volts)])
    through = _measured(_through_board(firmware, volts))
    taps = sum(count for _, count in PLAN)
    name = "a pad of an emulated board, tapped"
    rates = ", ".join(f"{rate.tap_hz:.1f} Hz {rate.height[0]:.2f} V" for rate in through.by_rate)
    return [
        row(f"{name}: taps missed or found twice, of {taps}", abs(through.taps - taps), "taps",
            "<=", 0.0, f"found without marks in its scans; by rate: {rates}"),
        _time_row(f"{name}: response, 10 to 90 %", through.response_s[0], straight.response_s[0]),
        _time_row(f"{name}: recovery, 90 to 10 %", through.recovery_s[0], straight.recovery_s[0]),
    ]  # fmt: skip


def _time_row(name: str, through_s: float, straight_s: float) -> Row:
    """Return how far a median time through the board is off, two scans at most."""
    note = f"{1000 * through_s:.1f} ms, {1000 * straight_s:.1f} ms without a board"
    off_ms = 1000 * abs(through_s - straight_s)
    return row(f"{name}, off", off_ms, "ms", "<=", 2.0, note)


def _tapped() -> NDArray[np.float64]:
    """Return what the gauge's taps give on the first four pads, shape (n, 4), volts at 1 kHz."""
    gauge = ForceGauge(TengHandConfig(seed=SEED, rate_hz=RATE_HZ), GaugeConfig())
    parts = [gauge.rest(_SETTLE_S + 3.0)]
    for tap_hz, taps in PLAN:
        parts += [gauge.tap(0, 1.0, tap_hz) for _ in range(taps)]
        parts.append(gauge.rest(PAUSE_S + 0.5))
    return np.concatenate([part.values[:, :4] for part in parts]).astype(np.float64)


def _as_samples(volts: NDArray[np.float64]) -> Samples:
    return Samples.from_values(volts.astype(np.float32), np.arange(len(volts)) / RATE_HZ)


def _through_board(firmware: Firmware, volts: NDArray[np.float64]) -> list[Samples]:
    """Return the host's scans of a board with these voltages on its pins."""
    pins = np.zeros((len(volts), PINS))
    pins[:, CHANNELS] = volts
    setup = BoardSetup(elf=firmware.elf("teng_daq_0"), volts=pins)
    found: list[Samples] = []
    with EmulatedBoards(firmware, [setup]) as boards:
        clock = VirtualClock(boards, readers=True)
        with SerialBoards(str(boards.port(0)), {}, clock) as source:
            read_for(len(volts) / RATE_HZ, source, boards, found.append)
    return [part for part in found if len(part)]


def _measured(parts: list[Samples]) -> Durability:
    meter = TapMeter(RATE_HZ)
    for part in parts:
        values = np.where(part.usable, part.values, np.nan)[:, 0].astype(np.float64)
        ends = (part.validity[:, 0] & np.uint8(Validity.SATURATED)) != 0
        meter.push(values, part.fitted_s, ends)
    return durability_of("pad", meter.taps)
