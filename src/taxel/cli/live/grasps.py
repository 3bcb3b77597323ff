"""What `taxel live` does with a grasp bundle: watch, and print each change of state."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from rich.text import Text

from taxel.cli.printing import console, print_json, say
from taxel.cli.recordings.recording import SUMMARY_FOLLOWS, stop_signals
from taxel.plain_text import number_of, visible, visible_line

if TYPE_CHECKING:
    from taxel.bundles.grasp import GraspContract
    from taxel.bundles.signing import Trust
    from taxel.live.grasp_monitor import GraspAnswer

_COLOURS = {"STABLE": "green", "WARNING": "yellow", "UNSTABLE": "red", "UNKNOWN": "dim",
    "NO GRASP": "dim",
}  # fmt: skip


def number_words(contract: GraspContract, number: float) -> str:
    """Return a monitor's number in words, if it gave one: a probability, or a score."""
    if not math.isfinite(number):
        return ""
    if contract.gives_probability:
        return f"  P({visible(contract.rule)}) {number:.2f}"
    return f"  score {number:.2f} (warns from {contract.stability.warn:.2f})"


def live_grasps(
    bundle: Path,
    source_url: str,
    seconds: float | None,
    as_json: bool,
    trust: Trust | None,
    device: str,
) -> None:
    """Watch a source with cameras; print each change of state, then a summary."""
    from taxel.bundles.grasp import read_grasp_bundle
    from taxel.live.grasp_session import run_grasp_session
    from taxel.sources.opening import open_source

    opened = read_grasp_bundle(bundle, trust=trust, device=device)
    first_s: list[float] = []

    def show(answer: GraspAnswer, changed: bool) -> None:
        first_s[:] = first_s or [answer.time_s]
        if changed and not as_json:
            name = answer.decision.state.name.replace("_", " ")
            reason = f"  {answer.decision.reason}" if answer.decision.reason else ""
            slip = answer.decision.slip
            reason += f"  {slip.words}" if slip is not None and slip.seen else ""
            what = number_words(opened.contract, answer.probability)
            console.print(
                Text.assemble(
                    f"{answer.time_s - first_s[0]:8.2f} s  ", (f"{name:<8}", _COLOURS[name]),
                    f"{what}{visible_line(reason)}",
                ), soft_wrap=True,
            )  # fmt: skip

    with stop_signals(SUMMARY_FOLLOWS) as stopped, open_source(source_url) as source:
        tally = run_grasp_session(source, opened, seconds, on_answer=show, stopped=stopped)
    summary = tally.summary()
    if as_json:
        print_json(summary)
        return
    states = ", ".join(f"{name} {count}" for name, count in summary["states"].items())
    say(
        f"{number_of(summary['moments'], 'moment')}: {states or 'none'}; "
        f"{number_of(summary['alarms'], 'alarm')}"
    )
    if summary["starts"]:
        starts = ", ".join(f"{start_s:.2f} s" for start_s in summary["starts"])
        say(f"grasps found to begin after: {starts}")
    for grasp in summary["grasps"]:
        alarm_s = grasp["first_alarm_s"]
        warned = "no alarm" if alarm_s is None else f"first alarm after {alarm_s:.2f} s"
        say(f"  {visible(grasp.get('run', 'grasp'))}: {visible(grasp['outcome'] or '–')}, {warned}")
    if summary["moments"]:
        say(
            f"frames to decision: median {summary['latency_ms_median']:.1f} ms, "
            f"99 % below {summary['latency_ms_p99']:.1f} ms"
        )
