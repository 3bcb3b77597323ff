"""The live path: samples in, decisions out, by the stages that training used.

Adds no maths of its own. Knows nothing about screens or training frameworks.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf
from time import perf_counter
from typing import Any

from taxel.bundles.contract import MOST_JOINED, Contract
from taxel.bundles.reader import Bundle
from taxel.decisions.recognition import (
    Decision,
    GraspVote,
    Quality,
    RecogniseConfig,
    decide,
)
from taxel.decisions.still_channels import StillChannel, StillWatch
from taxel.decisions.value_scale import OtherScale, ScaleWatch
from taxel.live.rate_watch import RateChange, RateWatch
from taxel.signals import Samples, SensorInfo
from taxel.windows.following import GateMove
from taxel.windows.level_follow import LevelFollower, LevelNow, parse_level_follow
from taxel.windows.windower import Windower, Windows

_NEAR_S = 0.03
"""Rows that have stopped for longer may be the contact's last: nothing to stay awake for.
Source: three rows of the common grid, docs/decisions/0010."""
_SINGLE_S = 1.0
"""From a source's only scan to the next one that is rehearsed, where no rate is known. Source: our
choice, docs/decisions/0011: any time later than the scan's will do."""


@dataclass(frozen=True, slots=True)
class Answer:
    """One window with its decision."""

    decision: Decision
    window: Windows
    """The one window, shape (1, steps, channels); scaled where levels follow."""
    latency_s: float
    """From the samples in hand to the decision, seconds; windows of one call share
    the time that cutting took."""


class Recogniser:
    """Turn samples of one source into answers.

    Args:
        bundle: The model with its contract.
        sensor: The source's array.
        config: When an answer may be given.
        follower: What follows the level of a session that went on before; a new one unless given,
            where the bundle's levels follow.
        scale: What watched the values of the recordings before; a new one unless given.
        still: What watched their channels; a new one unless given, where the bundle says how
            channels changed in training.

    Raises:
        BadBundle: The bundle was not made for such an array.
    """

    def __init__(
        self,
        bundle: Bundle,
        sensor: SensorInfo,
        config: RecogniseConfig | None = None,
        follower: LevelFollower | None = None,
        scale: ScaleWatch | None = None,
        still: StillWatch | None = None,
    ) -> None:
        bundle.contract.check_sensor(sensor)
        self.bundle = bundle
        self._config = config or RecogniseConfig()
        window = bundle.contract.window
        self._windower = Windower(window, sensor)
        self._still = still or still_watch_of(bundle.contract)
        if still is not None:
            still.next_recording()
        self._scale = scale or scale_watch_of(bundle.contract)
        self._columns = sensor.indices(bundle.contract.channels)
        own = window.grid_hz is None and window.steps > 1 and bundle.contract.rate_hz > 0
        self._rate = RateWatch(bundle.contract.rate_hz) if own else None
        self._level = follower or follower_of(bundle.contract)
        if follower is not None:
            follower.over()
        self._near = len(sensor.only(window.channels).channels) if window.layout == "A" else 1
        rate_hz = window.grid_hz or sensor.rate_hz  # 0 of a recording of a single scan
        self._row_s = 1.0 / rate_hz if rate_hz > 0 else _SINGLE_S
        self._last: Samples | None = None
        self._grown_s = -inf
        self._missing = self._windower.missing

    @property
    def near(self) -> bool:
        """True when the next row will complete a window, and rows have just been coming."""
        return self._missing <= self._near and perf_counter() - self._grown_s < _NEAR_S

    def new_vote(self) -> GraspVote:
        """Return what joins the windows of a stream, contact by contact."""
        contract = self.bundle.contract
        return GraspVote(
            contract.classes, contract.window.max_gap_s, self.bundle.novelty_test,
            contract.joining, contract.most_windows,
        )  # fmt: skip

    def warm(self) -> None:
        """Rehearse the next answer, so that the caches hold all of it when its row comes."""
        if self._last is not None:
            moved = self._last.fitted_s + self._row_s
            windows = self._windower.rehearse(replace(self._last, fitted_s=moved))
            self._answers(windows, perf_counter())

    def push(self, samples: Samples) -> list[Answer]:
        """Return the answers that these scans complete, oldest first."""
        started = perf_counter()
        answers = self._watched(self._windower.push(samples), started)
        missing = self._windower.missing
        self._last = samples[-1:] if len(samples) else self._last
        if missing != self._missing:
            self._missing, self._grown_s = missing, perf_counter()
        if self._rate is not None:
            self._rate.look(samples)
        if self._scale.waits and len(samples):
            own = samples.only(self._columns)
            self._scale.wait(own.values[own.usable])
        return answers

    def gate_moves(self) -> list[GateMove]:
        """Return how the contact gate was moved since the last call, oldest first."""
        return self._windower.gate_moves()

    def still_channels(self) -> list[StillChannel]:
        """Return the channels found since the last call that have stopped changing, once each;
        none where the bundle does not say how they changed in training.
        """
        return [] if self._still is None else self._still.take()

    def other_scales(self) -> list[OtherScale]:
        """Return where values changed so much more than in training, since the last call, that
        their unit is another; found once.
        """
        return self._scale.take()

    def waiting(self) -> str:
        """Return what the first window waits for; empty once it has come, or without a gate."""
        return self._scale.waiting()

    def untouched(self) -> str:
        """Return that nothing changed as touch does so far; empty where something did."""
        return self._scale.untouched()

    def level(self) -> LevelNow | None:
        """Return where the session's level stands; None where levels are not followed."""
        return None if self._level is None else self._level.now()

    def new_touch(self) -> None:
        """End the touch whose level is measured, as where a person says that a new one begins."""
        if self._level is not None:
            self._level.over()

    @property
    def touches(self) -> int:
        """How many touches have shown the session's level; 0 where levels are not followed."""
        return 0 if self._level is None else self._level.touches

    def level_state(self) -> dict[str, Any] | None:
        """Return what another recogniser of this session goes on from; None where none follows."""
        return None if self._level is None else self._level.state()

    def resume_level(self, state: dict[str, Any]) -> None:
        """Go on from where another recogniser's level stood."""
        if self._level is not None:
            self._level.resume(state)

    def rate_changes(self) -> list[RateChange]:
        """Return where rows began, since the last call, to come at another rate than in training,
        or at that one again; none where rows are taken from a grid.
        """
        return [] if self._rate is None else self._rate.take()

    def flush(self) -> list[Answer]:
        """End the stream; return the answer of its last, padded window if there is one."""
        started = perf_counter()
        return self._watched(self._windower.flush(), started)

    def _watched(self, windows: Windows, started: float) -> list[Answer]:
        """Return the answers of windows that really came, and look for channels that stopped."""
        answers = self._answers(windows, started, self._level)
        for answer in answers:
            moved = None if self._still is None else self._still.look(answer.window)
            self._scale.look(moved, answer.decision.end_s)
        return answers

    def _answers(
        self, windows: Windows, started: float, learning: LevelFollower | None = None
    ) -> list[Answer]:
        """Return the answers; the level is taken from windows that really came alone."""
        cutting_s = (perf_counter() - started) / max(1, len(windows))
        answers = []
        for index in range(len(windows)):
            began = perf_counter()
            measured = windows if len(windows) == 1 else windows[index : index + 1]
            window = measured
            if learning is not None:
                learning.begin(measured)
            if self._level is not None:
                window = replace(measured, values=measured.values * self._level.factor)
            found, novelty = self.bundle.recognise(window.values, window.mask)
            quality = Quality.of(window, 0, self.bundle.contract.motion)
            decision = decide(
                found,
                quality,
                self.bundle.contract.classes,
                self._config,
                novelty,
                self.bundle.novelty_test,
            )
            answers.append(Answer(decision, window, cutting_s + perf_counter() - began))
            # For the next touch: this answer need not wait for it. A hung array shows no level.
            if learning is not None and not quality.frozen:
                learning.add(measured)
        return answers


