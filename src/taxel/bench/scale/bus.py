"""Figures of the live bus and of a fleet's view, beside their goals; part of `taxel bench scale`.

Knows nothing about other engines and formats.
"""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import ExitStack, suppress
from importlib.util import find_spec
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np

from taxel.bench.real_mosquitto import MOSQUITTO, Mosquitto, free_port
from taxel.bench.rows import Row, missing, row
from taxel.frame_codec import encode_jpeg
from taxel.live.station.beats import Beats
from taxel.live.station.packets import pack
from taxel.live.station.page_link import PageSeen, ViewConfig
from taxel.live.station.processes import ProcessGroup
from taxel.live.station.ring import Ring, RingWriter
from taxel.signals import CameraInfo, Frame, Samples, SensorInfo

Measure = Callable[[], list[Row]]
_RATE_HZ, _FRAME_HZ, _CHANNELS = 1000.0, 25.0, 12
"""Of the hand and of each of two cameras. Source: issue 19."""
_SECONDS = 20.0
_SIZE = (320, 240)
"""Of the images, pixels."""
_STATIONS, _WATCHED_S = 50, 20.0
_LOST = "live bus, 1 kHz × 12 and 2 × 25 Hz: scans and frames lost"
_SHARE = f"fleet: `taxel fleet` with {_STATIONS} stations, share of a core"
_REPORTS = """
import sys, time
from contextlib import ExitStack
from taxel.bus.addresses import parse_mqtt
from taxel.fleet.reporter import Reporter
alarm = {"kind": "slip", "text": "the cup slips", "level": "warning", "since_s": 0.0,
         "acknowledged": False}
with ExitStack() as stack:
    every = [stack.enter_context(Reporter(parse_mqtt(url), ("cup-pour.taxel 0123456789ab",)))
             for url in sys.argv[1:]]
    while True:
        now_s = time.monotonic()
        state = {"time_s": now_s, "state": "WARNING", "reason": "the cup slips", "since_s": 0.0,
                 "alarms": [alarm], "consumers": [{"name": name, "state": "running", "dropped": 0}
                 for name in ("monitor", "recorder", "page", "alarm watch")]}
        for reporter in every:
            reporter.take_in("/state", state, float(state["time_s"]))
            reporter.report(now_s)
        time.sleep(0.05)
"""
_LISTENER = """
import json, sys, time
import numpy as np
from taxel.bus.zenoh_reader import BusReader
scans, frames, late = 0, 0, []
with BusReader(sys.argv[1]) as reader:
    print("ready", flush=True)
    quiet_s = time.monotonic() + 10.0
    while time.monotonic() < quiet_s:
        for message in reader.take(wait_s=0.1):
            if message.topic == "touch/teng":
                quiet_s = time.monotonic() + 1.0
                scans += len(message.value)
                late += (message.came_s - message.value.arrival_s).tolist()
            elif message.topic.startswith("camera/"):
                frames += 1
    print(json.dumps({"scans": scans, "frames": frames, "lost": reader.lost,
                      "lost_before": reader.lost_before,
                      "late_ms": np.percentile(np.array(late) * 1000, (50, 99, 100)).tolist()}))
"""


def quick_steps() -> list[tuple[str, Measure]]:
    """Return the measurements: (what, how)."""
    from taxel.bench.faults.bus import bus_rows

    return [
        ("scans and frames over the live bus", zenoh_rows),
        ("a stopped subscriber of the live bus", bus_rows),
        ("a fleet of 50 stations", fleet_rows),
    ]


def zenoh_rows() -> list[Row]:
    """Put a hand's scans and two cameras' frames into rings; count and time what a subscriber
    gets.
    """
    from taxel.bus.addresses import parse_zenoh
    from taxel.bus.zenoh_publisher import ZenohPublishing, publish

    if find_spec("zenoh") is None:
        return [missing(_LOST, "of all", "<= 0", "eclipse-zenoh is not installed")]
    url = f"zenoh://127.0.0.1:{free_port()}/bench"
    with ExitStack() as stack:
        beats = stack.enter_context(Beats())
        processes = ProcessGroup(beats)
        stack.callback(processes.close)
        source, view = _rings(stack, beats.name)
        processes.opened(
            processes.add("publisher", publish, lambda place: ZenohPublishing(
                place=place, view=view, address=parse_zenoh(url)))
        )  # fmt: skip
        listener = stack.enter_context(_program(_LISTENER, url))
        assert listener.stdout is not None
        listener.stdout.readline()
        sleep(1.0)  # until publisher and subscriber know each other
        sent = _send(source, _SECONDS)
        received: dict[str, Any] = json.loads(listener.stdout.readline())
    scans, frames = sent
    gone = scans - received["scans"] + frames - received["frames"]
    p50, p99, most = received["late_ms"]
    return [
        row(_LOST, gone, "of "
            f"{scans + frames:,}", "<=", 0.0, f"{received['lost']} messages by number, "
            f"{received['lost_before']} before the publisher; {_SECONDS:g} s"),
        row("live bus: from a scan's ring to a subscriber, 99 %", p99, "ms", "<=", 15.0,
            f"batches of 10 ms; median {p50:.1f}, longest {most:.1f} ms; the machine's load was "
            f"{os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"),
    ]  # fmt: skip


