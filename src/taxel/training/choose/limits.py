"""Train what was chosen so that its bundle keeps to its limits of size and time.

A member that costs too much is given up, with all that see the same features where it is time
that lacks, and what is left is blended anew. Done in each outer fold as at the end, so that the
outer score is of what is shipped. Knows nothing about scores of test trials.

Source: docs/decisions/0039.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from torch import nn

from taxel.models.blend import Blend
from taxel.training.choose.candidates import Candidate
from taxel.training.choose.choice import Choice
from taxel.training.choose.costs import Cost, cost_of
from taxel.training.choose.fit_choice import copies, fit_choice
from taxel.training.choose.preparations import Prepared
from taxel.training.choose.search import Found

MINUTES = 5.0
"""Default: to choose and train. Source: issue 16."""
MOST_MB, MOST_US = 20.0, 2000.0
"""Defaults: megabytes of a bundle, microseconds a window on one core. Source: issue 16."""
BARE: Final = 0.85
"""Share of a window's time that the bare model may take: the bundle's own checks and scaling, timed
later, take the rest. Source: our choice, docs/decisions/0039."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What choosing and its result may take."""

    minutes: float = MINUTES
    most_mb: float = MOST_MB
    """Of the exported model, packed."""
    most_us: float = MOST_US
    """Of one window on one core."""

    @property
    def bare_us(self) -> float:
        """Return what the bare model may take of it."""
        return BARE * self.most_us


USUAL_LIMITS = Limits()
"""Source: issue 16."""


@dataclass(frozen=True, slots=True)
class Fitted:
    """A trained blend within its limits."""

    choice: Choice
    blend: Blend
    given_up: tuple[str, ...]
    """What was left out for the limits, and what that cost in inner accuracy."""


def fit_within(
    found: Found,
    train: Sequence[int],
    limits: Limits = USUAL_LIMITS,
    *,
    seed: int = 0,
    cost: Callable[[Blend, Prepared], Cost] | None = None,
) -> Fitted:
    """Blend and train; leave out what makes the blend too large or too slow.

    Args:
        found: What was tried.
        train: Indices of the trials to learn from.
        limits: Megabytes and microseconds.
        seed: Of all that is random.
        cost: Measures a blend; `cost_of` unless given.
    """
    measure = cost or cost_of
    heads: dict[tuple[Candidate, int], nn.Module] = {}
    without: set[Candidate] = set()
    given_up: list[str] = []
    whole = choice = found.choice()
    while True:
        blend = fit_choice(choice, found.base, found.part.prepared, train, seed, heads)
        now = measure(blend, found.part.prepared)
        slow = now.us > limits.bare_us and len(_units(choice)) > 1
        large = now.mb > limits.most_mb and len(choice.members) > 1
        if not slow and not large:
            return Fitted(choice, blend, tuple(given_up))
        name, unit = _dearest(choice, blend, found.part.prepared, slow=slow)
        without |= _all_of(found, unit, slow=slow)
        choice = found.choice(without)
        given_up.append(
            f"{name}: {now.mb:.1f} MB and {now.us:.0f} µs with it; inner accuracy "
            f"{whole.accuracy:.4f} → {choice.accuracy:.4f}"
        )


def _units(choice: Choice) -> list[tuple[str, ...] | Candidate]:
    """Return what can be left out to save time: a set of features with all on it, or a network."""
    return list(dict.fromkeys(member.blocks or member.candidate for member in choice.members))


def _dearest(
    choice: Choice, blend: Blend, prepared: Prepared, *, slow: bool
) -> tuple[str, tuple[str, ...] | Candidate]:
    """Return what to give up, its name first: where time lacks, that without which the rest takes
    least; else the member with most numbers.
    """
    if not slow:
        sizes = [sum(t.numel() for t in head.state_dict().values()) for head in blend.heads]
        heavy = copies(choice)[int(np.argmax(sizes))][0].candidate
        return heavy.name, heavy
    units = [member.blocks or member.candidate for member, _ in copies(choice)]
    window = _one_window(prepared)
    left = {
        unit: blend.seconds(*window, [n for n, other in enumerate(units) if other != unit])
        for unit in dict.fromkeys(units)
    }
    unit = min(left, key=lambda key: left[key])
    own = [m.candidate for m in choice.members if (m.blocks or m.candidate) == unit]
    return (own[0].name if isinstance(unit, Candidate) else f"every model on {own[0].seen}"), unit


def _all_of(found: Found, unit: tuple[str, ...] | Candidate, *, slow: bool) -> set[Candidate]:
    tried = [own.candidate for _, part, own in found.board if part is found.part]
    if slow:
        return {own for own in tried if unit in (found.sets.get(own.features, ()), own)}
    return {own for own in tried if own == unit}


def _one_window(prepared: Prepared) -> tuple[torch.Tensor, torch.Tensor]:
    windows = prepared.dataset.windows
    return torch.from_numpy(windows.values[:1]), torch.from_numpy(windows.mask[:1])
