"""Sixty grasps collected by the emulated hand: killed once, gone on with, and learned from.

A process of its own lives with the boards (`python -m taxel.bench.boards.collect PLAN FOLDER`)
and notes a line a grasp; it is killed in the middle of one. Virtual time: no figure but the
duration depends on how busy this machine is. Knows nothing about how rows are printed.

Background of our choices: docs/decisions/0043.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from taxel.actions.collecting import collect_grasp
from taxel.actions.grasp_cycle import CycleConfig
from taxel.actions.hand_driver import HandDriver, hand_limits
from taxel.bench.boards.emulator import Firmware, build_firmware
from taxel.bench.boards.grasping_boards import STROKE_S, GraspingBoards
from taxel.bench.rows import Row, row
from taxel.recordings.reader import read_recording
from taxel.recordings.trial_plan import PlannedTrial, done_of, read_plan

PLAN = Path(__file__).resolve().parents[4] / "plans" / "teng-nine-objects.csv"
CYCLE = CycleConfig(stroke_s=STROKE_S, presses=4, hold_s=0.15, lift_s=0.12, pause_s=0.1)
"""Quick grasps, since a second of four emulated boards takes several. Source: our choice."""
_KILLED_AFTER = 30
"""Grasps before the kill; it comes so long into the next, real seconds: our choice."""
_INTO_S = 2.0
_EPOCHS = "60"
_LOOK_S = 0.2
LOG = "told.jsonl"
"""File beside the recordings: fingers and times of each grasp."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Collected:
    """The outcome of a plan of grasps."""

    planned: int
    labelled: int
    """Recordings with the plan's labels, one mark and scans."""
    redone: int
    """Recordings that were complete before the kill and were written again after it."""
    off_ms: list[float]
    """From each contact to that motor being off, milliseconds."""
    accuracy: float
    """Of windows, sessions held out, 0…1."""
    majority: float
    seconds: float
    """Real time, both runs."""


def collect_rows(firmware: Firmware) -> list[Row]:
    """Collect the plan of sixty grasps on emulated boards and learn from it."""
    del firmware  # built by now; the process finds it
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        found = collect_and_learn(PLAN, Path(scratch))
    name = f"{found.planned} grasps of nine objects, emulated hand and boards, killed once"
    worst, middle = max(found.off_ms), sorted(found.off_ms)[len(found.off_ms) // 2]
    return [
        row(f"{name}: recorded and labelled", found.labelled, "grasps", ">=", found.planned,
            f"{found.seconds:.0f} s of this machine"),
        row(f"{name}: grasps made twice", found.redone, "grasps", "<=", 0.0),
        row(f"{name}: contact to that motor off", worst, "ms", "<=", 10.0,
            f"worst of {len(found.off_ms)} contacts, median {middle:.1f}"),
        Row(name=f"{name}: shape, session held out", value=found.accuracy, unit="accuracy",
            note=f"majority {found.majority:.3f}; taxel train on what was "
            "collected, as it was collected"),
    ]  # fmt: skip


def collect_and_learn(plan: Path, folder: Path) -> Collected:
    """Collect a plan in processes of their own, killing the first, and train on the recordings.

    Args:
        plan: The plan.
        folder: An empty folder.
    """
    trials, output = read_plan(plan), folder / "grasps"
    started = time.perf_counter()
    _collect(plan, output, killed_after=min(_KILLED_AFTER, len(trials) // 2))
    written = {trial.file_name: (output / trial.file_name).stat().st_mtime_ns
               for trial in done_of(trials, output)}  # fmt: skip
    _collect(plan, output, killed_after=None)
    seconds = time.perf_counter() - started
    redone = sum((output / name).stat().st_mtime_ns != stamp for name, stamp in written.items())
    lines = [json.loads(line) for line in (output / LOG).read_text("utf-8").splitlines()]
    accuracy, majority = _train(output, folder / "run")
    return Collected(
        planned=len(trials),
        labelled=sum(_whole(output / trial.file_name) for trial in done_of(trials, output)),
        redone=redone,
        off_ms=[ms for line in lines for ms in line["off_ms"]],
        accuracy=accuracy,
        majority=majority,
        seconds=seconds,
    )


def _whole(path: Path) -> bool:
    recording = read_recording(path)
    return len(recording.marks) == 1 and len(recording.samples) > 0


def _collect(plan: Path, output: Path, killed_after: int | None) -> None:
    """Run a collecting process, to its end or to a kill -9 in the middle of a grasp."""
    command = [sys.executable, "-m", "taxel.bench.boards.collect", str(plan), str(output)]
    with subprocess.Popen(command) as process:
        while killed_after is not None and process.poll() is None:
            time.sleep(_LOOK_S)
            if len(list(output.glob("trial-*.mcap"))) >= killed_after:
                time.sleep(_INTO_S)
                process.kill()
                return
    if process.returncode:
        raise RuntimeError(f"collecting ended with {process.returncode}")


def _train(data: Path, run: Path) -> tuple[float, float]:
    """Train on the recordings as they are; return accuracy and the commonest class's."""
    command = [sys.executable, "-m", "taxel.cli.main", "train", str(data), "--output", str(run),
               "--target", "shape", "--epochs", _EPOCHS, "--fold-count", "3", "--json"]  # fmt: skip
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    result = json.loads(done.stdout)
    (accuracy,) = result["accuracy"].values()
    return float(accuracy), float(result["trivial"]["majority"])


def collect_on_boards(firmware: Firmware, trials: list[PlannedTrial], output: Path) -> None:
    """Collect what is missing of a plan; note a line of JSON a grasp."""
    ready = {trial.number for trial in done_of(trials, output)}
    with GraspingBoards(firmware) as rig:
        source, actuator = rig.open()
        driver = HandDriver(actuator, rig, hand_limits(CYCLE.contact_ma))
        driver.arm()
        for trial in trials:
            if trial.number in ready:
                continue
            rig.plant.begin_session(trial.groups["session"])
            rig.plant.present(trial.labels["shape"], trial.labels["material"], trial.number)
            before = len(rig.contact_to_off_ms())
            grasp = collect_grasp(source, driver, trial, output, CYCLE)
            line = {
                "trial": trial.number,
                "touched": list(grasp.touched),
                "off_ms": rig.contact_to_off_ms()[before:],
            }
            with (output / LOG).open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")


if __name__ == "__main__":
    collect_on_boards(build_firmware(), read_plan(Path(sys.argv[1])), Path(sys.argv[2]))
