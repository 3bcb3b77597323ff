"""Read cameras until a source ends, or for some of its seconds: moments and marks, in order.

A mark that lies between two frames of one read, as where a busy machine reads a stored file late,
comes between them: the frames behind it are another trial's.

Knows nothing about what is recognised, or about screens.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import inf

from taxel.signals import Frame, Mark
from taxel.sources.contract import Source
from taxel.windows.pairs import FramePairer, FrameSet

_IN_STEP_S = 0.1
"""Frames that go no further on than this since the last read are given before the marks are asked
for: a simulator makes its next moment first. Further on, a mark may lie between. Source: our
choice, docs/decisions/0019."""


def ends_grasp(mark: Mark) -> bool:
    """Return whether a mark ends a grasp: it holds the outcome. A hand's marks in the same file,
    and those of a person's reactions, do not, which in a replay hold their recording's outcome.
    """
    return "outcome" in mark.labels and "reaction" not in mark.labels


def ends_trial(mark: Mark, target: str) -> bool:
    """Return whether a mark ends a camera trial: it holds its label, a grasp's outcome, or nothing.

    A person's reaction does not. In a replay each mark also holds its recording's labels.

    Args:
        mark: Of the source.
        target: The label that is predicted.
    """
    if "reaction" in mark.labels:
        return False
    return not mark.labels or target in mark.labels or ends_grasp(mark)


def frames_and_marks(source: Source, last_s: float) -> Iterator[Frame | Mark]:
    """Yield what a source's read gave: frames, and each mark before the frames that follow its end.

    Args:
        source: An open source that has been read.
        last_s: When the newest frame of the reads before was taken, fitted clock, seconds; minus
            infinity where there was none.
    """
    frames = source.frames()
    if not frames or frames[-1].fitted_s - last_s <= _IN_STEP_S:
        yield from frames
        yield from source.marks()
        return
    marks = sorted(source.marks(), key=lambda mark: mark.end_s)
    for frame in frames:
        while marks and marks[0].end_s < frame.fitted_s:
            yield marks.pop(0)
        yield frame
    yield from marks


def moments_and_marks(
    source: Source,
    pairer: FramePairer,
    see: Callable[[Frame], None],
    seconds: float | None = None,
    stopped: Callable[[], bool] = lambda: False,
    silent: Callable[[], bool] = lambda: False,
) -> Iterator[FrameSet | Mark]:
    """Yield each moment that all cameras saw, and each mark behind the moments up to its end.

    Args:
        source: An open source with cameras.
        pairer: What joins the cameras' frames.
        see: Called with each frame, before the moment that it completes.
        seconds: Length on the frames' fitted clock, seconds; None has no end. Frames and marks
            beyond it are left out, however many a read gives at once.
        stopped: True once it shall end early.
        silent: Called after each read that gave nothing; True where none is waited for any more.
    """
    end_s: float | None = None
    last_s = -inf
    over = False
    while not (over or source.ended or stopped()):
        source.read()
        came = False
        for item in frames_and_marks(source, last_s):
            came = True
            if isinstance(item, Mark):
                if end_s is None or item.end_s < end_s:
                    yield item
                continue
            last_s = item.fitted_s
            if end_s is None:
                end_s = last_s + (inf if seconds is None else seconds)
            over = over or last_s >= end_s
            if over:
                continue
            see(item)
            found = pairer.push(item)
            if found is not None:
                yield found
        over = over or (not came and silent())
