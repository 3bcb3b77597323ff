"""`taxel bundle … --board mega`: a bundle as C for the board, and what that costs.

Knows nothing about screens.
"""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.avr.emit import board_window, left_out, write_c
from taxel.bundles.avr.integers import (
    CERTAIN,
    IntegerNetwork,
    network_bounds,
    quantise_counts,
    run_integers,
)
from taxel.bundles.avr.measure import equal_windows, run_on_board, without_board
from taxel.bundles.avr.network import ImageNetwork, read_network
from taxel.bundles.avr.quantise import Converter, quantise
from taxel.bundles.contract import fingerprint_of
from taxel.bundles.envelope import unpack
from taxel.bundles.reader import Bundle, read_bundle
from taxel.bundles.recordings import load_at_level
from taxel.errors import BadBundle, BadInput
from taxel.plain_text import number_of
from taxel.recordings.whole import write_whole
from taxel.signals import SensorInfo
from taxel.windows.dataset import Dataset

_EMULATED = 8
"""Windows that the report runs on the emulated board."""
REPORT = "avr_report.json"
_WAITING = 7
"""The scan that is complete so many rows after a window's last is lost if the window is not yet
classified. Source: WAITING in firmware/teng_classify/classify_board.c, one of which is classified.
"""
_BESIDE = 1.05
"""A window takes so much longer beside the interrupts that read the sensors. Our choice,
docs/decisions/0021.
"""
_LARGEST_MV = 10_000
"""No converter of a board compares with more, millivolts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AvrReport:
    """What a network in C costs, and what it lost."""

    folder: str
    files: tuple[str, ...]
    parameters: int
    products: int
    """Multiplications a window."""
    sums: dict[str, tuple[int, int]]
    """Layer → least and largest sum that can occur; 24 bits hold ±8,388,607."""
    reference_mv: int
    accuracy_on: str
    """On which windows the accuracies below were measured."""
    windows: int
    float_accuracy: float
    """The bundle's, 0…1."""
    integer_accuracy: float
    """The C's, 0…1, by its integer reference."""
    same_answer: float
    """Share of windows that both classify alike, 0…1."""
    confidence_off: float
    """Largest difference of the confidence, 0…1."""
    flash_bytes: int | None
    """Of a program that only classifies; None where no board can be emulated."""
    ram_bytes: int | None
    """Variables and deepest stack of that program."""
    clocks: int | None
    """Of the slowest of the emulated windows."""
    milliseconds: float | None
    """The same at 16 MHz."""
    bit_exact: bool | None
    """Whether the emulated board gave the reference's numbers."""
    row_hz: int
    """Rows a second."""
    stride: int
    """Rows from one window to the next."""
    unmeasured: str
    """Why flash_bytes to bit_exact are None; empty where they are not."""
    left_out: str
    """What the bundle does and the board does not; empty where there is no such thing."""

    @property
    def points_lost(self) -> float:
        """Accuracy lost against floating point, percentage points; below 0 where it gained."""
        return 100.0 * (self.float_accuracy - self.integer_accuracy)

    @property
    def allowed_ms(self) -> float:
        """How long a window may take on the board alone before it loses scans, milliseconds."""
        return 1000.0 * min(self.stride, _WAITING) / self.row_hz / _BESIDE

    def lines(self) -> list[str]:
        """Return the report for a person."""
        most = max(max(-low, high) for low, high in self.sums.values())
        found = [
            f"{self.folder}: {', '.join(self.files)}",
            f"{self.parameters:,} parameters, {self.products:,} products a window; sums stay "
            f"within ±{most:,} of ±8,388,607; reference {self.reference_mv} mV",
            f"accuracy on {self.accuracy_on}, {number_of(self.windows, 'window', ',')}: float "
            f"{self.float_accuracy:.4f}, on the board {self.integer_accuracy:.4f} "
            f"({self.points_lost:+.2f} points lost); {self.same_answer:.2%} the same class",
        ]
        if self.left_out:
            found.append(f"left out: {self.left_out}")
        if self.milliseconds is None:
            return [*found, f"flash, RAM and clocks unknown ({self.unmeasured})"]
        found.append(
            f"emulated ATmega2560: {self.milliseconds:.1f} ms a window at 16 MHz "
            f"({self.clocks:,} clocks), {self.ram_bytes:,} bytes of RAM with the stack, "
            f"{self.flash_bytes:,} of flash; "
            + ("answers as the reference's, bit for bit" if self.bit_exact else "ANSWERS DIFFER")
        )
        if self.milliseconds > self.allowed_ms:
            found.append(
                f"warning: too slow for {self.row_hz} rows/s with a stride of {self.stride}: a "
                f"window may take {self.allowed_ms:.0f} ms, then the board loses scans, and the "
                "windows that they belong to; train with "
                + ("a longer stride, " if self.stride < _WAITING else "")
                + "fewer rows or a lower grid"
            )
        return found


