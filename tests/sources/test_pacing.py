"""Pacing: what is due is given before anything else is made or read."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from taxel.clock import ManualClock
from taxel.signals import Frame, Mark, Samples
from taxel.sources.pacing import FrameStream, Pacer, Stretch

PERIOD_S = 0.02
MAKING_S = 0.007
"""What it takes to make a moment or to read a chunk, seconds."""
MOMENTS = 30


class Maker:
    """Moments of two cameras, each of which costs time when it is asked for."""

    def __init__(self, clock: ManualClock) -> None:
        self.clock = clock
        self.frames_made = 0

    def frames(self) -> Iterator[Frame]:
        for number in range(MOMENTS):
            self.clock.sleep(MAKING_S)
            for camera in range(2):
                self.frames_made += 1
                time_s = number * PERIOD_S
                yield Frame(camera=camera, jpeg=b"", counter=number, device_s=time_s,
                            arrival_s=time_s + 0.004, fitted_s=time_s)  # fmt: skip

    def stretches(self) -> Iterator[Stretch]:
        for number in range(MOMENTS):
            self.clock.sleep(MAKING_S / 10)
            mark = Mark(start_s=number * PERIOD_S, end_s=number * PERIOD_S, labels={})
            yield Samples.empty(0), [mark]


@pytest.mark.parametrize("ahead", [True, False])
def test_a_frame_leaves_when_it_is_due_whatever_the_next_one_costs(ahead: bool):
    """With the next moment made first each frame would be 7 ms late."""
    clock = ManualClock()
    maker = Maker(clock)
    pacer = Pacer(maker.stretches(), 0, clock, 1.0, FrameStream(maker.frames(), 2), ahead=ahead)
    late_s, given, marks = [], [], 0
    while not pacer.ended:
        pacer.read(0.1)
        for frame in pacer.frames():
            late_s.append(clock.now_s() - frame.arrival_s)
            given.append((frame.counter, frame.camera))
        marks += len(pacer.marks())
    assert given == [(number, camera) for number in range(MOMENTS) for camera in range(2)]
    assert marks == MOMENTS
    # The first moment is made while the source is opened, the second before it begins to flow.
    assert max(late_s[4:]) < 1e-9


def test_frames_that_nobody_fetched_come_at_once():
    clock = ManualClock()
    maker = Maker(clock)
    pacer = Pacer(maker.stretches(), 0, clock, 1.0, FrameStream(maker.frames(), 2))
    clock.advance(10 * PERIOD_S)
    pacer.read(0.0)
    assert len(pacer.frames()) >= 20


def scans(first: int) -> Stretch:
    time_s = (first + np.arange(10)) / 1000.0
    zeros = np.zeros((10, 1), np.float32)
    return (
        Samples(values=zeros, counter=first + np.arange(10), device_s=time_s, arrival_s=time_s,
                fitted_s=time_s, validity=zeros.astype(np.uint8)),
        [Mark(start_s=time_s[0], end_s=time_s[-1], labels={})],
    )  # fmt: skip


@pytest.mark.parametrize("speed", [1.0, np.inf])
def test_no_scan_and_no_mark_is_lost_or_early(speed: float):
    clock = ManualClock()
    pacer = Pacer((scans(10 * part) for part in range(20)), 1, clock, speed)
    counters: list[int] = []
    ends: list[int] = []
    while not pacer.ended:
        counters += [int(counter) for counter in pacer.read(0.1).counter]
        ends += [round(1000 * mark.end_s) for mark in pacer.marks()]
        assert not ends or ends[-1] <= counters[-1]
    assert counters == list(range(200))
    assert len(ends) == 20
