"""How camera trials are recognised, as tables in the terminal. Knows nothing of how it was made."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from math import isfinite, isnan
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from taxel.decisions.recognition import UNKNOWN
from taxel.decisions.trial_verdict import NOVEL, Verdict
from taxel.evaluation.camera_trials.crossval import (
    CameraTrialScores,
    Difference,
    TrialResult,
    by_group,
)
from taxel.evaluation.camera_trials.cut_choice import CutTrials
from taxel.evaluation.camera_trials.sides import TrialSplit, shared_values
from taxel.evaluation.camera_trials.trial_set import TrialSet
from taxel.evaluation.paired import LEVEL, smallest_p
from taxel.plain_text import number_of, several, visible, visible_line, visible_names
from taxel.recordings.imports.spelling import by_numbers
from taxel.views.tables.results import alike_note, bracketed
from taxel.views.tables.trial_notes import (
    bar_warnings,
    control_warnings,
    crop_notes,
    cut_line,
    trial_notes,
)
from taxel.windows.trial_crops import PLACES

_UNSURE = re.compile(r"^confidence [\d.]+(?= is below)")
"""A reason's own confidence, which differs from trial to trial."""
_REASONS = 3
"""Reasons of UNKNOWN that are shown."""
_WEAKEST = 5
"""Groups that are shown, those with the fewest right first."""


def trial_tables(
    trials: TrialSet,
    split: TrialSplit,
    results: Sequence[TrialResult],
    differences: Sequence[Difference],
    cut: CutTrials | None = None,
) -> RenderableType:
    """Return scores by trial, by place, the difference to the bar, and what controls know.

    Args:
        trials: What was judged.
        split: How it was parted.
        results: A row each, ours first.
        differences: Ours less others; the first is to what the recogniser should exceed.
        cut: How each training side cuts them, where inner folds chose.
    """
    ours = results[0]
    parts: list[RenderableType] = [
        Text(_head(trials, split, ours)),
        _table("by trial", [(result.name, result.whole) for result in results]),
    ]
    if ours.places:
        rows = [
            (f"{result.name}, {place} crop", scores)
            for result in results
            if result is ours or result.name in [own.other for own in differences[:1]]
            for place, scores in zip(PLACES, result.places, strict=True)
        ]
        parts.append(_table("by one crop alone", rows))
        parts += [Text(f"note: {note}") for note in crop_notes(ours)]
    parts += [Text(line) for line in (cut and cut_line(cut),) if line]
    parts += [Text(_difference_line(difference)) for difference in differences]
    parts += [Text(f"{result.name}: {result.leaks}.") for result in results if result.leaks]
    parts.append(Text(_weakest(trials, split, ours)))
    parts += [Text(f"note: {note}") for note in trial_notes(trials)]
    if warning := shared_values(split, trials.groups, trials.y):
        parts.append(Text(f"warning: {visible_line(warning)}", style="yellow"))
    if warning := _too_few(split, trials):
        parts.append(Text(f"warning: {warning}", style="yellow"))
    parts += [Text(f"warning: {own}", style="yellow") for own in bar_warnings(results)]
    parts.append(Text(f"Intervals in []: 95 % CI, whole {several(split.group)} resampled."))
    whole = [result.whole for result in results]
    intervals = [own for scores in whole for own in (scores.accuracy_interval, scores.auc_interval)]
    return Group(*parts, *alike_note(intervals, split.group))


def _too_few(split: TrialSplit, trials: TrialSet) -> str:
    """Return a warning where so few groups are tested that no difference can be claimed."""
    tested = {row for fold in split.folds for row in fold.test_rows.tolist()}
    groups = {trials.groups[row].get(split.group, str(row)) for row in tested}
    least = smallest_p(len(groups))
    if least < LEVEL:
        return ""
    found = (
        f"with {number_of(len(groups), visible(split.group))} no difference can be claimed "
        f"(smallest possible p {least:.2g})"
    )
    return f"{found}, and intervals in [] are too narrow" if len(groups) > 1 else found


def not_scored_line(target: str, truth: Sequence[str], classes: Sequence[str]) -> str:
    """Return how many trials a bundle's accuracy leaves out, for it never learned their class.

    Args:
        target: What it predicts.
        truth: Each trial's own label; empty where it has none.
        classes: Those that the bundle knows.

    Returns:
        A sentence; empty where it knows all.
    """
    odd = [own for own in truth if own not in classes]
    if not odd:
        return ""
    shown = visible_names(dict.fromkeys(own or "none" for own in odd[:_WEAKEST]))
    are = "is" if len(odd) == 1 else "are"
    return (
        f"{len(odd)} of {number_of(len(truth), 'trial')} {are} in no accuracy, for the bundle "
        f"knows the {target} "
        f"{visible_names(classes)} only, not {shown}; mend the label if it is misspelt"
    )


