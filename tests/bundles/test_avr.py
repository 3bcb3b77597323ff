"""The image network in C gives the integer reference's numbers, on this machine and on the chip."""

import ctypes
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
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
from taxel.bundles.avr.measure import (
    equal_windows,
    host_library,
    run_on_board,
    run_on_host,
    without_board,
    without_host,
)
from taxel.bundles.avr.network import ImageNetwork, read_network, run_float
from taxel.bundles.avr.quantise import Converter, quantise
from taxel.bundles.avr.write import compare, model_of, reference_of, write_avr
from taxel.bundles.contract import Contract
from taxel.bundles.reader import read_bundle
from taxel.bundles.writer import write_bundle
from taxel.cli.main import main
from taxel.errors import BadBundle, BadInput
from taxel.evaluation.crossval import Job, fit_model
from taxel.evaluation.splits import by_group
from taxel.models.cnn1d import Cnn1d
from taxel.models.cnn2d import Cnn2d
from taxel.recordings.reader import list_recordings, read_recording
from taxel.signals import SensorInfo
from taxel.sources.data_sets import simulate_presets
from taxel.training.loop import TrainConfig, new_network
from taxel.training.run import Run, contract_of, save_run
from taxel.windows.config import TENG_WINDOW, WindowConfig
from taxel.windows.dataset import Dataset, load_dataset
from taxel.windows.scaling import Scaling
from taxel.windows.windower import cut_windows

RNG = np.random.default_rng(0)
VOLTS = Converter(reference_mv=3300)
needs_gcc = pytest.mark.skipif(bool(without_host()), reason=without_host())
needs_board = pytest.mark.skipif(bool(without_board()), reason=without_board())


class Trained:
    """A network trained on five simulated sessions, with the sixth held out."""

    def __init__(self, folder: Path) -> None:
        simulate_presets(folder, ("honest",), 30_000, 0)
        self.data = folder / "honest"
        self.dataset: Dataset = load_dataset(self.data, TENG_WINDOW, target="shape")
        fold = by_group(self.dataset, "shape", "session", 5, 0, final=True).final
        assert fold is not None
        self.train, self.test = fold.windows(self.dataset)
        self.y = self.dataset.class_numbers("shape")
        values = self.dataset.windows.values
        fitted = fit_model(
            self.dataset.windows[self.train],
            self.y[self.train],
            3,
            self.dataset.sensor.full_scale,
            Job(model="cnn2d", target="shape"),
        )
        assert isinstance(fitted.model, tuple)
        contract = contract_of(self.dataset, "shape", "cnn2d", fitted.model, fitted.scaling, {})
        run = Run(
            networks=fitted.model, contract=contract, train=TrainConfig(), history=(),
            data=str(self.data),
        )  # fmt: skip
        self.run = folder / "run"
        save_run(self.run, run)
        self.path = folder / "shape.taxel"
        write_bundle(self.path, fitted.model, contract, values[:50], self.dataset.windows.mask[:50])
        self.bundle = read_bundle(self.path)
        self.network = read_network(model_of(self.path), 12, 12)
        self.integers = quantise(
            self.network, self.bundle.contract.scaling, VOLTS, values[self.train]
        )
        self.counts = VOLTS.counts(values)
        self.c = folder / "c"
        window = board_window(self.bundle.contract, VOLTS, self.dataset.sensor.full_scale)
        write_c(self.c, self.integers, window, VOLTS, self.bundle.contract, self.counts[0])

    def reference(self, counts: NDArray[np.uint16]):  # type: ignore[no-untyped-def]
        return run_integers(self.integers, quantise_counts(self.integers, counts))


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Trained:
    return Trained(tmp_path_factory.mktemp("avr"))


