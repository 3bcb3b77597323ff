"""The process that reads a source: orders to a gripper, a source that ends, a word to end early."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Iterator
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path
from time import monotonic
from typing import Any, cast

import numpy as np
import pytest
from station_rig import WAIT_S, until

from taxel.errors import BadRecording, BadSource
from taxel.live.station import acquisition
from taxel.live.station.acquisition import Acquisition, acquire
from taxel.live.station.beats import Beats, Work
from taxel.live.station.packets import pack, unpack
from taxel.live.station.page_link import StationView
from taxel.live.station.ring import Ring, RingReader, RingWriter
from taxel.live.station.station import Station
from taxel.live.station.wiring import StationConfig, _check_pace
from taxel.live.station.worker import Place, Pulse
from taxel.signals import CameraInfo, Frame, Mark, Samples, SensorInfo
from taxel.sources.boards.emulation import EmulatedBoard, RunningBoard
from taxel.sources.opening import is_replay

CONTEXT = multiprocessing.get_context("spawn")
HAND = SensorInfo(name="hand", channels=("a",), units=("V",), rate_hz=100.0)


class Cup:
    """A source of one scan a read; the test says what happens at which read."""

    info = HAND
    cameras: tuple[CameraInfo, ...] = ()

    def __init__(self, pulse: Pulse, reads: int, ends_at: int | None = None) -> None:
        self._pulse, self._reads, self._ends_at = pulse, reads, ends_at
        self.read_times = 0
        self.orders: dict[int, list[dict[str, Any]]] = {}
        self.to: RingWriter | None = None
        self.forces_n: list[float] = []
        self.fails_at: int | None = None

    @property
    def ended(self) -> bool:
        return self._ends_at is not None and self.read_times >= self._ends_at

    def read(self, timeout_s: float) -> Samples:
        ended = self.ended
        self.read_times += 1
        if self.read_times == self.fails_at:
            raise BadRecording("a whole recording", "damaged bytes", "run: taxel recover")
        for order in self.orders.get(self.read_times, []):
            assert self.to is not None
            self.to.put(pack(order))
        if self.read_times >= self._reads:
            self._pulse.end_here()
        if ended:
            return Samples.empty(1)
        return Samples.from_values(np.ones((1, 1)), np.array([self.read_times / 100]), 3.3)

    def frames(self) -> list[Frame]:
        return []

    def marks(self) -> list[Mark]:
        return []

    def grip(self, force_n: float) -> None:
        self.forces_n.append(force_n)


class Rig:
    """The loop of a source's process on real rings, in this process."""

    def __init__(self, stack: ExitStack, **cup: Any) -> None:
        self._beats = stack.enter_context(Beats())
        place = Place(
            name="source", beats=self._beats.name, row=2, parent=os.getppid(),
            report=cast("Any", None),
        )  # fmt: skip
        self._pulse = stack.enter_context(closing(Pulse(place)))
        ring, orders = (stack.enter_context(Ring(2**16)).name for _ in range(2))
        self._reader = stack.enter_context(RingReader(ring))
        self._writer = stack.enter_context(RingWriter(ring))
        self._orders = stack.enter_context(RingReader(orders))
        self._job = Acquisition(place=place, url="sim://cup", ring=ring, orders=orders)
        self.cup = Cup(self._pulse, **cup)
        self.cup.to = stack.enter_context(RingWriter(orders))

    def run(self, *, once: bool = False) -> list[Any]:
        """Run until the cup asks for the end; return what was put into the ring."""
        job, cup = replace(self._job, once=once), cast("Any", self.cup)
        acquisition._pump(cup, self._writer, self._orders, self._pulse, job)
        return self.taken()

    def taken(self) -> list[Any]:
        return [unpack(content) for content in self._reader.take()]

    @property
    def work(self) -> Work:
        return self._beats.read(2).work

    @property
    def produced(self) -> int:
        return self._beats.read(2).produced


@pytest.fixture
def make() -> Iterator[Any]:
    with ExitStack() as stack:
        yield lambda **cup: Rig(stack, **cup)


def test_an_order_that_comes_while_a_source_runs_is_obeyed_and_one_that_has_expired_is_not(
    make: Any,
):
    rig = make(reads=6)
    later_s = monotonic() + WAIT_S
    rig.cup.orders = {
        2: [{"grip_n": 30.0, "expires_s": later_s}], 3: [{"grip_n": 40.0, "expires_s": 0.0}],
        4: [{"grip_n": 20.0, "expires_s": later_s}, {"grip_n": 35.0, "expires_s": later_s}],
    }  # fmt: skip
    rig.run()
    assert rig.cup.forces_n == [30.0, 35.0]
    assert rig.work is Work.RUNNING


