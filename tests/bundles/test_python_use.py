"""A bundle from Python: windows of other kinds of number, of other shapes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_bundle import MASK, VALUES, contract

from taxel.bundles.reader import read_bundle, read_contract
from taxel.bundles.writer import write_bundle
from taxel.errors import BadInput
from taxel.models.cnn2d import Cnn2d
from taxel.training.loop import new_network


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bundle") / "a.taxel"
    write_bundle(path, (new_network(lambda: Cnn2d(12, 12, 3), 0),), contract(), VALUES, MASK)
    return path


def test_windows_of_other_numbers_give_the_same(path: Path) -> None:
    """Of 64 bits, whole numbers and lists: converted, not said to be a broken bundle."""
    bundle = read_bundle(str(path))
    expected = bundle.probabilities(VALUES, MASK)

    for values in (VALUES.astype(np.float64), VALUES.tolist()):
        np.testing.assert_array_equal(bundle.probabilities(values, MASK.astype(int)), expected)
    assert read_contract(str(path)).target == "shape"


@pytest.mark.parametrize(
    ("values", "mask"),
    [
        (VALUES[:, :, :1], MASK),
        (VALUES[:, :6], MASK[:, :6]),
        (VALUES[0], MASK[0]),
        (VALUES, MASK[:5]),
        (VALUES, MASK[:1]),
    ],
    ids=["one channel", "short", "one window", "short mask", "one mask"],
)
def test_windows_of_another_shape_are_refused(
    path: Path, values: np.ndarray, mask: np.ndarray
) -> None:
    """One channel would else be taken for all twelve, and one mask for all windows."""
    bundle = read_bundle(path)
    for ask in (bundle.probabilities, bundle.recognise):
        with pytest.raises(BadInput, match=r"needed windows of shape \(n, 12, 12\)"):
            ask(values, mask)


def test_a_bundle_is_written_from_windows_of_64_bits(tmp_path: Path) -> None:
    """With the same parity, and by a path that is a text."""
    networks = (new_network(lambda: Cnn2d(12, 12, 3), 0),)

    written = write_bundle(
        str(tmp_path / "a.taxel"), networks, contract(), VALUES.astype(np.float64), MASK
    )

    assert written.parity is not None
    assert written.parity < 1e-6


def test_a_bundle_needs_a_network_and_a_window(tmp_path: Path) -> None:
    networks = (new_network(lambda: Cnn2d(12, 12, 3), 0),)
    for own, values in (((), VALUES), (networks, VALUES[:0])):
        with pytest.raises(BadInput, match="needed networks, and windows"):
            write_bundle(tmp_path / "a.taxel", own, contract(), values, MASK[: len(values)])

    assert not list(tmp_path.iterdir())


def test_a_model_larger_than_a_bundle_is_refused_before_its_export(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A forest of thousands of windows: its export takes hours, and no reader would open it."""
    monkeypatch.setattr("taxel.bundles.writer.LARGEST_BYTES", 1000)
    monkeypatch.setattr("taxel.bundles.writer.export_onnx", None)
    networks = (new_network(lambda: Cnn2d(12, 12, 3), 0),)

    with pytest.raises(BadInput, match=r"needed a model of at most 1,000 bytes.*--max-mb"):
        write_bundle(tmp_path / "a.taxel", networks, contract(), VALUES, MASK)
    assert not (tmp_path / "a.taxel").exists()
