"""The process that reads one source and puts what comes into its ring.

Nothing downstream can slow it: the ring drops its oldest. Knows nothing about models.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from time import monotonic, sleep
from typing import Protocol, runtime_checkable

from taxel.errors import TaxelError
from taxel.live.frame_loop import frames_and_marks
from taxel.live.station.beats import Work
from taxel.live.station.packets import pack, unpack
from taxel.live.station.ring import RingReader, RingWriter
from taxel.live.station.source_news import SourceNews
from taxel.live.station.worker import Place, Pulse, Rank, at_work, hurry_threads, settle_memory
from taxel.signals import Frame
from taxel.sources.contract import Source
from taxel.sources.opening import open_source

_WAIT_S = 0.02
"""Longest wait for the next scan or frame: how often a silent source gives a sign of life."""


@runtime_checkable
class Gripped(Protocol):
    """A simulated source whose gripper takes commands."""

    def grip(self, force_n: float) -> None:
        """Hold with a force, newtons."""
        ...


@runtime_checkable
class Begun(Protocol):
    """A simulator or a replay, whose time can begin when everybody is there."""

    def begin(self) -> None:
        """Begin now instead of at opening."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Acquisition:
    """The job of a source's process: its address and rings."""

    place: Place
    url: str
    ring: str
    orders: str
    """Ring with notes such as {"grip_n": 30.0, "expires_s": 512.3}, for a simulated gripper."""
    once: bool = False
    """Nothing more comes where it fails: its process is not started again."""


def acquire(job: Acquisition) -> None:
    """Read a source until it is asked to end; the entry point of the process."""
    with at_work(job.place) as pulse:
        try:
            source = open_source(job.url)
        except TaxelError as error:
            pulse.report("refused", error)
            pulse.beat(Work.FAILED)
            raise SystemExit(2) from error
        with source, RingWriter(job.ring) as writer, RingReader(job.orders) as orders:
            pulse.report("opened", source.info, source.cameras)
            settle_memory()
            hurry_threads(Rank.SOURCE)
            while not (pulse.may_begin or pulse.stopping):
                pulse.beat(Work.STARTING)
                sleep(_WAIT_S / 4)
            if isinstance(source, Begun):
                source.begin()
                if job.place.again:  # unlike a camera's, its grasp begins anew
                    writer.put(pack({"do": "new grasp"}))
            _pump(source, writer, orders, pulse, job)


def _pump(
    source: Source, writer: RingWriter, orders: RingReader, pulse: Pulse, job: Acquisition
) -> None:
    news = SourceNews(source, job.url)
    try:
        _hand_on(source, writer, orders, pulse, news)
    except Exception as error:
        try:
            writer.put(pack(news.failed(error, monotonic())))
        finally:
            if job.once:
                writer.put(_over())
        raise


def _hand_on(
    source: Source, writer: RingWriter, orders: RingReader, pulse: Pulse, news: SourceNews
) -> None:
    ended = False
    last_s = -math.inf
    while not pulse.stopping:
        if source.ended and not ended:
            ended = True
            writer.put(_over())
        samples = source.read(_WAIT_S)
        if len(samples):
            writer.put(pack(samples))
        frames = []
        for item in frames_and_marks(source, last_s):
            writer.put(pack(item))
            if isinstance(item, Frame):
                frames.append(item)
                last_s = item.fitted_s
        now_s = monotonic()
        news.add(samples, frames, now_s)
        if news.due(now_s):
            writer.put(pack(news.note(now_s)))
        pulse.produced = writer.written
        pulse.beat(Work.ENDED if ended else Work.RUNNING)
        if orders.waiting:
            _obey(source, orders)
        if ended:
            sleep(_WAIT_S)


def _over() -> bytes:
    """Return the note that the source is over: nothing more comes of it."""
    return pack({"ended": monotonic()})


def _obey(source: Source, orders: RingReader) -> None:
    content = orders.newest()
    order = unpack(content) if content is not None else None
    if not isinstance(order, dict) or "grip_n" not in order or not isinstance(source, Gripped):
        return
    if monotonic() < float(order["expires_s"]):
        source.grip(float(order["grip_n"]))
