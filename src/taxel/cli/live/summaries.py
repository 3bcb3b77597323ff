"""What `taxel live` prints at the end: each recogniser's answers, and what a station went through.

Knows nothing about how they were run.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from taxel.cli.printing import say
from taxel.plain_text import number_of, visible

if TYPE_CHECKING:
    from taxel.live.station.station import Station


def answers_lines(results: list[dict[str, Any]]) -> list[str]:
    """Return how many windows or camera trials of each recogniser had which answer."""
    from taxel.live.station.answers import titles

    lines = []
    for title, result in zip(titles(results), results, strict=True):
        each = ", ".join(f"{visible(name)} {count}" for name, count in result["answers"].items())
        done = ", ".join(f"{visible(name)} {n}" for name, n in result["actions"].items())
        to_do = f"; to do: {done}" if done else ""
        many = number_of(result.get("windows", 0), "window")
        if "trials" in result:
            many = number_of(result["trials"], "trial")
            if result["marked"]:
                to_do += f"; {result['right']}/{result['marked']} as the source's own labels say"
        lines.append(f"{title}: {many}: {each or 'none'}{to_do}")
    return lines


def trials_line(trials: list[dict[str, Any]]) -> str:
    """Return in how many grasps an alarm came, the person did something, and what came of them."""
    warned = sum(trial["alarm_s"] is not None for trial in trials)
    done = sum(bool(trial["reaction"]) for trial in trials)
    came = Counter(trial["outcome"] or "unknown" for trial in trials)
    each = ", ".join(f"{count} {name}" for name, count in came.most_common())
    many = f"{len(trials)} grasp{'' if len(trials) == 1 else 's'}"
    total = sum({trial["cameras"]: trial["number"] for trial in trials}.values())
    if total > len(trials):  # a station keeps the latest alone
        many = f"the last {len(trials)} of {total} grasps"
    return f"{many}: {warned} with an alarm, {done} with a reaction; {each}"


def station_summary(station: Station) -> dict[str, Any]:
    """Return what --json prints of a station: states, alarms, trials, losses and latencies."""
    from taxel.cli.live.trained_trials import warn_of_training

    alarms = station.guard.alarms
    answers = station.answers.summary()
    warn_of_training(station, answers)
    return {
        "state": station.guard.shown[0],
        "events": [{"time_s": time_s, "text": text} for _, time_s, text in station.events],
        "given_up": station.failed,
        "answers": answers,
        "alarms": alarms.as_json(),
        "trials": [asdict(trial) for trial in station.person.trials],
        "latency_ms": {
            stage: dict(zip(("p50", "p95", "p99"), values, strict=True))
            for stage, values in station.latencies.percentiles_ms().items()
        },
        "processes": station.ledger(),
        "outputs": station.driving.counts(),
        "recording": station.recording,
    }


def print_station_summary(summary: dict[str, Any]) -> None:
    """Print what `station_summary` gave, in lines."""
    from taxel.live.station.guard import NO_GRASP

    for line, result in zip(answers_lines(summary["answers"]), summary["answers"], strict=True):
        say(line)
        if result.get("level"):
            say(f"  {result['level']}")
        if result.get("warning"):
            say(f"warning: {result['warning']}", style="yellow")
    counts = summary["alarms"]["counts"]
    if summary["state"] != NO_GRASP or counts["raised"]:
        say(f"alarms: {counts['raised']} raised, {counts['acknowledged']} acknowledged")
    if summary["trials"]:
        say(trials_line(summary["trials"]))
    for name, process in summary["processes"].items():
        again = f", started {process['starts']} times" if process["starts"] > 1 else ""
        if name == "recorder" and summary["recording"].get("not_written"):
            again = f", not written {summary['recording']['not_written']}{again}"
        say(
            f"  {name}: {number_of(process['produced'], 'message')} produced, "
            f"{process['consumed']} received, {process['dropped']} lost{again}"
        )
    for name, count in summary["outputs"].items():
        sent = number_of(count["sent"], "message")
        say(f"  {visible(name)}: {sent} sent, {count['lost']} lost")
    if summary["latency_ms"]:
        parts = [
            f"{stage} {quantiles['p50']:.1f}" for stage, quantiles in summary["latency_ms"].items()
        ]
        say(f"  median latency, ms: {' · '.join(parts)}")
    recording = summary["recording"]
    if recording.get("error"):
        for line in recording["error"].splitlines():
            say(line, style="red")
    if recording.get("ledger"):
        ledger = recording["ledger"]
        parts = [number_of(ledger["scans"], "scan")] if ledger["scans"] else []
        parts += [
            f"{name} {number_of(camera['frames'], 'frame')}"
            for name, camera in ledger.get("cameras", {}).items()
        ]
        failed = recording.get("error") and not recording.get("whole")
        what = "taken in" if failed else f"recorded: {recording['path']}"
        say(f"  {what}: {', '.join(parts)}")
