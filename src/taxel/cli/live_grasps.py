"""What `taxel live` does with a grasp bundle: watch, and tell when the state changes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from taxel.cli.printing import console, print_json

if TYPE_CHECKING:
    from taxel.live.grasp_monitor import GraspAnswer

_COLOURS = {"STABLE": "green", "WARNING": "yellow", "UNSTABLE": "red", "UNKNOWN": "dim"}


def live_grasps(
    bundle: Path, source_url: str, seconds: float | None, quiet: bool, as_json: bool
) -> None:
    """Watch a source with cameras; print each change of state, then a summary."""
    from taxel.bundles.grasp import read_grasp_bundle
    from taxel.live.grasp_session import run_grasp_session
    from taxel.sources.opening import open_source

    opened = read_grasp_bundle(bundle)
    first_s: list[float] = []

    def show(answer: GraspAnswer, changed: bool) -> None:
        first_s[:] = first_s or [answer.time_s]
        if changed and not quiet and not as_json:
            name = answer.decision.state.name
            reason = f"  {answer.decision.reason}" if answer.decision.reason else ""
            console.print(
                f"{answer.time_s - first_s[0]:8.2f} s  [{_COLOURS[name]}]{name:<8}[/]  "
                f"P({opened.contract.rule}) {answer.probability:.2f}{reason}"
            )

    with open_source(source_url) as source:
        tally = run_grasp_session(source, opened, seconds, on_answer=show)
    result = tally.summary()
    if as_json:
        print_json(result)
        return
    states = ", ".join(f"{name} {count}" for name, count in result["states"].items())
    console.print(f"{result['moments']} moments: {states or 'none'}; {result['alarms']} alarms")
    for grasp in result["grasps"]:
        told = grasp["first_alarm_s"]
        warned = "no alarm" if told is None else f"first alarm after {told:.2f} s"
        console.print(f"  {grasp.get('run', 'grasp')}: {grasp['outcome'] or '–'}, {warned}")
    if result["moments"]:
        console.print(
            f"frames to decision: median {result['latency_ms_median']:.1f} ms, "
            f"99 % below {result['latency_ms_p99']:.1f} ms"
        )
