"""`taxel hand`: the TENG hand's fingers, one movement at a time.

Background of our choices: docs/decisions/0043.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import time_ns
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import tyro

from taxel.cli.figure_files import need_figures
from taxel.cli.options.rules import Only
from taxel.cli.printing import print_json, say, say_aside
from taxel.cli.recordings.recording import stop_signals
from taxel.errors import BadInput, TaxelError
from taxel.plain_text import number_of

if TYPE_CHECKING:
    from taxel.actions.actuators import HandActuator
    from taxel.actions.hand_moves import Moved
    from taxel.clock import Clock

MOVES = ("move", "grip", "release")
_LISTEN_S = 0.5
"""How long `status` listens, seconds. Source: our choice."""
_LASTS_S = 0.3
"""Each order runs out after this long unless it is repeated, seconds. Source: our choice."""


@dataclass(frozen=True)
class Hand:
    """Print the hand's status, move fingers, grip until contact, release, or stop."""

    action: tyro.conf.Positional[Literal["status", "move", "grip", "release", "stop"]]
    """status, move (to --closed), grip (until contact), release (open), stop (motors off)."""
    hand: tyro.conf.Positional[str]
    """Address of the motors: hand:///dev/serial/by-id/hand, or sim://hand."""
    arm: bool = False
    """Allow motion: needed to move, grip and release."""
    fingers: tuple[int, ...] = (1, 2, 3, 4)
    """Which fingers, from 1."""
    closed: int = 500
    """move: how far, 0 open … 1000 closed, per mille."""
    contact_ma: int = 700
    """The current at which a motor stops, mA."""
    seconds: float = 8.0
    """Time limit of a movement, seconds; after power-up the hand first opens, in 6 s."""
    record: Path | None = None
    """Write the motors' currents to this recording (.mcap)."""
    plot: Path | None = None
    """Draw the motors' currents to this picture (.png)."""
    overwrite: bool = False
    """Replace existing files of --record and --plot."""
    json: bool = False
    """Print the result as JSON."""

    RULES: ClassVar = (
        Only(("arm", "fingers", "seconds"), "move, grip or release", lambda o: o.action in MOVES),
        Only(("closed",), "move", lambda o: o.action == "move"),
        Only(("contact-ma",), "move, grip, release or --plot",
             lambda o: o.action in MOVES or o.plot is not None),
        Only(("overwrite",), "--record or --plot",
             lambda o: o.record is not None or o.plot is not None),
    )  # fmt: skip

    def run(self) -> None:
        """Move the fingers, then print their states and currents."""
        self._check()
        result = use_hand(
            self.action, self.hand, fingers=self.fingers, closed=self.closed,
            contact_ma=self.contact_ma, longest_s=self.seconds, record=self.record, plot=self.plot,
            overwrite=self.overwrite,
        )  # fmt: skip
        if self.json:
            print_json(result)
        else:
            say(_line(self.action, result))

    def _check(self) -> None:
        """Refuse what cannot be done, before anything moves."""
        if self.action in MOVES and not self.arm:
            raise BadInput(
                f"--arm for {self.action}: a person allows motion",
                "none",
                "look at the hand, then add --arm",
            )
        if not self.fingers or not all(1 <= finger <= 4 for finger in self.fingers):
            named = " ".join(map(str, self.fingers)) or "none"
            raise BadInput("--fingers among 1 to 4", named, "name fingers")
        if not 0 <= self.closed <= 1000:
            raise BadInput("--closed of 0 to 1000", f"{self.closed}", "choose another")
        if not 1 <= self.contact_ma <= 0x7FFF:
            raise BadInput(f"--contact-ma of 1 to {0x7FFF}", f"{self.contact_ma}", "choose another")
        if not 0 < self.seconds <= 60:
            raise BadInput("--seconds above 0 and up to 60", f"{self.seconds:g}", "choose another")
        if self.plot is not None:
            need_figures(self.plot)


