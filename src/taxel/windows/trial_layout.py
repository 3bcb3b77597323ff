"""How a set of camera trials is cut: crops that fit into the shortest trial.

Every trial shows as many different frames a crop as the shortest has, down to a single image: were
shorter trials filled up beside longer ones, standing still would show their length. Knows nothing
about images.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from taxel.errors import BadInput
from taxel.windows.trial_crops import LEAST_CROP, PLACES, Layout

LONGEST_CROP: Final = 48
"""Images of a crop where all trials are longer: 2 s at 25 images a second. Source: our choice,
docs/decisions/0041."""
CROP_HZ: Final = 25.0
"""Images a second of a crop: of faster cameras some are left out, as far as the shortest trial
still fills a crop. All that is measured in a crop was made for it. Source: our choice,
docs/decisions/0041."""
BETWEEN: Final = 6, 2, 0
"""Crops between the places, even numbers, of which the most are taken that `MOST_CROPS` allow."""
MOST_CROPS: Final = 3000
"""Of all trials, with those between the places: one of two cameras and 48 frames takes 0.5 s.
Source of both: our choice, docs/decisions/0041."""

SHIFTED_COPIES: Final = 3
MOST_SHIFTED: Final = 3000
"""Shifted copies of each crop, fewer where all crops would have more than so many. Source: our
choice, docs/decisions/0041."""


def choose_layout(
    lengths: Sequence[int],
    crop: int | None = None,
    *,
    rate_hz: float = CROP_HZ,
    moving: bool = True,
) -> Layout:
    """Return crops that fit into the shortest trial.

    Args:
        lengths: Frames of each trial.
        crop: Images in a crop; the shortest trial's frames, `LONGEST_CROP` at most, unless given.
        rate_hz: Frames a second.
        moving: Whether three crops are taken from the part in which something moves.

    Raises:
        BadInput: The crop asked for is too short or too long for a trial.
    """
    shortest = min(lengths)
    least = min(LEAST_CROP, shortest)
    if crop is not None and not least <= crop <= shortest:
        raise BadInput(
            f"--crop of {least} to {shortest} frames, the shortest trial's", str(crop),
            "choose another, or leave it out",
        )  # fmt: skip
    chosen = crop or min(shortest, LONGEST_CROP)
    if max(lengths) == chosen:
        return Layout(chosen, 1)
    step = max(1, min(round(rate_hz / CROP_HZ), shortest // chosen))
    return Layout(chosen, len(PLACES), moving, step)


def count_between(layout: Layout, trials: int) -> int:
    """Return how many crops between the places each of so many trials is learned from by."""
    if layout.places == 1:
        return 0
    return next((n for n in BETWEEN if trials * (layout.places + n) <= MOST_CROPS), BETWEEN[-1])


def count_shifted(layout: Layout, trials: int) -> int:
    """Return how many shifted copies of each crop of so many trials are learned from."""
    return min(SHIFTED_COPIES, MOST_SHIFTED // (trials * layout.places))