def unknown_line(verdicts: Sequence[Verdict]) -> str:
    """Return why trials got no verdict, the commonest reason first; empty where all have one."""
    reasons = [verdict.reason for verdict in verdicts if verdict.label == UNKNOWN]
    if not reasons:
        return ""
    counts = Counter(_UNSURE.sub("confidence", reason.partition(" (")[0]) for reason in reasons)
    novel = [verdict for verdict in verdicts if verdict.reason.startswith(NOVEL)]
    shown = [f"{visible(reason)} ({count})" for reason, count in counts.most_common(_REASONS)]
    line = f"UNKNOWN because of: {', '.join(shown)}"
    if len(novel) < len(verdicts) / 2:
        return line
    first = visible(novel[0].reason.partition("(")[2].rstrip(")"))
    return (
        f"{line}. Most trials are unlike those that the bundle learned from (the first: {first}): "
        "check sensor, light, crop, and how videos are compressed"
    )


def score_line(
    target: str, where: str, scores: CameraTrialScores, majority: float, key: str | None
) -> str:
    """Return a bundle's score on camera trials, as a sentence's first part.

    Args:
        target: What it predicts.
        where: Behind it, such as " · test part of folds.csv"; may be empty.
        scores: Of the trials whose class it learned.
        majority: Share of their commonest class, 0…1.
        key: The group that was resampled; None where each trial stands alone.
    """
    accuracy = bracketed(f"{scores.accuracy:.3f}", scores.accuracy_interval, ".3f",
                         f"one {key or 'trial'}")  # fmt: skip
    auc = "no AUC (a class has no trial)" if isnan(scores.auc) else f"AUC {scores.auc:.3f}"
    return (
        f"{target}{where}: accuracy {accuracy}, commonest class {majority:.3f}, {auc}, "
        f"log-loss {scores.loss:.3f} on {trial_count(scores.trials)}"
    )


def trial_count(trials: int) -> str:
    """Return how many trials there are, in words such as "1 trial"."""
    return number_of(trials, "trial")


def _head(trials: TrialSet, split: TrialSplit, ours: TrialResult) -> str:
    ordered = sorted(enumerate(trials.classes), key=lambda pair: by_numbers(pair[1]))
    counts = ", ".join(
        f"{visible_names([name])} ({int((trials.y == number).sum())})"
        for number, name in ordered[:8]
    )
    more = f", and {len(trials.classes) - 8} more classes" if len(trials.classes) > 8 else ""
    layout = trials.layout
    frames = f"{layout.crop} frame{'s' * (layout.crop > 1)} each, seen whole"
    if layout.places > 1:
        frames = (
            f"{trials.lengths.min()} to {trials.lengths.max()} frames; of each, three crops "
            f"(first, middle, last) of {layout.words}"
            f"{', from the part in which something moves' * layout.moving}"
        )
    through = trials.network and f" taxel also passes their images through {trials.network.words}."
    return (
        f"{number_of(len(trials.y), 'trial')} of {trials.cameras} "
        f"camera{'s' if trials.cameras > 1 else ''}, "
        f"{visible(trials.target)}: {counts}{more}; {frames}. "
        f"{split.name}: {len(split.folds)} fold{'s' if len(split.folds) > 1 else ''}, "
        f"{number_of(ours.whole.trials, 'trial')} tested. Nothing is chosen on a test trial."
        f"{through or ''}"
    )


def _table(title: str, rows: Sequence[tuple[str, CameraTrialScores]]) -> Table:
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("model")
    for column in ("accuracy %", "balanced %", "AUC", "log-loss", "ECE"):
        table.add_column(column, justify="right", no_wrap=True)
    for name, scores in rows:
        table.add_row(name, *_cells(scores))
    return table


def _cells(scores: CameraTrialScores) -> list[str]:
    low, high = scores.accuracy_interval
    return [
        bracketed(f"{100 * scores.accuracy:.1f}", (100 * low, 100 * high), ".1f"),
        f"{100 * scores.balanced:.1f}",
        "–" if isnan(scores.auc) else _auc(f"{scores.auc:.3f}", scores.auc_interval, low, ".3f"),
        f"{scores.loss:.3f}",
        f"{scores.calibration_error:.3f}",
    ]


def _auc(value: str, interval: tuple[float, float], accuracy_low: float, form: str) -> str:
    """Return an AUC with its interval; none where every draw of several groups lacks a class."""
    alone = "one group" if isnan(accuracy_low) else "no interval"
    return bracketed(value, interval, form, alone)


