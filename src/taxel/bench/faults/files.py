"""What hostile files, images and labels cost, measured: for `taxel bench faults`.

Each file of `taxel.bench.faults.hostile_cases` is given to real commands, in real processes. Knows
nothing about how the files are made.

Background of our choices: docs/decisions/0033.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from taxel.bench.faults.hostile_cases import (
    ALONE,
    GROWTH_MB,
    KINDS,
    MOST_MB,
    MOST_S,
    RESIDENT,
    kind_of_case,
    make_world,
)
from taxel.bench.faults.hostile_images import PIXELS, replay_in_process, write_hostile_replay
from taxel.bench.faults.hostile_labels import CLASSES, TRAINING, write_table
from taxel.bench.faults.watched_commands import Ended, Resident, run_alone
from taxel.bench.rows import Row, missing, row
from taxel.errors import TaxelError
from taxel.plain_text import visible
from taxel.recordings.reader import read_manifest

TRIES = 3
"""At most, of a command that takes longer than its goal: a shared machine lengthens some."""
_STARTS = 3
_FIRST, _COUNT = 180, 20
"""Frames of two cameras at 60 Hz: hostile images from 1.5 s on, 10 of one camera."""
_POUR_S = 3.0
_IMAGES_MB = 50.0
"""What hostile images may add to a replay's memory. Our choice: one decoded would be 1.2 GB."""
_IMAGES = "images of another size or progressive in a replay"
_LABELS = "labels with markup and escapes"
Run = Callable[[list[str]], Ended]


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusal:
    """What a command did with a hostile file."""

    name: str
    kind: str
    verb: str
    refused: bool
    """True for exit code 2, one plain line, and nothing written, at every try."""
    seconds: float
    """Of the quietest try."""
    memory_mb: float
    """Of the largest try."""
    tries: int


def hostile_rows() -> list[Row]:
    """Measure hostile files, images and labels; takes about two minutes.

    Raises:
        TaxelError: An honest command failed, such as for want of the extra `train`.
    """
    with tempfile.TemporaryDirectory(prefix="taxel-") as scratch:
        world = Path(scratch) / "world"
        world.mkdir()
        with Resident(world) as resident:

            def honest(words: Sequence[str]) -> Ended:
                return sound(resident.run(words))

            make_world(world, honest)
            started = [sound(run_alone(["info", "honest/session-1.mcap"], world))
                       for _ in range(_STARTS)]  # fmt: skip
            alone = refusals(ALONE, world, lambda words: run_alone(words, world))
            loaded = refusals(RESIDENT, world, resident.run)
            labels = Path(scratch) / "labels"
            labels.mkdir()
            named = _label_rows(labels, honest)
        return [*refused_rows([*alone, *loaded]), *_cost_rows(alone, loaded, started),
                *_image_rows(Path(scratch)), *named]  # fmt: skip


def sound(ended: Ended) -> Ended:
    """Return how an honest command ended.

    Raises:
        TaxelError: It failed.
    """
    if ended.code != 0:
        lines = ended.err.strip().splitlines() or [f"exit code {ended.code}"]
        raise TaxelError(f"an honest command failed: {lines[-1].removeprefix('taxel: ')}")
    return ended


def refusals(cases: Mapping[str, str], world: Path, run: Run) -> list[Refusal]:
    """Run command lines; return what each did.

    Args:
        cases: Name → command line.
        world: The working folder; what a command leaves in it is removed.
        run: Runs a command line.
    """
    return [_refusal(name, line, world, run) for name, line in cases.items()]


def _refusal(name: str, line: str, world: Path, run: Run) -> Refusal:
    before = set(os.listdir(world))
    tries: list[Ended] = []
    clean = True
    while not tries or (len(tries) < TRIES and _slow(tries[-1])):
        tries.append(run(line.split()))
        for left in set(os.listdir(world)) - before:
            clean = False
            path = world / left
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    return Refusal(
        name=name, kind=kind_of_case(line), verb=line.split()[0],
        refused=clean and all(ended.refused for ended in tries),
        seconds=min(ended.seconds for ended in tries),
        memory_mb=float(np.max([ended.memory_mb for ended in tries])), tries=len(tries),
    )  # fmt: skip


