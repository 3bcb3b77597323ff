"""What a publisher reads of a station's rings, and what the page makes of depth."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from time import monotonic
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from taxel.bus.following import DECISIONS, SOURCES, STATE, Following
from taxel.errors import BadInput
from taxel.frame_codec import encode_depth, encode_jpeg
from taxel.image_head import is_sound
from taxel.live.station.beats import Beats, BeatsView
from taxel.live.station.packets import pack
from taxel.live.station.page_link import PageSeen, StationView, ViewConfig
from taxel.live.station.ring import Ring, RingWriter
from taxel.signals import CODING, DEPTH_PNG, ROLE, SCENE, CameraInfo, Frame, Samples, SensorInfo

LEFT = CameraInfo(name="left", width=16, height=12, rate_hz=25.0)
DEPTH = CameraInfo(name="depth", width=16, height=12, rate_hz=30.0,
                   details={ROLE: SCENE, CODING: DEPTH_PNG})  # fmt: skip
HAND = SensorInfo(name="teng", channels=("a", "b"), units=("V", "V"), rate_hz=1000.0)


class Rings:
    """A station's rings, written by hand."""

    def __init__(self, stack: ExitStack) -> None:
        names = [stack.enter_context(Ring(2**18)).name for _ in range(4)]
        self.source, self.decisions, self.status, _ = (
            stack.enter_context(RingWriter(name)) for name in names
        )
        beats = stack.enter_context(Beats())
        self.board = BeatsView(beats.name)
        stack.callback(self.board.close)
        self.view = ViewConfig(
            sources=(PageSeen(url="sim://x", ring=names[0], sensor=HAND, cameras=(LEFT, DEPTH)),),
            decisions=(names[1],), status=names[2], requests=names[3], beats=beats.name,
            stall_s=0.1,
        )  # fmt: skip


@pytest.fixture
def rings() -> Iterator[Rings]:
    with ExitStack() as stack:
        yield Rings(stack)


@pytest.fixture
def following(rings: Rings) -> Iterator[Following]:
    following = Following(rings.view)
    yield following
    following.close()


def frame(camera: int, image: bytes) -> Frame:
    return Frame(camera=camera, jpeg=image, counter=1, device_s=0.0, arrival_s=1.0, fitted_s=1.0)


def test_a_batch_is_one_run_of_scans_then_all_else(rings: Rings, following: Following) -> None:
    image = encode_jpeg(np.zeros((12, 16, 3), np.uint8))
    for first in (0, 3):
        values = np.arange(first, first + 3.0)[:, None] * np.ones((1, 2))
        rings.source.put(pack(Samples.from_values(values, np.arange(first, first + 3) / 1000.0)))
        rings.source.put(pack(frame(0, image)))
    rings.source.put(pack({"kind": "source", "url": "sim://x", "lost": 0}))
    note = {"kind": "grasp", "who": "m", "time_s": 1.0, "p": 0.5, "slip": {"slip_mm": 0.2}}
    rings.decisions.put(pack(note))
    rings.decisions.put(pack({"kind": "new grasp"}))
    rings.status.put(pack({"time_s": 2.0, "state": "STABLE", "events": [[1.0, "x"]]}))

    items = following.take()

    assert [item.topic for item in items] == [
        "/touch/teng",
        "/camera/left",
        "/camera/left",
        SOURCES,
        DECISIONS,
        "/slip",
        STATE,
    ]
    assert items[0].value.values[:, 0].tolist() == [0, 1, 2, 3, 4, 5]
    assert items[5].value == {"time_s": 1.0, "who": "m", "slip_mm": 0.2}
    assert items[6].value == {"time_s": 2.0, "state": "STABLE"}
    assert following.take() == []


def test_what_is_no_image_of_its_camera_is_not_passed_on(
    rings: Rings, following: Following
) -> None:
    rings.source.put(pack(frame(0, b"\xff\xd8 no image \xff\xd9")))
    rings.source.put(pack(frame(1, encode_jpeg(np.zeros((12, 16, 3), np.uint8)))))
    assert following.take() == []
    rings.source.put(pack(frame(1, encode_depth(np.full((12, 16), 700, np.uint16)))))
    assert [item.topic for item in following.take()] == ["/camera/depth"]