def small_contract(trained: Trained, window: WindowConfig, columns: int) -> Contract:
    """The trained bundle's contract for a window of another shape."""
    contract = trained.bundle.contract
    return replace(
        contract, window=window, channels=contract.channels[:columns], units=("V",) * columns
    )


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
    told = trained.reference(VOLTS.counts(windows.values)).best
    ordered = np.sort(trained.bundle.probabilities(windows.values, windows.mask), axis=1)
    clear = ordered[:, -1] - ordered[:, -2] > 0.1
    best = trained.bundle.probabilities(windows.values, windows.mask).argmax(axis=1)
    assert clear.sum() > 50
    assert (told == best)[clear].all()


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


@pytest.mark.parametrize("reference_mv", [3300, 5000])
def test_the_gate_in_counts_is_the_gate_in_volts(reference_mv: int) -> None:
    converter = Converter(reference_mv=reference_mv)
    counts = np.arange(1024, dtype=np.uint16)
    last = converter.last_below(1.55)

    np.testing.assert_array_equal(counts > last, converter.volts(counts) > np.float32(1.55))
    np.testing.assert_array_equal(converter.counts(converter.volts(counts)), counts)
    assert converter.last_below(9.0) == 1023
    assert converter.last_below(-1.0) == -1


@needs_gcc
@pytest.mark.parametrize(
    "window",
    [
        TENG_WINDOW,
        replace(TENG_WINDOW, stride=5),
        replace(TENG_WINDOW, stride=17, max_gap_s=0.3),
        replace(TENG_WINDOW, gate=None),
    ],
    ids=["the thesis's", "overlapping", "with pauses", "without a gate"],
)
def test_the_board_cuts_the_windows_that_python_cuts(
    trained: Trained, tmp_path: Path, window: WindowConfig
) -> None:
    """Scan by scan through the C, window by window as the windower has them."""
    recording = read_recording(list_recordings(trained.data)[0])
    samples = recording.samples[:6000]
    contract = small_contract(trained, window, 12)
    write_c(
        tmp_path,
        trained.integers,
        board_window(contract, VOLTS, recording.manifest.sensor.full_scale),
        VOLTS,
        contract,
        trained.counts[0],
    )
    c = host_library(tmp_path)
    image = (ctypes.c_uint8 * (14 * 14)).in_dll(c, "taxel_image")
    state = ctypes.create_string_buffer(64)
    found = []
    for tick, counts in enumerate(VOLTS.counts(samples.values)):
        if c.taxel_window_push(state, ctypes.c_uint32(tick), ctypes.c_void_p(counts.ctypes.data)):
            found.append(np.array(image).reshape(14, 14)[1:13, 1:13])
            c.taxel_window_next(state)
    wanted = cut_windows(samples, window, recording.manifest.sensor)

    assert len(wanted) > 20
    inputs = quantise_counts(trained.integers, VOLTS.counts(wanted.values))
    np.testing.assert_array_equal(np.array(found), inputs)


@needs_gcc
def test_a_channel_at_its_end_for_a_whole_window_gives_no_answer(trained: Trained) -> None:
    c = host_library(trained.c)
    state = ctypes.create_string_buffer(64)
    sure, unsure = (ctypes.c_uint8 * 2)(0, 255), (ctypes.c_uint8 * 2)(0, 127)
    counts = np.full(12, 600, np.uint16)
    counts[3] = 1023

    def after(scans: list[int]) -> int:
        for tick in scans:
            c.taxel_window_push(state, ctypes.c_uint32(tick), ctypes.c_void_p(counts.ctypes.data))
        return int(c.taxel_doubt(state, sure))

    assert after(list(range(12))) == 1
    c.taxel_window_next(state)
    assert after(list(range(12, 23))) == 0
    counts[3] = 1022
    assert after([23]) == 0
    assert c.taxel_doubt(state, unsure) == 2


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


def test_the_report_says_what_was_measured_on_what(trained: Trained, tmp_path: Path) -> None:
    report = write_avr(trained.path, tmp_path / "new" / "c", trained.data)
    text = "\n".join(report.lines())

    assert "trained on (nothing held out)" in text
    assert (
        json.loads((tmp_path / "new" / "c" / "avr_report.json").read_text())["parameters"] == 5987
    )
    assert report.points_lost <= 1.0
    assert {"taxel_model.h", "taxel_weights.h", "taxel_cnn.c"} <= set(report.files)
    assert report.bit_exact is not False
    assert ("ms a window" in text) == (not without_board())


