"""Open a bundle and predict with it: NumPy and ONNX Runtime only.

Knows nothing about training frameworks, sources or decisions.
"""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.check_windows import other_windows, refuse_other_probabilities
from taxel.bundles.contract import Contract, contract_from_json
from taxel.bundles.engine import largest_difference
from taxel.bundles.envelope import from_npy, unpack
from taxel.bundles.model_check import check_model
from taxel.bundles.model_trial import Trial, try_models
from taxel.bundles.signing import Trust
from taxel.decisions.unknown import NoveltyTest
from taxel.errors import BadBundle, BadInput
from taxel.models.devices import CPU
from taxel.models.onnx_session import WindowModel

_MEMBERS = (
    "bundle.json",
    "model.onnx",
    "check_values.npy",
    "check_mask.npy",
    "check_probabilities.npy",
)


class Bundle:
    """A recogniser that is ready to run.

    Args:
        contract: What it needs and gives.
        model: The ONNX model's bytes.
        threads: Threads of ONNX Runtime; one is fastest for small networks and
            leaves the machine to others.
        device: Where ONNX Runtime runs it, a name in `PROVIDERS`.
    """

    def __init__(
        self, contract: Contract, model: bytes, threads: int = 1, device: str = CPU
    ) -> None:
        self.contract = contract
        self._run = WindowModel(model, threads, device)
        self.novelty_test = NoveltyTest(contract.unknown) if contract.unknown is not None else None
        """The test for touch that is unlike all that was learned; None where there is none."""

    def probabilities(
        self, values: NDArray[np.float32], mask: NDArray[np.bool_]
    ) -> NDArray[np.float32]:
        """Return class probabilities, shape (n, classes).

        Args:
            values: Unscaled windows, shape (n, steps, channels), in the channels' units; of
                another kind of number than float32 they are converted.
            mask: Shape (n, steps).

        Raises:
            BadInput: A shape is another.
        """
        values, mask = self._checked(values, mask)
        return self._run(self.contract.scaling.apply(values, mask), mask)

    def recognise(
        self, values: NDArray[np.float32], mask: NDArray[np.bool_]
    ) -> tuple[NDArray[np.float32], list[float] | None]:
        """Return one window's class probabilities, and its novelty score by each label.

        Args:
            values: One unscaled window of usable values, shape (1, steps, channels).
            mask: Shape (1, steps).

        Returns:
            Probabilities, shape (classes,), and novelty scores as `NoveltyTest.of_window` gives
            it; None where the bundle has no such test or gave NaN, or no row was measured:
            with a test, None means UNKNOWN.

        Raises:
            BadInput: A shape is another.
        """
        values, mask = self._checked(values, mask)
        scaled = self.contract.scaling.apply(values, mask)
        found = self._run(scaled, mask)[0]
        if self.novelty_test is None or not isfinite(float(found.sum())):
            return found, None
        rows = scaled[0] if mask.all() else scaled[0][mask[0]]
        return found, self.novelty_test.of_window(rows) if len(rows) else None

    def _checked(
        self, values: NDArray[np.float32], mask: NDArray[np.bool_]
    ) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """Return windows and mask as the model takes them; one channel would be taken for all."""
        values, mask = np.asarray(values, np.float32), np.asarray(mask, np.bool_)
        window = (self.contract.window.steps, len(self.contract.channels))
        if values.shape[1:] != window or mask.shape != values.shape[:2]:
            raise BadInput(
                f"windows of shape (n, {window[0]}, {window[1]}) and a mask of (n, {window[0]})",
                f"{values.shape} and {mask.shape}", "cut them with the contract's own window",
            )  # fmt: skip
        return values, mask


def read_bundle(
    path: Path | str, threads: int = 1, trust: Trust | None = None, device: str = CPU
) -> Bundle:
    """Open a bundle, after checking that it is whole and gives what it gave when written.

    Args:
        path: The bundle.
        threads: Threads of ONNX Runtime.
        trust: Keys of which one must have signed it; any bundle unless given.
        device: Where ONNX Runtime runs it, a name in `PROVIDERS`.

    Raises:
        BadInput: The device is not there.
        BadBundle: It is missing, damaged, of another format, its check windows give other
            probabilities, or none of the keys of `trust` signed it.
    """
    members = unpack(Path(path), _MEMBERS, trust)
    contract = contract_from_json(members["bundle.json"])
    values, mask, expected = (
        from_npy(members[f"check_{name}.npy"]) for name in ("values", "mask", "probabilities")
    )
    _check_shapes(contract, values, mask, expected)
    check_model(members["model.onnx"])
    scaled = contract.scaling.apply(values, mask)
    try_models([Trial(members["model.onnx"], {"values": scaled, "mask": mask})])
    bundle = Bundle(contract, members["model.onnx"], threads, device)
    computed = bundle.probabilities(values, mask)
    alone = bundle.probabilities(values[:1], mask[:1])  # as it will be asked live
    if computed.shape != expected.shape or alone.shape != expected[:1].shape:
        raise BadBundle(
            f"probabilities of {len(contract.classes)} classes", f"{computed.shape} from the model",
            "write the bundle again with taxel bundle",
        )  # fmt: skip
    refuse_other_probabilities(largest_difference(computed, expected))
    return bundle


def read_contract(path: Path | str, trust: Trust | None = None) -> Contract:
    """Return what a bundle needs and gives, without opening its model.

    Raises:
        BadBundle: It is missing, damaged, of another format, or not signed by a key of `trust`.
    """
    return contract_from_json(unpack(Path(path), ("bundle.json",), trust)["bundle.json"])


def _check_shapes(
    contract: Contract, values: NDArray[Any], mask: NDArray[Any], expected: NDArray[Any]
) -> None:
    """Refuse check windows that are not the contract's.

    Raises:
        BadBundle: A shape or kind of number is another, or a value is no number.
    """
    n = len(values) if values.ndim else 0
    window = (n, contract.window.steps, len(contract.channels))
    wanted = (("values", values, window, "f"), ("mask", mask, window[:2], "b"),
              ("probabilities", expected, (n, len(contract.classes)), "f"))  # fmt: skip
    for name, array, shape, kind in wanted:
        if not n or array.shape != shape or array.dtype.kind != kind or array.dtype.itemsize > 4:
            raise other_windows(name, shape, array)
    if not np.isfinite(values).all():
        raise BadBundle("check values that are numbers", "others among them",
                        "write the bundle again with taxel bundle")  # fmt: skip