def test_a_follower_that_is_late_counts_what_it_lost(rings: Rings, following: Following) -> None:
    image = encode_jpeg(np.random.default_rng(0).integers(0, 255, (12, 16, 3), np.uint8))
    for _ in range(2000):
        rings.source.put(pack(frame(0, image)))
    found = following.take()
    assert following.lost == 2000 - len(found) > 0


def test_a_supervisor_that_stands_still_is_reported_as_a_stop(
    rings: Rings, following: Following
) -> None:
    rings.status.put(pack({"time_s": 2.0, "state": "STABLE", "alarms": []}))
    following.take()
    rings.board.tick(monotonic() - 1.0)
    following._stall_sent_s = 0.0
    (item,) = following.take()
    assert item.value["state"] == "STOP"
    assert item.value["alarms"][0]["level"] == "danger"
    assert following.take() == []  # not at every look


def test_about_says_what_the_arrays_and_cameras_are(following: Following) -> None:
    about = following.about()
    assert about["sources"][0]["sensor"]["channels"] == ("a", "b")
    assert [camera["topic"] for camera in about["cameras"]] == ["/camera/left", "/camera/depth"]


def test_two_hands_of_one_kind_have_topics_of_their_own() -> None:
    """Scans of both under one topic would be one array with a jumping counter."""
    with ExitStack() as stack:
        own = Rings(stack)
        second = stack.enter_context(Ring(2**18)).name
        writer = stack.enter_context(RingWriter(second))
        beside = PageSeen(url="sim://y", ring=second, sensor=HAND, cameras=())
        view = replace(own.view, sources=(*own.view.sources, beside))
        following = stack.enter_context(Following(view))
        own.source.put(pack(Samples.from_values(np.full((1, 2), 1.0), np.array([0.0]))))
        writer.put(pack(Samples.from_values(np.full((1, 2), 2.0), np.array([0.0]))))
        found = {item.topic: float(item.value.values[0, 0]) for item in following.take()}
        for each in (own.source, writer):  # one simulator, named twice
            each.put(pack({"kind": "source", "url": "sim://x"}))
        numbers = [item.value["source"] for item in following.take()]
        topics = [source["topic"] for source in following.about()["sources"]]
    assert found == {"/touch/teng": 1.0, "/touch/teng-2": 2.0}
    assert topics == ["/touch/teng", "/touch/teng-2"]
    assert numbers == [1, 2]


def test_the_page_shows_depth_in_colours(rings: Rings) -> None:
    """A browser is given a JPEG: the newest depth, near and far in different colours."""
    view = StationView(rings.view)
    try:
        view.snapshot()
        depth = np.full((12, 16), 300, np.uint16)
        depth[:, 8:] = 1800
        rings.source.put(pack(frame(1, encode_depth(depth))))
        view.snapshot()
        number, jpeg = view.frame(1) or (0, b"")
        assert number == 1
        assert is_sound(jpeg, LEFT)
        assert view.frame(0) is None
    finally:
        view.close()


@pytest.mark.parametrize(
    ("module", "opens", "entry"),
    [
        ("taxel.bus.zenoh_publisher", "Bus", "publish"),
        ("taxel.bus.foxglove_server", "FoxgloveServer", "show"),
        ("taxel.fleet.reporter", "Reporter", "report"),
    ],
)
def test_a_publisher_that_cannot_open_lets_go_of_the_rings(
    rings: Rings, module: str, opens: str, entry: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else Python prints a traceback for each ring as the process ends, above the one line."""
    closed: list[Following] = []

    def close(following: Following, really: Callable[[Following], None] = Following.close) -> None:
        closed.append(following)
        really(following)

    def refuse(*_: object) -> None:
        raise BadInput("a free port", "none", "choose another")

    publisher = pytest.importorskip(module)
    monkeypatch.setattr(Following, "close", close)
    monkeypatch.setattr(publisher, "at_work", lambda _: nullcontext())
    monkeypatch.setattr(publisher, opens, refuse)
    job: Any = SimpleNamespace(place=None, view=rings.view, address=None, bundles=(), port=1,
                               token=None)  # fmt: skip
    with pytest.raises(BadInput, match="a free port"):
        getattr(publisher, entry)(job)
    assert len(closed) == 1
