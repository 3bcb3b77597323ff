"""Write a bundle from trained networks, and prove on export that it equals them.

Needs PyTorch; the reader does not. Knows nothing about recordings or splits.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from taxel.bundles.contract import LARGEST_DIFFERENCE, Contract
from taxel.bundles.engine import largest_difference
from taxel.bundles.envelope import LARGEST_BYTES, signed
from taxel.bundles.files import bundle_bytes
from taxel.bundles.reader import Bundle
from taxel.bundles.signing import Signer
from taxel.errors import BadBundle, BadInput
from taxel.foreign.files import in_words
from taxel.models.heads import TreesHead
from taxel.models.tree_operator import OPSETS
from taxel.recordings.whole import write_whole

_CHECK_WINDOWS = 16
"""Windows stored for the check on load."""
_OPSET = 18


class Classifier(nn.Module):
    """Networks that vote: the mean of their probabilities."""

    def __init__(self, networks: tuple[nn.Module, ...]) -> None:
        super().__init__()
        self.networks = nn.ModuleList(networks)

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        """Return probabilities, shape (n, classes), of scaled windows (n, steps, channels)."""
        each = [torch.softmax(network(values, mask), dim=1) for network in self.networks]
        # One network needs no mean: three nodes less are a third of a small model's time.
        return each[0] if len(each) == 1 else torch.stack(each).mean(dim=0)


def write_bundle(
    path: Path | str,
    networks: tuple[nn.Module, ...],
    contract: Contract,
    values: NDArray[np.float32],
    mask: NDArray[np.bool_],
    signer: Signer | None = None,
) -> Contract:
    """Write a bundle, whole or not at all, and return its contract with the parity found.

    Args:
        path: The file to write.
        networks: Trained networks whose probabilities are averaged.
        contract: What the bundle says of itself; its parity is measured here.
        values: Unscaled windows to measure parity on, shape (n, steps, channels).
        mask: Shape (n, steps).
        signer: Signs the bundle; it is not signed unless given.

    Raises:
        BadBundle: The exported model gives other probabilities than the networks.
        BadInput: There is no network or no window, the windows are not the contract's, or the
            networks are larger than a bundle may be.
        RecordingFailed: The disk refused.
    """
    if not networks or not len(values):
        got = f"{len(networks)} and {len(values)}"
        raise BadInput(
            "networks, and windows to measure parity on", got, "give one or more of each"
        )
    refuse_large(networks)
    values, mask = np.asarray(values, np.float32), np.asarray(mask, np.bool_)
    classifier = Classifier(networks).eval()
    model = export_onnx(classifier, contract.window.steps, len(contract.channels))
    found = Bundle(contract, model).probabilities(values, mask)
    scaled = contract.scaling.apply(values, mask)
    with torch.inference_mode():
        wanted = classifier(torch.from_numpy(scaled), torch.from_numpy(mask)).numpy()
    parity = largest_difference(found, wanted)
    if not parity <= LARGEST_DIFFERENCE:
        raise BadBundle(
            f"the exported model to equal the trained one within {LARGEST_DIFFERENCE:g}",
            f"a difference of {parity:.2g}",
            "report the model and the versions of torch and onnxruntime",
        )
    contract = replace(contract, parity=parity)
    part = np.linspace(0, len(values) - 1, min(_CHECK_WINDOWS, len(values))).astype(int)
    whole = bundle_bytes(contract, model, values[part], mask[part], wanted[part])
    write_whole(path, whole if signer is None else signed(whole, signer))
    return contract


def refuse_large(networks: Sequence[nn.Module]) -> None:
    """Refuse networks larger than a bundle may be, before hours of export.

    Raises:
        BadInput: They are, as a forest that grew on thousands of windows is.
    """
    size = sum(
        part.numel() * part.element_size()
        for network in networks
        for part in network.state_dict().values()
    )
    if size > LARGEST_BYTES:
        raise BadInput(
            f"a model of at most {in_words(LARGEST_BYTES)}, as large as a bundle may be",
            f"one of {in_words(size)}",
            "train on fewer windows or with another --model, or without one: the search keeps "
            "to --max-mb",
        )


def export_onnx(classifier: nn.Module, steps: int, channels: int) -> bytes:
    """Return an ONNX model with inputs values and mask; the number of windows is free."""
    example = (torch.zeros(2, steps, channels), torch.ones(2, steps, dtype=torch.bool))
    buffer = io.BytesIO()
    holds_trees = any(isinstance(part, TreesHead) for part in classifier.modules())
    with warnings.catch_warnings():
        # torch announces its newer exporter at each call; the older one writes small
        # graphs in 0.1 s instead of 4 s and is checked for parity above.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            classifier,
            example,
            buffer,  # type: ignore[arg-type]  # the older exporter writes to a buffer too
            input_names=["values", "mask"],
            output_names=["probabilities"],
            dynamic_axes={"values": {0: "n"}, "mask": {0: "n"}, "probabilities": {0: "n"}},
            opset_version=_OPSET,
            custom_opsets=OPSETS if holds_trees else None,
            dynamo=False,
        )
    return buffer.getvalue()
