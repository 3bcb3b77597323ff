"""`taxel view`: look at raw touch, from a source or a recording, without any model."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import tyro
from rich.console import Group
from rich.live import Live
from rich.text import Text

from taxel.cli.figure_files import need_figures
from taxel.cli.options.rules import Only
from taxel.cli.printing import console, print_json, say
from taxel.cli.recordings.view_cameras import view_cameras
from taxel.errors import BadInput
from taxel.plain_text import number_of
from taxel.recordings.whole import write_whole
from taxel.signals import Samples
from taxel.sources.contract import Source

if TYPE_CHECKING:
    from taxel.views.gel_moment import Moment

_REDRAW_S = 0.1
"""Shortest time between two drawings."""
_DEFAULT_S = 5.0
"""How much is looked at where nobody watches; more of slow arrays."""


@dataclass(frozen=True, kw_only=True)
class View:
    """Show a trace for each channel and the map of the array; q or Ctrl-C stops.

    Without a terminal, a plain summary is printed once instead. Tactile cameras are shown at one
    moment, chosen with --at or --frame: a line for each camera, and with --png a figure of each
    image, its dots' movement since the settled first frames, depth and normals.
    """

    source: tyro.conf.Positional[str]
    """A source, such as sim://teng, or a recording's file."""
    seconds: float | None = None
    """Stop after this many seconds of the source's time. Unless given: at its end or at q in a
    terminal, and after 5 s (or 40 scans) otherwise."""
    at: float | None = None
    """Cameras: the moment to look at, seconds after the first frame."""
    frame: int | None = None
    """Cameras: the moment to look at, as a frame counted from 0, instead of --at."""
    png: Path | None = None
    """Write a figure to this file (.png) instead, of that time or moment; of cameras' last moment
    within it unless --at or --frame chooses. Needs taxel[train]."""
    calibration: Path | None = None
    """A calibration (.json) of the array: traces and map in newtons instead of volts."""
    page: bool = False
    """A recording on the operator's page, with a time cursor; its address is printed."""
    json: bool = False
    """Print the summary as JSON."""

    RULES: ClassVar = (
        Only(
            ("seconds", "at", "frame", "png", "calibration", "json"),
            "no --page",
            lambda o: not o.page,
        ),
    )

    def run(self) -> None:
        """Show until the time is over, the source ends or the user stops it."""
        from taxel.sources.opening import at_full_speed, open_source

        self._check()
        if self.page:
            self._replay_page()
            return
        drawn = self.png is not None
        watched = console.is_terminal and not (self.json or drawn or self._chosen())
        with open_source(self.source if watched else at_full_speed(self.source)) as raw:
            source = self._calibrated(raw)
            if self._of_cameras(source):
                view_cameras(source, self.source, self._moment(), self.png, as_json=self.json)
            elif self.png is not None:
                self._write_png(source, self.png)
            elif watched:
                show(source, self.seconds)
            else:
                self._summarise(source)

    def _calibrated(self, source: Source) -> Source:
        """Return the source in newtons, where a calibration was named."""
        if self.calibration is None:
            return source
        from taxel.calibration.live import in_newtons
        from taxel.calibration.stored import read_calibration

        return in_newtons(source, read_calibration(self.calibration))

    def _replay_page(self) -> None:
        """Serve the recording's page until Ctrl-C."""
        from taxel.views.page.replay_link import ReplayLink
        from taxel.views.page.server import run_page

        path = Path(self.source.removeprefix("replay://"))
        if not path.is_file():
            raise BadInput("a recording's file with --page", repr(self.source), "name one")
        link = ReplayLink(path)
        run_page(link, on_open=lambda url: say(f"the page: {url}"))

    def _check(self) -> None:
        """Refuse, before anything is opened, what cannot be meant."""
        if self.seconds is not None and not self.seconds > 0:
            raise BadInput("--seconds above 0", f"{self.seconds:g}", "give a longer time")
        chosen = self._chosen()
        if chosen and len(chosen) + (self.seconds is not None) > 1:
            raise BadInput("one of --at, --frame and --seconds", "several", "choose one")
        for name, value in chosen.items():
            if not 0 <= value < math.inf:
                raise BadInput(f"{name} of at least 0", f"{value:g}", "choose another moment")
        if self.png is not None:
            need_figures(self.png)

    def _chosen(self) -> dict[str, float]:
        """Return the moment of cameras that was asked for, by option."""
        given = {"--at": self.at, "--frame": self.frame}
        return {name: value for name, value in given.items() if value is not None}

    def _moment(self) -> Moment:
        from taxel.views.gel_moment import Moment

        return Moment(at_s=self.at, frame=self.frame, until_s=self.seconds or _DEFAULT_S)

    def _of_cameras(self, source: Source) -> bool:
        """Return whether cameras are to be looked at, and not an array.

        Raises:
            BadInput: They are, and there are none.
        """
        chosen = self._chosen()
        if chosen and not source.cameras:
            raise BadInput(f"a source with cameras for {next(iter(chosen))}",
                           f"{self.source} without", "leave it out, or choose another")  # fmt: skip
        if not source.cameras:
            return False
        return bool(chosen) or self.png is not None or not source.info.channels

    def _summarise(self, source: Source) -> None:
        from taxel.views.trace_buffer import span_s
        from taxel.views.traces import TraceScreen

        screen = TraceScreen(source.info)
        follow(source, self.seconds or span_s(source.info, _DEFAULT_S), screen.buffer.add)
        if self.json:
            print_json(screen.buffer.summary())
            return
        for line in screen.summary():
            say(line)

    def _write_png(self, source: Source, path: Path) -> None:
        from taxel.views.figures.touch import touch_figure
        from taxel.views.trace_buffer import TraceBuffer, span_s

        seconds = self.seconds or span_s(source.info, _DEFAULT_S)
        buffer = TraceBuffer(source.info, kept_s=seconds)
        follow(source, seconds, buffer.add)
        if not buffer.scans:
            raise BadInput("a source with scans", f"none from {self.source}", "choose another")
        write_whole(path, touch_figure(buffer, self.source))
        if self.json:
            print_json(buffer.summary())
            return
        say(f"{path}: {number_of(buffer.scans, 'scan', ',')} of {buffer.info.name}")


