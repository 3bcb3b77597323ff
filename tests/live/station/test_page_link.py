"""What the operator's page sees of the rings, and what its wishes become.
No process runs: the rings are real, and the tests write what a station would."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from taxel.clock import ManualClock
from taxel.frame_codec import encode_depth, encode_jpeg
from taxel.live.station import page_link
from taxel.live.station.beats import Beats
from taxel.live.station.packets import pack, unpack
from taxel.live.station.page_link import PageSeen, StationView, ViewConfig
from taxel.live.station.ring import Ring, RingReader, RingWriter
from taxel.signals import CODING, DEPTH_PNG, CameraInfo, Frame, Samples, SensorInfo

WIDTH, HEIGHT = 32, 24
HAND = SensorInfo(name="hand", channels=("a", "b"), units=("V", "V"), rate_hz=100.0)
SIX = SensorInfo(name="imu", channels=("x",), units=("g",), rate_hz=100.0)
NONE = SensorInfo(name="none", channels=(), units=(), rate_hz=0.0)


def camera(name: str, **details: str) -> CameraInfo:
    return CameraInfo(name=name, width=WIDTH, height=HEIGHT, rate_hz=60.0, details=details)


LEFT, DEPTH = camera("left"), camera("depth", **{CODING: DEPTH_PNG})
IMAGE = encode_jpeg(np.full((HEIGHT, WIDTH, 3), 90, np.uint8))


class Rig:
    """A view on rings that this test writes."""

    def __init__(self, stack: ExitStack, *sources: tuple[SensorInfo, tuple[CameraInfo, ...]]):
        self.stack = stack
        rings = [self.ring() for _ in sources]
        self.decisions, self.status = self.ring(), self.ring()
        self._requests = self.ring()
        self.beats = stack.enter_context(Beats())
        self.view = StationView(
            ViewConfig(
                sources=tuple(
                    PageSeen(url="", ring=ring, sensor=sensor, cameras=cameras)
                    for ring, (sensor, cameras) in zip(rings, sources, strict=True)
                ),
                decisions=(self.decisions,), status=self.status, requests=self._requests,
                beats=self.beats.name, stall_s=0.08,
            )
        )  # fmt: skip
        stack.callback(self.view.close)
        self.to = [stack.enter_context(RingWriter(ring)) for ring in rings]
        self.supervisor = stack.enter_context(RingWriter(self.status))
        self.monitor = stack.enter_context(RingWriter(self.decisions))
        self._asked = stack.enter_context(RingReader(self._requests))

    def ring(self) -> str:
        return self.stack.enter_context(Ring(2**16)).name

    def asked(self) -> list[Any]:
        return [unpack(content) for content in self._asked.take()]

    def frame(self, image: bytes, camera: int = 0, source: int = 0) -> None:
        frame = Frame(camera=camera, jpeg=image, counter=1, device_s=0.0, arrival_s=0.0,
                      fitted_s=0.0)  # fmt: skip
        self.to[source].put(pack(frame))


@pytest.fixture
def make() -> Iterator[Any]:
    with ExitStack() as stack:
        yield lambda *sources: Rig(stack, *sources)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> ManualClock:
    found = ManualClock()
    monkeypatch.setattr(page_link, "monotonic", found.now_s)
    monkeypatch.setattr(page_link, "sleep", found.advance)
    return found


def test_each_button_is_one_request(make: Any):
    rig = make((HAND, ()))
    rig.supervisor.put(pack({"time_s": 7.5}))
    assert rig.view.snapshot()["time_s"] == 7.5
    rig.view.acknowledge(frozenset({3, 2}))
    rig.view.disarm()
    assert rig.view.react("put down") == ""
    asked = [{"do": "acknowledge", "seen": [2, 3]}, {"do": "disarm"}]
    assert rig.asked() == [*asked, {"do": "react", "what": "put down"}]


def answered_after(rig: Rig, clock: ManualClock, patch: pytest.MonkeyPatch, *notes: Any) -> None:
    """Let the supervisor tell one of these at each look of the page."""
    left = list(notes)

    def sleep(seconds: float) -> None:
        clock.advance(seconds)
        if left:
            rig.supervisor.put(pack(left.pop(0)))

    patch.setattr(page_link, "sleep", sleep)


OFF = {"recording": {"on": False, "error": ""}}
ON = {"recording": {"on": True, "error": ""}}


def test_a_recording_is_begun_once_the_recorder_says_so(
    make: Any, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
):
    rig = make((HAND, ()))
    answered_after(rig, clock, monkeypatch, {}, OFF, ON)
    assert rig.view.record(True, {"object": "cup"}) == ""
    assert rig.asked() == [{"do": "record", "labels": {"object": "cup"}}]
    assert clock.now_s() == pytest.approx(0.06)


def test_a_recording_that_cannot_begin_is_reported_in_the_recorders_words(
    make: Any, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
):
    rig = make((HAND, ()))
    full = {"recording": {"on": False, "error": "the disk is full"}}
    answered_after(rig, clock, monkeypatch, OFF, full)
    assert rig.view.record(True, {}) == "the disk is full"
    assert clock.now_s() < 0.1
    answered_after(rig, clock, monkeypatch, full, full, ON)
    assert rig.view.record(True, {}) == ""  # there is room again: an old error is no answer
    answered_after(rig, clock, monkeypatch, *[full] * 500)
    assert rig.view.record(True, {}) == "the disk is full"


def test_a_second_recording_is_refused_with_the_name_of_the_first(
    make: Any, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
):
    """Before, a second page's labels were thrown away, and it was answered as if they stood."""
    rig = make((HAND, ()))
    first = {"recording": {"on": True, "path": "recordings/a.mcap", "error": ""}}
    answered_after(rig, clock, monkeypatch, first)
    assert rig.view.record(True, {"object": "b"}) == "recording already: recordings/a.mcap"
    assert rig.asked() == []