def test_without_an_emulator_the_report_says_what_to_install(
    trained: Trained, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("taxel.bundles.avr.measure.shutil.which", lambda _: None)
    report = write_avr(trained.path, tmp_path, trained.data)

    assert report.clocks is None
    assert "apt install gcc-avr" in report.lines()[-1]
    with pytest.raises(BadInput, match="apt install gcc"):
        host_library(tmp_path)


def test_writing_twice_gives_the_same_c(trained: Trained, tmp_path: Path) -> None:
    window = board_window(trained.bundle.contract, VOLTS, trained.dataset.sensor.full_scale)
    write_c(tmp_path, trained.integers, window, VOLTS, trained.bundle.contract, trained.counts[0])

    for file in trained.c.iterdir():
        assert (tmp_path / file.name).read_bytes() == file.read_bytes()


@pytest.mark.parametrize("kind", ["several that vote", "signal-based"])
def test_another_network_is_refused(trained: Trained, tmp_path: Path, kind: str) -> None:
    several = kind == "several that vote"
    build = (lambda: Cnn2d(12, 12, 3)) if several else (lambda: Cnn1d(12, 12, 3))
    networks = tuple(new_network(build, seed) for seed in range(2 if several else 1))
    path = tmp_path / "other.taxel"
    part = trained.dataset.windows[:20]
    write_bundle(path, networks, trained.bundle.contract, part.values, part.mask)

    with pytest.raises(BadBundle, match="cnn2d") as caught:
        write_avr(path, tmp_path / "c", trained.data)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    ("window", "got"),
    [
        (replace(TENG_WINDOW, layout="A"), "layout A"),
        (replace(TENG_WINDOW, pad=True), "padded"),
        (replace(TENG_WINDOW, tare=True), "tared"),
        (replace(TENG_WINDOW, segment=0.3), "denoised"),
        (replace(TENG_WINDOW, grid_hz=1000.0), "1000"),
        (replace(TENG_WINDOW, grid_hz=33.3), "33.3"),
    ],
)
def test_a_window_that_the_board_cannot_cut_is_refused(
    trained: Trained, window: WindowConfig, got: str
) -> None:
    with pytest.raises(BadBundle, match=got):
        board_window(small_contract(trained, window, 12), VOLTS, 3.3)


def test_the_converters_reference_is_read_or_asked_for() -> None:
    def sensor(**details: str) -> SensorInfo:
        return SensorInfo(name="x", channels=("a",), units=("V",), rate_hz=100.0, details=details)

    assert reference_of(sensor(reference_v="3.3")) == 3300
    assert reference_of(sensor(a="firmware 1.0.0, 10 bits, reference 5000 mV")) == 5000
    with pytest.raises(BadInput, match="--reference-mv"):
        reference_of(sensor())
    with pytest.raises(BadInput, match="3300 mV and 5000 mV"):
        reference_of(sensor(a="reference 5000 mV", b="reference 3300 mV"))


def test_the_command_writes_a_folder_and_its_report(
    trained: Trained, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "board"
    order = ["bundle", str(trained.run), "--target", "avr", "--output", str(output), "--json"]

    main([*order, "--test", str(trained.data), "--reference-mv", "3300"])
    report = json.loads(capsys.readouterr().out)
    assert report["reference_mv"] == 3300
    assert report["points_lost"] <= 1.0
    written = read_bundle(output / "network.taxel").contract
    assert written.classes == trained.bundle.contract.classes
    with pytest.raises(SystemExit) as ended:
        main(["bundle", str(trained.run), "--output", str(output), "--reference-mv", "5000"])
    said = capsys.readouterr().err
    assert ended.value.code == 2
    assert "--target avr" in said
    assert said.count("\n") == 1
