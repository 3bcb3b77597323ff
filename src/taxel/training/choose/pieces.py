"""What the pieces of a blend take in the engine that runs it: its features, its forests, its
networks.

PyTorch's own times would not do: it takes thirteen times as long as the engine for a network's many
small steps, and three times for features, so that the network would always seem the slowest.
Knows nothing about limits, or about what is given up to keep to them.

Source: docs/decisions/0039.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import torch
from torch import Tensor, nn

from taxel.bundles.writer import export_onnx
from taxel.models.heads import TreesHead
from taxel.models.kernel_features import KERNELS, drawn_kernels
from taxel.models.onnx_session import WindowModel
from taxel.models.touch_blocks import GRID, UNIT
from taxel.models.touch_features import TouchFeatures
from taxel.training.choose.candidates import PLAIN, Candidate, Sets
from taxel.training.choose.choice import Choice
from taxel.training.choose.costs import quietest_of
from taxel.training.choose.fit_choice import Heads, copies_of
from taxel.training.choose.preparations import Prepared

_MEANS = "mean"
"""The block that has nothing but what all others need, too."""
_BEFORE = (UNIT, GRID)
"""Before blocks of what is made of a window's rows: it has means, too, which all others need."""
LARGE = 5000
"""Values of a window from where on its features are timed before any is tried. Source: our choice,
docs/decisions/0039."""
FOR_FEATURES = 0.75
"""Share of a window's time that features may take; models on them need the rest. Source: as
above."""


def _needs(block: str) -> tuple[str, ...]:
    """Return the blocks beside which a block is timed: none for the first."""
    if block == _MEANS:
        return ()
    own = next((f"{before}{_MEANS}" for before in _BEFORE if block.startswith(before)), block)
    return (_MEANS, own) if own != block else (_MEANS,)


def _with(block: str) -> tuple[str, ...]:
    return (*_needs(block), block)


class _OnFeatures(nn.Module):
    """A head as a model by itself: its features are the only row of a window."""

    def __init__(self, head: nn.Module) -> None:
        super().__init__()
        self.head = head

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        found: Tensor = self.head((values[:, 0] * mask).double())
        return found


class _Features(nn.Module):
    """Features as a blend computes them: without the mask where no row is padding."""

    def __init__(self, blocks: tuple[str, ...], prepared: Prepared, steps: int) -> None:
        super().__init__()
        self.blocks = blocks
        plain = tuple(block for block in blocks if block != KERNELS)
        self.features = nn.ModuleList([TouchFeatures(plain, prepared.pads, prepared.grids)])
        if KERNELS in blocks:
            self.features.append(drawn_kernels(steps, len(prepared.pads)))
        self.padded = prepared.config.pad

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        measured = mask if self.padded else None
        return torch.cat([features(values, measured) for features in self.features], dim=1)


class _Beside(nn.Module):
    """Networks that see the same window: what they have in common is computed once."""

    def __init__(self, networks: list[nn.Module]) -> None:
        super().__init__()
        self.networks = nn.ModuleList(networks)

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        return torch.stack([network(values, mask) for network in self.networks]).sum(dim=0)


class _Nothing(nn.Module):
    """What is only called."""

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        return values[:, 0] * mask[:, :1]


def engine_us(models: Sequence[nn.Module], values: Tensor, mask: Tensor) -> list[float]:
    """Return the microseconds that each model takes for one window.

    Args:
        models: forward(values, mask) → anything.
        values: Shape (1, steps, channels).
        mask: Shape (1, steps).
    """
    exported = [export_onnx(model.eval(), *values.shape[1:]) for model in models]
    runs = [WindowModel(model) for model in exported]
    return quietest_of(runs, values.numpy(), mask.numpy())


