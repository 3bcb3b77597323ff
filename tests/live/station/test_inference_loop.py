"""The monitor's loop: it looks at silent cameras however often something else comes."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from taxel.clock import ManualClock
from taxel.live.station import inference
from taxel.live.station.beats import Work
from taxel.live.station.packets import pack

SCANS = 200
EVERY_S = 0.001


class Scans:
    """A ring in which a note comes each millisecond; at the end nothing does."""

    put_s = 0.0
    lost = 0
    waiting = False

    def __init__(self, clock: ManualClock) -> None:
        self.clock = clock
        self.taken = 0

    def take(self) -> list[bytes]:
        self.clock.advance(EVERY_S)
        self.taken += 1
        return [pack({"scan": self.taken})] if self.taken <= SCANS else []

    def wait(self, longest_s: float) -> bool:
        raise AssertionError("there was something to take")


class Silence(Scans):
    """A ring in which nothing ever comes."""

    def take(self) -> list[bytes]:
        return []

    def wait(self, longest_s: float) -> bool:
        self.clock.advance(longest_s)
        self.taken += 1
        return False


def looks_s(monkeypatch: pytest.MonkeyPatch, ring: type[Scans], turns: int) -> list[float]:
    """Run the loop on a ring; return when it looked at the cameras, seconds."""
    clock = ManualClock()
    source, looked_s = ring(clock), list[float]()
    pulse = SimpleNamespace(
        beat=lambda **_: None, report=lambda *_: None, orphaned=False, work_of=lambda _: Work.ENDED,
        stopping=False,
    )  # fmt: skip

    class Watcher:
        what = "a test"

        def take(self, packets: list[Any], came: Any, pulse: Any) -> None:
            pulse.stopping = source.taken >= turns

        def silent(self, now_s: float) -> None:
            looked_s.append(now_s)
            pulse.stopping = source.taken >= turns

        def end(self) -> None:
            """Nothing to end."""

    @contextlib.contextmanager
    def opened(name: str) -> Iterator[Any]:
        yield source if name == "source" else SimpleNamespace(waiting=False, take=list, written=0)

    monkeypatch.setattr(inference, "at_work", lambda *_, **__: contextlib.nullcontext(pulse))
    monkeypatch.setattr(inference, "RingReader", opened)
    monkeypatch.setattr(inference, "RingWriter", opened)
    monkeypatch.setattr(inference, "settle_memory", lambda: None)
    monkeypatch.setattr(inference, "monotonic", clock.now_s)
    monkeypatch.setattr(inference, "watcher_of", lambda *_: Watcher())
    job = SimpleNamespace(
        place=None, ring="source", orders="", decisions="", bundles=(Path("a"),), source_row=0,
        drill=False, rank=0, last_step_s=0.0,
    )  # fmt: skip
    inference.infer(job)  # type: ignore[arg-type]  # what it reads of its job
    return looked_s


@pytest.mark.parametrize(("ring", "turns"), [(Scans, SCANS), (Silence, 40)])
def test_the_cameras_are_looked_at_every_few_milliseconds(
    monkeypatch: pytest.MonkeyPatch, ring: type[Scans], turns: int
):
    """Scans that come each millisecond wake the monitor before any wait is over."""
    looked_s = looks_s(monkeypatch, ring, turns)
    gaps = [after - before for before, after in pairwise(looked_s)]
    assert len(looked_s) >= 30
    assert max(gaps) <= 0.0071
    assert min(gaps) >= 0.0049
