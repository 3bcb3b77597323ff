"""Write the C of a network in integers: sizes, numbers in flash, and the run-time beside them.

Knows nothing about how the numbers were found or how C is compiled.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import floor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.avr.c_text import c_number, c_numbers, c_origin, c_strings
from taxel.bundles.avr.integers import (
    CERTAIN,
    EXP_TABLE,
    IntegerNetwork,
    Layer,
    quantise_counts,
    run_integers,
)
from taxel.bundles.avr.quantise import ADC_BITS, Converter
from taxel.bundles.contract import Contract
from taxel.decisions.recognition import RecogniseConfig
from taxel.errors import BadBundle
from taxel.recordings.whole import write_whole

_RUNTIME = Path(__file__).with_name("runtime")
RUNTIME = ("taxel_cnn.h", "taxel_cnn.c", "taxel_window.h", "taxel_window.c")
"""Files that are the same for every network."""
_MOST_IN_A_ROW = 255 * 8
"""The C loops count eights in one byte."""
_TIME_SLACK = 1e-6
"""Ticks: a gap of a whole number of them must not be rounded down to one less."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardWindow:
    """What `taxel_window.c` must know, in converter counts and ticks."""

    stride: int
    tick_hz: int
    gate_counts: int
    """A row counts where a channel lies above; −1 takes all rows."""
    end_counts: int
    """From here on a value stands at the converter's end."""
    gap_ticks: int
    """Rows further apart never share a window."""
    least_confidence: int
    """Below this, of 255, the answer is not given."""


def board_window(contract: Contract, converter: Converter, full_scale: float | None) -> BoardWindow:
    """Return a bundle's window as a board cuts it.

    Args:
        contract: The bundle's.
        converter: The board's.
        full_scale: The sensor's largest value, volts; None where unknown.

    Raises:
        BadBundle: The window needs what `taxel_window.c` cannot do.
    """
    window = contract.window
    for wrong, got in (
        (window.layout != "B", "layout A"),
        (window.pad, "padded windows"),
        (window.tare, "windows tared by their first row"),
        (window.wavelet is not None or window.segment is not None, "windows that are denoised"),
        (window.gate_follow_s is not None, "a gate that follows rest and noise"),
        (window.level_follow is not None, "levels that follow"),
        (window.subtract is not None, "windows less an untouched channel"),
        (set(contract.units) != {"V"}, f"units {', '.join(sorted(set(contract.units)))}"),
    ):
        if wrong:
            raise BadBundle("whole windows of 12 scans or so, in volts", got,
                            "train with another window")  # fmt: skip
    tick_hz = window.grid_hz or contract.rate_hz
    if tick_hz != round(tick_hz) or 1_000_000 % round(tick_hz) or not 31 <= tick_hz <= 500:
        raise BadBundle(
            "31 to 500 rows/s, a whole number that divides 1,000,000", f"{tick_hz:g}",
            "train with --window grid=100",
        )  # fmt: skip
    top = 2**ADC_BITS - 1
    end = top if full_scale is None else int(converter.counts(np.full(1, full_scale))[0])
    gate = -1 if window.gate is None else converter.last_below(window.gate)
    return BoardWindow(
        stride=window.stride,
        tick_hz=round(tick_hz),
        gate_counts=gate,
        end_counts=end,
        gap_ticks=floor(window.max_gap_s * tick_hz + _TIME_SLACK),
        least_confidence=round(RecogniseConfig().least_confidence * CERTAIN + 0.5),
    )


def left_out(contract: Contract) -> str:
    """Return what the bundle does but the board's C leaves out; empty for nothing."""
    lacking = []
    if contract.reference is not None:
        lacking.append(
            "scaling by each session's reference touches, with which accuracy is measured; the "
            "board keeps the level of this bundle"
        )
    if contract.unknown is not None:
        lacking.append(
            "the bundle's test for novel touch; on the board only a low confidence gives UNKNOWN"
        )
    return "; and ".join(lacking)


def write_c(
    folder: Path,
    network: IntegerNetwork,
    window: BoardWindow,
    converter: Converter,
    contract: Contract,
    check: NDArray[np.uint16],
) -> list[Path]:
    """Write `taxel_model.h`, `taxel_weights.h` and the run-time; return the files.

    Args:
        folder: Made where it does not exist; files of these names are replaced, each whole or not
            at all.
        network: In integers.
        window: As the board cuts it.
        converter: The board's.
        contract: What the bundle says of itself.
        check: A window of counts, shape (rows, columns), whose answer the board checks at boot.

    Raises:
        BadBundle: The network is too large for the loops.
        RecordingFailed: The disk refused.
    """
    flat = network.hidden.weights.shape[1]
    if flat > _MOST_IN_A_ROW or max(network.rows, network.columns) > 128:
        raise BadBundle(
            f"at most {_MOST_IN_A_ROW} values before the hidden layer and sides of at most 128",
            f"{flat} and {network.rows}×{network.columns}", "train on smaller windows",
        )  # fmt: skip
    texts = {
        "taxel_model.h": _model(network, window, converter, contract),
        "taxel_weights.h": _weights(network, check),
        **{name: (_RUNTIME / name).read_text("utf-8") for name in RUNTIME},
    }
    for name, text in texts.items():
        write_whole(folder / name, text)
    return [folder / name for name in texts]


