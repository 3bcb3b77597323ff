"""`taxel record --plan`: trial after trial of two tactile cameras, each shown before it is made.

Knows nothing about what settles a grasp.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taxel.cli.printing import console, print_json, say, say_aside
from taxel.cli.recordings.plan_page import PlanDisplay, open_shower
from taxel.cli.recordings.recording import record_source
from taxel.clock import SystemClock
from taxel.errors import BadInput
from taxel.recordings.trial_plan import PlannedTrial, balance_line, done_of, read_plan
from taxel.sources.contract import Source
from taxel.sources.handed_on import HandedOn
from taxel.sources.opening import open_source
from taxel.views.keys import Keys

if TYPE_CHECKING:
    from taxel.actions.actuators import GripperActuator
    from taxel.actions.guided_trials import RecordedTrial

SIMULATED = "sim://cup-pour"
_ARRAYS = ("sim://", "serial://")
"""How addresses of arrays begin, but for that of the simulated pair."""
TARE = Path("tare") / "untouched.mcap"
TARE_S = 1.0
"""How long untouched gels are recorded, seconds. Source: our choice, docs/decisions/0043."""
_KEYS = "Enter: ready · r: the last one again · d: discard the last one · q: end"
_TWO_KEYS = "Enter: ready · q: end"
_NO_LAST = f"there is no last trial to discard now; {_TWO_KEYS}"


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanRecording:
    """The options of `taxel record --plan`."""

    source: str
    plan: Path
    output: Path
    seconds: float
    tare: bool
    gripper: str | None
    ask: bool
    page: str | None
    """Where the page listens, HOST:PORT; None has none."""
    json: bool


def record_plan(options: PlanRecording, stopped: Callable[[], bool]) -> None:
    """Record the trials of a plan that are not done yet, then print how many are."""
    trials = read_plan(options.plan)
    recorded = done_of(trials, options.output)
    show_line = say_aside if options.json else say
    show_line(balance_line(trials, recorded))
    made: list[RecordedTrial] = []
    if len(recorded) < len(trials):
        simulated = options.source.partition("?")[0] == SIMULATED
        if options.tare and simulated:
            raise BadInput("--tare with real cameras", SIMULATED, "leave --tare out")
        if options.source.startswith(_ARRAYS) and not simulated:
            raise BadInput(
                "tactile cameras for a plan of grasps", f"an array, {options.source}",
                "record an array without --plan, or let the hand grasp by a plan: taxel collect",
            )  # fmt: skip
        asks = options.ask and not simulated
        if asks and not console.is_terminal and options.page is None:
            raise BadInput(
                "a terminal or a page, where a key says that the cup is held",
                "none",
                "add --page, or --no-ask where grasps are made by themselves",
            )
        with ExitStack() as stack:
            keys = stack.enter_context(Keys())
            shower = open_shower(options.page, stack, len(trials), show_line, asks=asks)
            shower.board.show("WAIT", done=len(recorded), balance=balance_line(trials, recorded))
            made = _Session(options, stack, keys if asks else None, stopped, shower).run(trials)
    ready = done_of(trials, options.output)
    if options.json:
        print_json(
            {
                "trials": len(trials),
                "recorded": len(ready),
                "now": [
                    {"recording": done.trial.file_name, "frames": done.frames,
                     "settled_after_s": done.settled_after_s, "change_pct": done.change}
                    for done in made
                ],
            }
        )  # fmt: skip
    else:
        say(balance_line(trials, ready))


class _Session:
    """One run through a plan.

    Args:
        options: What was asked for.
        stack: Closes what is opened.
        keys: The person's; None where nobody is asked.
        stopped: True once the run shall end.
        shower: Shows lines in the terminal, and what to do on the page.
    """

    def __init__(
        self,
        options: PlanRecording,
        stack: ExitStack,
        keys: Keys | None,
        stopped: Callable[[], bool],
        shower: PlanDisplay,
    ) -> None:
        self._options, self._stack, self._keys = options, stack, keys
        self._stopped, self._shower = stopped, shower
        self._show_line, self._board = shower.line, shower.board
        self._clock = SystemClock()
        self._gripper = self._open_gripper()
        self._source: Source | None = None
        if options.tare:
            self._record_untouched()

    def run(self, trials: list[PlannedTrial]) -> list[RecordedTrial]:
        """Record each trial that is missing; a discarded one is missing again."""
        made: list[RecordedTrial] = []
        queue = [t for t in trials if t not in done_of(trials, self._options.output)]
        last: PlannedTrial | None = None
        while queue and not self._stopped():
            trial = queue[0]
            self._show_line(f"trial {trial.number} of {len(trials)}: {trial.words}")
            key = self._ask(
                "GET READY", last=last is not None, number=trial.number, words=trial.words
            )
            if key == "q":
                break
            if key and last is not None:
                (self._options.output / last.file_name).unlink(missing_ok=True)
                made = [done for done in made if done.trial is not last]
                self._show_line(f"discarded: trial {last.number}")
                self._show_done("DONE", f"discarded: trial {last.number}", trials)
                if key == "r":
                    queue.insert(0, last)
                last = None
                continue
            recorded = self._one(trial)
            if recorded is None:
                break
            made.append(recorded)
            last = queue.pop(0)
            self._show_line(self._show_done("DONE", f"trial {trial.number}", trials))
        return made

    def _show_done(self, word: str, why: str, trials: list[PlannedTrial]) -> str:
        """Show on the page how far the plan is now; return the line that says so."""
        done = done_of(trials, self._options.output)
        line = balance_line(trials, done)
        self._board.show(word, why, done=len(done), balance=line)
        return line

    def _one(self, trial: PlannedTrial) -> RecordedTrial | None:
        """Record a trial; where a person is there, a grasp not held or not still is repeated."""
        from taxel.actions.guided_trials import NotHeld, NotSettled, record_trial, set_grip

        while not self._stopped():
            try:
                if self._gripper is not None:
                    force_n = set_grip(self._gripper, trial, self._clock)
                    self._show_line(f"gripper holds with {force_n:g} N")
                with ExitStack() as own:
                    source: Source = HandedOn(self._cameras_for(trial, own), see=self._board.see)
                    path = self._options.output / trial.file_name
                    return record_trial(
                        source,
                        trial,
                        path,
                        self._options.seconds,
                        self._shower.phase,
                        self._stopped,
                    )
            except (NotHeld, NotSettled) as error:
                if self._keys is None:
                    raise
                self._show_line(str(error))
                if self._ask("GRASP AGAIN", str(error)) == "q":
                    return None
        return None

    def _cameras_for(self, trial: PlannedTrial, own: ExitStack) -> Source:
        """Return the open cameras; of a simulated pair those of the trial's own cup."""
        url = self._options.source
        if url.partition("?")[0] == SIMULATED:
            return own.enter_context(
                open_source(simulated_trial(url, trial, self._options.seconds))
            )
        if self._source is None:
            self._source = self._stack.enter_context(open_source(url))
        self._source.read(0.0)
        self._source.frames()  # what came while a person got ready belongs to no trial
        return self._source

    def _open_gripper(self) -> GripperActuator | None:
        if self._options.gripper is None:
            return None
        from taxel.actions.actuators import GripperActuator
        from taxel.actions.opening import open_actuator

        gripper = open_actuator(self._options.gripper, self._clock)
        if not isinstance(gripper, GripperActuator):
            raise BadInput(
                "a gripper's address, such as pge:///dev/ttyUSB0?max_force_n=50",
                self._options.gripper, "name one",
            )  # fmt: skip
        self._stack.callback(gripper.close)
        gripper.connect()
        return gripper

    def _record_untouched(self) -> None:

        path = self._options.output / TARE
        if path.exists():
            return
        self._show_line("leave both gels untouched")
        if self._ask("HANDS OFF", "leave both gels untouched") == "q":
            return
        self._source = self._stack.enter_context(open_source(self._options.source))
        record_source(self._source, path, TARE_S, labels={}, groups={"touch": "none"},
                      stopped=self._stopped)  # fmt: skip

    def _ask(self, word: str, why: str = "", *, last: bool = False, **shown: Any) -> str:
        """Return the key that a person typed: "" for Enter, r, d or q; "" where nobody is asked.

        Args:
            word: What the page says is to be done.
            why: In words.
            last: There is a last trial, which r and d may discard; they are refused elsewhere.
            shown: More for the page.
        """
        self._board.show(word, why, waits=True, discards=last, **shown)
        if self._keys is None:
            return ""
        self._show_line(_KEYS if last else _TWO_KEYS)
        if self._keys.forget():
            return "q"
        while not self._stopped():
            typed = self._keys.typed()
            step = self._shower.step()
            key = step if step is not None else _first_key(typed)
            if key in ("r", "d") and not last:
                if "q" in typed:
                    return "q"
                self._show_line(_NO_LAST)
            elif key is not None:
                self._board.show("HOLD STILL", "until the grasp has settled")
                return key
            self._clock.sleep(0.05)
        return "q"


