"""Run recognisers on a source and count their answers.

Knows nothing about screens.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from math import inf
from typing import Any

import numpy as np

from taxel.actions.rule_table import RuleTable
from taxel.decisions.recognition import UNKNOWN, Decision, GraspVote
from taxel.decisions.still_channels import StillChannel
from taxel.decisions.value_scale import OtherScale
from taxel.labels.joined import joined_label
from taxel.live.outages import Outage, OutageWatch
from taxel.live.rate_watch import RateChange
from taxel.live.recogniser import Answer, Recogniser
from taxel.signals import Mark, Samples
from taxel.sources.contract import Source
from taxel.windows.following import GateMove
from taxel.windows.level_follow import LevelNow

_KEPT_LATENCIES = 10_000
"""Latest latencies kept, so that memory stays constant."""
_KEPT_ANSWERS = 2_000
"""Answers kept until their mark comes, so that memory stays constant."""
_ROUNDED_S = 1e-6
"""By which times of a mark and of a window may differ, seconds: recordings round both."""
_NO_RULES = RuleTable(())
_NEWS = ("gate_moves", "still_channels", "other_scales", "rate_changes", "outages")
"""What a tally keeps of its input: news, each with its time."""
_TIMES = {"time_s", "start_s", "end_s"}
"""Fields of news that are moments, on the fitted clock."""
MANY_TOUCHES, MOST_ALIKE = 20, 0.8
"""From so many touches on, a session of which more than this share has one answer is warned of,
where levels follow. Source: our choice, docs/decisions/0061."""


@dataclass(slots=True)
class Tally:
    """One recogniser's answers, and whether they were right where the source knows."""

    target: str
    vote: GraspVote
    rules: RuleTable = _NO_RULES
    """What is to be done about what is recognised."""
    actions: Counter[str] = field(default_factory=Counter)
    """Action → windows after which it was what to do, by all windows of their contact so far."""
    action: str = ""
    """What is to be done now."""
    answers: Counter[str] = field(default_factory=Counter)
    windows: int = 0
    filled: int = 0
    marked: int = 0
    right: int = 0
    grasps: int = 0
    grasps_right: int = 0
    grasps_without: int = 0
    """Grasps of a known target in which no whole window lay: nothing was decided of them."""
    grasp_answer: tuple[str, float] = (UNKNOWN, float("nan"))
    latest: Answer | None = None
    latencies_s: list[float] = field(default_factory=list)
    gate_moves: list[GateMove] = field(default_factory=list)
    """How the contact gate was moved, oldest first; the last `_KEPT_ANSWERS`."""
    still_channels: list[StillChannel] = field(default_factory=list)
    """Channels that have stopped changing, once each, in the order in which they were noticed."""
    other_scales: list[OtherScale] = field(default_factory=list)
    """Where values changed far more than in training, as in another unit: once at most."""
    untouched: str = ""
    """In words that nothing changed as touch does until the end; empty where something did."""
    rate_changes: list[RateChange] = field(default_factory=list)
    """Where rows came at another rate than in training, oldest first; the last `_KEPT_ANSWERS`."""
    outages: list[Outage] = field(default_factory=list)
    """Times without a usable window, oldest first; the last `_KEPT_ANSWERS`."""
    outage_watch: OutageWatch = field(default_factory=lambda: OutageWatch(inf))
    """What finds them; none unless given."""
    level: LevelNow | None = None
    """Where the session's level stood in the end; None where levels are not followed."""
    recording: str = ""
    """What is replayed, where that is one of several; for the summary."""
    began_s: float = 0.0
    """First scan of the source, fitted clock, seconds: the summary's times begin there."""
    late: bool = False
    """True where an answer may come after the mark that it lies in, as of a padded window."""
    _waiting: list[Decision] = field(default_factory=list)
    _marks: list[Mark] = field(default_factory=list)
    _ending: tuple[Mark, list[Decision]] | None = None
    """A mark that is over, with its windows, until it is known whether another begins there."""
    _more: dict[str, list[dict[str, Any]]] = field(
        default_factory=lambda: {name: [] for name in _NEWS}
    )
    """News of the other recordings, as in the summary."""

    def add(self, answer: Answer) -> None:
        """Take in one answer."""
        decision = answer.decision
        self.settle(decision.start_s)
        self.latest = answer
        self.windows += 1
        self.filled += decision.filled > 0
        self.answers[decision.label] += 1
        self.grasp_answer = self.vote.add(decision)
        self._note_outage(self.outage_watch.look(decision))
        self.action = self.rules.action(self.target, *self.grasp_answer)
        self.actions.update([self.action] if self.action else [])
        self.latencies_s.append(answer.latency_s)
        del self.latencies_s[:-_KEPT_LATENCIES]
        self._waiting.append(decision)
        del self._waiting[:-_KEPT_ANSWERS]

    def note(self, moves: Sequence[GateMove]) -> None:
        """Keep how the contact gate was moved."""
        self.gate_moves += moves
        del self.gate_moves[:-_KEPT_ANSWERS]

    def note_still(self, channels: Sequence[StillChannel]) -> None:
        """Keep which channels have stopped changing; one that is known is not kept again."""
        known = {still.channel for still in self.still_channels}
        self.still_channels += [still for still in channels if still.channel not in known]

    def note_scales(self, scales: Sequence[OtherScale]) -> None:
        """Keep that values change far more than in training; the first time is enough."""
        self.other_scales += scales[: 1 - len(self.other_scales)]

    def note_rates(self, changes: Sequence[RateChange]) -> None:
        """Keep where rows began to come at another rate."""
        self.rate_changes += changes
        del self.rate_changes[:-_KEPT_ANSWERS]

    def _note_outage(self, outage: Outage | None) -> None:
        """Keep an outage that began, or complete the one that is over."""
        if outage is None:
            return
        if outage.end_s is not None:
            self.outages.pop()
        self.outages.append(outage)
        del self.outages[:-_KEPT_ANSWERS]

    def compare(self, mark: Mark) -> None:
        """Count the windows inside a mark as right or wrong; their vote is the grasp's.

        Only they vote: where no pause parts one grasp from the next, the mark does. The row at the
        moment at which two marks meet is the later one's, as in a data set.

        The right answer to an object that was never learned is UNKNOWN. Where answers may be
        late, it is counted when one beyond the mark has come, or by `settle`; and where a window
        ends as the mark does, when it is known whether another mark begins there.
        """
        self._close(mark.start_s)
        self._marks.append(mark)
        del self._marks[:-_KEPT_ANSWERS]
        if not self.late:
            self._count_over(inf)

    def settle(self, start_s: float = inf) -> None:
        """Count the marks that are over before any answer to come begins."""
        self._count_over(start_s)
        if start_s == inf:
            self._close(inf)

    def _count_over(self, start_s: float) -> None:
        known = self._marks
        self._marks = [mark for mark in known if not mark.end_s < start_s]
        for mark in known:
            if mark.end_s < start_s:
                behind = (m.start_s for m in known if m.start_s >= mark.end_s - _ROUNDED_S)
                self._count(mark, min(behind, default=None))

    def _count(self, mark: Mark, next_s: float | None) -> None:
        """Count a mark, unless a window ends as it does and the next mark is not known."""
        if joined_label(mark.labels, self.target) is None:
            return
        inside = [
            window
            for window in self._waiting
            if window.start_s >= mark.start_s - _ROUNDED_S
            and window.end_s <= mark.end_s + _ROUNDED_S
        ]
        before_s = mark.end_s - _ROUNDED_S
        self._waiting = [window for window in self._waiting if window.end_s > before_s]
        self._ending = mark, inside
        if next_s is not None or all(window.end_s <= before_s for window in inside):
            self._close(inf if next_s is None else next_s)

    def _close(self, next_s: float) -> None:
        """Count the mark whose last windows were not decided, if there is one.

        Args:
            next_s: When the next mark begins, fitted clock, seconds.
        """
        if self._ending is None:
            return
        (mark, inside), self._ending = self._ending, None
        meets = abs(next_s - mark.end_s) <= _ROUNDED_S
        end_s = next_s - _ROUNDED_S if meets else mark.end_s + _ROUNDED_S
        inside = [window for window in inside if window.end_s <= end_s]
        self._waiting = [window for window in self._waiting if window.end_s > end_s]
        if not inside:
            self.grasps_without += 1
            return
        truth = joined_label(mark.labels, self.target)
        if truth not in self.vote.classes:
            truth = UNKNOWN
        self.marked += len(inside)
        self.right += sum(window.label == truth for window in inside)
        vote = self.vote.emptied()
        votes = [vote.add(window)[0] for window in inside]
        self.grasps += 1
        self.grasps_right += votes[-1] == truth

    def take_in(self, other: Tally) -> None:
        """Add the counts of another recording that has ended."""
        self.answers.update(other.answers)
        self.actions.update(other.actions)
        for name in ("windows", "filled", "marked", "right", "grasps", "grasps_right",
                     "grasps_without"):  # fmt: skip
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.latencies_s += other.latencies_s
        del self.latencies_s[:-_KEPT_LATENCIES]
        for name, news in other._news().items():
            self._more[name] += news
            del self._more[name][:-_KEPT_ANSWERS]
        self.untouched = other.untouched  # of all recordings so far
        self.latest, self.grasp_answer = other.latest, other.grasp_answer
        self.level = other.level

    def summary(self) -> dict[str, Any]:
        """Return the counts and latencies, for printing."""
        latencies = np.array(self.latencies_s or [np.nan]) * 1e6
        return {
            "target": self.target,
            "windows": self.windows,
            "filled": self.filled,
            "answers": dict(self.answers.most_common()),
            "actions": dict(self.actions.most_common()),
            "marked": self.marked,
            "right": self.right,
            "grasps": self.grasps,
            "grasps_right": self.grasps_right,
            "grasps_without": self.grasps_without,
            "untouched": self.untouched,
            **self._news(),
            "level": self._level_summary(),
            "latency_us_median": float(np.median(latencies)),
            "latency_us_p99": float(np.percentile(latencies, 99)),
        }

    def _news(self) -> dict[str, list[dict[str, Any]]]:
        """Return what happened to the input, by kind, as plain values.

        Times run from the first scan of the recording: a replay moves its clock to this moment.
        """
        return {
            name: [self._as_values(item) for item in getattr(self, name)] + self._more[name]
            for name in _NEWS
        }

    def _as_values(self, item: Any) -> dict[str, Any]:
        values = asdict(item)
        moments = {key: values[key] for key in _TIMES & values.keys() if values[key] is not None}
        since = {key: moment_s - self.began_s for key, moment_s in moments.items()}
        return values | since | {"text": item.words(), "recording": self.recording}

    def _level_summary(self) -> dict[str, Any] | None:
        """Return where the level stands; with a warning where one answer is nearly all."""
        if self.level is None:
            return None
        (most, count), *_ = self.answers.most_common(1) or [("", 0)]
        share = count / max(1, self.windows)
        alike = self.level.touches >= MANY_TOUCHES and share > MOST_ALIKE
        warning = (
            f"{share:.0%} of the answers are {most}, and levels follow a mixture of touches: where "
            "one thing is touched again and again, use a bundle written with --hold-level"
        )
        words = {"text": self.level.words(), "warning": warning if alike else ""}
        return asdict(self.level) | words


