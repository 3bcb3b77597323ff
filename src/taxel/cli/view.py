"""`taxel view`: look at raw touch, from a source or a recording, without any model."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.live import Live

from taxel.cli.printing import console
from taxel.errors import BadInput, MissingExtra
from taxel.signals import Samples


@dataclass(frozen=True, kw_only=True)
class View:
    """Show a trace for each channel and the map of the array."""

    source: tyro.conf.Positional[str]
    """A source, such as sim://teng, or a recording's file."""
    seconds: float | None = None
    """Stop after this many seconds of the source's time; else at its end or at Ctrl-C."""
    png: Path | None = None
    """Write a figure of the first --seconds (5 unless given) to this file instead."""

    def run(self) -> None:
        """Show until the time is over, the source ends or the user stops it."""
        if self.seconds is not None and not self.seconds > 0:
            raise BadInput("--seconds above 0", str(self.seconds), "give a longer time")
        if self.png is not None:
            self._write_png(self.png)
            return
        from taxel.sources.opening import open_source
        from taxel.views.traces import TraceScreen

        with open_source(self.source) as source:
            screen = TraceScreen(source.info)
            live = Live(console=console, auto_refresh=False, screen=False)
            started_s: float | None = None
            try:
                if console.is_terminal:
                    live.start()
                while not source.ended:
                    samples = source.read()
                    screen.add(samples)
                    if console.is_terminal:
                        live.update(screen.render(console.width), refresh=True)
                    if not len(samples):
                        continue
                    started_s = float(samples.fitted_s[0]) if started_s is None else started_s
                    if self.seconds and samples.fitted_s[-1] - started_s >= self.seconds:
                        break
            except KeyboardInterrupt:
                pass
            finally:
                live.stop()
            if not console.is_terminal:
                for line in screen.summary():
                    print(line)

    def _write_png(self, path: Path) -> None:
        try:
            from taxel.views import figures
        except ImportError as error:
            raise MissingExtra("matplotlib", "train", "figures") from error
        from taxel.sources.opening import open_source

        seconds = self.seconds or 5.0
        parts: list[Samples] = []
        with open_source(self.source) as source:
            info = source.info
            while not source.ended:
                parts.append(source.read())
                times = [part.fitted_s for part in parts if len(part)]
                if times and times[-1][-1] - times[0][0] >= seconds:
                    break
        samples = Samples.join(parts)
        time_s = samples.fitted_s - samples.fitted_s[0]
        unit = info.units[0] if len(set(info.units)) == 1 else "value"
        data = figures.traces(time_s, samples.values, info.channels, unit, self.source)
        temporary = path.with_name(path.name + ".part")
        temporary.write_bytes(data)
        os.replace(temporary, path)
        console.print(f"{path}: {len(samples)} scans of {info.name}")
