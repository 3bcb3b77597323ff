"""What a supervisor that stands still, or is killed, costs: the alarm, the stop, what is left.

The station is a program of its own (`taxel.bench.faults.supervised_station`), stopped and killed
from here by signals. Knows nothing about boards and cameras.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np

from taxel.bench.faults.supervised_station import LIMITS
from taxel.bench.rows import Row, row
from taxel.live.station.shared import SHARED, sweep

STALLS_S = (0.2, 0.45, 1.0, 1.5, 3.0)
ROUNDS = 10
"""Of each length."""
ALARM_S = 0.15
"""From the last tick to the alarm, seconds. Source: issue of live work."""
_BEFORE_S = (0.05, 0.5)
"""How long it raises before it is stopped, drawn between these, seconds."""
_AFTER_S = 0.5
"""How long it is watched after a stall, seconds: nothing may raise."""
_GONE_S = 10.0
"""How long processes may take to end, seconds."""


class StationProgram:
    """A station in a program of its own."""

    def __init__(self) -> None:
        self._program = subprocess.Popen(
            [sys.executable, "-m", "taxel.bench.faults.supervised_station"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        self.pid = self._program.pid
        self.children: dict[str, int] = self.line()

    def line(self) -> Any:
        """Return the next value that it says."""
        assert self._program.stdout is not None
        line = self._program.stdout.readline()
        if not line:
            raise RuntimeError("needed a station that runs; got its end")
        return json.loads(line)

    def ask(self) -> None:
        """Let it say what it has ordered in this round."""
        assert self._program.stdin is not None
        self._program.stdin.write(b"\n")
        self._program.stdin.flush()

    def alarm_until(self, until_s: float) -> float | None:
        """Return when an alarm stood on its terminal, monotonic seconds; None if none did."""
        assert self._program.stderr is not None
        terminal, text = self._program.stderr.fileno(), b""
        while (left_s := until_s - monotonic()) > 0:
            if select.select([terminal], [], [], left_s)[0]:
                text += os.read(terminal, 4096)
                if b"ALARM" in text:
                    return monotonic()
        return None

    def hush(self) -> None:
        """Throw away what stands on its terminal."""
        assert self._program.stderr is not None
        terminal = self._program.stderr.fileno()
        while select.select([terminal], [], [], 0)[0] and os.read(terminal, 4096):
            pass

    def kill(self) -> None:
        """Kill the supervisor."""
        self._program.kill()
        self._program.wait()

    def close(self) -> None:
        """End it, and whatever of it stands still."""
        for pid in (self.pid, *self.children.values()):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)
        assert self._program.stdin is not None
        with contextlib.suppress(OSError):
            self._program.stdin.close()
        try:
            self._program.wait(_GONE_S)
        except subprocess.TimeoutExpired:
            self.kill()
        for stream in (self._program.stdout, self._program.stderr):
            if stream is not None:
                stream.close()


@contextlib.contextmanager
def station_program() -> Iterator[StationProgram]:
    """Run a station in a program of its own."""
    program = StationProgram()
    try:
        yield program
    finally:
        program.close()


@dataclass(frozen=True, slots=True)
class Stall:
    """What one stall of the supervisor did."""

    alarm_s: float
    """From the last order to the alarm, seconds; infinity without any."""
    stopped: bool
    """STOP was the first order afterwards."""
    raised: bool
    """Some order afterwards was another than STOP."""
    step_n: float
    """The largest step of force from one order to the next, newtons."""
    raised_n: float
    """What had been raised before the stall, newtons: above 0 where it fell into a raise."""

    @property
    def good(self) -> bool:
        """True where everything was as it must be."""
        return (
            self.raised_n > 0
            and self.alarm_s <= ALARM_S
            and self.stopped
            and not self.raised
            and self.step_n <= LIMITS.slew_n_s * LIMITS.step_s + 1e-6
        )


def stall_once(program: StationProgram, seconds: float, before_s: float) -> Stall:
    """Stop a supervisor that is armed and raises, for some seconds.

    Args:
        program: The station.
        seconds: How long it is stopped.
        before_s: How long it raises before, seconds.
    """
    while program.line() != "raising":
        pass
    sleep(before_s)
    program.hush()
    os.kill(program.pid, signal.SIGSTOP)
    until_s = monotonic() + seconds
    alarm_s = program.alarm_until(until_s)
    sleep(max(0.0, until_s - monotonic()))
    os.kill(program.pid, signal.SIGCONT)
    sleep(_AFTER_S)
    program.ask()
    orders = program.line()
    gaps = [after[0] - before[0] for before, after in pairwise(orders)]
    last = int(np.argmax(gaps))
    kinds = [kind for _, kind, _ in orders[last + 1 :]]
    return Stall(
        alarm_s=np.inf if alarm_s is None else alarm_s - orders[last][0],
        stopped=kinds[0] == "stop",
        raised=any(kind != "stop" for kind in kinds),
        step_n=max(after[2] - before[2] for before, after in pairwise(orders)),
        raised_n=orders[last][2] - orders[0][2] if orders[last][1] == "grip" else 0.0,
    )


def stall_rows() -> list[Row]:
    """Stop the supervisor for each length of time, ten times; about three minutes."""
    random = np.random.default_rng(0)
    with station_program() as program:
        stalls = [
            stall_once(program, seconds, random.uniform(*_BEFORE_S))
            for seconds in STALLS_S
            for _ in range(ROUNDS)
        ]
    alarms_ms = [1000.0 * stall.alarm_s for stall in stalls]
    lengths = ", ".join(f"{seconds:g}" for seconds in STALLS_S)
    return [
        row(
            f"supervisor stopped for {lengths} s while armed and raising: alarm within 150 ms of "
            "its last tick, STOP at the first tick afterwards, nothing raised",
            sum(stall.good for stall in stalls), f"of {len(stalls)}", ">=", len(stalls),
            f"alarm on the terminal after {np.median(alarms_ms):.0f} ms in the median, at most "
            f"{max(alarms_ms):.0f} ms; STOP first: {sum(stall.stopped for stall in stalls)}; "
            f"raised without arming: {sum(stall.raised for stall in stalls)}",
        ),
        row("supervisor stopped: the largest step of force from one order to the next",
            max(stall.step_n for stall in stalls), "N", "<=", LIMITS.slew_n_s * LIMITS.step_s,
            f"slew {LIMITS.slew_n_s:g} N/s; a tick counts for at most {LIMITS.step_s:g} s"),
    ]  # fmt: skip


def killed_rows() -> list[Row]:
    """Stop each process of a station in turn and kill the supervisor; look at what is left."""
    left_processes, left_memory, swept, names = 0, 0, 0, []
    with station_program() as program:
        names = list(program.children)
    for name in names:
        with station_program() as program:
            os.kill(program.children[name], signal.SIGSTOP)
            program.kill()
            until_s = monotonic() + _GONE_S
            while monotonic() < until_s and _left(program):
                sleep(0.05)
            processes, memory = _alive(program), _memory(program)
            left_processes, left_memory = left_processes + processes, left_memory + len(memory)
            sweep()
            swept += len(_memory(program))
    each = f"each of {', '.join(names)} stopped in turn"
    return [
        row("a process stopped and the supervisor killed: processes left", left_processes,
            "processes", "<=", 0, f"{each}; looked at for {_GONE_S:g} s"),
        row("a process stopped and the supervisor killed: pieces of shared memory left",
            left_memory, "pieces", "<=", 0, f"{swept} of them after the next station's sweep"),
    ]  # fmt: skip


def _left(program: StationProgram) -> bool:
    return bool(_alive(program) or _memory(program))


def _alive(program: StationProgram) -> int:
    """Return how many of its processes have not ended."""
    return sum(not is_gone(pid) for pid in program.children.values())


def is_gone(pid: int) -> bool:
    """True where a process has ended, waited for or not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True


def _memory(program: StationProgram) -> list[str]:
    """Return the names of its shared memory."""
    return [path.name for path in SHARED.glob(f"taxel_*_{program.pid}_*")]
