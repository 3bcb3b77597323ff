"""What a Rerun viewer gets of a station's rings; the package itself is not needed."""

from __future__ import annotations

from contextlib import ExitStack
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from taxel.live.station.packets import pack
from taxel.live.station.page_link import PageSeen, ViewConfig
from taxel.live.station.ring import Ring, RingWriter
from taxel.signals import Samples, SensorInfo, Validity
from taxel.views.rerun_bridge import _Bridge

HAND = SensorInfo(name="hand", channels=("a", "b"), units=("V", "V"), rate_hz=100.0)


class Viewer:
    """Keeps what is logged."""

    def __init__(self) -> None:
        self.logged: list[tuple[str, Any]] = []

    def set_time(self, name: str, duration: float) -> None:
        pass

    def Scalars(self, values: Any) -> Any:  # noqa: N802  # as rerun calls it
        return values

    def TextLog(self, text: str) -> Any:  # noqa: N802  # as rerun calls it
        return text

    def log(self, path: str, what: Any) -> None:
        self.logged.append((path, what))


def test_a_value_that_may_not_be_used_is_a_gap_and_no_zero():
    """Boards fill scans that never came with zeros, and flag them."""
    viewer = Viewer()
    bridge = _Bridge.__new__(_Bridge)
    bridge._rerun, bridge._row_s, bridge._arrays = viewer, [-np.inf], ["hand"]
    bridge._view = ViewConfig(
        sources=(PageSeen(url="", ring="", sensor=HAND, cameras=()),), decisions=(), status="",
        requests="", beats="", stall_s=0.1,
    )  # fmt: skip
    scans = Samples.from_values(np.array([[0.5, 0.0], [0.7, 0.2]]), np.array([0.0, 0.01]))
    scans.validity[0, 1] = Validity.MISSING
    bridge._log(0, 0, scans)
    rows = [values.tolist() for _, values in viewer.logged]
    assert np.isnan(rows[0][1])
    np.testing.assert_allclose([rows[0][0], *rows[1]], [0.5, 0.7, 0.2], rtol=1e-6)


def _view(
    rings: list[str],
    beats: str,
    watchers: tuple[str, ...],
    recognisers: tuple[tuple[str, str], ...] = (),
) -> ViewConfig:
    seen = [PageSeen(url="", ring=name, sensor=HAND, cameras=()) for name in rings[:2]]
    return ViewConfig(
        sources=tuple(seen), decisions=tuple(rings[2:]), status="", requests="", beats=beats,
        stall_s=0.1, watchers=watchers, recognisers=recognisers,
    )  # fmt: skip


def test_two_hands_and_two_monitors_are_drawn_apart():
    """Both hands have one name, and both monitors decide about frames of the same moments."""
    viewer = Viewer()
    with ExitStack() as stack:
        rings = [stack.enter_context(Ring(2**16)).name for _ in range(4)]
        first, second, left, right = (stack.enter_context(RingWriter(name)) for name in rings)
        bridge = _Bridge(viewer, _view(rings, "", ("monitor 1/0", "monitor 2/0")))
        stack.callback(bridge.close)
        for writer, value in ((first, 1.0), (second, 2.0)):
            writer.put(pack(Samples.from_values(np.full((1, 2), value), np.array([0.0]))))
        decided = {"kind": "grasp", "time_s": 0.0, "reason": "", "is_score": True}
        left.put(pack(decided | {"who": "monitor 1/0", "p": 0.1, "state": "STABLE"}))
        right.put(pack(decided | {"who": "monitor 2/0", "p": 0.9, "state": "WARNING"}))
        bridge.follow(SimpleNamespace(consumed=0, dropped=0))
    assert [(path, np.asarray(what).tolist()) for path, what in viewer.logged] == [
        ("arrays/hand", [1.0, 1.0]),
        ("arrays/hand-2", [2.0, 2.0]),
        ("grasp/monitor-1-0/score", [0.1]),
        ("grasp/monitor-1-0/state", "STABLE"),
        ("grasp/monitor-2-0/score", [0.9]),
        ("grasp/monitor-2-0/state", "WARNING"),
    ]


def test_one_monitor_is_drawn_as_the_grasp():
    viewer = Viewer()
    with ExitStack() as stack:
        rings = [stack.enter_context(Ring(2**16)).name for _ in range(3)]
        _, _, decisions = (stack.enter_context(RingWriter(name)) for name in rings)
        bridge = _Bridge(viewer, _view(rings, "", ("monitor/0",)))
        stack.callback(bridge.close)
        decisions.put(pack({"kind": "grasp", "time_s": 0.0, "reason": "", "who": "monitor/0",
                            "p": 0.1, "state": "STABLE"}))  # fmt: skip
        bridge.follow(SimpleNamespace(consumed=0, dropped=0))
    assert [path for path, _ in viewer.logged] == ["grasp/probability", "grasp/state"]


@pytest.mark.parametrize(
    ("second", "paths"),
    [
        ("shape", ["answers/shape/monitor-0", "answers/shape/monitor-1"]),
        ("material", ["answers/shape", "answers/material"]),
    ],
)
def test_two_recognisers_of_one_target_are_drawn_apart(second: str, paths: list[str]):
    viewer = Viewer()
    own = (("monitor/0", "shape"), ("monitor/1", second))
    with ExitStack() as stack:
        rings = [stack.enter_context(Ring(2**16)).name for _ in range(3)]
        _, _, decisions = (stack.enter_context(RingWriter(name)) for name in rings)
        bridge = _Bridge(viewer, _view(rings, "", (), own))
        stack.callback(bridge.close)
        for who, target in own:
            decisions.put(pack({"kind": "answer", "time_s": 0.0, "who": who, "target": target,
                                "label": "sphere"}))  # fmt: skip
        bridge.follow(SimpleNamespace(consumed=0, dropped=0))
    assert viewer.logged == [(path, "sphere") for path in paths]


def test_a_reaction_that_the_source_marked_is_passed_over():
    """It has a time, and neither state nor score: the viewer's process died of it."""
    viewer = Viewer()
    with ExitStack() as stack:
        rings = [stack.enter_context(Ring(2**16)).name for _ in range(3)]
        _, _, decisions = (stack.enter_context(RingWriter(name)) for name in rings)
        bridge = _Bridge(viewer, _view(rings, "", ("monitor/0",)))
        stack.callback(bridge.close)
        decisions.put(pack({"kind": "reaction", "who": "monitor/0", "what": "put down",
                            "time_s": 1.0}))  # fmt: skip
        bridge.follow(SimpleNamespace(consumed=0, dropped=0))
    assert viewer.logged == []
