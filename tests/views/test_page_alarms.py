"""A person acknowledges on the page what the page had shown, and nothing that came since."""

import asyncio
from types import SimpleNamespace
from typing import Any, cast

import pytest

from taxel.actions.alarm import EARLIER, GRASP, AlarmLatch, Level
from taxel.actions.interlock import Interlock, InterlockConfig
from taxel.decisions.stability import Stability, StabilityDecision
from taxel.live.station.guard import Guard
from taxel.live.station.page_requests import fulfil
from taxel.live.station.snapshots import guard_snapshot, stalled_snapshot
from taxel.views.page.clients import Clients, _unacknowledged
from taxel.views.page.messages import Acknowledge


class Link:
    """A station's link without rings: what the page asks is done at once."""

    def __init__(self) -> None:
        self.guard = Guard(Interlock(InterlockConfig(min_n=1.0, max_n=10.0)))
        self.alarms = self.guard.alarms
        self.comes: str = ""
        """Kind of an alarm that comes on once the next snapshot was given."""
        self.whole: list[bool] = []

    def snapshot(self) -> dict[str, Any]:
        found = guard_snapshot(self.guard, 9.0)
        if self.comes:
            self.alarms.set(self.comes, Level.DANGER, "", 9.0)
            self.comes = ""
        return found

    def acknowledge(self, seen: frozenset[int]) -> None:
        station = SimpleNamespace(acknowledge=self._acknowledge)
        fulfil(cast("Any", station), {"do": "acknowledge", "seen": sorted(seen)})

    def _acknowledge(self, seen: frozenset[int]) -> None:
        self.whole.append(self.alarms.acknowledge_seen(seen, 9.5))


@pytest.fixture
def link() -> Link:
    return Link()


def pressed(link: Link, shown: frozenset[int]) -> str:
    """Press the key on a page that has shown these; return what the page is answered."""
    return asyncio.run(Clients(cast("Any", link))._do(Acknowledge(), shown))


def shown(link: Link) -> frozenset[int]:
    return _unacknowledged(link.snapshot())


def watch(alarms: AlarmLatch, state: Stability, now_s: float) -> None:
    alarms.watch(StabilityDecision(state, "", now_s, 0.5), armed=False, now_s=now_s)


def comes_again(alarms: AlarmLatch) -> None:
    alarms.clear(GRASP, 2.0)
    alarms.set(GRASP, Level.WARNING, "", 3.0)


def further_grasp(alarms: AlarmLatch) -> None:
    for now_s, state in ((2.0, Stability.NO_GRASP), (3.0, Stability.WARNING)):
        watch(alarms, state, now_s)


def worse(alarms: AlarmLatch) -> None:
    alarms.set(GRASP, Level.DANGER, "", 2.0)


def another_of_several(alarms: AlarmLatch) -> None:
    alarms.renew_grasp()
    alarms.set(GRASP, Level.WARNING, "", 2.0)


@pytest.mark.parametrize("becomes", [comes_again, further_grasp, worse, another_of_several])
def test_what_became_another_alarm_since_it_was_shown_is_not_acknowledged(link: Link, becomes: Any):
    """It kept its kind and its beginning: the key of the page before silenced it."""
    link.alarms.set(GRASP, Level.WARNING, "", 1.0)
    before = shown(link)
    becomes(link.alarms)
    assert "had not shown yet" in pressed(link, before)
    link.acknowledge(before)  # as one that was under way already
    assert link.alarms.sounding is not None
    assert link.whole == [False]
    assert pressed(link, shown(link)) == ""
    assert (link.alarms.sounding, link.whole) == (None, [False, True])


def test_a_further_grasp_that_joins_the_earlier_ones_is_not_acknowledged_unseen(link: Link):
    """Their line counted two, had the beginning of the first, and left with it."""
    watch(link.alarms, Stability.WARNING, 1.0)
    watch(link.alarms, Stability.NO_GRASP, 2.0)
    before = shown(link)
    watch(link.alarms, Stability.WARNING, 3.0)
    watch(link.alarms, Stability.NO_GRASP, 4.0)
    link.acknowledge(before)
    assert [(a.kind, a.count, a.acknowledged) for a in link.alarms.alarms] == [(EARLIER, 2, False)]
    assert link.alarms.counts.acknowledged == 0


def test_an_alarm_whose_words_change_or_that_goes_stays_what_was_shown(link: Link):
    link.alarms.set("disk", Level.WARNING, "90 % full", 1.0)
    before = shown(link)
    link.alarms.set("disk", Level.WARNING, "91 % full", 2.0)
    link.alarms.clear("disk", 3.0)
    assert pressed(link, before) == ""
    assert link.alarms.alarms == ()


def test_an_alarm_that_comes_between_look_and_word_is_not_acknowledged(link: Link):
    """The server looked at one snapshot, and the station took the word for a later one."""
    link.alarms.set(GRASP, Level.WARNING, "", 1.0)
    before = shown(link)
    link.comes = "disk"
    assert pressed(link, before) == ""
    assert [(a.kind, a.acknowledged) for a in link.alarms.alarms] == [
        ("disk", False), (GRASP, True),
    ]  # fmt: skip
    assert link.whole == [False]


def test_while_the_supervisor_stands_still_what_was_shown_is_acknowledged(link: Link):
    """Its alarm seemed to be another at each look, by some microseconds: always refused."""
    link.alarms.set(GRASP, Level.WARNING, "", 1.0)
    own, still_s = link.snapshot, iter([0.3, 0.35001])

    def snapshot() -> dict[str, Any]:
        newest, s = own(), next(still_s)
        return newest | stalled_snapshot(newest, s, 9.0 + s + 1e-5 * s)

    link.snapshot = snapshot  # type: ignore[method-assign]
    assert pressed(link, shown(link)) == ""
    assert link.whole == [True]
