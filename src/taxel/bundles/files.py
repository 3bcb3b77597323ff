"""Write a bundle's file, and write one again for another level: NumPy only.

The layout stands in `taxel.bundles.contract`. Knows nothing about training frameworks,
recordings or versions.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.contract import Contract, at_level, contract_to_json
from taxel.bundles.envelope import from_npy, pack, to_npy, unpack
from taxel.bundles.reader import read_bundle
from taxel.errors import BadBundle
from taxel.plain_text import number_of


def bundle_bytes(
    contract: Contract,
    model: bytes,
    values: NDArray[np.float32],
    mask: NDArray[np.bool_],
    probabilities: NDArray[np.float32],
) -> bytes:
    """Return a bundle as it stands on disk; the same parts give the same bytes.

    Args:
        contract: What the bundle says of itself.
        model: The ONNX model.
        values: Unscaled check windows, shape (n, steps, channels).
        mask: Shape (n, steps).
        probabilities: What the model must give for them, shape (n, classes).
    """
    members = {"bundle.json": contract_to_json(contract).encode(), "model.onnx": model}
    for name, array in {"values": values, "mask": mask, "probabilities": probabilities}.items():
        members[f"check_{name}.npy"] = to_npy(array)
    return pack(members)


def bundle_at_level(path: Path | str, level: NDArray[np.float32]) -> tuple[Contract, bytes]:
    """Return a bundle for reference touches of another level: its contract and its bytes.

    The check windows are scaled along, so that the stored probabilities still hold.

    Args:
        path: A bundle that was trained with reference touches.
        level: The new level, shape (channels,), as `taxel.windows.reference.touch_level` gives it.

    Raises:
        BadBundle: It is missing, damaged, or was trained without reference touches.
    """
    old = read_bundle(path).contract
    if len(level) != len(old.channels):
        raise BadBundle(
            f"{number_of(len(old.channels), 'level')}, one a channel", str(len(level)), "mend it"
        )
    new = at_level(old, level)
    assert old.reference is not None
    checks = ("values", "mask", "probabilities")
    members = unpack(Path(path), ("model.onnx", *(f"check_{name}.npy" for name in checks)))
    values, mask, probabilities = (from_npy(members[f"check_{name}.npy"]) for name in checks)
    assert new.reference is not None  # a channel that gives nothing keeps its level
    change = (new.reference.level / old.reference.level).astype(np.float32)
    return new, bundle_bytes(new, members["model.onnx"], values * change, mask, probabilities)