def test_a_recording_is_ended_although_an_old_error_is_reported(
    make: Any, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
):
    rig = make((HAND, ()))
    answered_after(rig, clock, monkeypatch, {"recording": {"on": True, "error": "slow"}}, OFF)
    assert rig.view.record(False, {}) == ""
    assert rig.asked() == [{"do": "end"}]


def test_a_recorder_that_says_nothing_is_reported_after_three_seconds(
    make: Any, clock: ManualClock
):
    rig = make((HAND, ()))
    assert rig.view.record(True, {}) == "the recorder does not answer"
    assert clock.now_s() == pytest.approx(3.0, abs=0.03)


def test_only_an_image_that_its_camera_can_have_made_is_shown(make: Any):
    rig = make((NONE, (LEFT, camera("left"))))
    assert rig.view.frame(0) is None
    large = encode_jpeg(np.zeros((HEIGHT, 2 * WIDTH, 3), np.uint8))
    for image in (b"<svg/>", large, IMAGE[:40]):
        rig.frame(image)
    assert [camera["name"] for camera in rig.view.snapshot()["cameras"]] == ["left", "left-2"]
    assert rig.view.frame(0) is None
    rig.frame(IMAGE, camera=1)
    rig.frame(IMAGE, camera=1)
    rig.view.snapshot()
    assert (rig.view.frame(0), rig.view.frame(1)) == (None, (2, IMAGE))
    assert rig.view.frame(2) is None


def test_depth_is_drawn_for_people_at_most_five_times_a_second(make: Any, clock: ManualClock):
    rig = make((HAND, ()), (NONE, (DEPTH,)))
    clock.advance(1.0)
    near, far = (encode_depth(np.full((HEIGHT, WIDTH), mm, np.uint16)) for mm in (300, 900))
    rig.frame(near, source=1)
    rig.view.snapshot()
    first = rig.view.frame(0)
    assert first is not None
    assert first[0] == 1
    assert first[1].startswith(b"\xff\xd8")

    rig.frame(far, source=1)
    rig.view.snapshot()
    clock.advance(0.19)
    assert rig.view.frame(0) == first
    clock.advance(0.02)
    second = rig.view.frame(0)
    assert second is not None
    assert second[0] == 2
    assert second[1] != first[1]


def test_where_no_image_can_be_drawn_a_depth_camera_is_refused(
    make: Any, monkeypatch: pytest.MonkeyPatch
):
    """The page's process ends and names what is missing; else its place would stay empty."""
    monkeypatch.setitem(sys.modules, "taxel.frame_codec", None)
    make((NONE, (LEFT,)))
    with pytest.raises(ImportError):
        make((NONE, (DEPTH,)))


def test_a_depth_image_that_cannot_be_drawn_leaves_the_one_before(make: Any, clock: ManualClock):
    rig = make((NONE, (DEPTH,)))
    clock.advance(1.0)
    rig.view._depth[0] = b"\x89PNG\r\n\x1a\n"
    assert rig.view.frame(0) is None
    assert page_link.draw_depth(b"", DEPTH) is None