def _model(
    network: IntegerNetwork, window: BoardWindow, converter: Converter, contract: Contract
) -> str:
    """Return sizes, window and names: what a sketch may include anywhere."""
    low, high = network.input_ends
    byte, word, long = 2**8 - 1, 2**16 - 1, 2**32 - 1
    sizes = {
        "TAXEL_ROWS": c_number(network.rows, 1, 128),
        "TAXEL_COLUMNS": c_number(network.columns, 1, 128),
        "TAXEL_FILTERS_1": c_number(len(network.first.biases), 1, word),
        "TAXEL_FILTERS_2": c_number(len(network.second.biases), 1, word),
        "TAXEL_HIDDEN": c_number(len(network.hidden.biases), 1, word),
        "TAXEL_CLASSES": c_number(len(network.last_biases), 1, byte),
        "TAXEL_SIGNED_INPUT": c_number(int(network.signed), 0, 1),
        "TAXEL_INPUT_LEAST": c_number(low, -word, word),
        "TAXEL_INPUT_LARGEST": c_number(high, -word, word),
        "TAXEL_EXP_SHIFT": c_number(network.exp_shift, -byte, byte),
        "TAXEL_EXP_MULTIPLIER": c_number(network.exp_multiplier, 0, long, "U"),
        "TAXEL_STRIDE": c_number(window.stride, 1, word),
        "TAXEL_TICK_HZ": c_number(window.tick_hz, 1, word),
        "TAXEL_GATE_COUNTS": c_number(window.gate_counts, -1, word),
        "TAXEL_END_COUNTS": c_number(window.end_counts, 0, word, "U"),
        "TAXEL_GAP_TICKS": c_number(window.gap_ticks, 0, long, "UL"),
        "TAXEL_LEAST_CONFIDENCE": c_number(window.least_confidence, 0, word),
        "TAXEL_MODEL_REFERENCE_MV": c_number(converter.reference_mv, 1, word, "U"),
    }
    lines = [f"#define {name} {value}" for name, value in sizes.items()]
    classes = c_strings(contract.classes, "classes")
    channels = c_strings(contract.channels, "channels")
    lacking = f"/* Left out: {left_out(contract)}. */\n" if left_out(contract) else ""
    return (
        f"{_head(contract)}"
        f"{lacking}"
        "#ifndef TAXEL_MODEL_H\n#define TAXEL_MODEL_H\n\n" + "\n".join(lines) + "\n\n"
        f"/* What it predicts, and its classes in the order of their numbers. */\n"
        f"#define TAXEL_TARGET {c_strings([contract.target], 'a target')}\n"
        f"#define TAXEL_CLASS_NAMES {classes}\n"
        f"/* The window's columns, in order. */\n"
        f"#define TAXEL_CHANNEL_NAMES {channels}\n\n#endif\n"
    )


def _weights(network: IntegerNetwork, check: NDArray[np.uint16]) -> str:
    """Return the numbers, which only `taxel_cnn.c` includes."""
    parts = ["/* Written by taxel bundle --board mega; included by taxel_cnn.c alone. */\n"]
    for name, layer in (("first", network.first), ("second", network.second),
                        ("hidden", network.hidden)):  # fmt: skip
        parts.append(_array("int8_t", f"{name}_weights", layer.weights))
        parts.append(_filters(name, layer))
    parts.append(_array("int8_t", "last_weights", network.last_weights))
    parts.append(_array("int32_t", "last_biases", network.last_biases))
    parts.append(_array("int32_t", "input_factor", network.input_factor))
    parts.append(_array("int32_t", "input_offset", network.input_offset))
    image = quantise_counts(network, check[None])
    answer = run_integers(network, image)
    parts.append(_array("taxel_input", "check_image", image))
    parts.append(_array("int32_t", "check_logits", answer.logits))
    confidence = c_number(answer.confidence[0], 0, CERTAIN)
    parts.append(f"#define TAXEL_CHECK_CONFIDENCE {confidence}\n")
    exps = ", ".join(c_number(step, 0, 2**16, "U") for step in EXP_TABLE)
    parts.append(f"#define TAXEL_EXPS {exps}\n")
    return "\n".join(parts)


def _filters(name: str, layer: Layer) -> str:
    parts = (c_numbers(part) for part in (layer.biases, layer.multipliers, layer.shifts))
    rows = zip(*parts, strict=True)
    body = "".join(f"  {{{bias}, {multiplier}U, {shift}}},\n" for bias, multiplier, shift in rows)
    return f"static const filter {name}_filters[] PROGMEM = {{\n{body}}};\n"


def _array(kind: str, name: str, values: NDArray[Any]) -> str:
    flat = c_numbers(values)
    body = "".join(f"  {', '.join(flat[i : i + 18])},\n" for i in range(0, len(flat), 18))
    return f"static const {kind} {name}[] PROGMEM = {{\n{body}}};\n"


def _head(contract: Contract) -> str:
    return (
        "/* Written by taxel bundle --board mega: change the bundle, not this file.\n"
        f" * Trained on {c_origin(contract.data_digest, contract.software)}. */\n"
    )
