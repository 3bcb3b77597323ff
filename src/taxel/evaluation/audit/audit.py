"""Look for every kind of leak in a data set, and in a split of it where one is given.

Knows nothing about files, screens or how single checks work.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np

from taxel.evaluation.audit.both_sides import (
    SESSIONS_UNKNOWN,
    future_labels,
    one_class_folds,
    shared_moments,
    shared_names,
)
from taxel.evaluation.audit.case import Case, Reading
from taxel.evaluation.audit.constant_rows import constant_rows
from taxel.evaluation.audit.copies import exact_copies, near_copies, same_rows
from taxel.evaluation.audit.copy_findings import (
    COPIES_UNKNOWN,
    Alike,
    repeated,
    shared_copies,
    shared_rows,
)
from taxel.evaluation.audit.cut_windows import beside_windows, cut_windows
from taxel.evaluation.audit.evidence import trial_folds
from taxel.evaluation.audit.finding import Audit, Finding, holm, sort_findings
from taxel.evaluation.audit.fitted_scaling import scaled_run, scaled_values
from taxel.evaluation.audit.frame_words import as_frames
from taxel.evaluation.audit.gaps import Gap, measure_gaps
from taxel.evaluation.audit.label_channels import CLEAR as NO_LABEL_CHANNELS
from taxel.evaluation.audit.label_channels import (
    label_channels,
    read_label_channels,
    without_channels,
)
from taxel.evaluation.audit.names import near_names
from taxel.evaluation.audit.noise import left_out
from taxel.evaluation.audit.nuisances import read_first, read_length, read_level, read_place
from taxel.evaluation.audit.order_effect import measure_order
from taxel.evaluation.audit.origins import read_origins
from taxel.evaluation.audit.sides import Sides
from taxel.evaluation.audit.single_copies import is_single, single_facts
from taxel.evaluation.audit.touch_set import (
    Pieces,
    TouchSet,
    counts,
    cut_pieces,
    group_values,
    honest_key,
    usual_steps,
)
from taxel.labels.class_order import figures_as_classes
from taxel.labels.trials import SESSIONS
from taxel.recordings.imports.same_cameras import same_notes

STEPS = 10
"""How often `audit` says what it looks for."""


def audit(
    touch: TouchSet,
    data: str,
    split: tuple[Pieces, Sides] | None = None,
    *,
    run: Path | None = None,
    steps: int | None = None,
    seed: int = 0,
    on_step: Callable[[str], None] = lambda _: None,
) -> Audit:
    """Return all findings.

    Args:
        touch: The labelled trials.
        data: Their name for the reader.
        split: Pieces and their sides; None audits the recordings by themselves.
        run: A run's folder whose stored scaling is looked at.
        steps: Rows of a window; `usual_steps` unless given.
        seed: Of folds, trees and labels dealt out.
        on_step: Called with what is looked for next.

    Raises:
        BadInput: The run is none, or of other channels.
    """
    case = make_case(touch, split, steps or usual_steps(touch), seed)
    facts: list[Finding] = []
    if run is not None:
        facts.append(scaled_run(case, run))
    waiting: list[Reading | Gap] = []
    labels = label_channels(touch)
    if len(labels):
        waiting.append(read_label_channels(case, labels))
        touch = without_channels(touch, labels)
        case = replace(case, touch=touch)
    else:
        facts.append(NO_LABEL_CHANNELS)
    on_step("copies")
    single = is_single(touch)
    facts += single_facts(case) if single else _copies(case)
    on_step("scaling")
    facts.append(scaled_values(case))
    if case.sides is not None:
        on_step("both sides")
        facts += [*shared_moments(case), *shared_names(case), one_class_folds(case),
                  future_labels(case)]  # fmt: skip
    elif not touch.keys(SESSIONS):
        facts.append(SESSIONS_UNKNOWN)
    for name, read in () if single else _READ.items():
        on_step(name)
        waiting.append(read(case))
    on_step("origins")
    waiting += read_origins(case)
    on_step("random windows beside held-out trials")
    waiting += measure_gaps(case)
    on_step("earlier trials beside later ones")
    order = measure_order(case)
    if isinstance(order, Finding):
        facts.append(order)
    else:
        waiting += order
    facts += _findings_of(waiting)
    facts.append(near_names(case))
    return Audit(
        data=data,
        kind=touch.kind,
        target=touch.target,
        classes=counts(touch),
        split="" if case.sides is None else case.sides.name,
        read_on=_read_on(case),
        findings=sort_findings(list(map(as_frames, facts)) if touch.kind == "camera" else facts),
        notes=(*touch.notes, *_figures(touch), *_same_cameras(touch)),
        groups=group_values(touch),
    )


_CUT = "go on where another has begun: they were cut from one stream and overlap"
_READ: dict[str, Callable[[Case], Reading]] = {
    "length": read_length, "place": read_place, "first rows": read_first, "level": read_level,
}  # fmt: skip


def _copies(case: Case) -> list[Finding]:
    """Return the findings on copies, and on windows that were cut from one stream."""
    touch, facts = case.touch, list[Finding]()
    same = same_rows(touch)
    cut = cut_windows(touch)
    copied = None if same is None else beside_windows(touch, same, cut)
    facts.append(COPIES_UNKNOWN if copied is None else shared_rows(case, copied))
    facts.append(shared_copies(case, "cut with overlap", cut, _CUT, streams=True))
    near, repeats, turned = near_copies(touch, {**cut, **(same or {})})
    unseen = left_out(touch.rows)
    if near or not repeats:
        own = Alike(exact_copies(touch, near), "are alike but for scale, offset or noise")
        facts.append(shared_copies(case, "near-duplicates", near,
                                   "are copies but for scale, offset or noise",
                                   unseen, alike=own))  # fmt: skip
    else:
        facts.append(repeated(touch, repeats))
    own = Alike(exact_copies(touch, turned), "are alike turned round")
    facts.append(shared_copies(case, "augmented copies", turned, "are copies turned round",
                               unseen, alike=own))  # fmt: skip
    facts.append(constant_rows(case, {**(same or {}), **near, **turned}))
    return facts


def _findings_of(waiting: Sequence[Reading | Gap]) -> list[Finding]:
    """Return the findings on what was read, their p corrected for how much was (Holm)."""
    corrected = holm(
        [reading.evidence.p if isinstance(reading, Reading) else reading.p for reading in waiting]
    )
    return [reading.finding(p, len(waiting)) for reading, p in zip(waiting, corrected, strict=True)]


def make_case(touch: TouchSet, split: tuple[Pieces, Sides] | None, steps: int, seed: int) -> Case:
    """Return the input of every check, with folds that suit the split."""
    key = honest_key(touch)
    pieces, sides = split if split is not None else (cut_pieces(touch, steps, steps), None)
    folds = trial_folds(touch.y, None if key is None else touch.group(key), seed)
    plain = trial_folds(touch.y, None, seed)
    if sides is not None and sides.whole_trials(pieces):
        folds = plain = sides.trial_folds(pieces)
    return Case(touch=touch, pieces=pieces, sides=sides, key=key, folds=folds, plain=plain,
                seed=seed, steps=steps)  # fmt: skip


def _figures(touch: TouchSet) -> list[str]:
    """Return the note on a label of measured figures, if it is one."""
    note = figures_as_classes([trial.labels[touch.target] for trial in touch.trials], touch.target)
    return [note] if note else []


def _same_cameras(touch: TouchSet) -> list[str]:
    """Return warnings of cameras that show the same images, as small as they are held here."""
    columns = {name: np.flatnonzero(np.array(touch.views) == name) for name in touch.views}
    same = Counter(
        (a, b)
        for rows in touch.rows
        for a, b in combinations(columns, 2)
        if np.array_equal(rows[:, columns[a]], rows[:, columns[b]])
    )
    return same_notes(same, len(touch))


def _read_on(case: Case) -> str:
    if case.whole and case.sides is not None:
        return case.sides.name
    return "whole trials held out" if case.key is None else f"{case.key} held out"
