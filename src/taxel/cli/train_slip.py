"""What `taxel train DATA --grasp slip` does: learn a slip warning and write it as a bundle."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from taxel.cli.printing import command, console, print_json, progress
from taxel.errors import BadInput

if TYPE_CHECKING:
    from taxel.evaluation.slip_warnings import Promise, WarningScores

RULE = "rule"
"""Name of the head that learns nothing: slip and its rate against a threshold."""
_CHECKED = 64


def train_slip(
    poses: Path, output: Path, head: str, per_min: float, seed: int, *, as_json: bool
) -> None:
    """Learn from simulated training cups and write a bundle.

    Args:
        poses: Folder where simulated poses are kept; what is missing is simulated.
        output: The bundle, NAME.taxel.
        head: boosting, logistic or rule; a head for frames, such as lstm, is taken for boosting.
        per_min: False alarms a minute that are promised.
        seed: Of learning.
        as_json: Print JSON.

    Raises:
        BadInput: An option lies outside its limits.
    """
    from taxel.evaluation import learn_slip_warning as learn
    from taxel.evaluation.slip_warnings import keep_promise, score_warnings
    from taxel.training.slip_heads import HeadName

    if output.is_dir() or not output.name.endswith(".taxel"):
        raise BadInput(
            "--output NAME.taxel: a monitor is written as the bundle that runs live",
            str(output), "name a file such as slip.taxel",
        )  # fmt: skip
    if not (math.isfinite(per_min) and 0 < per_min <= 60):
        raise BadInput("--false-alarms above 0 and at most 60 a minute", f"{per_min:g}",
                       "such as 0.3")  # fmt: skip
    if poses.exists() and not poses.is_dir():
        raise BadInput("a folder to keep simulated poses in", str(poses), "name another")
    chosen: HeadName = "logistic" if head == "logistic" else "boosting"
    with progress() as bar:
        task = bar.add_task("poses", total=None)

        def on_step(line: str) -> None:
            bar.update(task, description=line, advance=1)

        pours, _ = learn.training_features(poses, on_step=on_step)
        rows = pours[0].rows[:_CHECKED]
        if head == RULE:
            tracks = learn.rule_tracks(pours)
            promise = keep_promise(learn.promised(tracks), per_min)
            model, threshold = learn.rule_model(promise.threshold), 0.5
            expected = learn.rule_probability(rows, promise.threshold)
        else:
            learnt = learn.learn_warning(pours, chosen, per_min, seed=seed, on_step=on_step)
            promise, tracks = learnt.promise, list(learnt.tracks)
            model, threshold = learnt.head.to_onnx(), promise.threshold
            expected = learnt.head.probability(rows)
    scores, _ = score_warnings(learn.promised(tracks), promise.threshold)
    name = RULE if head == RULE else chosen
    parity = learn.write_warning(output, name, model, threshold, rows, expected, _measured(scores))
    if as_json:
        print_json({"bundle": str(output), "head": name, "parity": parity,
                    "promise": asdict(promise), "leads": scores.leads, "near": scores.near,
                    "alarms_by_slip": scores.alarms_by_slip,
                    "events": scores.events.as_dict()})  # fmt: skip
        return
    _print(output, name, promise, scores, parity)


def _measured(scores: WarningScores) -> dict[str, float]:
    events = scores.events
    found = {
        "median lead (s)": events.lead_median_s,
        "missed": events.missed_share,
        "false alarms a minute": events.false_alarms_per_min,
    }
    return {key: value for key, value in found.items() if math.isfinite(value)}


def _print(output: Path, name: str, promise: Promise, scores: WarningScores, parity: float) -> None:
    events = scores.events
    low, high = promise.found_interval
    console.print(
        f"{output}: slip + {name}, warns of slip above 0.3 mm; the bundle's probabilities differ "
        f"from the trained head's by at most {parity:.1e}",
        soft_wrap=True,
    )
    console.print(
        f"training cups held out, {events.clusters} of them: threshold {promise.threshold:.3f} "
        f"(95 % {promise.interval[0]:.3f} … {promise.interval[1]:.3f}) gives "
        f"{promise.found_per_min:.2f} false alarms a minute ({low:.2f} … {high:.2f}) in "
        f"{promise.hold_min:.0f} minutes that hold; {promise.asked_per_min:g} were asked",
        soft_wrap=True,
    )
    for loss, found in scores.leads.items():
        console.print(
            f"  warning before {loss}: median {found['median_s']:.2f} s, 5 % "
            f"{found['p5_s']:.2f} s, missed {found['missed']:.1%} of {found['n']:.0f}"
        )
    near = ", ".join(f"{what} {rate:.2f}" for what, rate in scores.near.items())
    alarms = ", ".join(f"{what}: {count}" for what, count in scores.alarms_by_slip.items())
    console.print(f"  grasps that hold but slip, a minute: {near}", soft_wrap=True)
    console.print(f"  false alarms by how far their grasp slipped: {alarms}", soft_wrap=True)
    watch = command("taxel", "live", output, "sim://cup-pour", "--seconds", "20")
    console.print(f"next: {watch}", markup=False, soft_wrap=True)
