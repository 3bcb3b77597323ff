"""What is tried: feature sets, and models on them, in families that make different mistakes.

A family's best is a member of the blend, so that a blend never rests on one kind of model.
Knows nothing about data.

Source: docs/decisions/0039.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from taxel.models.grid_features import IMAGE_BLOCKS
from taxel.models.kernel_features import KERNELS, TAPS
from taxel.models.touch_blocks import GRID, PARTS, UNIT, is_of_grids
from taxel.models.touch_features import fitting_blocks, seen_rows

Sets = dict[str, tuple[str, ...]]
"""Feature sets and their blocks."""
Family = Literal["discriminant", "linear", "trees", "perceptron", "network"]
FAMILIES: tuple[Family, ...] = ("discriminant", "linear", "trees", "perceptron", "network")

_FREE = ("shape", "course", "quantiles", "octaves", "spectrum", "correlation")
_UNIT = tuple(f"{UNIT}{name}" for name in ("level", "shape", "course"))
_COURSES = tuple(f"{GRID}{name}" for name in ("level", "tared", "shape", "course", "quantiles"))
_IMAGES = tuple(name for name in IMAGE_BLOCKS if name != "image patterns")
FEATURE_SETS: dict[str, tuple[str, ...]] = {
    "imprints and level": (*_COURSES, *IMAGE_BLOCKS, "level"),
    "all": ("level", "tared", *_FREE, "pattern"),
    "imprints": (*_COURSES, *IMAGE_BLOCKS),
    "imprints without patterns": (*_COURSES, *_IMAGES),
    "means": ("mean",),
    "without level": _FREE,
    "all with distributions": ("level", "tared", *_FREE, "pattern", "distribution"),
    "distributions without level": (*_FREE, "distribution"),
    "all with parts": ("level", "tared", *_FREE, "pattern", "parts"),
    "statistics": ("statistics",),
    "across the pad": (*_UNIT, *_FREE, "pattern"),
    "tared": ("tared", *_FREE),
    "start": ("start",),
    "both parts": ("parts", f"{UNIT}parts"),
    "both rows": ("rows", f"{UNIT}rows"),
    "rows across the pad": (f"{UNIT}rows",),
    "rows": ("rows",),
    "rows without level": ("centred",),
}
"""Name → blocks of `taxel.models.touch_blocks`; `feature_sets` adds `KERNELS`. That of grids and
levels comes first: all features of thousands of taxels may take all of the time."""
IMPRINTS = {"imprints", "imprints and level", "imprints without patterns"}
"""Sets of what is seen on grids of taxels."""
PLAIN = "means"
"""The set of each channel's level alone: often what a drift leaves best."""
LEVEL_FREE = (
    "without level", "distributions without level", "tared", "across the pad",
    "rows across the pad", "rows without level",
)  # fmt: skip
"""Sets that a drift of the channels' rest level, or of all of a pad's, leaves as they are."""
MOST_ROW_VALUES = 1500
"""Values of a window up to which its rows themselves are features; a single row always is, for it
has no other. Source: our choice, docs/decisions/0039."""
ROW_BLOCKS = {"rows", "centred"}
"""Blocks of a window's rows as they are."""
NETWORK_ROWS = (8, 800)
"""Rows of windows on which a convolutional network is tried; a longer one takes all the time.
Source: our choice, 0039."""


MODELS_BY_FREEDOM = (
    "winsorised-discriminant", "discriminant", "logistic", "extra-trees", "random-forest",
    "perceptron", "touchnet",
)  # fmt: skip
"""The least free first."""
MODEL_WORDS = {
    "winsorised-discriminant": "clipped discriminant",
    "logistic": "logistic regression",
    "random-forest": "random forest",
    "perceptron": "perceptrons",
    "touchnet": "TouchNet",
}
"""Models whose key is not what the leaderboard calls them."""
FEATURE_WORDS = {
    "all": "all features",
    "without level": "features without level",
    "means": "channel means",
    "all with distributions": "all features with distributions",
    "distributions without level": "features without level, with distributions",
    "all with parts": "all features with parts",
    "across the pad": "features across the pad",
    "tared": "tared features",
    "start": "the trial's start",
    "both parts": "parts, also across the pad",
    "both rows": "rows, also across the pad",
    KERNELS: "MiniRocket's kernels",
}
"""Feature sets whose key is not what the leaderboard calls them."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """One model on one set of features."""

    family: Family
    model: str
    """ridge of the linear model, kind of trees, …: a key of `fitting.FITS`."""
    features: str
    """A key of `FEATURE_SETS` or `KERNELS`; empty for a network, which sees the window."""
    strength: float = 0.0
    """What the model's one setting is: see `fitting`."""

    @property
    def kind(self) -> str:
        """Return what makes the same mistakes: a family on means, on kernels, on imprints, with
        level or without.

        A random forest is a kind of its own beside extra-trees: it looks for the best threshold, so
        that of many features that drift few are used.
        """
        name = "forest" if self.model == "random-forest" else self.family
        if self.features == PLAIN:
            return f"{name} of means"
        if self.features == KERNELS:
            return f"{name} of kernels"
        if self.features in IMPRINTS:
            return f"{name} of imprints"
        return f"{name}{' without level' if self.features in LEVEL_FREE else ''}"

    @property
    def camp(self) -> str:
        """Return what goes on alike beyond what was learned: a sum without bounds, one that
        leaves out what varies within classes, shares of leaves, or anything on kernels.
        """
        if self.features == KERNELS:
            return KERNELS
        return "sums" if self.family in ("linear", "perceptron") else self.family

    def freedom(self, sets: dict[str, tuple[str, ...]]) -> tuple[float, ...]:
        """Return how much it may fit, to be compared within its kind: less is safer.

        Args:
            sets: Feature sets and their blocks: more blocks, more features.
        """
        looser = self.model == "logistic"
        setting = self.strength if looser else -self.strength
        return (len(sets.get(self.features, ())), MODELS_BY_FREEDOM.index(self.model), setting)

    @property
    def name(self) -> str:
        """Return it in words, for the leaderboard."""
        model = MODEL_WORDS.get(self.model, self.model)
        setting = f" {self.strength:g}" if self.strength else ""
        on = f" on {self.seen}" if self.features else ""
        return f"{model}{setting}{on}"

    @property
    def kind_in_words(self) -> str:
        """Return its kind in words, as "extra-trees without level"."""
        model = MODEL_WORDS.get(self.model, self.model)
        if self.features in (PLAIN, KERNELS):
            return f"{model} on {self.seen}"
        if self.features in IMPRINTS:
            return f"{model} on imprints"
        return f"{model}{' without level' if self.features in LEVEL_FREE else ''}"

    @property
    def seen(self) -> str:
        """Return its feature set in words; empty for a network."""
        return FEATURE_WORDS.get(self.features, self.features)