def follow(
    source: Source,
    seconds: float | None,
    add: Callable[[Samples], None],
    stop: Callable[[], bool] = lambda: False,
) -> None:
    """Hand on what a source gives until it ends, the time is over or `stop` says so.

    Args:
        source: An open source.
        seconds: Length on the samples' fitted clock, seconds; None has no end.
        add: Gets the samples of each read, also none.
        stop: Asked after each read.
    """
    started_s: float | None = None
    while not source.ended:
        samples = source.read()
        inside = samples
        if len(samples) and seconds is not None:
            started_s = float(samples.fitted_s[0]) if started_s is None else started_s
            inside = samples[samples.fitted_s < started_s + seconds]
        add(inside)
        if len(inside) < len(samples) or stop():
            return


def show(source: Source, seconds: float | None) -> None:
    """Draw a source in the terminal until it ends, the time is over or q is pressed."""
    from taxel.views.keys import Keys
    from taxel.views.traces import TraceScreen

    screen = TraceScreen(source.info)
    drawn_s = -_REDRAW_S
    hint = Text("q stops", style="dim")

    with Keys() as key, Live(console=console, auto_refresh=False) as live:

        def draw() -> bool:
            nonlocal drawn_s
            if time.monotonic() - drawn_s >= _REDRAW_S:
                drawn_s = time.monotonic()
                picture = screen.render(console.width, console.height - 1)
                live.update(Group(picture, hint), refresh=True)
            return key.quit

        with suppress(KeyboardInterrupt):
            follow(source, seconds, screen.add, draw)
        live.update(screen.render(console.width, console.height), refresh=True)