def test_the_array_without_cameras_is_shown_with_gaps_where_a_value_is_not_usable(make: Any):
    rig = make((SIX, (LEFT,)), (HAND, ()))
    values = np.array([[0.1, 0.2], [0.3, np.nan], [0.5, 0.6]], np.float32)
    scans = Samples.from_values(values, np.array([0.0, 0.005, 0.02]), full_scale=3.3)
    rig.to[1].put(pack(scans))
    rig.to[0].put(pack(Samples.from_values(np.ones((1, 1)), np.zeros(1), full_scale=3.3)))
    traces = rig.view.traces(-math.inf)

    assert rig.view.snapshot()["array"]["name"] == "hand"
    assert traces["sensors"]["t"] == [0.0]  # rows a hundredth apart, half of them for a trace
    assert traces["time_s"] == 0.02
    np.testing.assert_allclose(traces["map"], values[[0, 2]] / 0.6, rtol=1e-6)


def test_no_line_is_drawn_across_a_pause_in_which_nothing_came(make: Any):
    """A board was silent for five seconds: a line fell from its last value to the next."""
    rig = make((HAND, ()))
    times_s = np.r_[np.arange(10) / 100, 5.0 + np.arange(10) / 100]
    rig.to[0].put(pack(Samples.from_values(np.ones((20, 2)), times_s)))
    trace = rig.view.traces(-math.inf)["sensors"]
    missing = np.isnan(np.array(trace["values"][0]))
    assert 1 <= missing.sum() <= 2
    assert all(0.09 <= t < 5.0 for t in np.array(trace["t"])[missing])


def test_a_slow_array_is_no_pause(make: Any):
    """It gives a row a second."""
    slow = SensorInfo(name="hand", channels=("a", "b"), units=("V", "V"), rate_hz=1.0)
    rig = make((slow, ()))
    rig.to[0].put(pack(Samples.from_values(np.ones((20, 2)), np.arange(20.0))))
    assert not np.isnan(np.array(rig.view.traces(-math.inf)["sensors"]["values"][0])).any()
    assert rig.view.snapshot()["array"]["gap_s"] == 5.0


def test_a_source_that_has_not_reported_for_a_second_is_not_shown_as_live(
    make: Any, clock: ManualClock
):
    """Its process hung: the page went on to say live, 1000 Hz."""
    rig = make((HAND, ()))
    note = {"kind": "source", "kind_of": "array", "name": "hand", "url": "", "state": "live",
            "rate_hz": 100.0, "nominal_hz": 100.0, "produced": 5, "lost": 0,
            "note": ""}  # fmt: skip
    rig.to[0].put(pack(note))
    assert rig.view.snapshot()["sources"][0]["state"] == "live"
    clock.advance(2.6)
    (shown,) = rig.view.snapshot()["sources"]
    assert (shown["state"], shown["rate_hz"], shown["note"]) == ("silent", 0.0, "no report for 3 s")
    for last in ("failed", "ended"):
        rig.to[0].put(pack(note | {"state": last}))
        rig.view.snapshot()
        clock.advance(2.6)
        assert rig.view.snapshot()["sources"][0]["state"] == last


def test_the_hands_numbers_are_per_cent_of_the_full_scale_where_there_is_one(make: Any):
    assert make((HAND, ())).view.snapshot()["array"]["scale"] == "the largest value"
    volts = SensorInfo(name="hand", channels=("a", "b"), units=("V", "V"), rate_hz=100.0,
                       full_scale=3.3)  # fmt: skip
    assert make((volts, ())).view.snapshot()["array"]["scale"] == "full scale"


def test_an_array_of_several_units_is_not_shown_under_the_first_channels_unit(make: Any):
    """A simulated cup's truth has millimetres and newtons beside the slip's micrometres."""
    truth = SensorInfo(name="truth", channels=("slip", "grip"), units=("um", "N"), rate_hz=60.0)
    assert make((truth, (LEFT,))).view.snapshot()["array"]["unit"] == "mixed units"
    assert make((HAND, ())).view.snapshot()["array"]["unit"] == "V"


def test_a_monitors_probability_is_drawn_where_it_was_measured(make: Any):
    rig = make((NONE, (LEFT,)))
    notes = (
        {"kind": "grasp", "time_s": 1.0, "p": 0.2}, {"kind": "grasp", "p": 0.9},
        {"kind": "answer", "time_s": 1.1}, {"kind": "grasp", "time_s": 2.0, "p": None},
    )  # fmt: skip
    for note in notes:
        rig.monitor.put(pack(note))
    traces = rig.view.traces(1.0)
    assert (traces["map"], traces["sensors"]) == (None, {"t": [], "values": []})
    assert traces["probability"]["t"] == [2.0]
    assert math.isnan(traces["probability"]["p"][0])
    assert rig.view.traces(3.0)["probability"]["t"] == [1.0, 2.0]  # another clock: all anew


