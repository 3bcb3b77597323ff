"""The image network on an emulated ATmega2560: time, memory, bits and what eight of them lose.

Networks are the thesis's, trained on the simulated hand as `taxel train` does, with a test part
that neither training nor calibration has seen. Knows nothing about motors or the serial line.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from taxel.bench.boards.emulator import build_firmware, missing_parts
from taxel.bench.boards.sketch import TICK_HZ, OnChip, on_chip, run_sketch
from taxel.bench.rows import Row, missing, row
from taxel.bundles.avr.integers import quantise_counts, run_integers
from taxel.bundles.avr.measure import equal_windows, run_on_board, without_board
from taxel.bundles.avr.write import Lost
from taxel.recordings.reader import list_recordings, read_recording

SCANS = 160_000
"""Scans a class: the thesis's number."""
WINDOWS = 1000
SKETCH_S = 30.0
"""Virtual seconds that the sketch runs."""
_NAMES = ("on-board CNN: slowest of 1,000 windows at 16 MHz", "on-board CNN: RAM with the stack",
          "on-board CNN: flash", "on-board CNN: windows of 1,000 that equal Python's integers",
          "on-board CNN: the same in plain C, slowest of 20 windows")  # fmt: skip
_SKETCH = f"teng_classify, {SKETCH_S:g} s: decisions that differ from Python's, or are missing"


def cnn_rows() -> list[Row]:
    """Train on two splits, quantise, run on the emulated chip and in the sketch."""
    from taxel.evaluation.splits import by_group, random_windows
    from taxel.sources.simulated.data_sets import simulate_presets
    from taxel.windows.config import TENG_WINDOW
    from taxel.windows.dataset import load_dataset

    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        place = Path(scratch)
        simulate_presets(place, ("honest",), SCANS, 0)
        dataset = load_dataset(place / "honest", TENG_WINDOW, target="shape")
        splits = (
            by_group(dataset, "shape", "session", 5, 0, final=True),
            random_windows(dataset, "shape", 5, 0, test=0.1),
        )
        chips, rows = [], []
        for split in splits:
            assert split.final is not None
            train, test = split.final.windows(dataset)
            chip = on_chip(dataset, train, test, place / split.name.split()[0])
            chips.append(chip)
            rows.append(_lost_row(chip.lost, split.name, len(test)))
        return [*_chip_rows(chips[0]), *rows, *_sketch_rows(chips[0], place / "honest", place)]


def _lost_row(lost: Lost, split: str, windows: int) -> Row:
    points = 100.0 * (lost.float_accuracy - lost.integer_accuracy)
    note = (
        f"float {lost.float_accuracy:.4f}, in C {lost.integer_accuracy:.4f} over the same "
        f"{windows} windows; {lost.same_answer:.1%} the same class"
    )
    name = f"on-board CNN, shape, test part of {split}: accuracy lost"
    return row(name, points, "points", "<=", 1.0, note)


def _chip_rows(chip: OnChip) -> list[Row]:
    units, goals = ("ms", "bytes", "bytes", "windows", "ms"), (110, 1536, 32768, WINDOWS, 110)
    if why := without_board():
        sides = ("<=", "<=", "<=", ">=", "<=")
        return [
            missing(name, unit, f"{side} {goal}", why)
            for name, unit, side, goal in zip(_NAMES, units, sides, goals, strict=True)
        ]
    counts, classes = chip.counts[:WINDOWS], len(chip.bundle.contract.classes)
    board = run_on_board(chip.folder, counts, classes)
    wanted = run_integers(chip.integers, quantise_counts(chip.integers, counts))
    plain = run_on_board(chip.folder, counts[:20], classes, ("-DTAXEL_PLAIN_C",))
    same = int(equal_windows(board.answers, wanted).sum())
    clocks = f"{int(board.clocks.min()):,} … {int(board.clocks.max()):,} clocks, emulated"
    program = "a program that only classifies, a window of raw counts included"
    return [
        row(_NAMES[0], board.milliseconds, "ms", "<=", 110.0, clocks),
        row(_NAMES[1], board.ram_bytes, "bytes", "<=", 1536.0, program),
        row(_NAMES[2], board.flash_bytes, "bytes", "<=", 32768.0, program),
        row(_NAMES[3], same, "windows", ">=", len(counts), "on the emulated chip, logits too"),
        row(_NAMES[4], plain.milliseconds, "ms", "<=", 110.0, "without its 8 lines of assembly"),
    ]


def _sketch_rows(chip: OnChip, recordings: Path, place: Path) -> list[Row]:
    if lacking := missing_parts():
        return [missing(_SKETCH, "windows", "<= 0", f"no {', '.join(lacking)}")]
    recording = read_recording(list_recordings(recordings)[0])
    volts = recording.samples.values[: int(SKETCH_S * TICK_HZ)]
    found = run_sketch(build_firmware(), chip, volts, recording.manifest.sensor, place)
    slowest = max((answer.took_us for answer in found.sent), default=0) / 1000
    given = sum(answer.best is not None for answer in found.sent)
    note = (
        f"{len(found.sent)} windows sent, {given} with a class; slowest network {slowest:.1f} ms "
        "with its interrupts; timer, converter, window, network and wire emulated"
    )
    least = row(_SKETCH, found.wrong, "windows", "<=", 0.0, note)
    return [least if found.wanted else missing(_SKETCH, "windows", "<= 0", "no window")]
