"""A guard whose monitors say what a test wants, millisecond by millisecond."""

from __future__ import annotations

from typing import Any

from taxel.actions.grip_policy import GripPolicy, GripPolicyConfig
from taxel.actions.interlock import Interlock, InterlockConfig
from taxel.live.station.guard import Guard, GuardConfig

LIMIT_S = GuardConfig().silent_s


def note(state: str, **more: Any) -> dict[str, Any]:
    return {"kind": "grasp", "state": state, "reason": "", "since_s": 0.0, "p": 0.1, **more}


class Rig:
    """A guard with monitors that beat every millisecond unless told otherwise."""

    def __init__(self, *names: str, least_n: float = 15.0, most_n: float = 50.0) -> None:
        interlock = Interlock(InterlockConfig(min_n=least_n, max_n=most_n))
        policy = GripPolicy(least_n, GripPolicyConfig(most_n=most_n))
        self.guard = Guard(interlock, policy=policy)
        self.now_s = 100.0
        self.silent: set[str] = set()
        self.mute: set[str] = set()
        self.notes: dict[str, dict[str, Any]] = {}
        self.names = names
        for name in names:
            self.guard.expect(name, self.now_s)

    def decide(self, name: str, content: dict[str, Any]) -> None:
        """Let a monitor say this from now on, each millisecond anew."""
        self.notes[name] = content

    def run(self, seconds: float) -> Any:
        order = None
        for _ in range(round(seconds * 1000)):
            self.now_s += 0.001
            for name in self.names:
                if name not in self.silent:
                    self.guard.beat(name, self.now_s)
                if name not in self.silent | self.mute:
                    content = self.notes.get(name, note("UNKNOWN", reason="no input yet"))
                    self.guard.decide(name, content | {"decided_s": self.now_s})
            self.guard.interlock.device(True, self.now_s)
            order = self.guard.tick(self.now_s)
        return order