def use_hand(
    action: str,
    url: str,
    *,
    fingers: tuple[int, ...],
    closed: int,
    contact_ma: int,
    longest_s: float,
    record: Path | None,
    plot: Path | None,
    overwrite: bool,
) -> dict[str, Any]:
    """Open the hand, do what was asked for, write what is to be kept; return what became of it.

    Whether it can be kept is looked at first: a motion is not repeated for its currents. Those of
    a movement that was stopped are kept too.
    """
    from taxel.actions.grasping import open_hand
    from taxel.actions.hand_driver import HandStopped
    from taxel.recordings.part_file import check_output
    from taxel.recordings.whole import check_place

    if record is not None:
        check_output(record, overwrite)
        check_place(record)
    if plot is not None:
        check_place(plot)
        if plot.exists() and not overwrite:
            raise BadInput("a new file", f"{plot}, which exists", "add --overwrite or name another")
    actuator, clock = open_hand(url)
    actuator.connect()
    keep = _Kept(record, plot, contact_ma)
    try:
        try:
            to = {"move": closed, "grip": 1000, "release": 0}.get(action)
            moved = _act(actuator, clock, fingers, to, contact_ma, longest_s, stop=action == "stop")
            result = _summary(actuator, moved)
        finally:
            wall_anchor_ns = time_ns() - round(clock.now_s() * 1e9)
            actuator.close()
    except HandStopped as error:
        if error.currents and (record or plot):  # they may show why
            try:
                keep.write(error.currents, wall_anchor_ns)
            except (TaxelError, OSError) as refused:  # the reason of the stop stays
                say_aside(f"the currents until the stop are lost: {refused}")
            else:
                files = ", ".join(str(path) for path in (record, plot) if path)
                say_aside(f"the currents until the stop: {files}")
        raise
    try:
        keep.write(moved.currents, wall_anchor_ns)
    except (TaxelError, OSError):
        say_aside(_line(action, result))  # where the fingers are now
        raise
    return result


@dataclass(frozen=True, slots=True)
class _Kept:
    """Where a movement's currents go."""

    record: Path | None
    plot: Path | None
    contact_ma: int

    def write(self, currents: Sequence[tuple[float, tuple[int, ...]]], wall_anchor_ns: int) -> None:
        """Write what was asked for, once the hand is closed."""
        time_s, values = [s for s, _ in currents], [ma for _, ma in currents]
        if self.record is not None:
            from taxel.actions.collecting import write_currents

            write_currents(self.record, time_s, values, wall_anchor_ns)
        if self.plot is not None:
            from taxel.views.figures.current import save_currents

            save_currents(self.plot, time_s, values, self.contact_ma)


def _act(
    actuator: HandActuator,
    clock: Clock,
    fingers: tuple[int, ...],
    to_permille: int | None,
    contact_ma: int,
    longest_s: float,
    *,
    stop: bool,
) -> Moved:
    """Move the fingers of a connected hand, or listen to it where there is nowhere to go."""
    from taxel.actions.grasp_cycle import Closing
    from taxel.actions.hand_driver import HandDriver, hand_limits
    from taxel.actions.hand_moves import Moved, move_fingers, watch
    from taxel.live.station.worker import hurried

    driver = HandDriver(actuator, clock, hand_limits(contact_ma))
    if stop:
        actuator.hand.stop()
    if to_permille is None:
        return Moved(ended="there", seconds=_LISTEN_S, currents=watch(driver, _LISTEN_S))
    bits = sum(1 << finger - 1 for finger in set(fingers))
    with stop_signals() as stopped, hurried(clock):
        driver.arm()
        wanted = Closing(bits, to_permille, contact_ma, _LASTS_S)
        return move_fingers(driver, wanted, longest_s, stopped)


def _summary(actuator: HandActuator, moved: Moved) -> dict[str, Any]:
    status = actuator.hand.status()
    return {
        "state": "unknown" if status.state is None else status.state.name.lower(),
        "fault": status.fault,
        "ended": moved.ended,
        "seconds": round(moved.seconds, 3),
        "currents_ma": list(status.currents_ma),
        "largest_ma": list(moved.largest_ma),
        "readings": len(moved.currents),
    }


def _line(action: str, result: dict[str, Any]) -> str:
    """Return the result as a line of text."""
    ended = {"there": "fingers rest", "time": "time is out", "stopped": "ended by a person"}
    largest = ", ".join(map(str, result["largest_ma"])) or "none"
    came = f"{ended[result['ended']]} after" if action in MOVES else "listened for"
    parts = [
        f"hand {result['state']}" + (f" ({result['fault']})" if result["fault"] else ""),
        f"{action}: {came} {result['seconds']:.2f} s",
        f"largest currents {largest} mA of {number_of(result['readings'], 'reading')}",
    ]
    return "; ".join(parts)
