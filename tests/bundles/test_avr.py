"""The image network in C gives the integer reference's numbers, on this machine and on the chip."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from avr_rig import VOLTS, Trained, needs_board, small_contract
from c_on_host import host_library, needs_gcc, run_on_host
from numpy.typing import NDArray

from taxel.bundles.avr.emit import board_window, write_c
from taxel.bundles.avr.integers import (
    ACC_LIMIT,
    IntegerNetwork,
    Layer,
    layer_bounds,
    quantise_counts,
    run_integers,
)
from taxel.bundles.avr.measure import equal_windows, run_on_board
from taxel.bundles.avr.network import ImageNetwork, run_float
from taxel.bundles.avr.quantise import quantise
from taxel.bundles.avr.write import compare
from taxel.errors import BadBundle
from taxel.windows.config import TENG_WINDOW
from taxel.windows.scaling import Scaling

RNG = np.random.default_rng(0)


def random_network(rows: int, columns: int, classes: int, scale: float) -> ImageNetwork:
    """A network of the thesis's layers with random weights."""

    def pair(*shape: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        weights = RNG.normal(0.0, scale / np.sqrt(np.prod(shape[1:])), shape)
        return weights.astype(np.float32), RNG.normal(0.0, 0.1, shape[0]).astype(np.float32)

    flat = -(-rows // 4) * -(-columns // 4) * 16
    return ImageNetwork(
        rows=rows,
        columns=columns,
        first=pair(8, 3, 3, 1),
        second=pair(16, 3, 3, 8),
        hidden=pair(32, flat),
        last=pair(classes, 32),
    )


def test_the_network_read_from_a_bundle_is_the_bundles(trained: Trained) -> None:
    values, mask = trained.dataset.windows.values[:200], trained.dataset.windows.mask[:200]
    logits = run_float(trained.network, trained.bundle.contract.scaling.apply(values, mask))[-1]
    weights = np.exp(logits - logits.max(axis=1, keepdims=True))

    np.testing.assert_allclose(
        weights / weights.sum(axis=1, keepdims=True),
        trained.bundle.probabilities(values, mask),
        atol=1e-5,
    )


@needs_gcc
def test_c_equals_the_reference_over_a_thousand_windows(trained: Trained) -> None:
    counts = trained.counts[:1000]
    assert len(counts) == 1000

    found = run_on_host(trained.c, counts, 3)

    assert equal_windows(found, trained.reference(counts)).all()


@needs_gcc
@pytest.mark.parametrize(
    ("rows", "columns", "classes", "offset"),
    [(12, 12, 3, 0.0), (12, 4, 5, 0.0), (11, 5, 2, 1.3), (13, 12, 7, 0.4), (1, 1, 2, 0.0)],
)
def test_c_equals_the_reference_for_any_shape_and_scaling(
    trained: Trained, tmp_path: Path, rows: int, columns: int, classes: int, offset: float
) -> None:
    """Sides that pooling rounds up, inputs with a sign, saturated and empty windows."""
    network = random_network(rows, columns, classes, scale=2.0)
    scaling = Scaling(
        kind="standard",
        offset=np.full(columns, offset, np.float32),
        factor=RNG.uniform(0.3, 2.0, columns).astype(np.float32),
    )
    counts = RNG.integers(0, 1024, (60, rows, columns)).astype(np.uint16)
    counts[0], counts[1] = 0, 1023
    # Calibrated on quiet windows alone, so that the rest runs into every limit.
    quiet = VOLTS.volts(counts[2:30] // 3)
    integers = quantise(network, scaling, VOLTS, quiet)
    contract = replace(
        small_contract(trained, replace(TENG_WINDOW, steps=rows, stride=rows), columns),
        classes=tuple(f"c{i}" for i in range(classes)),
    )
    write_c(tmp_path, integers, board_window(contract, VOLTS, 3.3), VOLTS, contract, counts[2])

    found = run_on_host(tmp_path, counts, classes)

    assert integers.signed == (offset > 0)
    wanted = run_integers(integers, quantise_counts(integers, counts))
    assert equal_windows(found, wanted).all()
    assert len(np.unique(wanted.logits, axis=0)) > 1


@needs_board
def test_the_chip_gives_the_same_numbers_in_time_and_space(trained: Trained) -> None:
    """An emulated ATmega2560, compiled as the Arduino IDE does: the issue's limits."""
    counts = trained.counts[:: len(trained.counts) // 5][:5]
    counts[1], counts[2] = 1023, 0

    board = run_on_board(trained.c, counts, 3)

    assert equal_windows(board.answers, trained.reference(counts)).all()
    assert board.milliseconds <= 110.0
    assert board.ram_bytes <= 1536
    assert board.flash_bytes <= 32 * 1024


@needs_board
def test_the_chip_gives_the_same_numbers_in_plain_c(trained: Trained) -> None:
    """Without the few lines of assembly; they are slower and within the limit too."""
    counts = trained.counts[:3]

    board = run_on_board(trained.c, counts, 3, ("-DTAXEL_PLAIN_C",))

    assert equal_windows(board.answers, trained.reference(counts)).all()
    assert board.milliseconds <= 110.0


def test_eight_bits_lose_at_most_a_point_on_a_session_held_out(trained: Trained) -> None:
    windows = trained.dataset.windows[trained.test]
    lost = compare(
        trained.bundle,
        trained.integers,
        VOLTS.counts(windows.values),
        windows.values,
        windows.mask,
        trained.y[trained.test],
    )

    assert lost.float_accuracy > 0.6
    assert 100 * (lost.float_accuracy - lost.integer_accuracy) <= 1.0
    assert lost.confidence_off <= 0.1
    answers = trained.reference(VOLTS.counts(windows.values)).best
    ordered = np.sort(trained.bundle.probabilities(windows.values, windows.mask), axis=1)
    clear = ordered[:, -1] - ordered[:, -2] > 0.1
    best = trained.bundle.probabilities(windows.values, windows.mask).argmax(axis=1)
    assert clear.sum() > 50
    assert (answers == best)[clear].all()


def test_bounds_of_sums_are_reached_and_never_passed() -> None:
    weights = RNG.integers(-127, 128, (4, 30)).astype(np.int8)
    biases = RNG.integers(-5000, 5000, 4).astype(np.int32)
    low, high = layer_bounds(weights, biases, (0, 255))
    worst = np.where(weights > 0, 255, 0).astype(np.int64)
    sums = np.einsum("fi,fi->f", weights.astype(np.int64), worst)

    assert high == (sums + np.maximum(biases, 0)).max()
    assert (
        low == ((weights.astype(np.int64) * 255).sum(axis=1) - sums + np.minimum(biases, 0)).min()
    )


def test_a_network_whose_sums_may_leave_24_bits_is_refused() -> None:
    network = random_network(40, 40, 3, scale=1.0)
    heavy = np.ones_like(network.hidden[0])
    network = replace(network, hidden=(heavy, network.hidden[1]))
    scaling = Scaling(kind="none", offset=np.zeros(40, np.float32), factor=np.ones(40, np.float32))
    values = RNG.random((4, 40, 40)).astype(np.float32)

    with pytest.raises(BadBundle, match="24 bits") as caught:
        quantise(network, scaling, VOLTS, values)
    assert "\n" not in str(caught.value)


def test_the_reference_notices_a_sum_of_more_than_24_bits(trained: Trained) -> None:
    layer = trained.integers.first
    biases = np.full_like(layer.biases, ACC_LIMIT)
    broken: IntegerNetwork = replace(
        trained.integers,
        first=Layer(
            weights=np.abs(layer.weights),
            biases=biases,
            multipliers=layer.multipliers,
            shifts=layer.shifts,
        ),
    )

    with pytest.raises(OverflowError, match="24 bits"):
        run_integers(broken, quantise_counts(broken, trained.counts[:1]))


@needs_gcc
def test_a_build_that_computes_otherwise_finds_itself_out(trained: Trained, tmp_path: Path) -> None:
    for file in trained.c.iterdir():
        (tmp_path / file.name).write_text(file.read_text())
    assert host_library(tmp_path).taxel_self_check() == 1
    path = tmp_path / "taxel_weights.h"
    text = path.read_text()
    first = text.index("last_biases[] PROGMEM = {\n  ") + len("last_biases[] PROGMEM = {\n  ")
    path.write_text(text[:first] + "1 + " + text[first:])

    assert host_library(tmp_path).taxel_self_check() == 0
