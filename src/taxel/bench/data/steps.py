"""`taxel bench data`: what `taxel train` reaches by default on real recordings, beside its bars.

No option is given but target and split: windows, features, models and calibration are found on
the training part of each fold. Knows nothing about how they are found.
"""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from taxel.bench.data.tables import import_biotac, import_fabric
from taxel.bench.rows import Row, missing, row
from taxel.evaluation.bars import BARS
from taxel.evaluation.expert import Expert, Task, train_expert
from taxel.evaluation.nested import Nested
from taxel.evaluation.outer_split import OuterSplit
from taxel.recordings.imports.importing import import_rows
from taxel.recordings.imports.known import glove_rows, icub_rows
from taxel.training.choose.limits import MINUTES, MOST_MB, MOST_US, Limits

Measure = Callable[[], list[Row]]
Import = Callable[[Path, Path, Path], None]
"""(the data set's folder, folder of recordings to be made, a scratch folder)."""
BEHIND = 0.005
"""Accuracy by which a default may stand behind its best bar. Source: issue 16."""
MOST_ERROR = 0.05
"""Of calibration. Source: issue 16."""
TENG_CHANNELS = tuple(f"Data{i}" for i in range(5))
SIM_SCANS = 160_000
"""Scans a class, as in the thesis."""


@dataclass(frozen=True, slots=True)
class Case:
    """One data set under one split."""

    name: str
    folder: str
    """In the folder of data; empty for what is simulated."""
    make: Import
    target: str
    split: str
    goal: float | None
    """Accuracy by window. Source: issue 16."""
    channels: tuple[str, ...] | None = None


def _glove(source: Path, output: Path, scratch: Path) -> None:
    import_rows(glove_rows(source), output)


def _icub(source: Path, output: Path, scratch: Path) -> None:
    import_rows(icub_rows(source), output)


def _sim(source: Path, output: Path, scratch: Path) -> None:
    from taxel.sources.simulated.data_sets import simulate_presets

    simulate_presets(scratch, ("honest",), SIM_SCANS, 0)
    (scratch / "honest").rename(output)


CASES = (
    Case("icub-grasp, trials 1–10 → 11–20", "icub-grasp", _icub, "object",
         "order:trial_number:10:20", 0.99),
    Case("biotacsp-stability, the authors' ten unseen objects", "biotacsp-stability",
         import_biotac, "outcome", "order:part:0", 0.77),
    Case("biotacsp-stability, objects held out", "biotacsp-stability", import_biotac, "outcome",
         "group:object", None),
    Case("fabric-slide, first half → second half", "fabric-slide", import_fabric, "material",
         "order:half:0", 0.85),
    Case("fabric-slide, forces held out", "fabric-slide", import_fabric, "material",
         "group:force", 0.92),
    Case("teng-glove, 8 channels, sessions held out", "teng-glove", _glove, "sign",
         "group:session", 0.92),
    Case("teng-glove, 5 TENG channels, sessions held out", "teng-glove", _glove, "sign",
         "group:session", 0.85, TENG_CHANNELS),
    Case("teng-glove, 8 channels, files held out", "teng-glove", _glove, "sign", "group:file",
         0.98),
    Case("teng-glove, 5 TENG channels, files held out", "teng-glove", _glove, "sign",
         "group:file", 0.96, TENG_CHANNELS),
    Case("sim://teng honest, shape, sessions held out", "", _sim, "shape", "group:session", 0.88),
    Case("sim://teng honest, material, sessions held out", "", _sim, "material",
         "group:session", 0.52),
)  # fmt: skip
"""Set and split → what must be reached."""


def quick_steps() -> list[tuple[str, Measure]]:
    """Return the measurements of a normal run: none, for each takes minutes."""
    return []


def full_steps(data: Path | None) -> list[tuple[str, Measure]]:
    """Return one measurement a set and split."""
    return [(case.name, partial(measure_case, case, data)) for case in CASES]


