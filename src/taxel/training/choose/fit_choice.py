"""Train what was chosen: a blend of all members on all training windows.

Knows nothing about how it was chosen.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from taxel.models.blend import Blend, Part, Plan
from taxel.training.choose.candidates import Candidate
from taxel.training.choose.choice import Choice, Member
from taxel.training.choose.fitting import fit_head
from taxel.training.choose.networks import fit_network
from taxel.training.choose.preparations import Base, Prepared

KINDS = {"discriminant": "linear", "linear": "linear", "trees": "trees", "perceptron": "perceptron"}
"""Family → head; a network is named after its model."""


def fit_choice(
    choice: Choice,
    base: Base,
    prepared: Prepared,
    train: Sequence[int],
    seed: int = 0,
    heads: dict[Candidate, nn.Module] | None = None,
) -> Blend:
    """Return the blend, trained.

    Args:
        choice: Members, weights, temperatures.
        base: The recordings.
        prepared: Them, cut as the choice says.
        train: Indices of the trials to learn from.
        seed: Of all that is random.
        heads: Those that were fitted before on the same trials; new ones are added.
    """
    fitted: dict[Candidate, nn.Module] = {} if heads is None else heads
    rows = np.flatnonzero(np.isin(prepared.trial[prepared.kept], np.asarray(train, np.intp)))
    y = base.y[prepared.trial[prepared.kept[rows]]]
    classes = len(base.dataset.classes(base.target))
    for member in choice.members:
        if member.candidate not in fitted:
            fitted[member.candidate] = _head(member, prepared, rows, y, classes, seed)
    parts = tuple(
        Part(KINDS.get(one.candidate.family, f"network:{one.candidate.model}"), one.blocks)
        for one in choice.members
    )
    return Blend(
        Plan(choice.window.steps, prepared.pads, classes, parts),
        tuple(fitted[member.candidate] for member in choice.members),
        tuple(one.weight for one in choice.members),
        tuple(one.sharpness for one in choice.members),
        choice.last,
    ).eval()


def _head(
    member: Member,
    prepared: Prepared,
    rows: NDArray[np.intp],
    y: NDArray[np.intp],
    classes: int,
    seed: int,
) -> nn.Module:
    if member.candidate.family == "network":
        windows = prepared.kept[rows]
        return fit_network(prepared, windows, y, classes, member.candidate, seed)
    return fit_head(member.candidate, prepared.features(member.blocks)[rows], y, classes, seed)


def predict_blend(
    blend: nn.Module, prepared: Prepared, windows: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Return probabilities of some windows, shape (n, classes)."""
    own = prepared.dataset.windows
    parts = []
    with torch.inference_mode():
        for start in range(0, len(windows), 256):
            part = windows[start : start + 256]
            logits = blend(torch.from_numpy(own.values[part]), torch.from_numpy(own.mask[part]))
            parts.append(torch.softmax(logits.double(), dim=1).numpy())
    return np.concatenate(parts)
