"""The first minutes on simulated cups: nothing false is told, and each UNKNOWN says why."""

from __future__ import annotations

import json
import struct
from collections import Counter
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from taxel.bench.faults.hostile_images import replay, write_hostile_replay
from taxel.bundles.grasp import read_grasp_bundle
from taxel.bundles.shipped import DEFAULT_WARNING, shipped_bundle
from taxel.clock import ManualClock
from taxel.decisions.reasons import SIMULATED, kind_of
from taxel.decisions.stability import Stability
from taxel.live.camera_health import CameraHealth
from taxel.live.grasp_monitor import GraspMonitor
from taxel.live.station import grasp_watcher
from taxel.live.station.packets import ends_grasp
from taxel.recordings.reader import iterate_frames
from taxel.signals import PAUSE, CameraInfo, Frame, Mark
from taxel.sim.gelsight.mini import camera_times
from taxel.sources.opening import open_source
from taxel.sources.simulated.pour import MOST_LOST, PAUSE_S
from taxel.sources.simulated.pour_sets import ARRIVAL_S
from taxel.windows.pairs import FramePairer

CAMERAS = tuple(
    CameraInfo(name=name, width=320, height=240, rate_hz=60.0, serial="sim://cup-pour 1",
               details={PAUSE: f"{PAUSE_S:g}"})
    for name in ("left", "right")
)  # fmt: skip


def frame(camera: int, number: int, time_s: float, cup: int = 0) -> Frame:
    jpeg = struct.pack(">iii", cup, camera, number)
    return Frame(camera=camera, jpeg=jpeg, counter=number, device_s=time_s,
                 arrival_s=time_s + ARRIVAL_S, fitted_s=time_s)  # fmt: skip


def doubts_of_cups(cups: int, most_lost: int | None) -> Counter[str]:
    """Return what the watchers doubt, and how often, while cups follow each other.

    Frames have the simulated cameras' clocks; the watchers are asked every 5 ms.
    """
    health, doubts = CameraHealth(CAMERAS), Counter[str]()
    start_s = 0.0
    for cup in range(cups):
        times = [camera_times(25.0, 60.0, 6.0, 2 * cup + side, most_lost=most_lost)
                 for side in (0, 1)]  # fmt: skip
        for index in range(360):
            time_s = start_s + index / 60
            for camera in (0, 1):
                health.see(frame(camera, int(times[camera].shown[index]), time_s, cup))
            for later_s in np.arange(0.0, 1 / 60, 0.005):
                doubts[health.doubt(time_s + ARRIVAL_S + later_s)] += 1
        health.rest(time_s + PAUSE_S)
        for later_s in np.arange(0.0, PAUSE_S, 0.005):
            doubts[health.doubt(time_s + ARRIVAL_S + later_s)] += 1
        assert health.late() == {}
        start_s = time_s + PAUSE_S + 1 / 60
    return doubts


def test_in_ten_simulated_minutes_no_camera_is_called_gone_frozen_or_late():
    assert set(doubts_of_cups(93, MOST_LOST)) == {""}


def test_images_lost_as_in_data_sets_are_reported_as_a_simulated_fault():
    """Where a camera loses up to 40 % of its images, it is frozen on purpose, and that is said."""
    doubts = set(doubts_of_cups(60, None)) - {""}

    assert doubts
    assert all(
        reason.startswith(f"{SIMULATED}the ") and reason.endswith("is frozen") for reason in doubts
    )


@pytest.mark.parametrize("most", [0, 1, 3])
def test_no_more_images_are_lost_in_a_row_than_was_asked_for(most: int):
    for seed in range(40):
        free = camera_times(25.0, 60.0, 6.0, seed)
        held = camera_times(25.0, 60.0, 6.0, seed, most_lost=most)
        assert np.diff(held.taken_s).max() < (most + 1.5) / 25
        assert len(held.taken_s) >= len(free.taken_s)


def test_a_camera_that_stays_away_after_the_pause_is_reported_within_100_ms():
    health = CameraHealth(CAMERAS)
    for index in range(60):
        for camera in (0, 1):
            health.see(frame(camera, index, index / 60))
    end_s = 59 / 60
    health.rest(end_s + PAUSE_S)
    noticed_s = next(s for s in np.arange(0.0, 1.0, 0.001) if health.doubt(end_s + PAUSE_S + s))

    assert 0.0 < noticed_s <= 0.1


def test_a_camera_that_froze_in_the_pause_is_reported_by_its_third_missing_image():
    health = CameraHealth(CAMERAS)
    for index in range(60):
        for camera in (0, 1):
            health.see(frame(camera, index, index / 60))
    health.rest(59 / 60 + PAUSE_S)
    doubts = []
    for index in range(5):
        time_s = 59 / 60 + PAUSE_S + index / 60
        health.see(frame(0, 100 + index, time_s))
        health.see(frame(1, 59, time_s))
        doubts.append(kind_of(health.doubt(time_s + ARRIVAL_S)))

    assert doubts == [None, None, None, "frozen", "frozen"]