def write_avr(
    bundle: Path,
    output: Path,
    calibration: Path,
    *,
    test: Path | None = None,
    reference_mv: int | None = None,
) -> AvrReport:
    """Write a bundle's network as C for the ATmega2560, and return what it costs.

    Args:
        bundle: A bundle of one network of the model cnn2d.
        output: Folder for the C, such as a copy of `firmware/teng_classify`.
        calibration: Recordings that the network was trained on: scales are measured on them.
        test: Recordings to measure accuracy on; the calibration's unless given, which the
            report then says.
        reference_mv: Voltage of 1024 counts of the board's converter, millivolts; as the
            recordings say unless given.

    Raises:
        BadBundle: The network, window or scaling does not fit the board.
        BadDataset: The recordings hold no such windows or labels.
        BadInput: The converter's reference is not known, or the C does not compile.
        MissingExtra: The package onnx is not installed.
        RecordingFailed: The disk refused.
    """
    opened = read_bundle(bundle)
    contract = opened.contract
    rows, columns = contract.window.steps, len(contract.channels)
    network = read_network(model_of(bundle), rows, columns)
    dataset = load_at_level(calibration, contract)
    converter = Converter(reference_mv=reference_mv or reference_of(dataset.sensor))
    window = board_window(contract, converter, dataset.sensor.full_scale)
    integers = quantise(network, contract.scaling, converter, dataset.windows.values)
    check = converter.counts(dataset.windows.values[_clearest(dataset)])
    files = write_c(output, integers, window, converter, contract, check)
    tested = load_at_level(test or calibration, contract, target=contract.target)
    report = _report(opened, network, integers, converter, tested, files)
    content = asdict(report) | {"points_lost": report.points_lost}
    write_whole(output / REPORT, json.dumps(content, indent=1) + "\n")
    return report


def model_of(bundle: Path) -> bytes:
    """Return the ONNX model of a bundle that `read_bundle` has found whole."""
    return unpack(bundle, ("model.onnx",))["model.onnx"]


def reference_of(sensor: SensorInfo) -> int:
    """Return the converter's reference that recordings speak of, millivolts.

    Raises:
        BadInput: They do not say it, or boards differ.
    """
    levels_mv = {round(1000 * _volts(sensor.details["reference_v"]))} \
        if "reference_v" in sensor.details else {
            int(level) for text in sensor.details.values()
            for level in re.findall(r"reference (\d{1,6}) mV", text)
        }  # fmt: skip
    if len(levels_mv) != 1 or not 1 <= min(levels_mv) <= _LARGEST_MV:
        raise BadInput(
            "one voltage of the board's converter",
            " and ".join(f"{level} mV" for level in sorted(levels_mv))
            or "recordings that do not say it",
            "say --reference-mv 5000, or 3300 with 3.3 V on the pin AREF",
        )
    return levels_mv.pop()


