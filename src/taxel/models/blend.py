"""A blend of recognisers that were chosen together: features, heads, weights, one temperature.

What it consists of stands in its own weights, as JSON in the buffer `plan`, so that it is saved,
loaded and exported as any network. Knows nothing about how it was chosen.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from taxel.errors import BadInput
from taxel.foreign.json_text import Fields, parse_json
from taxel.models.grid_features import SMALLEST, Grid, Grids
from taxel.models.heads import HEADS, TreesHead, walk
from taxel.models.kernel_features import KERNELS, KernelFeatures
from taxel.models.touch_blocks import is_block, is_of_grids
from taxel.models.touch_features import TouchFeatures

EXPERT = "expert"
"""What a contract calls such a model."""
LEAST_PROBABILITY = 1e-6
"""Source: our choice, docs/decisions/0039."""
DOUBT = 0.005
"""Share of its certainty in a window that a blend spreads over all classes: no recordings show that
touch of a kind never met is recognised more surely. Source: our choice, docs/decisions/0039."""
NETWORK = "network:"
"""Begins the name of a head that is a network of the catalogue."""
_MOST_MEMBERS = 64
_MOST_ROWS = 100
"""Rows that a plan may have a network see as one."""
_LARGEST_PLAN = 100_000
"""Bytes of a plan; those of `taxel train` have some thousands."""


@dataclass(frozen=True, slots=True)
class Part:
    """One member of a blend."""

    head: str
    """A key of `HEADS`, or "network:NAME" for a network of the catalogue; "network:NAME/2" for one
    that sees the mean of each two rows."""
    blocks: tuple[str, ...]
    """Its features; none for a network, which sees the window."""


@dataclass(frozen=True, slots=True)
class Plan:
    """What a blend consists of."""

    steps: int
    pads: tuple[int, ...]
    """Each channel's pad; see `taxel.models.touch_features.pads_of`."""
    classes: int
    parts: tuple[Part, ...]
    padded: bool = True
    """Whether rows of a window may be padding; where none may, features are computed without the
    mask, with 40 % fewer operators."""
    grids: Grids = ()
    """Where channels lie; see `taxel.models.grid_features.grids_of`."""
    every_row: bool = False
    """Whether features see every row of a large window, as they did in earlier checkouts; else
    evenly spaced ones, see `taxel.models.touch_features.seen_rows`."""


class ScaledNetwork(nn.Module):
    """A network of the catalogue behind its own scaling.

    Args:
        network: forward(values, mask) → logits.
        channels: Of the array.
        thin: Rows whose mean it sees as one.
    """

    offset: Tensor
    factor: Tensor

    def __init__(self, network: nn.Module, channels: int, thin: int = 1) -> None:
        super().__init__()
        self.network = network
        self.thin = thin
        self.register_buffer("offset", torch.zeros(channels))
        self.register_buffer("factor", torch.ones(channels))

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        """Return logits, shape (n, classes), of unscaled windows."""
        scaled = (values - self.offset) * self.factor * mask.unsqueeze(2)
        found: Tensor = self.network(*thinned(scaled, mask, self.thin))
        return found


def thinned(values: Tensor, mask: Tensor, rows: int) -> tuple[Tensor, Tensor]:
    """Return means over blocks of `rows` rows, and which blocks have no padding.

    Args:
        values: Shape (n, steps, channels).
        mask: Shape (n, steps), False where a row is padding.
        rows: How many become one; those left over at the end are dropped.

    Returns:
        Shapes (n, steps / rows, channels) and (n, steps / rows).
    """
    if rows == 1:
        return values, mask
    mean = functional.avg_pool1d(values.transpose(1, 2), rows).transpose(1, 2)
    measured = functional.avg_pool1d(mask.to(values.dtype).unsqueeze(1), rows).squeeze(1)
    return mean, measured > 1.0 - 0.5 / rows


