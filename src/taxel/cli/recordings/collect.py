"""`taxel collect`: the hand grasps a plan of objects, each grasp labelled and recorded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import tyro

from taxel.cli.options.rules import Only
from taxel.cli.printing import console, print_json, progress, say, say_aside
from taxel.cli.recordings.recording import stop_signals
from taxel.errors import BadInput
from taxel.views.keys import Keys

if TYPE_CHECKING:
    from taxel.actions.collecting import CollectedGrasp
    from taxel.actions.grasp_cycle import CycleConfig
    from taxel.actions.grasping import Grasping
    from taxel.actions.hand_driver import HandDriver
    from taxel.recordings.trial_plan import PlannedTrial
    from taxel.sources.contract import Source

TRIES = 3
"""How often a grasp that met nothing is tried. Source: our choice, docs/decisions/0043."""


@dataclass(frozen=True)
class Collect:
    """Grasp, label and record a plan of objects: approach, close until contact, hold, release.

    Each grasp becomes a recording of its own in --output. The same command continues an
    interrupted plan. The plan is a table of label:NAME, group:NAME and times columns.
    """

    plan: tyro.conf.Positional[Path]
    """The plan (.csv), such as plans/teng-nine-objects.csv."""
    source: str
    """Address of the touch sensors, such as sim://teng or serial:///dev/teng-a,/dev/teng-b."""
    hand: str
    """Address of the hand's motors, such as sim://hand or hand:///dev/serial/by-id/hand."""
    output: Path
    """Folder for the recordings, one file per grasp."""
    arm: bool = False
    """Allow motion at once; otherwise the hand first moves after a key is pressed."""
    ask: bool = True
    """Wait for a key whenever the object changes; a simulated hand never waits."""
    contact_ma: int = 700
    """Motor current that counts as contact and stops the motor, mA."""
    presses: int = 5
    """Presses in each grasp, the closing one included."""
    hold_s: float = 0.4
    """How long the fingers rest on the object after each press, seconds."""
    stroke_s: float = 5.0
    """Time of the fingers from open to closed, seconds; as HAND_STROKE_MS of the firmware."""
    pause_s: float = 0.5
    """How long the hand stays open after each grasp, seconds."""
    json: bool = False
    """Print what was recorded as JSON."""

    RULES: ClassVar = (
        Only(("arm", "ask"), "a real hand", lambda o: not o.hand.startswith("sim://")),
    )

    def run(self) -> None:
        """Grasp what is missing of the plan, then say how far it is."""
        result = collect_plan(
            self.plan, self.source, self.hand, self.output, self.cycle(), ask=self.ask, arm=self.arm
        )
        if self.json:
            print_json(result)
        else:
            say(result["balance"])

    def cycle(self) -> CycleConfig:
        """Return how the hand grasps."""
        from taxel.actions.grasp_cycle import CycleConfig

        return CycleConfig(
            contact_ma=self.contact_ma, presses=self.presses, hold_s=self.hold_s,
            stroke_s=self.stroke_s, pause_s=self.pause_s,
        )  # fmt: skip


def collect_plan(
    plan: Path, source: str, hand: str, output: Path, config: CycleConfig, *, ask: bool, arm: bool
) -> dict[str, Any]:
    """Grasp what is missing of a plan; return how far it is."""
    from taxel.actions.grasping import open_grasping
    from taxel.recordings.trial_plan import balance_line, done_of, read_plan

    trials = read_plan(plan)
    done = done_of(trials, output)
    made: list[CollectedGrasp] = []
    if len(done) < len(trials):
        say_aside(balance_line(trials, done))
        rig = open_grasping(source, hand)
        asks = rig.place is None and (ask or not arm)
        made = _grasp_all(rig, trials, done, output, config, asks=asks, each=ask)
    ready = done_of(trials, output)
    return {
        "trials": len(trials),
        "recorded": len(ready),
        "balance": balance_line(trials, ready),
        "now": [_summary(grasp) for grasp in made],
    }


def _grasp_all(
    rig: Grasping,
    trials: list[PlannedTrial],
    done: list[PlannedTrial],
    output: Path,
    config: CycleConfig,
    *,
    asks: bool,
    each: bool,
) -> list[CollectedGrasp]:
    """Grasp each trial that is missing, in order.

    Where it `asks`, that is before `each` object, or else before the hand first moves.
    """
    from taxel.actions.hand_driver import HandDriver, hand_limits
    from taxel.live.station.worker import hurried

    if asks and not console.is_terminal:
        raise BadInput(
            "a terminal, where a key says that the object lies in the hand",
            "none",
            "add --arm --no-ask where objects come by themselves",
        )
    ready = {trial.number for trial in done}
    grasps: list[CollectedGrasp] = []
    rig.actuator.connect()
    with (
        rig.source as source, stop_signals() as stopped, Keys() as keys, progress() as bars,
        hurried(rig.clock),  # the hand stops where nobody speaks to it for a while
    ):  # fmt: skip
        driver = HandDriver(rig.actuator, rig.clock, hand_limits(config.contact_ma))
        try:
            driver.arm()
            bar = bars.add_task("grasps", total=len(trials), completed=len(ready))
            before = ""
            for trial in trials:
                if trial.number in ready or stopped():
                    continue
                bars.update(bar, description=f"grasp {trial.number}: {trial.words}")
                wait = asks and (trial.words != before if each else not grasps)
                grasp = _one(rig, source, driver, trial, output, config,
                             keys if wait else None, stopped)  # fmt: skip
                if grasp is None:
                    break
                grasps.append(grasp)
                before = trial.words
                bars.update(bar, advance=1)
        finally:
            rig.actuator.close()
    return grasps


def _one(
    rig: Grasping,
    source: Source,
    driver: HandDriver,
    trial: PlannedTrial,
    folder: Path,
    config: CycleConfig,
    keys: Keys | None,
    stopped: Callable[[], bool],
) -> CollectedGrasp | None:
    """Return a grasp that met its object; None where a person asked for the end.

    Raises:
        BadInput: It met nothing, however often it was tried.
    """
    from taxel.actions.collecting import collect_grasp, rest

    for _ in range(TRIES):
        if rig.place is not None:
            rig.place(trial)
        elif keys is not None:
            say_aside(f"put into the open hand: {trial.words}; then Enter (q: end)")
            if keys.forget():
                return None
            typed: list[str] = []

            def waiting(typed: list[str] = typed) -> bool:
                typed.append(keys.typed())
                return not stopped() and not set("\r\nq") & set("".join(typed))

            rest(source, driver, waiting)
            if stopped() or "q" in "".join(typed):
                return None
        grasp = collect_grasp(source, driver, trial, folder, config, stopped)
        if grasp.touched:
            return grasp
        if stopped():
            return None
    raise BadInput(
        f"an object between the fingers for trial {trial.number} ({trial.words})",
        f"nothing, {TRIES} times",
        "put it into the hand, lower --contact-ma, or give the fingers' own time from open to "
        "closed as --stroke-s; then run the same command again",
    )


def _summary(grasp: CollectedGrasp) -> dict[str, Any]:
    rest = asdict(grasp)
    del rest["trial"]
    return {"recording": grasp.trial.file_name, **grasp.trial.labels, **grasp.trial.groups, **rest}