def _first_key(typed: str) -> str | None:
    """Return the first key that means something, "" for Enter; None without any."""
    return next((key.strip() for key in typed if key in "\r\nrdq"), None)


def simulated_trial(url: str, trial: PlannedTrial, seconds: float) -> str:
    """Return the address of the simulated pair that holds a trial's cup.

    Args:
        url: sim://cup-pour, with or without options.
        trial: Its groups cup, position and force_n (and kind, if there is one) choose the grasp.
        seconds: How long it lasts.

    Raises:
        BadInput: The plan lacks one of them, or names a cup that is no number.
    """
    groups = trial.groups
    missing = [name for name in ("cup", "position", "force_n") if name not in groups]
    if missing or not groups["cup"].isdecimal():
        raise BadInput(
            "group:cup (a number), group:position and group:force_n for the simulated pair",
            f"no {', '.join(missing)}" if missing else f"cup {groups['cup']!r}", "mend the plan",
        )  # fmt: skip
    own: dict[str, Any] = {
        "cup": int(groups["cup"]), "position": groups["position"], "force_n": groups["force_n"],
        "runs": 1, "duration_s": f"{seconds:g}",
    }  # fmt: skip
    if "kind" in groups:
        own["kind"] = groups["kind"].replace(" ", "-")
    more = "&".join(f"{key}={value}" for key, value in own.items())
    return f"{url}{'&' if '?' in url else '?'}{more}"
