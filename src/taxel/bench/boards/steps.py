"""`taxel bench boards`: the hand's firmware on emulated boards, from the converter to the file.

The programs are those that a lab flashes; boards, converters, current sensors and serial lines
are emulated in virtual time (`firmware/emulator`), so that no figure depends on how busy this
machine is. A minute of three boards takes some minutes here: it is measured by `--full`.

Background of our choices: docs/decisions/0020.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from taxel.bench.boards.cnn import cnn_rows
from taxel.bench.boards.collect import collect_rows
from taxel.bench.boards.emulator import Firmware, build_firmware
from taxel.bench.boards.hand import Drill, drill
from taxel.bench.boards.sensors import (
    ChainResult,
    WideResult,
    naive_rate_hz,
    run_chain,
    run_damage,
    run_wide,
)
from taxel.bench.boards.taps import tap_rows
from taxel.bench.rows import Row, row

PPM = (0.0, 40.0, -25.0)
"""How wrong the resonators of the three boards are, parts per million. Our choice: crystals."""
_QUICK_S = 5.0
_FULL_S = 60.0
_WIDE_S = 2.0
_FAULTS = 200_000
_TIMES = 10
_WIDE = {
    "teng_daq_16": (500, "125 kHz: within the 200 kHz up to which the datasheet promises ten bits; "
                    "500,000 baud"),
    "teng_daq_16_64": (1000, "250 kHz: a quarter above that; 1,000,000 baud"),
    "teng_daq_16_32": (1250, "500 kHz: 2.5 times that, on the way to the 1 MHz at which it ends; "
                       "1,000,000 baud; here the processor is the limit"),
}  # fmt: skip
_DRILLS: dict[str, tuple[str, float]] = {
    "contact": ("contact to that motor off", 10.0),
    "silence": ("host's last heartbeat to motors off", 100.0),
    "silent": ("current sensors do not answer: motors off", 10.0),
    "hangs": ("I2C clock held low: motors off", 10.0),
    "low": ("I2C data held low, which reads as no current: motors off", 10.0),
    "power": ("current sensors lose their setting: motors off", 10.0),
    "over-current": ("over-current to motors off", 10.0),
    "stop": ("order to stop to motors off", 10.0),
    "hang 0": ("program hangs: motors off", 100.0),
    "hang 1": ("program hangs with interrupts off: motors off", 100.0),
}
"""Drill → its words and its limit, milliseconds. Source: issue of the hand's firmware."""
Measure = Callable[[], list[Row]]


def quick_steps() -> list[tuple[str, Measure]]:
    """Return the measurements of a normal run.

    Raises:
        BadInput: The firmware's sources or the emulator's packages are missing; says what to
            install.
    """
    firmware = build_firmware()
    return [
        ("three boards for five seconds", lambda: chain_rows(firmware, _QUICK_S)),
        ("sixteen channels on one board", lambda: wide_rows(firmware)),
        ("a pad that is tapped", lambda: tap_rows(firmware)),
        ("the hand's motors", lambda: hand_rows(firmware)),
        ("the image network on the board", cnn_rows),
    ]


def full_steps(_: Path | None) -> list[tuple[str, Measure]]:
    """Return the minute of three boards, and the plan of sixty grasps.

    Raises:
        BadInput: As `quick_steps`.
    """
    firmware = build_firmware()
    return [
        ("three boards for a minute", lambda: chain_rows(firmware, _FULL_S)),
        ("sixty grasps collected", lambda: collect_rows(firmware)),
    ]


def data_digest(_: Path | None) -> str:
    """Return the digest of recordings used: none are."""
    return "none"