Show = Callable[[Samples, list[Tally]], None]
"""Called after each read with the new samples and all tallies."""


def run_session(
    source: Source,
    recognisers: list[Recogniser],
    seconds: float | None = None,
    show: Show | None = None,
    rules: RuleTable = _NO_RULES,
    stopped: Callable[[], bool] = lambda: False,
) -> list[Tally]:
    """Read a source until it ends, is stopped, or for some of its seconds; return the tallies.

    Args:
        source: An open source.
        recognisers: Each gets all samples.
        seconds: Length on the samples' fitted clock, seconds; None has no end. Scans and marks
            beyond it are left out, however many a read gives at once.
        show: Draws the screen.
        rules: What is to be done about what is recognised.
        stopped: True once it shall end early.
    """
    tallies = [
        Tally(
            recogniser.bundle.contract.target,
            recogniser.new_vote(),
            rules,
            late=recogniser.bundle.contract.window.pad,
            outage_watch=OutageWatch(recogniser.bundle.contract.window.max_gap_s),
        )
        for recogniser in recognisers
    ]
    end_s: float | None = None
    over = False
    while not (over or source.ended or stopped()):
        samples = _read(source, recognisers)
        if end_s is None and len(samples):
            began_s = float(samples.fitted_s[0])
            end_s = began_s + (inf if seconds is None else seconds)
            for tally in tallies:
                tally.began_s = began_s
        if end_s is not None and len(samples):
            over = bool(samples.fitted_s[-1] >= end_s)
            samples = samples[samples.fitted_s < end_s] if over else samples
        for recogniser, tally in zip(recognisers, tallies, strict=True):
            for answer in recogniser.push(samples):
                tally.add(answer)
            tally.note(recogniser.gate_moves())
            tally.note_still(recogniser.still_channels())
            tally.note_scales(recogniser.other_scales())
            tally.note_rates(recogniser.rate_changes())
        _compare(source, tallies, end_s)
        if show is not None:
            show(samples, tallies)
    for recogniser, tally in zip(recognisers, tallies, strict=True):
        for answer in recogniser.flush():
            tally.add(answer)
        tally.note_still(recogniser.still_channels())
        tally.note_scales(recogniser.other_scales())
        tally.untouched = recogniser.untouched()
        tally.level = recogniser.level()
    _compare(source, tallies, end_s)
    for tally in tallies:
        tally.settle()
    return tallies


def _compare(source: Source, tallies: list[Tally], end_s: float | None) -> None:
    for mark in source.marks():
        if end_s is None or mark.end_s < end_s:
            for tally in tallies:
                tally.compare(mark)


def _read(source: Source, recognisers: list[Recogniser]) -> Samples:
    """Wait for scans; where a window lacks one row, awake and with the model at hand.

    A processor that sleeps between scans answers ten times slower (docs/decisions/0010).
    """
    near = [recogniser for recogniser in recognisers if recogniser.near]
    if not near:
        return source.read()
    for recogniser in near:
        recogniser.warm()
    return source.read(0.0)