def feature_sets(
    steps: int, channels: int, padded: bool = False, *, grids: bool = False, starts: bool = False
) -> dict[str, tuple[str, ...]]:
    """Return the feature sets that windows of this size have, without those that are alike.

    Rows themselves would show how much of a window is padding, and so a trial's length, and so
    would changes over more rows than a trial has; means over its parts do not.

    Args:
        steps: Rows in a window.
        channels: Of the array.
        padded: Whether some windows are padded.
        grids: Whether some channels lie in a grid.
        starts: Whether each window begins where its trial does.
    """
    rows = not padded and (steps == 1 or steps * channels <= MOST_ROW_VALUES)
    without = set() if rows else ROW_BLOCKS
    if padded:
        without = without | {"distribution"}
    if not starts:
        without = without | {"start"}
    if seen_rows(steps, channels) <= PARTS and not padded:
        without = without | {"parts"}
    found: dict[str, tuple[str, ...]] = {}
    for name, blocks in FEATURE_SETS.items():
        kept = tuple(block for block in blocks if block.removeprefix(UNIT) not in without)
        own = fitting_blocks(kept, steps, channels, grids=grids)
        whole = len(own) == len(blocks) or not ROW_BLOCKS & set(blocks)
        if any(map(is_of_grids, blocks)):  # a single row has no level but its rows
            whole = grids and ("level" in own or "level" not in blocks)
        if own and whole and own not in found.values():
            found[name] = own
    if steps >= TAPS:
        found[KERNELS] = (KERNELS,)
    return found


def discriminant(features: str, shrink: float) -> Candidate:
    """Return a linear discriminant: winsorised, unless it sees each channel's level alone.

    Args:
        features: A key of `FEATURE_SETS`.
        shrink: Of its covariance, 0…1.
    """
    model = "discriminant" if features == PLAIN else "winsorised-discriminant"
    return Candidate("discriminant", model, features, shrink)


def first_round(sets: dict[str, tuple[str, ...]], steps: int) -> list[Candidate]:
    """Return one of each kind, the most informative for its time first.

    All models on the broadest set; discriminants on all others, which say in no time what carries
    over; the network, and trees and a discriminant on kernels, which are like nothing else; all
    models on the next broad sets; last, on the other sets, logistic regression, perceptrons, and
    trees, which take most time.

    Args:
        sets: Feature sets of these windows, the broadest first.
        steps: Rows in a window.
    """

    def logistic(name: str) -> Candidate:
        return Candidate("linear", "logistic", name, 1.0 if name == PLAIN else 0.03)

    def trees(name: str) -> Candidate:
        return Candidate("trees", "extra-trees", name, 2)

    first, *others = [name for name in sets if name != KERNELS]
    early, late = others[:2], others[2:]
    candidates = [discriminant(first, 0.3), logistic(first), trees(first)]
    candidates += [discriminant(name, 0.3) for name in others]
    least, most = NETWORK_ROWS
    if least <= steps <= most:
        candidates.append(Candidate("network", "touchnet", ""))
    if KERNELS in sets:
        candidates += [trees(KERNELS), discriminant(KERNELS, 0.3)]
    candidates.append(Candidate("trees", "random-forest", first, 2))
    candidates += [model(name) for name in early for model in (logistic, trees)]
    candidates += [logistic(name) for name in late]
    candidates += [
        Candidate("perceptron", "perceptron", n, 3.0) for n in (first, *early) if n != PLAIN
    ]
    return candidates + [trees(name) for name in late]


def second_round(steady: list[str], linear: list[str], trees: list[str]) -> list[Candidate]:
    """Return finer models on the sets that did best, the most promising first.

    Args:
        steady: Feature sets that suit discriminants, the best first.
        linear: Those that suit logistic regression.
        trees: Those that suit trees.
    """
    free = next((name for name in linear if (name in LEVEL_FREE) != (linear[0] in LEVEL_FREE)), "")
    names = [name for name in (linear[0], free) if name not in ("", PLAIN)]
    if not names:
        names = [linear[0]]
    found = [discriminant(steady[0], shrink) for shrink in (0.1, 0.6)]
    found += [Candidate("perceptron", "perceptron", name, 3.0) for name in names]
    found += [Candidate("linear", "logistic", name, c) for c in (0.003, 0.3) for name in names]
    if trees[0] not in names:
        found += [Candidate("perceptron", "perceptron", trees[0], 3.0)]
    found += [Candidate("trees", "extra-trees", trees[0], leaf) for leaf in (10, 1)]
    found += [Candidate("trees", "random-forest", trees[0], 2)]
    return found