def test_a_real_camera_that_sends_nothing_after_a_mark_is_gone_as_ever():
    """It said nothing of a pause."""
    bundle = read_grasp_bundle(shipped_bundle(DEFAULT_WARNING))
    monitor = GraspMonitor(bundle, tuple(replace(camera, details={}) for camera in CAMERAS))
    for camera in (0, 1):
        monitor.see(frame(camera, 0, 0.0))
    assert monitor.over(0.0, 0.01).state is Stability.NO_GRASP
    assert kind_of(monitor.at(0.1).reason) == "gone"


def test_a_mark_from_ahead_does_not_keep_cameras_from_being_missed():
    monitor = GraspMonitor(read_grasp_bundle(shipped_bundle(DEFAULT_WARNING)), CAMERAS)
    for camera in (0, 1):
        monitor.see(frame(camera, 0, 0.0))
    assert monitor.over(1e9, 0.01).state is Stability.NO_GRASP
    assert kind_of(monitor.at(0.01 + PAUSE_S + 0.2).reason) == "gone"


class _Ring:
    """Keeps what a watcher writes."""

    def __init__(self) -> None:
        self.notes: list[dict[str, Any]] = []

    def put(self, content: bytes) -> None:
        self.notes.append(json.loads(content[1:]))


@pytest.fixture(scope="module")
def watched() -> list[dict[str, Any]]:
    """The notes of the station's own watcher over two cups, on a manual clock."""
    clock, ring = ManualClock(50.0), _Ring()
    with (
        pytest.MonkeyPatch.context() as patched,
        open_source("sim://cup-pour?runs=2&duration_s=1.5&seed=4&kind=still", clock) as source,
    ):
        patched.setattr(grasp_watcher, "monotonic", clock.now_s)
        place, path = SimpleNamespace(name="monitor"), shipped_bundle(DEFAULT_WARNING)
        job = SimpleNamespace(
            place=place, bundles=(path,), cameras=source.cameras, trust=None, device="cpu"
        )
        watcher = grasp_watcher.GraspWatcher(path, job, ring, 0)  # type: ignore[arg-type]
        pulse = SimpleNamespace(beat=lambda **_: None)
        while not source.ended:
            source.read(0.005)
            packets = [*source.frames(), *source.marks()]
            if packets:
                now_s = clock.now_s()
                came = {"put_s": now_s, "taken_s": now_s}
                watcher.take(packets, came, pulse)  # type: ignore[arg-type]
            else:
                watcher.silent(clock.now_s())
    return ring.notes


def test_between_cups_the_watcher_says_no_grasp_and_nothing_is_gone(watched: list[dict[str, Any]]):
    states = [note["state"] for note in watched if note["kind"] == "grasp"]
    short = [state for i, state in enumerate(states) if i == 0 or state != states[i - 1]]

    assert short == ["UNKNOWN", "STABLE", "NO_GRASP"] * 2
    assert sum(note["kind"] == "new grasp" for note in watched) == 2


def test_every_unknown_of_the_watcher_has_its_reason_in_the_table(watched: list[dict[str, Any]]):
    kinds = Counter(
        kind_of(note["reason"]) for note in watched if note.get("state") in ("UNKNOWN", "NO_GRASP")
    )

    assert None not in kinds
    assert {"no input", "settling", "grasp over"} <= set(kinds)
    assert not set(kinds) & {"gone", "frozen", "old"}


def test_settling_says_what_is_left_and_that_holds(watched: list[dict[str, Any]]):
    """What is left falls from frame to frame, and the state is told when it is over."""
    notes = [note for note in watched if "time_s" in note]
    first = notes[: next(i for i, note in enumerate(notes) if note["state"] == "STABLE") + 1]
    left_s = [float(answer["reason"].split()[-3]) for answer in first if answer["reason"]]
    took_s = first[-1]["time_s"] - first[0]["time_s"]

    assert left_s == sorted(left_s, reverse=True)
    assert abs(took_s - left_s[0]) < 0.1


def test_a_hostile_image_is_unknown_with_its_reason_and_the_run_goes_on(
    few_pours: Path, tmp_path: Path
):
    """A replay with a few images of 20,000 × 20,000 px, and progressive ones, in its middle."""
    source = sorted(few_pours.glob("*.mcap"))[0]
    path = tmp_path / "hostile.mcap"
    written = write_hostile_replay(source, path, first=140, count=10)
    assert [kept.jpeg for kept in iterate_frames(path)] == [kept.jpeg for kept in written]

    replayed = replay(path)

    assert len(replayed.bad) == 5
    assert any("needed images of 320 × 240 px; got one of 20000 × 20000 px" in reason
               for reason in replayed.bad)  # fmt: skip
    assert any("progressive" in reason for reason in replayed.bad)
    assert replayed.moments == len(written) // 2
    assert replayed.decided == replayed.after > 0


def test_frames_pair_as_ever_across_a_pause():
    """The pairer needs no word of the pause: what waits from before is let go."""
    pairer = FramePairer(2)
    assert pairer.push(frame(0, 0, 0.0)) is None
    assert pairer.push(frame(1, 1, 0.5)) is None
    assert pairer.push(frame(0, 1, 0.5)) is not None


def test_a_mark_without_an_outcome_ends_no_grasp():
    hand = Mark(start_s=0.0, end_s=1.0, labels={"shape": "ball"})
    assert not ends_grasp(hand)