def _slow(ended: Ended) -> bool:
    """True where another try may be quicker; a hang is one at every try."""
    return ended.code is not None and ended.seconds > MOST_S


def refused_rows(found: Sequence[Refusal]) -> list[Row]:
    """Return for each kind of file how many commands refused it."""
    rows = []
    for kind, words in KINDS.items():
        those = [refusal for refusal in found if refusal.kind == kind]
        passed = ", ".join(refusal.name for refusal in those if not refusal.refused)
        verbs = ", ".join(sorted({refusal.verb for refusal in those}))
        rows.append(
            row(
                f"hostile {words}: refused in one plain line with exit code 2, nothing written",
                sum(refusal.refused for refusal in those), f"of {len(those)}", ">=", len(those),
                f"not refused: {passed}" if passed else f"given to {verbs}",
            )
        )  # fmt: skip
    return rows


def _cost_rows(
    alone: Sequence[Refusal], loaded: Sequence[Refusal], started: Sequence[Ended]
) -> list[Row]:
    start_s = float(np.median([ended.seconds for ended in started]))
    start_mb = max(ended.memory_mb for ended in started)
    own, beside = "a command in a process of its own", "a verb in a process that holds PyTorch"
    quietest = f"the quietest of up to {TRIES} tries where one took longer than {MOST_S:g} s"
    return [
        _largest(f"hostile files: largest memory of {own}", alone, "memory_mb", "MB", MOST_MB,
                 f"`taxel info` of an honest recording: {start_mb:.0f} MB"),
        _largest(f"hostile files: what {beside} takes beside what it held, at most", loaded,
                 "memory_mb", "MB", GROWTH_MB, "PyTorch alone takes some 230 MB"),
        _largest(f"hostile files: slowest refusal by {own}", alone, "seconds", "s", MOST_S,
                 f"of it start-up: `taxel info` of an honest recording takes {start_s:.2f} s; "
                 f"{quietest} ({_again(alone)})"),
        _largest(f"hostile files: slowest refusal by {beside}", loaded, "seconds", "s", MOST_S,
                 f"without start-up; {quietest} ({_again(loaded)})"),
    ]  # fmt: skip


def _again(found: Sequence[Refusal]) -> str:
    return f"{sum(refusal.tries > 1 for refusal in found)} of {len(found)} tried again"


def _largest(
    name: str, found: Sequence[Refusal], field: str, unit: str, limit: float, note: str
) -> Row:
    """Return the largest figure of some refusals as a row that says whose it is."""
    worst = max(found, key=lambda refusal: _or_most(getattr(refusal, field)))
    value = float(getattr(worst, field))
    if math.isnan(value):
        return missing(name, unit, f"<= {limit:g}", f"not known of {worst.name}: it did not end "
                       "by itself, or this system does not say it")  # fmt: skip
    middle = float(np.median([getattr(refusal, field) for refusal in found]))
    worst_note = f"{worst.verb}, “{worst.name}”; median of {len(found)}: {middle:.3g} {unit}"
    return row(name, value, unit, "<=", limit, f"{worst_note}; {note}")


def _or_most(value: float) -> float:
    return math.inf if math.isnan(value) else value