def test_no_line_is_drawn_across_what_was_not_read_while_no_page_was_open(make: Any):
    """A ring keeps the newest alone; what it has overwritten is a gap in both traces."""
    rig = make((HAND, ()))

    def write(first: int, count: int) -> None:
        for number in range(first, first + count):
            time_s = number / 100.0
            rig.monitor.put(pack({"kind": "grasp", "time_s": time_s, "p": 0.2}))
            rig.to[0].put(pack(Samples.from_values(np.ones((1, 2)), np.array([time_s]))))

    write(0, 20)
    before = rig.view.traces(-math.inf)
    write(20, 20_000)
    after = rig.view.traces(before["time_s"])
    for name, values in (
        ("probability", lambda trace: trace["p"]), ("sensors", lambda trace: trace["values"][0]),
    ):  # fmt: skip
        assert not np.isnan(values(before[name])).any()
        t, found = np.array(after[name]["t"]), np.array(values(after[name]))
        jump = int(np.diff(t).argmax())
        assert np.diff(t)[jump] > 1.0
        assert np.flatnonzero(np.isnan(found)).tolist() == [jump]


def test_the_newest_moment_does_not_go_back_where_two_monitors_answer(make: Any):
    """The page took that for another clock, and cleared its traces."""
    rig = make((NONE, (LEFT,)))
    moments = []
    for time_s in (5.0, 4.99, 5.02):
        rig.monitor.put(pack({"kind": "grasp", "time_s": time_s, "p": 0.2}))
        moments.append(rig.view.traces(-math.inf)["time_s"])
    assert moments == [5.0, 5.0, 5.02]


def test_a_trace_of_scores_holds_no_probability(make: Any):
    rig = make((NONE, (LEFT,)))
    rig.supervisor.put(pack({"time_s": 0.5, "scored": True}))
    rig.monitor.put(pack({"kind": "grasp", "time_s": 1.0, "p": 0.2, "is_score": True}))
    rig.monitor.put(pack({"kind": "grasp", "time_s": 2.0, "p": 0.9, "is_score": False}))
    assert rig.view.traces(-math.inf)["probability"] == {"t": [1.0], "p": [0.2]}


def test_before_a_station_reports_anything_the_page_claims_nothing(make: Any):
    rig = make((NONE, (LEFT,)))
    for content in (None, b"N[1]"):
        if content is not None:
            rig.supervisor.put(content)
        snapshot = rig.view.snapshot()
        assert (snapshot["state"], snapshot["gripper"], snapshot["array"]) == (
            "UNKNOWN",
            None,
            None,
        )


@pytest.mark.parametrize("rate_hz", [100.0, 100.05, 101.0, 50.0, 20.0])
def test_an_array_is_shown_whole_up_to_50_points_a_second(make: Any, rate_hz: float):
    """Every second row was left out: of a board's 100.05 Hz, and of a slow array."""
    rig = make((replace(HAND, rate_hz=round(rate_hz, -1)), ()))
    rig.to[0].put(pack(Samples.from_values(np.ones((200, 2)), 5.0 + np.arange(200) / rate_hz)))
    assert len(rig.view.traces(-math.inf)["sensors"]["t"]) == (100 if rate_hz > 50 else 200)


def test_what_comes_later_than_newer_rows_of_an_array_is_shown_all_the_same(make: Any):
    """A decision is of images of some 40 ms ago, an event waits for a status: never shown."""
    rig = make((NONE, (LEFT,)), (HAND, ()))

    def rows(*times_s: float) -> None:
        rig.to[1].put(pack(Samples.from_values(np.ones((len(times_s), 2)), np.array(times_s))))

    def event(*times_s: float) -> None:
        rig.supervisor.put(pack({"events": [[t, f"at {t:g}"] for t in times_s]}))

    rows(5.0, 5.02)
    event(4.9)
    first = rig.view.traces(-math.inf)
    assert (first["time_s"], [found["t"] for found in first["events"]]) == (5.02, [4.9])
    rig.monitor.put(pack({"kind": "grasp", "time_s": 4.98, "p": 0.7}))
    event(4.9, 5.01)
    rows(5.04)
    second = rig.view.traces(first["time_s"])
    assert second["probability"] == {"t": [4.98], "p": [0.7]}
    assert [found["t"] for found in second["events"]] == [5.01]
    assert second["sensors"]["t"] == [5.04]
    third = rig.view.traces(second["time_s"])
    assert (third["probability"]["t"], third["sensors"]["t"], third["events"]) == ([], [], [])


def test_an_event_is_sent_once_where_no_source_gives_anything_any_more(make: Any):
    rig = make((HAND, ()))
    rig.to[0].put(pack(Samples.from_values(np.ones((1, 2)), np.array([5.0]))))
    rig.supervisor.put(pack({"events": [[6.0, "the hand is gone"]]}))
    assert len((first := rig.view.traces(-math.inf))["events"]) == 1
    assert rig.view.traces(first["time_s"])["events"] == []