def _difference_line(found: Difference) -> str:
    low, high = found.accuracy_interval
    accuracy = bracketed(f"{100 * found.accuracy:+.1f} points", (100 * low, 100 * high), "+.1f")
    auc = _auc(f"{found.auc:+.3f}", found.auc_interval, low, "+.3f")
    loss = bracketed(f"{found.loss:+.3f}", found.loss_interval, "+.3f")
    return (
        f"taxel less {found.other}: accuracy {accuracy}, AUC {'–' if isnan(found.auc) else auc}, "
        f"log-loss {loss}, on the same trials."
    )


def _weakest(trials: TrialSet, split: TrialSplit, ours: TrialResult) -> str:
    groups = by_group(trials, split, ours)
    missed = [(name, right, of) for name, (right, of) in groups.items() if right < of]
    if missed and all(of == 1 for _, of in groups.values()):
        return _wrong(trials, ours)
    if not missed and all(of == 1 for _, of in groups.values()):
        return f"all {number_of(len(groups), 'tested trial')} are correct."
    if not missed:
        whole = "all " * (len(groups) > 1)
        return f"all trials of {whole}{number_of(len(groups), visible(split.group))} are correct."
    shown = ", ".join(f"{visible(name)} ({right} of {of})" for name, right, of in missed[:_WEAKEST])
    perfect = len(groups) - len(missed)
    return (
        f"{perfect} of {number_of(len(groups), visible(split.group))} "
        f"{'has' if perfect == 1 else 'have'} all "
        f"trials correct; lowest: {shown}."
    )


def _wrong(trials: TrialSet, ours: TrialResult) -> str:
    """Return which trials are wrong, where each stands alone, and what was predicted."""
    tested = np.flatnonzero(np.isfinite(ours.probabilities[:, 0]))
    best = ours.probabilities.argmax(axis=1)
    rows = tested[best[tested] != trials.y[tested]].tolist()
    shown = ", ".join(
        f"{visible(trials.names[row])} (predicted {visible_names([trials.classes[best[row]]])})"
        for row in rows[:_WEAKEST]
    )
    such = ", such as" if len(rows) > _WEAKEST else ":"
    of = number_of(len(tested), "tested trial")
    return f"{len(rows)} of {of} {'is' if len(rows) == 1 else 'are'} wrong{such} {shown}."


def part_choices(cut: CutTrials, split: TrialSplit) -> list[dict[str, Any]]:
    """Return which part each training side chose, as plain values; losses of null where no trial
    could be held out.

    Args:
        cut: The trials.
        split: How they are parted; a side that is no fold's is that of the recogniser kept.
    """
    folds = [fold.name for fold in split.folds]
    names = [*folds, "kept"] if len(cut.sides) >= len(folds) else ["kept"]
    losses = [[own if isfinite(own) else None for own in pair] for pair in cut.losses]
    return [
        {"side": name, "moving": own.layout.moving, "loss_whole": whole, "loss_moving": part}
        for name, own, (whole, part) in zip(names, cut.sides, losses, strict=False)
    ]


def trial_json(
    trials: TrialSet,
    split: TrialSplit,
    results: Sequence[TrialResult],
    differences: Sequence[Difference],
    cut: CutTrials | None = None,
) -> dict[str, Any]:
    """Return what was measured, for printing: predictions of tested trials only, with the fold."""
    folds = {row: fold.name for fold in split.folds for row in fold.test_rows.tolist()}

    def row(result: TrialResult) -> dict[str, Any]:
        places = {place: asdict(s) for place, s in zip(PLACES, result.places, strict=False)}
        return {"name": result.name, "leaks": result.leaks, "trials": asdict(result.whole),
                "crops": places}  # fmt: skip

    return {
        "target": trials.target,
        "classes": trials.classes,
        "trials": len(trials.y),
        "cameras": trials.cameras,
        "crop": trials.layout.crop,
        "crops_a_trial": trials.layout.places,
        "every": trials.layout.step,
        "of_moving_part": trials.layout.moving,
        "part_chosen": [] if cut is None else part_choices(cut, split),
        "split": split.name,
        "folds": len(split.folds),
        "network": trials.network and trials.network.words,
        "warning": shared_values(split, trials.groups, trials.y),
        "note": "; ".join(trial_notes(trials)) or None,
        "bar_warnings": bar_warnings(results),
        "control_warnings": control_warnings(results),
        "rows": [row(result) for result in results],
        "differences": [asdict(difference) for difference in differences],
        "groups": {
            name: {"right": right, "trials": of}
            for name, (right, of) in by_group(trials, split, results[0]).items()
        },
        "predictions": [
            {
                "trial": trials.names[row],
                "fold": folds.get(row),
                "truth": trials.classes[y],
                "probabilities": p.tolist(),
            }
            for row, (y, p) in enumerate(zip(trials.y, results[0].probabilities, strict=True))
            if np.isfinite(p).all()
        ],
    }
