"""A small network trained on simulated sessions, as a bundle, as integers and as C."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.bundles.avr.emit import board_window, write_c
from taxel.bundles.avr.integers import quantise_counts, run_integers
from taxel.bundles.avr.measure import without_board
from taxel.bundles.avr.network import read_network
from taxel.bundles.avr.quantise import Converter, quantise
from taxel.bundles.avr.write import model_of
from taxel.bundles.contract import Contract
from taxel.bundles.reader import read_bundle
from taxel.bundles.writer import write_bundle
from taxel.evaluation.splits import by_group
from taxel.sources.simulated.data_sets import simulate_presets
from taxel.training.fitting import Job, TrainingSet, fit_model
from taxel.training.loop import TrainConfig
from taxel.training.run import Run, contract_of, save_run
from taxel.windows.config import TENG_WINDOW, WindowConfig
from taxel.windows.dataset import Dataset, load_dataset

VOLTS = Converter(reference_mv=3300)
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
        training = TrainingSet.of(self.dataset, "shape", self.train)
        fitted = fit_model(training, Job(model="cnn2d", target="shape"))
        contract = contract_of(self.dataset, "shape", "cnn2d", fitted.networks, fitted.scaling, {})
        run = Run(
            networks=fitted.networks, contract=contract, train=TrainConfig(), history=(),
            data=str(self.data),
        )  # fmt: skip
        self.run = folder / "run"
        save_run(self.run, run)
        self.path = folder / "shape.taxel"
        mask = self.dataset.windows.mask[:50]
        write_bundle(self.path, fitted.networks, contract, values[:50], mask)
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


def small_contract(trained: Trained, window: WindowConfig, columns: int) -> Contract:
    """The trained bundle's contract for a window of another shape."""
    contract = trained.bundle.contract
    return replace(
        contract, window=window, channels=contract.channels[:columns], units=("V",) * columns
    )