@dataclass(slots=True)
class Pieces:
    """Times of pieces, each measured once for all folds.

    Args:
        measure: Times models on one window.
    """

    measure: Callable[[Sequence[nn.Module], Tensor, Tensor], list[float]] = engine_us
    _known: dict[tuple[object, ...], float] = field(default_factory=dict)

    def us(self, choice: Choice, prepared: Prepared, heads: Heads) -> float:
        """Return about how many microseconds a choice takes for one window, for comparison.

        Linear heads take next to nothing. A forest that was not fitted takes as long as the slowest
        that was.

        Args:
            choice: What it consists of.
            prepared: The windows.
            heads: Those that were fitted, by candidate and copy.
        """
        windows = prepared.dataset.windows
        window = torch.from_numpy(windows.values[:1]), torch.from_numpy(windows.mask[:1])
        shape = windows.values.shape[1:]
        blocks = tuple(sorted({name for member in choice.members for name in member.blocks}))
        total = 0.0
        if blocks:
            total += self._features(blocks, prepared, *window)
        for member in choice.members:
            member_heads = [heads[member.candidate, copy] for copy in range(copies_of(member))
                            if (member.candidate, copy) in heads]  # fmt: skip
            if member.candidate.family == "network" and member_heads:
                total += self._us((member.candidate, shape), _Beside(member_heads), *window)
            elif member.candidate.family == "trees":
                total += self._forest(member.candidate, member_heads, shape)
        return total

    def quick_sets(
        self, sets: Sets, prepared: Prepared, most_us: float
    ) -> tuple[Sets, tuple[str, ...]]:
        """Return feature sets that are quick enough, and the blocks that none of them has.

        From each set the block that takes longest goes, until the rest is quick enough; sets that
        are alike then are one. So the time to choose is not spent on models that no bundle may
        have.

        Args:
            sets: Feature sets and their blocks, the broadest first.
            prepared: The windows.
            most_us: Microseconds that a window may take.
        """
        windows = prepared.dataset.windows
        _, steps, channels = windows.values.shape
        if steps * channels <= LARGE or most_us == float("inf"):
            return sets, ()
        window = torch.from_numpy(windows.values[:1]), torch.from_numpy(windows.mask[:1])
        shape, quick = (steps, channels), dict[str, tuple[str, ...]]()
        for name, blocks in sets.items():
            self._features(blocks, prepared, *window)
            kept = sorted(blocks, key=lambda block: self._known[block, shape])
            while kept and self._features(tuple(kept), prepared, *window) > FOR_FEATURES * most_us:
                kept.pop()
            blocks_kept = tuple(block for block in blocks if block in kept)
            if blocks_kept and blocks_kept not in quick.values():
                quick[name] = blocks_kept
        if not quick:
            least = PLAIN if PLAIN in sets else next(iter(sets))  # one row has no means
            quick = {least: sets[least]}
        if next(iter(quick)) == PLAIN:  # the broadest set comes first
            quick[PLAIN] = quick.pop(PLAIN)
        if KERNELS in quick:  # and kernels, which are no part of it, last
            quick[KERNELS] = quick.pop(KERNELS)
        everything, left = (
            {b for blocks in some.values() for b in blocks} for some in (sets, quick)
        )
        return quick, tuple(sorted(everything - left))

    def _features(
        self, blocks: tuple[str, ...], prepared: Prepared, values: Tensor, mask: Tensor
    ) -> float:
        """Return what blocks take together: each once, beside what all of its kind need.

        Each is timed beside the channels' means, those of rows standardised across a pad or of
        imprints on grids beside their means, too: of sets that have nearly all in common the slower
        one would be a matter of chance.
        """
        shape = values.shape[1:]
        needed = dict.fromkeys(need for block in blocks for need in _needs(block))
        wanted = tuple(dict.fromkeys((_MEANS, *needed, *blocks)))
        new = [block for block in wanted if (block, shape) not in self._known]
        if new:
            ways = [way for block in new for way in (_needs(block), _with(block)) if way]
            timed = list(dict.fromkeys(ways))
            models = [_Features(own, prepared, shape[0]) for own in timed]
            us = dict(zip(timed, self.measure(models, values, mask), strict=True))
            for block in new:
                spent = us[_with(block)] - us.get(_needs(block), 0.0)
                self._known[block, shape] = max(spent, 0.0)
        return sum(self._known[block, shape] for block in wanted)

    def _forest(self, candidate: Candidate, fitted: list[nn.Module], shape: object) -> float:
        head = fitted[0] if fitted else None
        if not isinstance(head, TreesHead):
            known = [us for key, us in self._known.items() if key[0] == "forest"]
            return max(known, default=0.0)
        columns = int(head.column.max()) + 1
        features, mask = torch.zeros(1, 1, columns), torch.ones(1, 1, dtype=torch.bool)
        return self._us(("forest", candidate, shape), _OnFeatures(head), features, mask)

    def _us(self, key: tuple[object, ...], model: nn.Module, values: Tensor, mask: Tensor) -> float:
        if ("nothing",) not in self._known:
            own = torch.zeros(1, 1, 1), torch.ones(1, 1, dtype=torch.bool)
            self._known["nothing",] = self.measure([_Nothing()], *own)[0]
        if key not in self._known:
            spent = self.measure([model], values, mask)[0] - self._known["nothing",]
            self._known[key] = max(spent, 0.0)
        return self._known[key]
