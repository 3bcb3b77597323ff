"""How a set of camera trials is cut: crops that fit into the shortest trial.

Every trial shows as many different frames a crop as the shortest has, down to a single image: were
shorter trials filled up beside longer ones, standing still would show their length. Knows nothing
about images.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from taxel.errors import BadInput
from taxel.plain_text import number_of
from taxel.windows.trial_crops import LEAST_CROP, PLACES

LONGEST_CROP: Final = 48
"""Images of a crop where all trials are longer: 2 s at 25 images a second. Source: our choice,
docs/decisions/0041."""
CROP_HZ: Final = 25.0
"""Images a second of a crop of the part in which something moves: of faster cameras some are left
out, as far as the shortest trial still fills a crop. All that is measured in a crop was made for
it. Source: our choice, docs/decisions/0041."""
BETWEEN: Final = 6, 2, 0
"""Crops between the places, even numbers, of which the most are taken that `MOST_CROPS` allow."""
MOST_CROPS: Final = 3000
"""Of all trials, with those between the places: one of two cameras and 48 frames takes 0.5 s.
Source of both: our choice, docs/decisions/0041."""

SHIFTED_COPIES: Final = 3
MOST_SHIFTED: Final = 3000
"""Shifted copies of each crop, fewer where all crops would have more than so many. Source: our
choice, docs/decisions/0041."""


@dataclass(frozen=True, slots=True)
class Layout:
    """How trials are cut, the same for all of a set."""

    crop: int
    """Images in a crop."""
    places: int
    """1 or 3 crops a trial."""
    moving: bool = False
    """Whether three crops are taken from the part of a trial in which something moves, as
    `taxel.windows.trial_stretch` finds it, or from all of it."""
    step: int = 1
    """Frames from a crop's image to its next."""

    @property
    def span(self) -> int:
        """Frames from a crop's first image to its last, both counted."""
        return (self.crop - 1) * self.step + 1

    @property
    def words(self) -> str:
        """What a crop is, such as "48 frames", or "48 images, one in 4 of 189 frames"."""
        if self.step > 1:
            return f"{self.crop} images, one in {self.step} of {self.span} frames"
        return number_of(self.crop, "frame")

    def starts(self, part: range) -> list[int]:
        """Return the first frames of a trial's crops, in the order of `PLACES`.

        Args:
            part: Frames that crops are taken from, as many as one spans or more.
        """
        last = len(part) - self.span
        return [part.start + at for at in (0, last // 2, last)][: self.places]

    def between(self, part: range, count: int) -> list[int]:
        """Return the first frames of crops between the places, evenly apart.

        As many whatever a trial's length; none where a trial is one crop.

        Args:
            part: Frames that crops are taken from.
            count: How many, even: half of them before the middle crop.
        """
        last, each = len(part) - self.span, count // 2
        parts = [*range(1, each + 1), *range(each + 2, 2 * each + 2)]
        starts = [part.start + last * at // (2 * each + 2) for at in parts]
        return starts if self.places > 1 else []

    @property
    def every(self) -> int:
        """Frames after which a running trial is looked at again: half a crop."""
        return max(1, self.span // 2)


def choose_layout(
    lengths: Sequence[int],
    crop: int | None = None,
    *,
    rate_hz: float = CROP_HZ,
    moving: bool = False,
    shortest_name: str = "",
) -> Layout:
    """Return crops that fit into the shortest trial.

    Args:
        lengths: Frames of each trial.
        crop: Images in a crop; the shortest trial's frames, `LONGEST_CROP` at most, unless given.
        rate_hz: Frames a second.
        moving: Whether three crops are taken from the part in which something moves, and of fast
            cameras one image in several.
        shortest_name: What the shortest trial is called, for the message.

    Raises:
        BadInput: The crop asked for is too short or too long for a trial.
    """
    shortest = min(lengths)
    least = min(LEAST_CROP, shortest)
    if crop is not None and not least <= crop <= shortest:
        named = f", {shortest_name}" if shortest_name else ""
        raise BadInput(
            f"--crop of {least} to {shortest} frames, the shortest trial's{named}", str(crop),
            "choose another, or leave it out",
        )  # fmt: skip
    chosen = crop or min(shortest, LONGEST_CROP)
    if max(lengths) == chosen:
        return Layout(chosen, 1)
    step = max(1, min(round(rate_hz / CROP_HZ), shortest // chosen)) if moving else 1
    return Layout(chosen, len(PLACES), moving, step)


def count_between(layout: Layout, trials: int) -> int:
    """Return how many crops between the places each of so many trials is learned from by."""
    if layout.places == 1:
        return 0
    return next((n for n in BETWEEN if trials * (layout.places + n) <= MOST_CROPS), BETWEEN[-1])


def count_shifted(layout: Layout, trials: int) -> int:
    """Return how many shifted copies of each crop of so many trials are learned from."""
    return min(SHIFTED_COPIES, MOST_SHIFTED // (trials * layout.places))
