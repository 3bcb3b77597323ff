"""Read cameras until a source ends, or for some of its seconds: moments and marks, in order.

Knows nothing about what is recognised, or about screens.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import inf

from taxel.signals import Frame, Mark
from taxel.sources.contract import Source
from taxel.windows.pairs import FramePairer, FrameSet


def moments_and_marks(
    source: Source,
    pairer: FramePairer,
    see: Callable[[Frame], None],
    seconds: float | None = None,
) -> Iterator[FrameSet | Mark]:
    """Yield each moment that all cameras saw, and each mark behind the moments of its read.

    Args:
        source: An open source with cameras.
        pairer: What joins the cameras' frames.
        see: Called with each frame, before the moment that it completes.
        seconds: Length on the frames' fitted clock, seconds; None has no end. Frames and marks
            beyond it are left out, however many a read gives at once.
    """
    end_s: float | None = None
    over = False
    while not (over or source.ended):
        source.read()
        for frame in source.frames():
            if end_s is None:
                end_s = frame.fitted_s + (inf if seconds is None else seconds)
            over = frame.fitted_s >= end_s
            if over:
                break
            see(frame)
            found = pairer.push(frame)
            if found is not None:
                yield found
        for mark in source.marks():
            if end_s is None or mark.end_s < end_s:
                yield mark
