"""Whether values change about as much as in training, or so much more or less that a unit is wrong.

A board that sends millivolts where a model learned volts gives complete windows, and the model
answers as if all were well. Training keeps how much each channel changes within a window; live,
windows that change far more than the loudest of training are counted, and reported once. Far less
is no fault by itself, as hands may be quiet: it is reported at the end alone, where nothing in a
whole session changed as touch does. It changes no decision. Knows nothing about models, sources or
screens.

Background of our choices: docs/decisions/0010.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.still_channels import Motion
from taxel.plain_text import visible

OTHER_SCALE: Final = 20.0
"""Times by which values may change more or less than in training; wrong prefixes of units are 1000
times, and gains of other days or pads hardly ever more than 5. Source: our choice,
docs/decisions/0010."""
_GAIN: Final = 5.0
"""Times by which a day's gains may be higher than in training. Source: as above."""
DUE: Final = 10
"""So many windows must change too much before that is reported live. Source: our choice, 0010."""
_OTHERS: Final = 10
"""So many others that change outweigh one of them: a knock now and then is no other unit. Source:
our choice, docs/decisions/0010."""
LEAST_WINDOWS: Final = 10
"""Of fewer windows nobody can say that nothing was touched. Source: our choice, 0010."""
_TOUCHES: Final = 3
"""So many windows must change as touch does: a glitch of all channels is none. Source: our choice,
docs/decisions/0010."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherScale:
    """Values that change far more than in training."""

    time_s: float
    """End of the window in which it was noticed, fitted clock, seconds."""
    share: float
    """How much the newest window changed, as a multiple of training's usual one."""
    unit: str
    """The unit that the bundle learned in."""

    def words(self) -> str:
        """Return it as a line of a log."""
        return scale_words(self.share, self.unit)


def scale_words(share: float, unit: str) -> str:
    """Return that values change another number of times as much as in training, and what to do.

    Args:
        share: How many times as much, above 0.
        unit: The unit of the training recordings.
    """
    times = f"{float(f'{share:.2g}'):,.15g}"
    return (
        f"values change about {times} times as much within a window as in training: check whether "
        f"they are in {visible(unit)}"
    )


class ScaleWatch:
    """Looks for windows that change far more than those of training, and for any touch at all.

    Memory and time are constant: two comparisons and two counts a window.

    Args:
        motion: What was usual in training; None where that is not known.
        unit: The unit of the channels' values in training.
        gate: What a value must exceed to be touch, in that unit; None where all rows are taken, or
            where the gate is not compared with values as they come.
    """

    def __init__(self, motion: Motion | None, unit: str, gate: float | None = None) -> None:
        every = np.zeros(0) if motion is None else motion.usual
        self._known = np.flatnonzero(every > 0)
        usual = every[self._known]
        self._usual, self._unit, self._gate = usual.astype(np.float32), unit, gate
        self._highest, self._windows = -np.inf, 0
        loudest = None if motion is None else motion.loudest
        times = np.inf if loudest is None else max(OTHER_SCALE, _GAIN * loudest)
        self._far = (times * usual).astype(np.float32)
        self._near = (usual / OTHER_SCALE).astype(np.float32)
        self._half = max(1, (len(usual) + 1) // 2)
        self._ahead, self._done = 0, False
        self._found: list[OtherScale] = []
        self._touches = 0

    @property
    def touched(self) -> bool:
        """True once half of the channels changed as touch does, in several windows."""
        return self._touches >= _TOUCHES

    @property
    def waits(self) -> bool:
        """True until the first window, where a gate lets rows through."""
        return self._gate is not None and not self._windows

    def wait(self, values: NDArray[np.float32]) -> None:
        """Take in rows that complete no window, while `waits`.

        Args:
            values: Usable ones, any shape, in the channels' unit.
        """
        if values.size:
            self._highest = max(self._highest, float(np.fmax.reduce(values, axis=None)))

    def waiting(self) -> str:
        """Return in words what the first window waits for; empty where it does not, or no value
        has come.
        """
        if self._gate is None or self._windows or not np.isfinite(self._highest):
            return ""
        gate = f"the gate of {self._gate:.3g} {visible(self._unit)}"
        if self._highest > self._gate:
            return f"above {gate}, but not yet for a whole window"
        return f"nothing above {gate} yet, {self._highest:.2g} at most"

    def untouched(self) -> str:
        """Return in words that nothing changed as touch does; empty where something did, or where
        so little came that nobody can say.
        """
        doubt = f"nothing was touched, or values are not in {visible(self._unit)}"
        if self.waiting() and self._gate is not None:
            gate = f"the gate of {self._gate:.3g} {visible(self._unit)}"
            if self._highest > self._gate:
                return f"no touch stayed above {gate} for a whole window: too short, or too weak"
            return f"nothing came above {gate}, {self._highest:.2g} at most: {doubt}"
        if not len(self._known) or self._windows < LEAST_WINDOWS or self.touched:
            return ""
        return f"no window changed as touch does in training: {doubt}"

    def look(self, moved: NDArray[np.float32] | None, time_s: float) -> None:
        """Take in one window.

        Args:
            moved: Range of each channel within it, shape (channels,), in the channels' units; None
                where it overlaps the last one that was looked at, or holds one row only.
            time_s: Its end, fitted clock, seconds.
        """
        self._windows += 1
        if moved is None or self._done:
            return
        moved = moved[self._known]
        if not self.touched and np.count_nonzero(moved >= self._near) >= self._half:
            self._touches += 1
        if np.count_nonzero(moved > self._far) >= self._half:
            self._ahead += _OTHERS
        elif self._ahead and np.count_nonzero(moved) >= self._half:
            self._ahead -= 1  # of windows without any change nobody can say
        if self._ahead >= _OTHERS * DUE:
            self._done = True
            share = float(np.median(moved / self._usual))
            self._found.append(OtherScale(time_s=time_s, share=share, unit=self._unit))

    def take(self) -> list[OtherScale]:
        """Return what was found since the last call; it is found once."""
        if not self._found:
            return []
        found, self._found = self._found, []
        return found