def test_a_source_that_ended_says_so_once_and_lives_on_until_it_is_asked_to_end(make: Any):
    """A monitor must see the end, and the recorder has to be given all that came before it."""
    rig = make(reads=6, ends_at=3)
    packets = rig.run()
    scans = [packet for packet in packets if isinstance(packet, Samples)]
    ends = [i for i, p in enumerate(packets) if isinstance(p, dict) and "ended" in p]
    assert len(scans) == 3
    assert len(ends) == 1
    assert not any(isinstance(packet, Samples) for packet in packets[ends[0] :])
    assert (rig.work, rig.produced) == (Work.ENDED, len(packets))


@pytest.mark.parametrize("once", [True, False])
def test_a_failed_source_is_over_for_its_monitors_only_where_it_is_not_started_again(
    make: Any, once: bool
):
    """Else a monitor would keep its grasp for the frames of a camera that comes back."""
    rig = make(reads=6)
    rig.cup.fails_at = 4
    with pytest.raises(BadRecording, match="damaged bytes"):
        rig.run(once=once)
    packets = rig.taken()
    assert sum(isinstance(packet, Samples) for packet in packets) == 3
    assert any(isinstance(packet, dict) and "ended" in packet for packet in packets) is once


def test_the_last_report_of_a_failed_source_says_why(make: Any):
    rig = make(reads=6)
    rig.cup.fails_at = 4
    with pytest.raises(BadRecording):
        rig.run()
    *_, report = rig.taken()
    assert (report["kind"], report["state"], report["rate_hz"]) == ("source", "failed", 0.0)
    assert report["produced"] == 3
    assert "damaged bytes" in report["note"]


@pytest.mark.parametrize(
    ("url", "replayed"),
    [("{file}", True), ("replay://{file}?scene=yes", True), ("sim://teng", False),
     ("camera:///dev/video0", False), ("serial:///dev/ttyACM0", False)],
)  # fmt: skip
def test_recordings_alone_are_read_once_and_devices_are_opened_again(
    tmp_path: Path, url: str, replayed: bool
):
    file = tmp_path / "a.mcap"
    file.write_bytes(b"")
    assert is_replay(url.format(file=file)) is replayed


@pytest.mark.parametrize("number", [signal.SIGTERM, None], ids=["SIGTERM", "the station's word"])
def test_a_source_that_must_end_before_it_may_begin_ends_cleanly_and_gave_nothing(
    number: signal.Signals | None,
):
    """Ctrl-C at a terminal reaches every process; it is the supervisor's alone."""
    with ExitStack() as stack:
        beats = stack.enter_context(Beats())
        ring, orders = (stack.enter_context(Ring(2**16)).name for _ in range(2))
        mine, theirs = CONTEXT.Pipe(duplex=False)
        place = Place(name="source", beats=beats.name, row=0, parent=os.getpid(), report=theirs)
        job = Acquisition(place=place, url="sim://teng", ring=ring, orders=orders)
        process = CONTEXT.Process(target=acquire, args=(job,))
        process.start()
        theirs.close()
        assert mine.poll(WAIT_S)
        words = mine.recv()
        assert words[0] == "opened"
        assert process.pid is not None
        os.kill(process.pid, signal.SIGINT)
        assert beats.read(0).work is Work.STARTING
        if number is None:
            beats.stop()
        else:
            os.kill(process.pid, number)
        process.join(WAIT_S)
        assert process.exitcode == 0
        assert (beats.read(0).work, beats.read(0).produced) == (Work.ENDED, 0)


def test_a_board_whose_cable_is_pulled_is_reported_while_its_process_lives_on(tmp_path: Path):
    with (
        RunningBoard(EmulatedBoard(), tmp_path / "board") as board,
        Station(StationConfig(sources=(f"serial://{board.port.path}",), bundles=())) as station,
        closing(StationView(station.view_config())) as view,
    ):
        notes: list[dict[str, Any]] = []

        def shown() -> dict[str, Any]:
            notes[:] = view.snapshot()["sources"]
            return notes[0] if notes else {}

        station.run(0.0)
        until(station, lambda: shown().get("produced", 0) > 100)
        assert (notes[0]["kind"], notes[0]["state"]) == ("array", "live")
        board.unplug()
        until(station, lambda: "rows with missing values" in shown()["note"])
        before = notes[0]["note"]
        board.replug()
        until(station, lambda: shown()["produced"] > 1000)
        assert station.failed == ""
        assert before != ""
    assert station.ledger()["source"]["starts"] == 1


def test_a_speed_of_one_is_one_however_it_is_written() -> None:
    """speed=1.0 was refused: needed speed=1."""
    for own in ("replay://a.mcap", "sim://teng?speed=1", "replay://a.mcap?speed=1.0"):
        _check_pace(own)
    for other in ("max", "2", "1.5", "nan", "0.9999999"):
        with pytest.raises(BadSource, match="speed=1 where several processes run"):
            _check_pace(f"sim://teng?speed={other}")


def test_the_speed_behind_a_name_with_a_question_mark_counts(tmp_path: Path) -> None:
    (tmp_path / "why?.mcap").touch()
    with pytest.raises(BadSource, match="speed=1 where several processes run"):
        _check_pace(f"replay://{tmp_path}/why?.mcap?speed=max")
