"""What the page needs of the station that it shows; the page's server knows nothing else of it.

A link sends, and takes what a person asks (acknowledge, disarm, record, a replay's cursor): it has
no way to arm or to move a gripper, so the page has none either. One exception: where a plan of
trials is recorded with a gripper, that closes once a person says that they are ready. Knows nothing
about HTTP.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Protocol, runtime_checkable


class StationLink(Protocol):
    """A running station, as the page sees it.

    `snapshot`, `frame` and `traces` are called some 20 times a second for each open page, in the
    server's event loop: they must return at once (a millisecond or less) and never wait.
    The others are called in another thread, one at a time, and may take seconds.

    All times are seconds on one clock of the station's choice that never steps back while it
    runs. Numbers may be NaN; the page shows a dash.
    """

    def snapshot(self) -> dict[str, Any]:
        """Return the newest state of everything, plain values only.

        Returns:
            time_s: when this was true; it must move on while the station lives, or the
                page says STALE after 0.5 s.
            state: STABLE, WARNING, UNSTABLE, UNKNOWN, STOP, NO GRASP (a grasp has ended and the
                next has not begun) or NONE (nothing watches a grasp, and the page names what is
                in the hand instead); any other is shown as UNKNOWN;
            reason: why, in a few words; since_s: when the state began, or None;
            probability: of instability 0…1, or None;
            scored (may be left out): True where the monitor gives no probability but a warning's
                score, 0…1 or None, in the field score;
            slip: {slip_mm, slip_rate_mm_s, …, slip_seen}, or None where nothing follows it;
            thresholds (may be left out): {warn, clear, unstable}, 0…1;
            alarms: list of {key, kind, text, level ("warning" or "danger"), since_s,
                acknowledged}; key is a number that becomes another where an alarm comes on again,
                gets worse or is about more than before;
            answers: list of {target, label, confidence 0…1, reason, action and time_s (may be left
                out)}; time_s is of the station's clock, an empty label that of no answer yet;
            sources: list of {name, url, kind ("array" or "cameras"), state ("live",
                "reconnecting", "stale", "frozen", "late", "gone", "silent", "ended", "failed"),
                rate_hz, nominal_hz, produced, lost, note};
            consumers: list of {name, consumed, dropped, beat_age_s, state};
            latency_ms: {stage: [p50, p95, p99]}, milliseconds;
            gripper: {interlock, armed, force_n, commanded_n, motion, note}, or None;
            recording: {on, path, seconds, bytes, error};
            cameras: list of {name, width, height};
            array: {name, channels, unit, rows, and, may be left out: gap_s, after which the newest
                row is not shown as the present, and scale, of what the hand's numbers are per
                cent}, or None;
            do (may be left out): {word, why, since_s}: what the person is to do, or None;
            trial (may be left out): {number, alarm_s, reaction, reaction_time_s, outcome} of the
                grasp that is watched, or None; where there are several, also cameras: those of the
                grasp that `react` is about;
            plan (may be left out): {word, why, number, of, words, balance, asks}: a plan of
                trials that is recorded, see `PlanLink`;
            replay: only of recordings, see `ReplayLink.snapshot`.
        """
        ...

    def frame(self, camera: int) -> tuple[int, bytes] | None:
        """Return a camera's newest image as (its number, JPEG); None before the first.

        Args:
            camera: From 0, in the order of the snapshot's cameras.
        """
        ...

    def traces(self, since_s: float) -> dict[str, Any]:
        """Return what came after a moment, at most 60 points a second.

        Args:
            since_s: The `time_s` of the last answer; minus infinity asks for all that is kept
                (30 s are shown). A moment later than the newest also means all that is kept:
                the clock was set back, or a replay's cursor.

        Returns:
            time_s: of the newest value;
            probability: {t: [n], p: [n]}, seconds and 0…1, of the score where there is one;
            sensors: {t: [n], values: [a list of n for each channel]}, in the array's unit;
            map: the newest rows of the array, oldest first, 0…1, or None;
            events: list of {t, text}.
        """
        ...

    def acknowledge(self, seen: Collection[int]) -> None:
        """Take a person's word that alarms were seen.

        Args:
            seen: Their keys, as the page had shown them: an alarm of another key was not seen.
        """
        ...

    def disarm(self) -> str | None:
        """Give the gripper no more orders, on a person's word; what it holds it keeps holding.

        Returns:
            Why that was not possible; nothing where it was done.
        """
        ...

    def record(self, on: bool, labels: dict[str, str]) -> str:
        """Start or stop recording; return "" or why that was not possible.

        Args:
            on: True starts.
            labels: What the person says is recorded, checked by `messages.read_command`.
        """
        ...


@runtime_checkable
class PersonLog(Protocol):
    """A page link that can log a person's reactions."""

    def react(self, what: str) -> str:
        """Log a person's reaction to the grasp, or its outcome; return "" or why not.

        Args:
            what: A word of `trial_log.REACTIONS` or `OUTCOMES`.
        """
        ...


@runtime_checkable
class PlanSteps(Protocol):
    """A page link that can step a plan of trials on."""

    def step(self, what: str) -> str:
        """Take a person's word how the plan goes on; return "" or why not.

        Args:
            what: A word of `messages.STEPS`.
        """
        ...


@runtime_checkable
class ReplayControls(Protocol):
    """What a link of a recording can do besides: move its time cursor."""

    def overview(self) -> dict[str, Any]:
        """Return the whole recording, small enough to draw at once.

        Returns:
            start_s, end_s: of the recording's clock;
            t: [n] middles of bins; series: list of {name, unit, low: [n], high: [n]};
            bands: list of {start_s, end_s, text}.
        """
        ...

    def seek(self, time_s: float) -> None:
        """Put the cursor at a moment of the recording's clock."""
        ...

    def play(self, speed: float) -> None:
        """Let the cursor run, at a factor of real time above 0."""
        ...

    def pause(self) -> None:
        """Hold the cursor."""
        ...