def _volts(text: str) -> float:
    """Return the volts that a text names; 0 where it names none."""
    try:
        volts = float(text)
    except ValueError:
        return 0.0
    return volts if 0 < volts < _LARGEST_MV / 1000 else 0.0


def _clearest(known: Dataset) -> int:
    """Return the window with the largest values: the one that a board checks itself with."""
    return int(known.windows.values.sum(axis=(1, 2)).argmax())


def _report(
    bundle: Bundle,
    network: ImageNetwork,
    integers: IntegerNetwork,
    converter: Converter,
    tested: Dataset,
    files: list[Path],
) -> AvrReport:
    contract = bundle.contract
    if set(tested.classes(contract.target)) - set(contract.classes):
        raise BadBundle(
            f"recordings of {', '.join(contract.classes)}",
            ", ".join(tested.classes(contract.target)), "choose others for the test",
        )  # fmt: skip
    names = np.array([contract.classes.index(class_) for class_ in tested.classes(contract.target)])
    truth = names[tested.class_numbers(contract.target)]
    fingerprints = [fingerprint_of(digest) for digest in tested.fingerprints.values()]
    seen = sum(name in contract.learned for name in fingerprints)
    if tested.digest == contract.data_digest or seen == len(fingerprints):
        where = "the recordings that it was trained on (nothing held out)"
    elif seen:
        where = f"recordings of which it was trained on {seen} of {len(fingerprints)}"
    else:
        where = "recordings other than its training set"
    counts = converter.counts(tested.windows.values)
    lost = compare(bundle, integers, counts, tested.windows.values, tested.windows.mask, truth)
    missing = without_board()
    folder = files[0].parent
    board = None if missing else run_on_board(folder, counts[:_EMULATED], len(contract.classes))
    emulated = run_integers(integers, quantise_counts(integers, counts[:_EMULATED]))
    return AvrReport(
        folder=str(folder),
        files=tuple(file.name for file in files),
        parameters=integers.parameters,
        products=network.products,
        sums=network_bounds(integers),
        reference_mv=converter.reference_mv,
        accuracy_on=where,
        windows=len(truth),
        float_accuracy=lost.float_accuracy,
        integer_accuracy=lost.integer_accuracy,
        same_answer=lost.same_answer,
        confidence_off=lost.confidence_off,
        flash_bytes=board.flash_bytes if board else None,
        ram_bytes=board.ram_bytes if board else None,
        clocks=int(board.clocks.max()) if board else None,
        milliseconds=board.milliseconds if board else None,
        bit_exact=bool(equal_windows(board.answers, emulated).all()) if board else None,
        row_hz=round(contract.window.grid_hz or contract.rate_hz),
        stride=contract.window.stride,
        unmeasured=missing,
        left_out=left_out(contract),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Lost:
    """A network in floating point beside the same in integers, on the same windows."""

    float_accuracy: float
    integer_accuracy: float
    same_answer: float
    confidence_off: float


def compare(
    bundle: Bundle,
    integers: IntegerNetwork,
    counts: NDArray[np.uint16],
    values: NDArray[np.float32],
    mask: NDArray[np.bool_],
    truth: NDArray[np.intp],
) -> Lost:
    """Return what integers lose against floating point.

    Args:
        bundle: In floating point.
        integers: The same network.
        counts: Windows as the converter gives them, shape (n, rows, columns).
        values: The same in volts, as recorded.
        mask: Shape (n, rows).
        truth: Shape (n,): class numbers.
    """
    probabilities = bundle.probabilities(values, mask)
    answers = run_integers(integers, quantise_counts(integers, counts))
    best = probabilities.argmax(axis=1)
    off = np.abs(answers.confidence / CERTAIN - probabilities.max(axis=1))
    return Lost(
        float_accuracy=float((best == truth).mean()),
        integer_accuracy=float((answers.best == truth).mean()),
        same_answer=float((answers.best == best).mean()),
        confidence_off=float(off.max()),
    )
