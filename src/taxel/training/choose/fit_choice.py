"""Train what was chosen: a blend of all members on all training windows.

Knows nothing about how it was chosen.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from taxel.models.blend import NETWORK, Blend, Part, Plan
from taxel.models.kernel_features import KERNELS
from taxel.training.choose.base import Base
from taxel.training.choose.candidates import Candidate
from taxel.training.choose.choice import Choice, Member
from taxel.training.choose.cores import working_threads
from taxel.training.choose.fitting import fit_head
from taxel.training.choose.networks import thinning, train_network, untrained
from taxel.training.choose.preparations import Prepared

Heads = dict[tuple[Candidate, int], nn.Module]
"""Candidate and number of its copy → what was fitted."""
KINDS = {"discriminant": "linear", "linear": "linear", "trees": "trees", "perceptron": "perceptron"}
"""Family → head; a network is named after its model."""
LONGEST = ("network", "trees")
"""Families that take longest to fit, and so are begun first."""
NETWORKS = 2
"""Networks that stand for one that was chosen, of other seeds; inner folds see one, for time.
Source: our choice, docs/decisions/0039: three are hardly better, and take half as long again."""


def fit_choice(
    choice: Choice,
    base: Base,
    prepared: Prepared,
    train: Sequence[int],
    seed: int = 0,
    heads: Heads | None = None,
    draft: bool = False,
) -> Blend:
    """Return the blend, trained.

    Args:
        choice: Members, weights, temperatures.
        base: The recordings.
        prepared: Them, cut as the choice says.
        train: Indices of the trials to learn from.
        seed: Of all that is random.
        heads: Those that were fitted before on the same trials; new ones are added.
        draft: Networks stay as training begins with them: as quick and as large as in the end.
    """
    fitted: Heads = {} if heads is None else heads
    rows = np.flatnonzero(np.isin(prepared.trial[prepared.kept], np.asarray(train, np.intp)))
    windows = prepared.kept[rows]
    y = base.y[prepared.trial[windows]]
    classes = len(base.dataset.classes(base.target))
    member_copies = copies(choice)
    new = [
        (member, copy) for member, copy in member_copies if (member.candidate, copy) not in fitted
    ]
    new.sort(key=lambda own: own[0].candidate.family not in LONGEST)
    # First weights come from PyTorch's one generator, so that they are drawn one after another.
    networks = {
        (member, copy): untrained(prepared, classes, member.candidate, seed + copy)
        for member, copy in new if member.candidate.family == "network"
    }  # fmt: skip

    def head_of(own: tuple[Member, int]) -> nn.Module:
        member, copy = own
        network = networks.get(own)
        if network is None:
            seen = (
                prepared.fitted_features(windows, windows, seed)[1]
                if member.blocks == (KERNELS,)
                else prepared.features(member.blocks)[rows]
            )
            return fit_head(member.candidate, seen, y, classes, seed + copy)
        if not draft:
            train_network(network, prepared, windows, y, member.candidate, seed + copy)
        return network

    with working_threads() as pool:
        for (member, copy), head in zip(new, pool.map(head_of, new), strict=True):
            fitted[member.candidate, copy] = head
    kernels = None
    if any(member.blocks == (KERNELS,) for member in choice.members):
        kernels = prepared.fitted_features(windows, windows, seed)[0]
    parts = tuple(
        Part(KINDS.get(own.candidate.family, _network_name(own, choice.window.steps)), own.blocks)
        for own, _ in member_copies
    )
    return Blend(
        Plan(choice.window.steps, prepared.pads, classes, parts, choice.window.pad, prepared.grids),
        tuple(fitted[member.candidate, copy] for member, copy in member_copies),
        tuple(member.weight / copies_of(member) for member, _ in member_copies),
        tuple(member.sharpness for member, _ in member_copies),
        choice.last,
        kernels,
    ).eval()


def _network_name(member: Member, steps: int) -> str:
    """Return what a plan calls a network on windows of so many rows."""
    rows = thinning(steps)
    return f"{NETWORK}{member.candidate.model}" + (f"/{rows}" if rows > 1 else "")


def copies_of(member: Member) -> int:
    """Return how many models of other seeds stand for a member."""
    return NETWORKS if member.candidate.family == "network" else 1


def copies(choice: Choice) -> list[tuple[Member, int]]:
    """Return the parts of the blend in their order: each member with the number of its copy."""
    return [(member, copy) for member in choice.members for copy in range(copies_of(member))]


def predict_blend(
    blend: nn.Module, prepared: Prepared, windows: NDArray[np.intp], classes: int
) -> NDArray[np.float64]:
    """Return probabilities of some windows to test on, shape (n, classes)."""
    parts = [np.zeros((0, classes))]
    with torch.inference_mode():
        for start in range(0, len(windows), 256):
            own = prepared.dataset.tested(windows[start : start + 256])
            logits = blend(torch.from_numpy(own.values), torch.from_numpy(own.mask))
            parts.append(torch.softmax(logits.double(), dim=1).numpy())
    return np.concatenate(parts)