def _image_rows(scratch: Path) -> list[Row]:
    from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
    from taxel.sources.simulated.pour_sets import CAMERA_HZ, write_run

    pour = CupPourConfig(cups=1, positions=("middle",), forces_n=(50.0,), duration_s=_POUR_S,
                         still=0.0)  # fmt: skip
    run = list_runs(pour)[0]
    write_run(scratch, run, pour, CAMERA_HZ)
    sound_path, path = scratch / f"{run.name}.mcap", scratch / "hostile.mcap"
    frames = write_hostile_replay(sound_path, path, _FIRST, _COUNT)
    replayed, plain = replay_in_process(path), replay_in_process(sound_path)
    hostile = _COUNT // 2
    progressive = sum("progressive" in reason for reason in replayed.bad)
    grown = replayed.memory_mb - plain.memory_mb
    return [
        row(f"{_IMAGES}: UNKNOWN with the reason", len(replayed.bad), f"of {hostile}", ">=",
            hostile, f"{PIXELS:,} × {PIXELS:,} px, {progressive} of them called progressive; "
            f"such as: {replayed.bad[0] if replayed.bad else 'none'}"),
        row(f"{_IMAGES}: later moments decided", replayed.decided / max(1, replayed.after),
            "share", ">=", 1.0, f"{replayed.decided} of {replayed.after} after the last of them; "
            f"{replayed.moments} of {len(frames) // 2} moments watched"),
        _memory_row(f"{_IMAGES}: memory beside that of the replay without them", grown,
                    f"{replayed.memory_mb:.0f} and {plain.memory_mb:.0f} MB"),
    ]  # fmt: skip


def _memory_row(name: str, grown_mb: float, note: str) -> Row:
    if math.isnan(grown_mb):
        return missing(name, "MB", f"<= {_IMAGES_MB:g}", "this system does not say it")
    return row(name, grown_mb, "MB", "<=", _IMAGES_MB, note)


def _label_rows(folder: Path, honest: Callable[[Sequence[str]], Ended]) -> list[Row]:
    """Import hostile labels, train on them, bundle, report and watch; count what is left of them.

    Args:
        folder: An empty folder.
        honest: Runs a command line, and raises where it fails.
    """
    recordings, run, page = folder / "recordings", folder / "run", folder / "report.html"
    bundle = folder / "b[red]\x1b[1m.taxel"
    lines = [
        ["import", write_table(folder), "--output", recordings],
        ["info", recordings],
        ["audit", recordings, "--target", "object"],
        ["train", recordings, "--output", run, "--fold-count", "2", *TRAINING],
        ["bundle", run, "--output", bundle],
        ["report", run, "--no-latency", "--data", recordings, "--output", page],
    ]
    ended = [honest([str(word) for word in line]) for line in lines]
    paths = sorted(recordings.glob("*.mcap"))
    ended.append(honest(["live", str(bundle), str(paths[0])]))
    shown = {line[0]: stopped.out for line, stopped in zip(lines, ended, strict=False)}
    stages = {
        "recorded": {read_manifest(path).labels["object"] for path in paths},
        "learned": set(json.loads((run / "run.json").read_text())["contract"]["classes"]),
        "shown by info": shown_classes(shown["info"]),
        "shown by train": shown_classes(shown["train"]),
    }
    distinct = {stage: len(set(CLASSES) & names) for stage, names in stages.items()}
    printed = [text for done in ended for text in (done.out, done.err)] + [page.read_text()]
    each = ", ".join(f"{count} {stage}" for stage, count in distinct.items())
    obeyed = [c for text in printed for c in text if obeys(c)]
    commands = f"{', '.join(str(line[0]) for line in lines)} and live, and the report's page"
    return [
        row(f"{_LABELS}: classes that stay distinct", min(distinct.values()),
            f"of {len(CLASSES)}", ">=", len(CLASSES), each),
        row(f"{_LABELS}: raw ESC bytes printed", obeyed.count("\x1b"), "bytes", "<=", 0.0,
            commands),
        row(f"{_LABELS}: other characters printed that a terminal obeys or hides",
            sum(c != "\x1b" for c in obeyed), "characters", "<=", 0.0, commands),
    ]  # fmt: skip


def shown_classes(text: str) -> set[str]:
    """Return the hostile classes that a text shows literally."""
    return {name for name in CLASSES if visible(name) in text}


def obeys(character: str) -> bool:
    """True for what a terminal would obey or not show; a line break is neither."""
    return character != "\n" and not character.isprintable()