def chain_rows(firmware: Firmware, seconds: float) -> list[Row]:
    """Run three boards to the recording, then damage what they sent."""
    chain = run_chain(firmware, seconds, PPM)
    name = f"3 boards x 4 channels x 1 kHz, {seconds:g} s"
    lost = sum(board["lost"] + board["late"] + board["dropped"] for board in chain.boards)
    bad = sum(sum(board["bad"].values()) for board in chain.boards)
    moved = sum(board["repeated"] + board["skipped"] for board in chain.boards)
    rows = [
        row(f"{name}: frames lost", lost + bad, "frames", "<=", 0.0,
            f"{chain.frames} frames of {chain.scans} scans; firmware, UART, port, serial://"),
        row(f"{name}: converter values in frames that differ from the waveform",
            chain.wrong_values, "values", "<=", 0.0, f"{chain.frame_values} values"),
        row(f"{name}: rows of the recording that are no scan, bit for bit", chain.wrong_rows,
            "rows", "<=", 0.0, f"{chain.rows} rows; {moved} scans left out or repeated to keep "
            f"boards in step whose resonators differ by {PPM[1]:g} and {PPM[2]:g} ppm"),
        row(f"{name}: values missing in the recording", chain.missing, "values", "<=", 0.0),
        _clock_row(name, chain),
    ]  # fmt: skip
    damage = run_damage(chain.sent, _FAULTS)
    faults = f"{damage.faults} single faults: a bit flipped, a byte dropped, a byte put in"
    return [
        *rows,
        row(f"{name}, damaged: most frames lost by one fault", damage.most_lost, "frames", "<=",
            1.0, f"{faults}; {damage.lost} frames lost"),
        row(f"{name}, damaged: frames accepted that were never sent", damage.invented, "frames",
            "<=", damage.faults * 2.0**-16, faults),
    ]  # fmt: skip


def _clock_row(name: str, done: ChainResult) -> Row:
    """Return how well the clocks' fit finds the boards' resonators."""
    # A board that is fast has a clock of which less host time passes a second.
    off = [
        abs(board["clock_ppm"] + ppm) for board, ppm in zip(done.boards, PPM, strict=True)
    ]  # fmt: skip
    each = ", ".join(f"{board['clock_ppm']:.1f}" for board in done.boards)
    return Row(
        name=f"{name}: resonator error that the clock fit finds, off by at most",
        value=max(off),
        unit="ppm",
        note=f"found {each} for 0, {-PPM[1]:g} and {-PPM[2]:g}; looks 3 to 7 ms apart",
    )


def wide_rows(firmware: Firmware) -> list[Row]:
    """Scan 16 channels at three clocks of the converter, and by the usual sketch."""
    naive = naive_rate_hz(firmware, _WIDE_S)
    rows = []
    for name, (rate_hz, note) in _WIDE.items():
        found: WideResult = run_wide(firmware, name, _WIDE_S)
        wide = f"16 channels at {rate_hz} Hz"
        rows += [
            row(f"{wide}: scans a second", found.rate_hz, "Hz", ">=", rate_hz - 0.01,
                f"{found.rate_hz / naive:.1f} times the usual sketch; a scan takes "
                f"{found.scan_us:.0f} us; converter at {note}"),
            row(f"{wide}: scans lost, or values that differ", found.lost + found.wrong_values,
                "scans and values", "<=", 0.0),
        ]  # fmt: skip
    rows.append(
        Row(name="16 channels by the usual sketch: analogRead and print at 115,200 baud",
            value=naive, unit="Hz", note="naive_print; no time, no check")
    )  # fmt: skip
    return rows


def hand_rows(firmware: Firmware) -> list[Row]:
    """Bring trouble to a hand that closes; see how soon its motors are off."""
    rows = []
    for name, (words, limit_ms) in _DRILLS.items():
        found: Drill = drill(firmware, name, _TIMES)
        middle = sorted(found.off_ms)[len(found.off_ms) // 2]
        rows.append(
            row(f"hand: {words}", found.worst_ms, "ms", "<=", limit_ms,
                f"worst of {_TIMES}, median {middle:.1f}; afterwards {found.state.name}")
        )  # fmt: skip
    return rows