class Blend(nn.Module):
    """Members' probabilities, each at its own temperature, weighted; one temperature on all, and
    the rest of doubt that always stays.

    Args:
        plan: What it consists of; None for one whose weights are about to be loaded.
        heads: One a part, fitted.
        weights: One a part; their sum is 1.
        sharpness: One a part: what its logits are multiplied by.
        last: What the logarithm of the whole is multiplied by.
        kernels: Fitted features, where a part sees `KERNELS`.
    """

    plan: Tensor
    weights: Tensor
    sharpness: Tensor
    last: Tensor

    def __init__(
        self,
        plan: Plan | None = None,
        heads: tuple[nn.Module, ...] = (),
        weights: tuple[float, ...] = (),
        sharpness: tuple[float, ...] = (),
        last: float = 1.0,
        kernels: KernelFeatures | None = None,
    ) -> None:
        super().__init__()
        text = json.dumps(asdict(plan)) if plan is not None else ""
        self.register_buffer("plan", torch.tensor(list(text.encode()), dtype=torch.uint8))
        self.register_buffer("weights", torch.tensor(weights))
        self.register_buffer("sharpness", torch.tensor(sharpness))
        self.register_buffer("last", torch.tensor(last))
        self.heads = nn.ModuleList(heads)
        self.features = nn.ModuleList()
        self._seen: list[int | None] = []
        self._padded = True
        if plan is not None:
            self._share_features(plan, kernels)

    def _share_features(self, plan: Plan, kernels: KernelFeatures | None = None) -> None:
        """Compute each set of features once, however many members see it.

        Args:
            plan: What there is.
            kernels: Those that are fitted; None: they are about to be loaded.
        """
        sets = list(dict.fromkeys(part.blocks for part in plan.parts if part.blocks))
        self.features = nn.ModuleList(
            kernels or KernelFeatures()
            if blocks == (KERNELS,)
            else TouchFeatures(blocks, plan.pads, plan.grids, every_row=plan.every_row)
            for blocks in sets
        )
        self._padded = plan.padded
        self._seen = [sets.index(part.blocks) if part.blocks else None for part in plan.parts]

    def forward(self, values: Tensor, mask: Tensor) -> Tensor:
        """Return logits, shape (n, classes).

        Args:
            values: Unscaled windows, shape (n, steps, channels).
            mask: Shape (n, steps).
        """
        measured = mask if self._padded else None
        sets = [features(values, measured) for features in self.features]
        given = [(values, mask) if seen is None else (sets[seen],) for seen in self._seen]
        total = None
        for number, logits in self._logits(range(len(given)), given).items():
            share = torch.softmax(logits * self.sharpness[number], dim=1) * self.weights[number]
            total = share if total is None else total + share
        assert total is not None
        sure = torch.softmax(self.last * torch.log(total.clamp(min=LEAST_PROBABILITY)), dim=1)
        return torch.log((1.0 - DOUBT) * sure + DOUBT / sure.shape[1])

    def _logits(
        self, parts: Sequence[int], given: Sequence[tuple[Tensor, ...]]
    ) -> dict[int, Tensor]:
        """Return some parts' logits, shape (n, classes) each, forests walked together.

        Args:
            parts: Their places.
            given: What each of all parts sees.
        """
        trees = {n: head for n in parts if isinstance(head := self.heads[n], TreesHead)}
        seen = [given[n][0] for n in trees]
        walked = walk(tuple(trees.values()), seen) if trees else ()
        found = dict(zip(trees, walked, strict=True))
        return {n: found[n] if n in found else self.heads[n](*given[n]) for n in parts}

    def _load_from_state_dict(self, state_dict: Any, prefix: str, *rest: Any) -> None:
        for name in ("plan", "weights", "sharpness"):
            if prefix + name in state_dict:
                setattr(self, name, torch.empty_like(state_dict[prefix + name]))
        if prefix + "plan" in state_dict:
            plan = read_plan(bytes(state_dict[prefix + "plan"].tolist()))
            self.heads = nn.ModuleList(_empty_head(plan, part) for part in plan.parts)
            self._share_features(plan)
        super()._load_from_state_dict(state_dict, prefix, *rest)


def read_plan(text: bytes) -> Plan:
    """Return the plan that a blend's weights hold.

    Raises:
        BadInput: It is none, or names what there is not.
    """
    try:
        if len(text) > _LARGEST_PLAN:
            raise ValueError("longer than any plan")
        given = Fields(parse_json(text), "the plan")
        steps, classes = (given.count(name, 1, 1_000_000) for name in ("steps", "classes"))
        pads = tuple(int(pad) for pad in given.array("pads", (None,)))
        parts = tuple(_part(Fields(raw, "a part"), steps) for raw in given.items("parts"))
        if not 0 < len(parts) <= _MOST_MEMBERS:
            raise ValueError(f"{len(parts)} members")
        # Older weights do not say.
        padded = given.flag("padded") if "padded" in given else True
        every_row = given.flag("every_row") if "every_row" in given else True
        grids = _grids(given, len(pads)) if "grids" in given and given.items("grids") else ()
        if not grids and any(is_of_grids(name) for part in parts for name in part.blocks):
            raise ValueError("features of grids, and no grid")
        return Plan(steps, pads, classes, parts, padded, grids, every_row)
    except ValueError as error:  # BadFile is one
        got = str(getattr(error, "got", error))
        raise BadInput("a blend's plan", got, "train it again with: taxel train") from error


def _grids(given: Fields, channels: int) -> Grids:
    found, taken = [], set[int]()
    for own in given.array("grids", (None, len(Grid._fields))):
        if (own != np.trunc(own)).any() or (np.abs(own) > channels).any():
            raise ValueError("a grid of channels that there are not")
        grid = Grid(*(int(number) for number in own))
        count = grid.rows * grid.columns
        if min(grid.rows, grid.columns) < SMALLEST or count > channels:
            raise ValueError(f"a grid of {grid.rows} × {grid.columns}")
        numbers = set(grid.channels.tolist())
        if not numbers <= set(range(channels)) or len(numbers) < count or numbers & taken:
            raise ValueError("a grid of channels that there are not, or twice")
        taken |= numbers
        found.append(grid)
    return tuple(found)


def _part(given: Fields, steps: int) -> Part:
    head, blocks = given.text("head"), given.texts("blocks")
    unknown = [name for name in blocks if not is_block(name) and blocks != (KERNELS,)]
    network = head.startswith(NETWORK) and _rows_fit(head, steps)
    if unknown or (head not in HEADS and not network):
        raise ValueError(f"{head} on {', '.join(blocks)}")
    return Part(head, blocks)


def _rows_fit(head: str, steps: int) -> bool:
    """Return whether a network's rows, where it names them, are few and no more than a window's."""
    _, named, rows = head.partition("/")
    if not named:
        return True
    is_count = rows.isascii() and rows.isdecimal() and len(rows) <= len(str(_MOST_ROWS))
    return is_count and 0 < int(rows) <= min(_MOST_ROWS, steps)


def _empty_head(plan: Plan, part: Part) -> nn.Module:
    if part.head in HEADS:
        return HEADS[part.head]()
    from taxel.models.catalogue import find_network

    name, _, rows = part.head.removeprefix(NETWORK).partition("/")
    thin = int(rows or 1)
    built = find_network(name).build(plan.steps // thin, len(plan.pads), plan.classes)
    return ScaledNetwork(built, len(plan.pads), thin)
