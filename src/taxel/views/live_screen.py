"""The live screen: what is in the hand, how sure, how fast, and the window it was predicted from.

Knows nothing about sources or models.
"""

from __future__ import annotations

import time
from typing import Self

import numpy as np
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from taxel.calibration.live import LiveNewtons
from taxel.decisions.recognition import UNKNOWN
from taxel.live.recogniser import Recogniser
from taxel.live.session import Tally
from taxel.plain_text import number_of, visible, visible_line
from taxel.signals import Samples, SensorInfo
from taxel.views.terminal import array_map, heat_map

_REDRAW_S = 0.1
"""Shortest time between two drawings: the screen must not slow the path down."""


class LiveView:
    """Draws the tallies of a session. Use it in a `with` block.

    Args:
        console: Where to draw.
        info: The source's array.
        recognisers: Those whose tallies will be shown.
        newtons: Shows the map in newtons; in the array's own unit unless given.
    """

    def __init__(
        self,
        console: Console,
        info: SensorInfo,
        recognisers: list[Recogniser],
        newtons: LiveNewtons | None = None,
    ) -> None:
        self._info = info
        self._newtons = newtons
        self._recognisers = recognisers
        self._contracts = [recogniser.bundle.contract for recogniser in recognisers]
        self._live = Live(console=console, auto_refresh=False)
        self._drawn_s = -np.inf
        self._now = np.full(len(info.channels), np.nan, np.float32)

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def show(self, samples: Samples, tallies: list[Tally]) -> None:
        """Draw, at most ten times a second."""
        if len(samples) and self._newtons is not None:
            samples = self._newtons.push(samples)
        if len(samples):
            self._now = np.where(samples.usable[-1], samples.values[-1], np.float32(np.nan))
        now_s = time.monotonic()
        if now_s - self._drawn_s < _REDRAW_S:
            return
        self._drawn_s = now_s
        self._live.update(self.render(tallies), refresh=True)

    def render(self, tallies: list[Tally]) -> RenderableType:
        """Return the screen."""
        high = self._info.full_scale or float(np.nanmax(self._now, initial=1.0))
        shown = self._info if self._newtons is None else self._newtons.info
        most = shown.full_scale or float(np.nanmax(self._now, initial=1.0))
        unit = visible(shown.units[0])
        answers = Table.grid(padding=(0, 3))
        answers.add_row(*(self._answer(i, tally) for i, tally in enumerate(tallies)))
        pictures = Table.grid(padding=(0, 4))
        pictures.add_row(
            Group(
                Text(f"now, {unit}: fingers across, distal on top"),
                array_map(self._now, 0.0, most),
            ),
            Group(Text("the last window: rows time, columns sensors"), _window(tallies, high)),
        )
        return Panel(Group(answers, Text(), pictures), title="taxel live", title_align="left")

    def _answer(self, index: int, tally: Tally) -> RenderableType:
        contract, latest = self._contracts[index], tally.latest
        lines = Text()
        if latest is None:
            why = self._recognisers[index].waiting()
            words = f"waiting for contact{': ' if why else ''}{why}"
            lines.append(f"{visible(contract.target)}: {words}", style="dim")
            return lines
        label, confidence = tally.grasp_answer
        sure = latest.decision.label != UNKNOWN
        style = "bold red" if label == UNKNOWN else "bold green" if sure else "bold yellow"
        lines.append(f"{visible(contract.target)}: ")
        lines.append(f"{visible(label):<12}", style=style)
        of = "of this contact" if contract.window.gate is not None else "joined"
        sure_words = f"{confidence:4.0%} over " if np.isfinite(confidence) else ""
        lines.append(f"{sure_words}{number_of(tally.vote.windows, 'window')} {of}\n")
        if tally.action:
            lines.append(f"  → {visible_line(tally.action)}\n", style="bold")
        for name, p in zip(contract.classes, latest.decision.probabilities, strict=True):
            full = round(float(p) * 20) if np.isfinite(p) else 0
            share = f"{p:4.0%}" if np.isfinite(p) else "   –"
            lines.append(f"  {visible(name):<12}{'█' * full}{'·' * (20 - full)} {share}\n")
        if latest.decision.reason:
            lines.append(f"  {visible_line(latest.decision.reason)}\n", style="red")
        if tally.gate_moves:
            lines.append(f"  {visible_line(tally.gate_moves[-1].words())}\n", style="yellow")
        if tally.outages and tally.outages[-1].end_s is None:
            lines.append(f"  {visible_line(tally.outages[-1].words())}\n", style="bold red")
        if tally.rate_changes and not tally.rate_changes[-1].fits:
            lines.append(f"  {visible_line(tally.rate_changes[-1].words())}\n", style="bold yellow")
        for scale in tally.other_scales:
            lines.append(f"  {visible_line(scale.words())}\n", style="bold yellow")
        for still in tally.still_channels:
            lines.append(f"  {visible_line(still.words())}\n", style="bold yellow")
        lines.append(
            f"  {number_of(tally.windows, 'window')}, {1e6 * latest.latency_s:.0f} µs the last"
            + (f", right {tally.right} of {tally.marked}" if tally.marked else ""),
            style="dim",
        )
        return lines


def _window(tallies: list[Tally], high: float) -> RenderableType:
    latest = next((tally.latest for tally in tallies if tally.latest is not None), None)
    if latest is None:
        return Text("none yet", style="dim")
    return heat_map(latest.window.values[0][:24], 0.0, high)
