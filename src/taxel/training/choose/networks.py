"""Networks of the catalogue as candidates: trained on windows, with augmentation.

Knows nothing about folds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from taxel.models.blend import ScaledNetwork, thinned
from taxel.models.catalogue import find_network
from taxel.training.augment import Augment
from taxel.training.choose.candidates import Candidate
from taxel.training.choose.preparations import Prepared
from taxel.training.loop import Labelled, TrainConfig, fit, new_network
from taxel.windows.scaling import fit_scaling

TRAIN = TrainConfig(
    epochs=8, steps=15, batch=64, learning_rate=4e-3, warmup=0.2, weight_decay=0.02,
    label_smoothing=0.05, clip=5.0,
    augment=Augment(noise=0.02, gain=0.3, channel_gain=0.2, offset=0.3, drift=0.5),
)  # fmt: skip
"""As of the recipe teng-glove (docs/decisions/0011), without warping, in two thirds of its steps.
Source: our choice, docs/decisions/0039."""
LONG_ROWS = 200
"""Rows that a network sees at least; of twice as many, each two are seen as their mean, since time
grows with them. Source: our choice, docs/decisions/0039."""


def thinning(steps: int) -> int:
    """Return how many rows of a window a network sees as one."""
    return max(1, steps // LONG_ROWS)


def train_network(
    whole: ScaledNetwork,
    prepared: Prepared,
    windows: NDArray[np.intp],
    y: NDArray[np.intp],
    candidate: Candidate,
    seed: int,
    on_share: Callable[[float], None] = lambda _: None,
) -> None:
    """Train in place; several may be trained side by side.

    Args:
        whole: As `untrained` returns it.
        prepared: The data set.
        windows: Which of its windows, shape (n,).
        y: Their classes, shape (n,).
        candidate: Its `model` is the network's name.
        seed: Of order, augmentation and what is dropped.
        on_share: Called after each epoch with the share that is done, 0…1; may raise.
    """
    for part in whole.modules():
        if isinstance(part, _OwnDropout):
            part.generator = torch.Generator().manual_seed(seed)
    learned = prepared.dataset.windows[windows]
    scaling_of_model = find_network(candidate.model).scaling
    kind = "standard" if scaling_of_model == "full-scale" else scaling_of_model
    scaling = fit_scaling(kind, learned.values, learned.mask, None)
    scaled = (
        torch.from_numpy(scaling.apply(learned.values, learned.mask)),
        torch.from_numpy(learned.mask),
    )
    values, mask = (part.numpy() for part in thinned(*scaled, whole.thin))
    data = Labelled(values, mask, y)
    fit(
        whole.network, data, replace(TRAIN, seed=seed),
        on_epoch=lambda epoch: on_share(epoch.number / TRAIN.epochs),
    )  # fmt: skip
    settle_norms(whole.network, data)
    whole.offset, whole.factor = map(torch.from_numpy, (scaling.offset, scaling.factor))
    whole.eval()
    for part in whole.modules():
        if isinstance(part, _OwnDropout):
            part.generator = None


def untrained(prepared: Prepared, classes: int, candidate: Candidate, seed: int) -> ScaledNetwork:
    """Return a network as training begins with it: as quick and as large as in the end.

    Args:
        prepared: The data set.
        classes: How many there are.
        candidate: Its `model` is a network's name.
        seed: Of its weights.
    """
    steps, channels = prepared.dataset.windows.values.shape[1:]
    thin = thinning(steps)
    build = find_network(candidate.model).build
    network = new_network(lambda: build(steps // thin, channels, classes), seed)
    for part in list(network.modules()):
        for name, child in part.named_children():
            if type(child) is nn.Dropout:
                setattr(part, name, _OwnDropout(child.p))
    return ScaledNetwork(network, channels, thin).eval()


class _OwnDropout(nn.Dropout):
    """Draws from a generator of its own: PyTorch's is one for all threads."""

    generator: torch.Generator | None = None

    def forward(self, x: Tensor) -> Tensor:
        if not self.training:
            return x
        drawn = torch.rand(x.shape, generator=self.generator)
        return x * (drawn >= self.p) / (1.0 - self.p)


def settle_norms(network: nn.Module, data: Labelled, batch: int = 256) -> None:
    """Measure the batch norms' means and variances anew on windows without augmentation.

    A channel that is still in most windows is never still with noise and drift added, so that
    statistics gathered while training are not those of the windows to come: on icub-grasp a
    network that was right on 97 % of its training windows fell to 10 % with them. Batches are drawn
    in a shuffled order: windows stand by recording, and those of a single session vary too little.
    """
    norms = [part for part in network.modules() if isinstance(part, nn.BatchNorm1d)]
    momenta = [norm.momentum for norm in norms]
    for norm in norms:
        norm.reset_running_stats()
        norm.momentum = None  # a plain mean over batches
    network.train()
    values, mask, _ = data.tensors()
    order = torch.from_numpy(np.random.default_rng(0).permutation(len(data)))
    with torch.random.fork_rng(devices=[]), torch.inference_mode():
        for part in order.tensor_split(max(1, len(data) // batch)):
            network(values[part], mask[part])
    for norm, momentum in zip(norms, momenta, strict=True):
        norm.momentum = momentum
    network.eval()


def predict_network(
    network: ScaledNetwork, prepared: Prepared, windows: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Return a trained network's logits of some windows to test on, shape (n, classes)."""
    own = prepared.dataset.tested(windows)
    with torch.inference_mode():
        parts = [network(torch.from_numpy(own.values[i : i + 512]),
                         torch.from_numpy(own.mask[i : i + 512])).double().numpy()
                 for i in range(0, len(windows), 512)]  # fmt: skip
    return np.concatenate(parts)