def fleet_rows() -> list[Row]:
    """Let 50 stations report to a real broker; watch the watcher, kill one, stop one."""
    if MOSQUITTO is None or find_spec("paho") is None:
        return [missing(_SHARE, "%", "<= 10", "mosquitto or paho-mqtt is not installed")]
    from taxel.bus.addresses import parse_mqtt
    from taxel.fleet.watch import FleetWatch

    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch, ExitStack() as stack:
        broker = Mosquitto(Path(scratch))
        broker.start()
        stack.callback(broker.kill)
        place = f"mqtt://127.0.0.1:{broker.port}"
        names = [f"{place}/s{number:02}" for number in range(_STATIONS - 2)]
        stack.enter_context(_program(_REPORTS, *names))
        killed = stack.enter_context(_program(_REPORTS, f"{place}/killed"))
        halted = stack.enter_context(_program(_REPORTS, f"{place}/halted"))
        sleep(3.0)
        fleet_s, found = _watched(place)
        broker_s = broker.cpu_s()
        with FleetWatch(parse_mqtt(place)) as watch:
            sleep(2.5)
            killed.kill()
            gone_s = _until_shown(watch, "killed")
            halted.send_signal(signal.SIGSTOP)
            silent_s = _until_shown(watch, "halted")
    live = sum(station["presence"] == "WARNING" for station in found["stations"])
    return [
        row(_SHARE, 100 * fleet_s / _WATCHED_S, "%", "<=", 10.0,
            f"{live} of {_STATIONS} stations shown as they are; over {_WATCHED_S:g} s without "
            f"the program's start; the broker since its own start: {broker_s:.2f} s"),
        row("fleet: a station killed by -9 is shown as gone within", gone_s, "s", "<=", 10.0,
            "by its last will"),
        row("fleet: a station that is stopped, as one whose network is cut, is shown as silent "
            "within", silent_s, "s", "<=", 10.0, "its last will follows its keep-alive"),
    ]  # fmt: skip


def _rings(stack: ExitStack, beats: str) -> tuple[RingWriter, ViewConfig]:
    """Return a source's ring, and what a publisher needs to read it."""
    ring = stack.enter_context(Ring(16 * 2**20)).name
    status, requests = (stack.enter_context(Ring(2**18)).name for _ in range(2))
    cameras = tuple(
        CameraInfo(name=name, width=_SIZE[0], height=_SIZE[1], rate_hz=_FRAME_HZ)
        for name in ("left", "right")
    )
    hand = SensorInfo(
        name="teng", channels=tuple(f"s{number}" for number in range(_CHANNELS)),
        units=("V",) * _CHANNELS, rate_hz=_RATE_HZ,
    )  # fmt: skip
    seen = PageSeen(url="bench://", ring=ring, sensor=hand, cameras=cameras)
    view = ViewConfig(sources=(seen,), decisions=(), status=status, requests=requests,
                      beats=beats, stall_s=0.15)  # fmt: skip
    return stack.enter_context(RingWriter(ring)), view


def _send(ring: RingWriter, seconds: float) -> tuple[int, int]:
    """Write scans as they come, and frames; return how many of each."""
    rng = np.random.default_rng(0)
    jpeg = encode_jpeg(rng.integers(90, 160, (_SIZE[1], _SIZE[0], 3), np.uint8))
    scans = frames = 0
    began_s = monotonic()
    while (past_s := monotonic() - began_s) < seconds:
        due = int(past_s * _RATE_HZ) - scans
        if due:
            now_s = monotonic()
            values = rng.normal(size=(due, _CHANNELS))
            ring.put(pack(Samples.from_values(values, np.full(due, now_s))))
            scans += due
        while frames < 2 * int(past_s * _FRAME_HZ):
            now_s = monotonic()
            ring.put(pack(Frame(camera=frames % 2, jpeg=jpeg, counter=frames // 2, device_s=now_s,
                                arrival_s=now_s, fitted_s=now_s)))  # fmt: skip
            frames += 1
        sleep(0.001)
    return scans, frames


def _watched(place: str) -> tuple[float, dict[str, Any]]:
    """Return the processor seconds of a `taxel fleet` that draws its table, its start aside, and
    what it shows.
    """
    taxel = [sys.executable, "-m", "taxel.cli.main", "fleet", place, "--seconds"]
    done = subprocess.run([*taxel, "3", "--json"], stdout=subprocess.PIPE, check=True, env=_env())
    spent = []
    for seconds in (1.0, 1.0 + _WATCHED_S):
        before = _children_s()
        _on_a_terminal([*taxel, str(seconds)])
        spent.append(_children_s() - before)
    found: dict[str, Any] = json.loads(done.stdout)
    return spent[1] - spent[0], found


def _on_a_terminal(words: list[str]) -> None:
    """Run a program whose output is a terminal that somebody reads."""
    ours, theirs = pty.openpty()
    env = {**_env(), "TERM": "xterm-256color", "COLUMNS": "120", "LINES": "60"}
    with subprocess.Popen(words, stdout=theirs, env=env) as process:
        os.close(theirs)
        with suppress(OSError):  # EIO: nobody writes there any more
            while os.read(ours, 1 << 16):
                pass
        process.wait()
    os.close(ours)


def _children_s() -> float:
    times = os.times()
    return times.children_user + times.children_system


def _until_shown(watch: Any, name: str) -> float:
    """Return how long it takes until a station is no longer shown as there, seconds."""
    began_s = monotonic()
    while monotonic() < began_s + 30.0:
        if any(r.station == name and r.presence in ("GONE", "SILENT") for r in watch.rows()):
            break
        sleep(0.02)
    return monotonic() - began_s


def _program(text: str, *words: str) -> _Program:
    return _Program(
        [sys.executable, "-c", text, *words], stdout=subprocess.PIPE, text=True, env=_env()
    )


def _env() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}


class _Program(subprocess.Popen[str]):
    """A process that is killed where its block ends."""

    def __exit__(self, *_: object) -> None:
        self.kill()
        self.wait()
        assert self.stdout is not None
        self.stdout.close()
