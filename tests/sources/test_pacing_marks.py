"""What falls due is let out once, in order, and looking for it costs little."""

import numpy as np

from taxel.clock import ManualClock
from taxel.signals import Mark, Samples
from taxel.sources.pacing import Pacer


class Counted(float):
    """A time that counts how often it is compared."""

    compared = 0

    def __add__(self, other):
        return Counted(float(self) + other)

    def __lt__(self, other):
        Counted.compared += 1
        return float(self) < other

    __le__ = __gt__ = __lt__


def marks_given(count: int) -> list[str]:
    """Play `count` scans 5 ms apart with a mark each in one stretch, read one by one."""
    times_s = np.arange(count) * 0.005
    samples = Samples.from_values(np.ones((count, 1)), times_s, None)
    marks = [
        Mark(start_s=0.0, end_s=Counted(time_s), labels={"n": str(i)})
        for i, time_s in enumerate(times_s)
    ]
    marks.append(Mark(start_s=0.0, end_s=float("nan"), labels={"n": "never"}))
    clock = ManualClock()
    pacer = Pacer(iter([(samples, marks)]), 1, clock, 1.0)
    given: list[str] = []
    while not pacer.ended:
        pacer.read(0.005)
        given += [mark.labels["n"] for mark in pacer.marks()]
    return given


def test_a_mark_a_scan_costs_each_time_a_few_comparisons_and_not_one_with_each_other_mark():
    for count in (200, 800):
        Counted.compared = 0
        assert marks_given(count) == [str(i) for i in range(count)]
        assert Counted.compared <= 4 * count * np.log2(count)
