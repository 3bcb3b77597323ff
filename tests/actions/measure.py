"""Print how long commands take on the rigs: python tests/actions/measure.py (half a minute)."""

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

import modbus_rig
from hand_rig import emulated_hand

from taxel.actions.hand import HandController
from taxel.actions.hand_link import HandConfig
from taxel.actions.interlock import Interlock, InterlockConfig
from taxel.actions.pge_gripper import PgeConfig, PgeGripper
from taxel.clock import SystemClock
from taxel.wire.messages import State


def _print_times(name: str, seconds: list[float]) -> None:
    p50, p99 = np.percentile(seconds, (50, 99)) * 1e3
    print(f"{name:44s} p50 {p50:8.3f}  p99 {p99:8.3f}  worst {max(seconds) * 1e3:8.3f} ms")


def measure_pge() -> None:
    with modbus_rig.pge_on_a_cable() as (cable, _):
        gripper = PgeGripper(PgeConfig(port=cable.near), SystemClock())
        gripper.connect()
        calls, took = [], []
        for i in range(400):
            start = time.perf_counter()
            gripper.grip(20 + i % 80)
            calls.append(time.perf_counter() - start)
            time.sleep(0.025)
            took.append(gripper.latency.last_s)
        gripper.close()
    _print_times("PGE: the call", calls)
    _print_times("PGE: call to force and position acknowledged", took[5:])


def measure_hand() -> None:
    with emulated_hand() as board:
        hand = HandController(HandConfig(port=board.port), SystemClock())
        hand.connect()
        took = []
        for _ in range(100):
            hand.arm()
            while not hand.status().armed:
                hand.refresh()
                time.sleep(0.001)
            start = time.monotonic()
            hand.stop()
            while board.state is not State.STOPPED:
                time.sleep(0.0002)
            took.append(time.monotonic() - start)
            while hand.status().state is not State.STOPPED:
                time.sleep(0.001)
        hand.close()
    _print_times("hand: stop to motors off", took)


def measure_interlock() -> None:
    lock = Interlock(InterlockConfig(min_n=10.0, max_n=40.0))
    now, took = 100.0, []
    for i in range(20_000):
        now += 0.01
        start = time.perf_counter()
        lock.beat(now)
        lock.device(True, now)
        lock.decision("WARNING", now)
        lock.tick(now)
        took.append(time.perf_counter() - start)
        if i == 0:
            assert lock.arm(now) == ()
    _print_times("interlock: all words and the tick", took)


if __name__ == "__main__":
    measure_interlock()
    measure_hand()
    measure_pge()
