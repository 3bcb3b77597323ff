"""How often a window's rows answer to small patterns: MiniRocket's features, as a module to export.

Each of 84 kernels of nine taps, two of three weights −1 and the third 2, looks at one channel, or
at one less another, at several dilations; a feature is the share of places where its answer is
above a bias. The biases are quantiles of answers in training windows
(`taxel.training.choose.kernels`).

Windows of full length have zeros beyond their ends, so that kernels there see the level. Where
windows are padded, each has as many places, in its own measured rows, and no kernel looks beyond:
the length of a trial must not predict its class. Sums are exact in double precision, so that
PyTorch offline and ONNX Runtime live count the same places. Knows nothing about models or files.

Source: Dempster et al., "MiniRocket", KDD 2021; one channel a kernel or the difference of two, and
fewer places in long windows, are our choice, docs/decisions/0039.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

KERNELS = "kernels"
"""What these features are called beside `taxel.models.touch_features.BLOCKS`."""
DIFFERENCES = 0.5
"""Share of the slots that see the difference of two channels. Source: our choice, 0039."""
TAPS = 9
"""Rows that a kernel sees, and so the fewest of a window."""
SLOTS = 12
"""Channels that are looked at with each dilation, by a twelfth of the kernels each; a single
channel by all. Source: our choice, 0039."""
DILATIONS, BIASES, PLACES = 6, 18, 100
"""Dilations at most; biases of each kernel over all of them; rows of a window at most around which
kernels look. Source: as above."""
ALONE = -1
"""In the table `less`: no channel is subtracted."""
_TABLES = ("dilation", "channel", "less", "place", "bias")


class KernelFeatures(nn.Module):
    """Shares of places above a bias."""

    dilation: Tensor
    """Rows between taps, shape (dilations,)."""
    channel: Tensor
    """Which channel each slot sees, shape (dilations, slots)."""
    less: Tensor
    """Which channel is subtracted from it, or `ALONE`, likewise: what all taxels have in common, as
    drift or the force of a whole grasp, goes."""
    place: Tensor
    """Around which rows kernels look, as shares of those there are, shape (places,)."""
    bias: Tensor
    """Shape (dilations, slots, kernels of a slot, biases) float64."""

    def __init__(self, **tables: Tensor) -> None:
        super().__init__()
        for name in _TABLES:
            self.register_buffer(name, tables.get(name, torch.zeros(1)))

    def forward(self, values: Tensor, mask: Tensor | None) -> Tensor:
        """Return features, shape (n, features) float64.

        Args:
            values: Shape (n, steps, channels), unscaled.
            mask: Shape (n, steps); None where no row is padding.
        """
        rows = None if mask is None else mask.long().sum(dim=1)
        found = []
        for number in range(int(self.dilation.shape[0])):
            above = self.answers(values, rows, number).unsqueeze(3) > self.bias[number].unsqueeze(3)
            # Counts are exact in single precision, which is twice as quick.
            found.append(above.float().sum(dim=4).double() / int(self.place.shape[0]))
        return torch.cat([shares.flatten(1) for shares in found], dim=1)

    def answers(self, values: Tensor, rows: Tensor | None, number: int) -> Tensor:
        """Return what kernels answer, shape (n, slots, kernels of a slot, places).

        Args:
            values: Shape (n, steps, channels), unscaled.
            rows: Measured rows of each window, shape (n,); None where no row is padding.
            number: Of the dilation.
        """
        apart, last = int(self.dilation[number]), int(values.shape[1]) - 1
        slots, places = int(self.channel.shape[1]), int(self.place.shape[0])
        tap = apart * torch.arange(TAPS).unsqueeze(1)
        if rows is None:
            at = (self.place * (last + 1)).long() + tap - TAPS // 2 * apart
            inside = ((at >= 0) & (at <= last)).flatten().view(1, -1, 1)
            at = at.clamp(0, last).flatten()
            if last * slots < TAPS * places * int(values.shape[2]):  # the less work
                taps = self._seen(partial(values.index_select, 2), number).index_select(1, at)
            else:
                taps = self._seen(partial(values.index_select(1, at).index_select, 2), number)
            taps = taps * inside
        else:
            free = (rows - (TAPS - 1) * apart).clamp(min=1).view(-1, 1, 1)
            at = ((self.place * free).long() + tap).clamp(max=last).flatten(1)
            flat, first = values.flatten(1), at.unsqueeze(2) * int(values.shape[2])

            def taken(channel: Tensor) -> Tensor:  # nothing but what is looked at
                own = flat.gather(1, (first + channel).flatten(1))
                return own.reshape(-1, TAPS * places, slots)

            taps = self._seen(taken, number)
        kernels = torch.from_numpy(kernels_of(slots, number))
        seen = taps.double().transpose(1, 2).reshape(-1, slots, TAPS, places)
        return torch.matmul(kernels, seen)

    def _seen(self, taken: Callable[[Tensor], Tensor], number: int) -> Tensor:
        """Return what each slot sees, shape (n, rows, slots).

        A difference stays in single precision, so that sums of it are exact, too.

        Args:
            taken: Channels' numbers → their values, shape (n, rows, slots).
            number: Of the dilation.
        """
        own, less = taken(self.channel[number]), self.less[number]
        if int(less.max()) == ALONE:
            return own
        return torch.where(less == ALONE, own, own - taken(less.clamp(min=0)))

    def _load_from_state_dict(self, state_dict: Any, prefix: str, *rest: Any) -> None:
        if prefix + "less" not in state_dict and prefix + "channel" in state_dict:
            # Weights of an earlier checkout.
            state_dict[prefix + "less"] = torch.full_like(state_dict[prefix + "channel"], ALONE)
        for name in _TABLES:
            if prefix + name in state_dict:
                setattr(self, name, torch.empty_like(state_dict[prefix + name]))
        super()._load_from_state_dict(state_dict, prefix, *rest)


def drawn_kernels(
    steps: int, channels: int, seed: int = 0, shortest: int | None = None
) -> KernelFeatures:
    """Return features whose biases are 0 yet: as quick and as many as fitted ones.

    Args:
        steps: Rows in a window, at least `TAPS`.
        channels: Of the array; their order is drawn where there are more than slots.
        seed: Of that order, and of which slots see the difference of two channels: half of them.
        shortest: Measured rows of the shortest window; None where no row is padding.
    """
    rows = steps if shortest is None else shortest
    # Half of a padded window's rows, at least, must be places: as many as in any other.
    most = max(1, (rows - 1) // (TAPS - 1) if shortest is None else rows // (2 * (TAPS - 1)))
    dilation = np.unique(np.round(np.geomspace(1, most, DILATIONS)).astype(np.int64))
    slots = SLOTS if channels > 1 else 1
    random = np.random.default_rng(seed)
    order = random.permutation(channels) if channels > slots else np.arange(channels)
    channel = np.resize(order, (len(dilation), slots)).astype(np.int64)
    less = np.full(channel.shape, ALONE)
    if channels > 1:
        other = (channel + random.integers(1, channels, channel.shape)) % channels
        less = np.where(random.random(channel.shape) < DIFFERENCES, other, ALONE)
    places = min(PLACES, rows if shortest is None else max(1, rows // 2))
    biases = round(BIASES / len(dilation))
    return KernelFeatures(
        dilation=torch.from_numpy(dilation),
        channel=torch.from_numpy(channel),
        less=torch.from_numpy(less),
        place=torch.from_numpy((np.arange(places) + 0.5) / places),
        bias=torch.zeros(len(dilation), slots, len(_KERNELS) // slots, biases).double(),
    )


def kernels_of(slots: int, number: int) -> NDArray[np.float64]:
    """Return the kernels of each slot at a dilation, shape (slots, kernels of a slot, TAPS).

    They go round from dilation to dilation, so that a kernel meets several channels.

    Args:
        slots: How many there are: a divisor of 84.
        number: Of the dilation.
    """
    first = (np.arange(slots) + number) % slots
    return _KERNELS[first[:, None] + slots * np.arange(len(_KERNELS) // slots)]


def _all_kernels() -> NDArray[np.float64]:
    """Return all 84 kernels, shape (84, TAPS): their weights add up to 0."""
    found = np.full((84, TAPS), -1.0)
    for row, taps in enumerate(combinations(range(TAPS), 3)):
        found[row, list(taps)] = 2.0
    return found


_KERNELS = _all_kernels()
