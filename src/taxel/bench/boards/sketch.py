"""A network on the emulated chip and in the sketch that classifies, beside Python's own answers.

Everything between pins and wire is emulated: timer, converter, window, network, frames. Works in a
checkout only. Knows nothing about rows and goals.
"""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.bench.boards.emulator import FOLDER, PINS, BoardSetup, EmulatedBoards, Firmware
from taxel.bundles.avr.decisions import BoardDecision, Doubt, unpack_decision
from taxel.bundles.avr.emit import board_window, write_c
from taxel.bundles.avr.integers import IntegerNetwork, quantise_counts, run_integers
from taxel.bundles.avr.network import read_network
from taxel.bundles.avr.quantise import Converter, quantise
from taxel.bundles.avr.write import Lost, compare, model_of, reference_of
from taxel.bundles.reader import Bundle, read_bundle
from taxel.errors import BadInput
from taxel.signals import Samples, SensorInfo
from taxel.windows.dataset import Dataset
from taxel.windows.windower import cut_windows
from taxel.wire.framing import FrameDecoder

TICK_HZ = 100
"""Rows a second of the thesis's window. Source: docs/decisions/0003."""
_GROUND_PIN = 15
"""As in `firmware/teng_classify/settings.h`."""


@dataclass(frozen=True, slots=True)
class OnChip:
    """A network in floating point and in integers, and its C."""

    bundle: Bundle
    integers: IntegerNetwork
    converter: Converter
    folder: Path
    """With the C."""
    lost: Lost
    """On the windows held out."""
    counts: NDArray[np.uint16]
    """Shape (n, 12, 12): the windows held out, as the converter gives them."""


@dataclass(frozen=True, slots=True)
class Sketch:
    """What the sketch sent, beside what it should have sent."""

    sent: list[BoardDecision]
    wanted: list[tuple[int, int | None, int, int]]
    """Tick of the last row, class or None, confidence, reason."""
    payloads: list[bytes]
    """All messages that it sent."""

    @property
    def wrong(self) -> int:
        """Decisions that differ, are missing or are too many."""
        keys = [(answer.seq, answer.best, answer.confidence, answer.reason) for answer in self.sent]
        return len(set(keys) ^ set(self.wanted)) + len(keys) - len(set(keys))


def on_chip(
    dataset: Dataset, train: NDArray[np.intp], test: NDArray[np.intp], place: Path
) -> OnChip:
    """Train a network, write its C, and compare both on windows held out.

    Args:
        dataset: Windows of the TENG hand with the label "shape".
        train: Windows to train and to calibrate on.
        test: Windows held out.
        place: A folder that may be made.
    """
    from taxel.bundles.writer import write_bundle
    from taxel.training.fitting import Job, TrainingSet, fit_model
    from taxel.training.run import contract_of

    y, windows = dataset.class_numbers("shape"), dataset.windows
    fitted = fit_model(TrainingSet.of(dataset, "shape", train), Job(model="cnn2d", target="shape"))
    contract = contract_of(dataset, "shape", "cnn2d", fitted.networks, fitted.scaling, {})
    path = place / "shape.taxel"
    write_bundle(path, fitted.networks, contract, windows.values[:500], windows.mask[:500])
    bundle = read_bundle(path)
    converter = Converter(reference_mv=reference_of(dataset.sensor))
    network = read_network(model_of(path), *windows.values.shape[1:])
    integers = quantise(network, fitted.scaling, converter, windows.values[train])
    counts = converter.counts(windows.values[test])
    window = board_window(contract, converter, dataset.sensor.full_scale)
    write_c(place / "c", integers, window, converter, contract, counts[0])
    held = windows[test]
    lost = compare(bundle, integers, counts, held.values, held.mask, y[test])
    return OnChip(bundle, integers, converter, place / "c", lost, counts)


