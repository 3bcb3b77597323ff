"""What `taxel view` does with tactile cameras: one moment, a line a camera, and a figure."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from taxel.cli.printing import print_json, say
from taxel.recordings.whole import write_whole
from taxel.sources.contract import Source
from taxel.windows.pairs import FramePairer, FrameSet

if TYPE_CHECKING:
    from taxel.views.gel_moment import Moment


def view_cameras(
    source: Source, url: str, moment: Moment, png: Path | None, *, as_json: bool
) -> None:
    """Print what each camera of a source shows at a moment, and draw it where asked.

    Args:
        source: An open source with cameras.
        url: Its address, for people.
        moment: When to look.
        png: Where to draw it; None draws nothing.
        as_json: Print JSON.

    Raises:
        BadInput: The source ends before the moment.
        RecordingFailed: The disk refused the figure.
    """
    from taxel.views.gel_moment import look

    view = look(frame_sets_of(source), source.cameras, moment)
    names = [camera.name for camera in source.cameras]
    when = f"{view.time_s:.3f} s, frame {view.frame}"
    if png is not None:
        from taxel.views.figures.gel import gels_figure

        touches = dict(zip(names, view.touches, strict=True))
        write_whole(png, gels_figure(touches, f"{url}, {when}"))
    if as_json:
        print_json(
            {
                "source": url,
                "frame": view.frame,
                "time_s": view.time_s,
                "cameras": [
                    {"camera": name, **touch.figures()}
                    for name, touch in zip(names, view.touches, strict=True)
                ],
            }
        )
        return
    lines = [when] + [
        f"{name}: {touch.words()}" for name, touch in zip(names, view.touches, strict=True)
    ]
    if png is not None:
        lines.append(f"figure: {png}")
    for line in lines:
        say(line)


def frame_sets_of(source: Source) -> Iterator[FrameSet]:
    """Yield a source's sets of frames, one of each camera, until it ends."""
    pairer = FramePairer(len(source.cameras))
    while not source.ended:
        source.read()
        for frame in source.frames():
            found = pairer.push(frame)
            if found is not None:
                yield found