def data_digest(data: Path | None) -> str:
    """Return the SHA-256 over the sets' tables, hexadecimal; over names where they are huge."""
    whole = hashlib.sha256()
    for folder in sorted({case.folder for case in CASES if case.folder}):
        for path in sorted((data / folder).rglob("*")) if data is not None else ():
            if path.is_file():
                whole.update(f"{path.name} {path.stat().st_size}\n".encode())
    return whole.hexdigest()


def measure_case(case: Case, data: Path | None, minutes: float = MINUTES) -> list[Row]:
    """Import a set, let it be chosen for, and return its rows."""
    source = Path() if data is None else data / case.folder
    if case.folder and (data is None or not source.exists()):
        return [missing(case.name, "accuracy", "", "no recordings: name their folder with --data")]

    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        scratch = Path(folder) / "tables"
        scratch.mkdir()
        recordings = Path(folder) / "recordings"
        case.make(source, recordings, scratch)
        expert = train_expert(
            Task(data=recordings, target=case.target, channels=case.channels,
                 split=OuterSplit(named=case.split), bars=tuple(BARS)),
            Limits(minutes=minutes),
        )  # fmt: skip
    return rows_of(case.name, case.goal, expert)


def rows_of(name: str, goal: float | None, expert: Expert) -> list[Row]:
    """Return one training's rows: accuracy, loss and calibration, what stands beside, and cost."""
    nested = expert.nested
    assert nested is not None
    bars = {bar: own.scores.accuracy for bar, (own, _) in nested.bars.items()}
    accuracy = float(nested.scores.scores.accuracy)
    beside = _beside(nested)
    first = Row(name=f"{name}: accuracy", value=accuracy, unit="accuracy",
                note=beside)  # fmt: skip
    if goal is not None:
        first = row(f"{name}: accuracy", accuracy, "accuracy", ">=", goal, beside)
    best = max(bars, key=lambda bar: bars[bar])
    losses = {bar: own.scores.loss for bar, (own, _) in nested.bars.items()}
    least = min(losses, key=lambda bar: losses[bar])
    measured, trials = expert.measured, nested.by_trial
    return [
        first,
        row(f"{name}: over its best bar", accuracy - bars[best], "accuracy", ">=", -BEHIND,
            f"{best} {bars[best]:.4f}"),
        row(f"{name}: by trial over by window", trials.accuracy - accuracy, "accuracy", ">=",
            0.0, f"{trials.accuracy:.4f} of {trials.trials} trials; loss {trials.loss:.4f}"),
        row(f"{name}: loss over the bars' least", nested.scores.scores.loss - losses[least],
            "nats", "<=", 0.0, f"{nested.scores.scores.loss:.4f}; {least} {losses[least]:.4f}"),
        row(f"{name}: calibration error", nested.scores.calibration_error, "", "<=", MOST_ERROR),
        row(f"{name}: bundle", measured.mb, "MB", "<=", MOST_MB,
            "; ".join(expert.given_up) or f"parity {measured.parity:.1e}"),
        row(f"{name}: a window", measured.us, "µs", "<=", MOST_US, "one core, the quietest tenth"),
        row(f"{name}: training", expert.seconds / 60, "min", "<=", MINUTES,
            f"{len(expert.choice.left_out)} tries left out for time"),
    ]  # fmt: skip


def _beside(nested: Nested) -> str:
    """Return all bars and the majority, beside how many windows were tested."""
    y = nested.predictions.y.tolist()
    parts: Sequence[str] = [
        f"{len(y)} test windows of {_lengths(nested)}; split: {nested.split}",
        *(f"{bar} {own.scores.accuracy:.4f}" for bar, (own, _) in nested.bars.items()),
        f"majority {max(map(y.count, set(y))) / len(y):.4f}",
    ]
    return ", ".join(parts)


def _lengths(nested: Nested) -> str:
    lengths = sorted({choice.window.steps for choice in nested.choices})
    return f"{' or '.join(map(str, lengths))} rows"
