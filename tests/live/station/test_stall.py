"""A supervisor that stands still or is killed, in real processes, stopped from outside."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest

from taxel.live.station.alarm_watch import StallAlarm
from taxel.live.station.beats import Beats, BeatsView
from taxel.live.station.shared import SHARED

WAIT_S = 40.0
"""Longest wait on a busy machine; what is waited for usually comes within a second."""

_STATION = """
import json, sys
from pathlib import Path
from taxel.actions.interlock import InterlockConfig
from taxel.live.station.page_link import StationView
from taxel.live.station.station import Station
from taxel.live.station.wiring import StationConfig
if __name__ == "__main__":
    config = StationConfig(
        sources=("sim://teng",), bundles=(),
        interlock=InterlockConfig(min_n=15.0, max_n=50.0, stall_s=0.3),
    )
    with Station(config) as station:
        view = station.view_config()
        if len(sys.argv) > 1:
            station.record(Path(sys.argv[1]), {})
        print(json.dumps({
            "workers": {name: p.pid for name, p in station.workers().items()},
            "beats": view.beats,
        }), flush=True)
        ordered = []

        def order(now_s):
            if station.recording.get("kept", 0) > 5 and not ordered:
                ordered.append(1)
                print("recording", flush=True)
            if any("stood still" in text for _, _, text in station.events):
                print(json.dumps([text for _, _, text in station.events]), flush=True)
                station.stop()

        station.run(120.0, on_tick=order)
"""


class Program:
    """A station in a program of its own."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        script = folder / "station.py"
        script.write_text(_STATION)
        self.process = subprocess.Popen(
            [sys.executable, str(script), *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        self.pid = self.process.pid
        ready = json.loads(self.line())
        self.workers: dict[str, int] = ready["workers"]
        self.beats: str = ready["beats"]

    def line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline().decode()

    def terminal(self, words: bytes) -> float:
        """Return when some words stood on its terminal, monotonic seconds."""
        assert self.process.stderr is not None
        found, limit_s = b"", monotonic() + WAIT_S
        while words not in found:
            assert select.select([self.process.stderr], [], [], limit_s - monotonic())[0], found
            found += os.read(self.process.stderr.fileno(), 4096)
        return monotonic()

    def memory(self) -> list[str]:
        return [path.name for path in SHARED.glob(f"taxel_*_{self.pid}_*")]


@pytest.fixture
def program(tmp_path: Path) -> Iterator[Callable[..., Program]]:
    made: list[Program] = []

    def make(*arguments: str) -> Program:
        made.append(Program(tmp_path, *arguments))
        return made[-1]

    yield make
    for station in made:
        for pid in (station.pid, *station.workers.values()):
            _signal(pid, signal.SIGCONT)
        station.process.kill()
        station.process.wait()
        for stream in (station.process.stdout, station.process.stderr):
            if stream is not None:
                stream.close()


def _signal(pid: int, number: signal.Signals) -> None:
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        return


def gone(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True


def until(holds: Callable[[], bool], what: str) -> None:
    limit_s = monotonic() + WAIT_S
    while not holds():
        assert monotonic() < limit_s, what
        sleep(0.02)


def test_the_alarm_sounds_once_a_second_while_the_supervisor_stands_still():
    alarm = StallAlarm(0.08)
    alarms = [ms for ms in range(0, 3000, 5) if alarm.look(ms / 1000.0)]
    assert alarms == [85, 1085, 2085]
    assert alarm.raised == 1
    assert alarm.look(0.001) == ""
    assert alarm.look(0.2) == (
        "the supervisor has stood still for 0.20 s: nothing watches the grasp, orders have expired"
    )
    assert alarm.raised == 2


def test_no_tick_is_due_before_the_first_and_after_a_rest():
    with Beats() as beats:
        view = BeatsView(beats.name)
        assert view.still_s(1e6) == 0.0
        beats.tick(100.0)
        assert view.still_s(100.5) == pytest.approx(0.5)
        beats.rest()
        assert view.still_s(1e6) == 0.0
        view.close()


@pytest.mark.slow
@pytest.mark.data
def test_a_stopped_supervisor_is_alarmed_on_terminal_and_page_and_knows_of_it_afterwards(
    program: Callable[..., Program],
):
    station = program()
    board = BeatsView(station.beats)
    until(lambda: 0.0 < board.still_s(monotonic()) < 0.3, "no tick")
    os.kill(station.pid, signal.SIGSTOP)
    station.terminal(b"ALARM: the supervisor has stood still for 0.3")
    still_s = board.still_s(monotonic())
    assert still_s > 0.3
    os.kill(station.pid, signal.SIGCONT)
    board.close()
    lines: list[Any] = []
    while not lines:
        line = station.line()
        assert line, "the station ended"
        lines = json.loads(line) if line.startswith("[") else []
    assert any(text.startswith("the supervisor stood still for 0.") for text in lines)


@pytest.mark.slow
@pytest.mark.data
@pytest.mark.parametrize("name", ["source", "recorder", "alarm watch"])
def test_a_killed_supervisor_leaves_no_process_though_one_was_stopped_and_no_memory(
    program: Callable[..., Program], name: str
):
    station = program()
    os.kill(station.workers[name], signal.SIGSTOP)
    assert station.memory()
    station.process.kill()
    station.process.wait()
    until(lambda: all(map(gone, station.workers.values())), "a process has outlived its supervisor")
    until(lambda: not station.memory(), "shared memory is left")


@pytest.mark.slow
@pytest.mark.data
def test_a_recorder_that_was_stopped_completes_its_file_when_the_supervisor_is_killed(
    program: Callable[..., Program], tmp_path: Path
):
    path = tmp_path / "all.mcap"
    station = program(str(path))
    assert station.line() == "recording\n"
    os.kill(station.workers["recorder"], signal.SIGSTOP)
    station.process.kill()
    station.process.wait()
    until(lambda: gone(station.workers["recorder"]), "the recorder has not ended")
    assert path.exists()


@pytest.mark.slow
@pytest.mark.data
def test_the_alarm_watch_says_that_the_supervisor_was_killed(program: Callable[..., Program]):
    station = program()
    board = BeatsView(station.beats)
    until(lambda: board.still_s(monotonic()) > 0.0, "no tick")
    board.close()
    station.process.kill()
    station.terminal(b"ALARM: the supervisor has ended without a word")
