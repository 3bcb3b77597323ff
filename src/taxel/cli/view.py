"""`taxel view`: look at raw touch, from a source or a recording, without any model."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Group
from rich.live import Live
from rich.text import Text

from taxel.cli.printing import console, print_json
from taxel.errors import BadInput, MissingExtra, RecordingFailed
from taxel.signals import Samples
from taxel.sources.contract import Source

_REDRAW_S = 0.1
"""Shortest time between two drawings."""
_DEFAULT_S = 5.0
"""How much is looked at where nobody watches; more of slow arrays."""


@dataclass(frozen=True, kw_only=True)
class View:
    """Show a trace for each channel and the map of the array; q or Ctrl-C stops.

    Where the output is no terminal, a plain summary is printed once instead.
    """

    source: tyro.conf.Positional[str]
    """A source, such as sim://teng, or a recording's file."""
    seconds: float | None = None
    """Stop after this many seconds of the source's time. Unless given: at its end or at q in a
    terminal, and after 5 s (or 40 scans) otherwise."""
    png: Path | None = None
    """Write a figure of that time to this file (.png) instead; needs taxel[train]."""
    json: bool = False
    """Print the summary as JSON."""

    def run(self) -> None:
        """Show until the time is over, the source ends or the user stops it."""
        from taxel.sources.opening import at_full_speed, open_source

        if self.seconds is not None and not self.seconds > 0:
            raise BadInput("--seconds above 0", f"{self.seconds:g}", "give a longer time")
        if self.png is not None:
            self._write_png(self.png)
        elif console.is_terminal and not self.json:
            with open_source(self.source) as source:
                show(source, self.seconds)
        else:
            with open_source(at_full_speed(self.source)) as source:
                self._summarise(source)

    def _summarise(self, source: Source) -> None:
        from taxel.views.trace_buffer import span_s
        from taxel.views.traces import TraceScreen

        screen = TraceScreen(source.info)
        follow(source, self.seconds or span_s(source.info, _DEFAULT_S), screen.buffer.add)
        if self.json:
            print_json(screen.buffer.summary())
            return
        for line in screen.summary():
            print(line)

    def _write_png(self, path: Path) -> None:
        try:
            from taxel.views.touch_figure import touch_figure
        except ModuleNotFoundError as error:
            raise MissingExtra(error.name or "matplotlib", "train", "figures") from error
        from taxel.sources.opening import at_full_speed, open_source
        from taxel.views.trace_buffer import TraceBuffer, span_s

        if path.suffix.lower() != ".png":
            raise BadInput("a name that ends in .png for --png", str(path), "rename it")
        with open_source(at_full_speed(self.source)) as source:
            seconds = self.seconds or span_s(source.info, _DEFAULT_S)
            buffer = TraceBuffer(source.info, kept_s=seconds)
            follow(source, seconds, buffer.add)
        if not buffer.scans:
            raise BadInput("a source with scans", f"none from {self.source}", "choose another")
        write_whole(path, touch_figure(buffer, self.source))
        console.print(f"{path}: {buffer.scans:,} scans of {buffer.info.name}", soft_wrap=True)


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
    from taxel.views.keys import QuitKey
    from taxel.views.traces import TraceScreen

    screen = TraceScreen(source.info)
    drawn_s = -_REDRAW_S
    hint = Text("q stops", style="dim")

    with QuitKey() as key, Live(console=console, auto_refresh=False) as live:

        def draw() -> bool:
            nonlocal drawn_s
            if time.monotonic() - drawn_s >= _REDRAW_S:
                drawn_s = time.monotonic()
                picture = screen.render(console.width, console.height - 1)
                live.update(Group(picture, hint), refresh=True)
            return key.pressed

        with suppress(KeyboardInterrupt):
            follow(source, seconds, screen.add, draw)
        live.update(screen.render(console.width, console.height), refresh=True)


def write_whole(path: Path, data: bytes) -> None:
    """Write a file so that it is there as a whole or not at all.

    Raises:
        RecordingFailed: The disk refused.
    """
    part = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(data)
        os.replace(part, path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise RecordingFailed(
            f"needed to write {path}; got {error.strerror or error}; choose another place."
        ) from error