def run_sketch(
    firmware: Firmware,
    chip: OnChip,
    volts: NDArray[np.float32],
    sensor: SensorInfo,
    place: Path,
) -> Sketch:
    """Run `teng_classify` on an emulated board, and Python on the very counts it converted.

    Args:
        firmware: As built; its emulator is used.
        chip: The network.
        volts: Shape (n, 12), 100 rows a second.
        sensor: The array that they come from.
        place: A folder for the sketch's program.
    """
    elf = build_sketch(chip.folder, place / "sketch.elf")
    pins = np.zeros((len(volts), PINS))
    pins[:, : volts.shape[1]] = volts
    with EmulatedBoards(firmware, [BoardSetup(elf=elf, volts=pins, volts_hz=TICK_HZ)]) as boards:
        boards.run(len(volts) / TICK_HZ)
        conversions, sent_bytes = boards.conversions(0), boards.bytes_sent(0)
    payloads = FrameDecoder().feed(sent_bytes)
    sent = [answer for answer in map(unpack_decision, payloads) if answer is not None]
    kept = conversions["count"][conversions["pin"] != _GROUND_PIN]
    columns = volts.shape[1]
    scans = kept[: len(kept) // columns * columns].reshape(-1, columns)
    # What ended with the last rows may still have been on its way.
    until = max(len(scans) - columns, sent[-1].seq + 1 if sent else 0)
    return Sketch(
        sent, [answer for answer in _wanted(chip, scans, sensor) if answer[0] < until], payloads
    )


def build_sketch(network: Path, elf: Path, options: tuple[str, ...] = ()) -> Path:
    """Compile `teng_classify` with a network's C; return the program.

    Args:
        network: Folder with the C.
        elf: The program to write.
        options: More of the compiler's, such as ("-DTAXEL_CHANNELS=1,4,7,10",).

    Raises:
        BadInput: It does not compile.
    """
    sketch, wire = FOLDER / "teng_classify", FOLDER / "libraries" / "TaxelWire" / "src"
    sources = [
        *(sketch / name for name in ("classify_board.c", "decision.c", "emulate/sketch_main.c")),
        *(network / name for name in ("taxel_cnn.c", "taxel_window.c")),
        *sorted(wire.glob("*.c")),
    ]
    command = [
        "avr-gcc", "-mmcu=atmega2560", "-DF_CPU=16000000L", "-Os", "-std=gnu11", "-Wall", "-Wextra",
        "-Werror", *options, f"-I{network}", f"-I{wire}", f"-I{sketch}", "-o", str(elf),
        *map(str, sources),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise BadInput("a sketch that compiles", done.stderr.strip()[-300:], "mend the sketch")
    return elf


def _wanted(
    chip: OnChip, scans: NDArray[np.uint16], sensor: SensorInfo
) -> list[tuple[int, int | None, int, int]]:
    """Return Python's answers to the same scans, by its own windows."""
    n = len(scans)
    time_s = np.arange(n) / TICK_HZ
    volts = chip.converter.volts(scans)
    samples = Samples(
        values=volts,
        counter=np.arange(n),
        device_s=time_s,
        arrival_s=time_s,
        fitted_s=time_s,
        validity=np.zeros(volts.shape, np.uint8),
    )
    windows = cut_windows(samples, chip.bundle.contract.window, sensor)
    counts = chip.converter.counts(windows.values)
    answers = run_integers(chip.integers, quantise_counts(chip.integers, counts))
    end = counts >= chip.converter.counts(np.full(1, sensor.full_scale or 9.0))[0]
    decisions: list[tuple[int, int | None, int, int]] = []
    for number in range(len(windows)):
        confidence = int(answers.confidence[number])
        reason = Doubt.NOT_SURE if confidence < 128 else Doubt.NONE
        if end[number].all(axis=0).any():
            reason = Doubt.SATURATED
        best = None if reason else int(answers.best[number])
        tick = round(float(windows.end_s[number]) * TICK_HZ)
        decisions.append((tick, best, confidence, int(reason)))
    return decisions