def still_watch_of(contract: Contract) -> StillWatch | None:
    """Return what looks for channels that have stopped; None where training's are not known."""
    motion = contract.motion
    return None if motion is None else StillWatch(motion, contract.channels)


def scale_watch_of(contract: Contract) -> ScaleWatch:
    """Return what looks whether values change about as much as those that a bundle learned."""
    window = contract.window
    asis = window.gate_follow_s is None and window.subtract is None
    return ScaleWatch(contract.motion, contract.units[0], window.gate if asis else None)


def follower_of(contract: Contract) -> LevelFollower | None:
    """Return what follows a session's level for a bundle; None where its levels do not follow."""
    text, usual = contract.window.level_follow, contract.usual
    if text is None or usual is None:
        return None
    touches, gap_s = parse_level_follow(text).touches, contract.window.max_gap_s
    most = None if contract.window.gate is not None else contract.trial_windows or MOST_JOINED
    return LevelFollower(usual, touches, gap_s, most)


class SessionLevels:
    """What follows the level of each session that a folder's recordings belong to.

    Args:
        contract: Of the bundle that is run on them.
    """

    def __init__(self, contract: Contract) -> None:
        self._contract = contract
        self._known: dict[str, LevelFollower | None] = {}

    def of(self, groups: Mapping[str, str]) -> LevelFollower | None:
        """Return that of a recording's session; None where levels are not followed.

        Args:
            groups: The recording's own; one that does not name its session is of an unnamed one.
        """
        text = self._contract.window.level_follow
        if text is None:
            return None
        session = groups.get(parse_level_follow(text).key, "")
        if session not in self._known:
            self._known[session] = follower_of(self._contract)
        return self._known[session]
