"""What a trial shows without touch: its length, place, first row, and its level.

Touch itself may stand in a first row or in a level, so that those two are compared with the
middle row and with what is left without the level. Knows nothing about files.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.audit.case import Case, Reading, rows_folds
from taxel.evaluation.audit.evidence import LabelEvidence, evidence_of, predict, trial_folds
from taxel.evaluation.audit.finding import UNSURE, Verdict
from taxel.evaluation.audit.touch_set import TouchSet, cut_pieces
from taxel.plain_text import visible

AT_REST = 0.8
"""A trial moves away from a first row that is farther from its middle than this share of its
rows. Our choice, docs/decisions/0023."""
STILL, LEAST_STILL = 0.1, 3
"""Share of a trial's way from its first row within which it stands still, and rows for which it
does, at least; half of the way is reached in twice as many rows at most. Source: our choice,
docs/decisions/0023."""
AHEAD = 0.10
"""Accuracy by which a first row in touch must beat the middle row. Our choice, decision 23."""
_ERRORS = 1.645
"""Standard errors that it must be ahead, too: one-sided 5 %. Our choice, decision 23."""
NEARLY = 0.95
"""Share of the way that level and first frame must both go where what is left without the level
predicts much as well, only less by `AHEAD`. Our choice, decision 23."""
_TENTH = 10
_DIGITS = 3
"""Of what is left without the level, in deviations: beyond, rounding gives the level away."""
ENOUGH = 0.5
"""Share of the trials that an audit without a split trains on, from which a split shows what such
an audit shows. Our choice, decision 23."""
MOSTLY = 0.8
"""Share of the way from majority to 1 that a level must go to be suspected; what is left without
it must go half of that at most. Our choice, decision 23."""


def read_length(case: Case) -> Reading:
    """Return how well a trial's length predicts the label."""
    touch = case.touch
    lengths = np.array([touch.every.get(trial.recording, 1) * len(rows)
                        for trial, rows in zip(touch.trials, touch.rows, strict=True)])  # fmt: skip
    features = np.stack([[t[-1] - t[0] for t in touch.time_s], lengths], axis=1)
    found = trial_evidence(case, features)
    middle = [
        f"{name}: {np.median(lengths[touch.y == c]):.0f} rows"
        for c, name in enumerate(touch.classes)
    ]

    def decide(counts: bool) -> tuple[Verdict, str, str]:
        if not counts:
            return "clear", "A trial's length does not predict the label.", ""
        return (
            "leak",
            "The label can be predicted from how long a trial is, without any touch.",
            "cut crops of one length at the same places of every trial, and print a control "
            "that sees the length only",
        )

    return Reading(kind="length", evidence=found, decide=decide, examples=tuple(middle),
                   mended=lambda: cropped(case), same=_same(features),
                   over_all=lambda: over_all(case, features))  # fmt: skip


def _same(features: NDArray[np.floating]) -> bool:
    """Return whether all rows are the same up to rounding."""
    return bool(np.allclose(features, features[:1], rtol=1e-6, atol=1e-6))


def _same_places(place: NDArray[np.floating], trial: NDArray[np.intp]) -> bool:
    """Return whether each trial has windows at the same places."""
    counts = np.unique(trial, return_counts=True)[1]
    if len(set(counts.tolist())) > 1:
        return False
    by_trial = place[np.argsort(trial, kind="stable")].reshape(len(counts), -1)
    return _same(by_trial)


def read_place(case: Case) -> Reading:
    """Return how well a window's place within its trial predicts the label."""
    touch, pieces = case.touch, case.pieces
    folds = rows_folds(case.folds, pieces.trial)
    if not folds:  # a table that names too few trials: the windows of all of them
        pieces = cut_pieces(touch, case.steps, case.steps)
        folds = rows_folds(case.folds, pieces.trial)
    start = np.array([t[0] for t in touch.time_s])[pieces.trial]
    place = np.stack([pieces.first, pieces.start_s(touch) - start], axis=1)
    y = touch.y[pieces.trial]
    found = evidence_of(predict(place, y, folds, case.seed), y, pieces.trial, case.groups, folds)

    def decide(counts: bool) -> tuple[Verdict, str, str]:
        if not counts:
            return "clear", "A window's place in its trial does not predict the label.", ""
        return (
            "leak",
            "The label can be predicted from when within its trial a window was taken.",
            "take windows at the same places of every trial, whatever its label and length",
        )

    return Reading(kind="place", evidence=found, decide=decide, mended=lambda: cropped(case),
                   same=_same_places(place, pieces.trial))  # fmt: skip


def read_first(case: Case) -> Reading:
    """Return how well a trial's first row or frame predicts the label."""
    touch = case.touch
    what = "frame" if touch.kind == "camera" else "row"
    first_evidence = _first_evidence(case)
    middle = trial_evidence(case, np.stack([rows[len(rows) // 2] for rows in touch.rows]))
    before = leaves_its_start(touch)
    tested = sum(len(test) for _, test in case.folds)

    def decide(counts: bool) -> tuple[Verdict, str, str]:
        if not counts:
            return "clear", f"A trial's first {what} does not predict the label.", ""
        start = f"take each trial's first {what} from it (tare), hold out sessions" \
            if taring_helps(case) else \
            f"hold out sessions, since taking each trial's first {what} from it (tare) does not " \
            "remove this"  # fmt: skip
        mend = f"{start}, and print a control that sees the first {what} only"
        if _is_ahead(first_evidence.accuracy, middle.accuracy, tested):
            return (
                "leak",
                f"The first {what} predicts the label better than the middle one "
                f"({middle.accuracy:.3f}): something at the start gives it away.",
                mend,
            )
        still = before and stands_still_first(touch)
        if still and (why := _not_of_touch(case, first_evidence)):
            return (
                "leak",
                f"The first {what} predicts the label, trials stand still there before anything "
                f"happens, and {why}: drift or a setting, unless the sensor already lay around "
                "the object.",
                mend,
            )
        if before:
            stood = " after they stood still there" if still else ""
            return (
                "hazard",
                f"The first {what} predicts the label, and trials move away from it{stood}. Two "
                "things do that, and the recordings do not say which. If the sensor does not yet "
                f"touch in the first {what}, it is drift or a setting, and a leak. If it already "
                "touches, or lies around the object (as the joint angles of a closed hand do), it "
                f"may be touch itself (the middle {what}: {middle.accuracy:.3f}).",
                "look at a video or at your protocol: was the object in contact when the recording "
                f"began? If not, {mend}. If it was, state so, and print that control all the same",
            )
        return (
            "note",
            f"The first {what} predicts the label; trials begin in touch, so this may be touch "
            f"itself (the middle one: {middle.accuracy:.3f}).",
            f"print a control that sees the first {what} only",
        )

    return Reading(kind=UNSURE, evidence=first_evidence, decide=decide, mended=lambda: tared(case),
                   over_all=lambda: over_all(case, np.stack([rows[0] for rows in touch.rows])),
                   )  # fmt: skip


def _is_ahead(first: float, middle: float, trials: int) -> bool:
    """Return whether one accuracy, 0…1, is farther above another than so few trials give by
    chance, as if they were of different trials, so that fewer are called ahead than might be.
    """
    error = np.sqrt((first * (1 - first) + middle * (1 - middle)) / trials)
    return first - middle >= max(AHEAD, _ERRORS * float(error))


def read_level(case: Case) -> Reading:
    """Return how well the channels' means, or the mean image, predict the label."""
    touch = case.touch
    is_camera = touch.kind == "camera"
    what, verb, no = ("mean image", "predicts", "does not") if is_camera else (
        "channels' means", "predict", "do not")  # fmt: skip
    means = [rows.mean(axis=0, dtype=np.float64) for rows in touch.rows]
    level = trial_evidence(case, np.stack(means))
    spread = np.concatenate(touch.rows).std(axis=0)
    moved = np.stack(
        [sum_up(np.round((rows - m) / np.where(spread > 0, spread, 1.0), _DIGITS))
         for rows, m in zip(touch.rows, means, strict=True)]
    )  # fmt: skip
    without = trial_evidence(case, moved)
    first = _first_evidence(case)
    before = leaves_its_start(touch)

    def decide(counts: bool) -> tuple[Verdict, str, str]:
        if not counts:
            return "clear", f"The {what} {no} predict the label.", ""
        way, rest, start = _way(level), _way(without), _way(first)
        alone = way >= MOSTLY and rest <= way / 2 and (start >= way / 2 or not before)
        ahead = level.accuracy >= without.accuracy + AHEAD
        if alone or (ahead and min(way, start) >= NEARLY):
            if found := _lone_channel(case, np.stack(means), way):
                return "leak", *found
            return (
                "leak",
                f"The {what} alone {verb} the label, and what changes in a trial less well "
                f"({without.accuracy:.3f}): the label sits in an offset.",
                f"{_without_level(case)}hold out sessions, and print a control that sees the "
                f"{what} only",
            )
        return (
            "note",
            f"The {what} {verb} the label; without that level {without.accuracy:.3f} is left, so "
            "this may be touch itself.",
            f"print a control that sees the {what} only",
        )

    return Reading(kind="level", evidence=level, decide=decide, mended=lambda: tared(case),
                   over_all=lambda: over_all(case, np.stack(means)))  # fmt: skip


def _lone_channel(case: Case, means: NDArray[np.float64], way: float) -> tuple[str, str] | None:
    """Return what to say and do where one channel of an array carries the whole level.

    Args:
        case: What is audited.
        means: Of each trial's channels, shape (trials, channels).
        way: How far all of them go from the majority class to 1.
    """
    names, y = case.touch.channels, case.touch.y
    if len(names) != means.shape[1] or len(names) < 2:
        return None
    classes = np.stack([means[y == number].mean(axis=0) for number in y])
    between, within = classes.var(axis=0), (means - classes).var(axis=0)
    first = int(np.argmax(between / np.maximum(within, 1e-9 * between + np.finfo(float).tiny)))
    evidence = trial_evidence(case, means[:, [first]])
    others = trial_evidence(case, np.delete(means, first, axis=1))
    if _way(evidence) < NEARLY * way or _way(others) > way / 2:
        return None
    name = visible(names[first])
    return (
        f"The mean of the channel {name} alone predicts the label ({evidence.accuracy:.3f}), "
        f"the means of all other channels less well ({others.accuracy:.3f}): a counter, a label, "
        "or an offset.",
        f"leave {name} out if it does not measure touch (name the others in the table's column "
        f"'channels' and import again); else {_without_level(case)}hold out sessions",
    )


def trial_evidence(case: Case, features: NDArray[np.floating]) -> LabelEvidence:
    """Return how well one row of features a trial predicts the label, under the case's folds.

    Args:
        case: The audit under way.
        features: Shape (trials, columns).
    """
    y = case.touch.y
    found = predict(features, y, case.folds, case.seed)
    return evidence_of(found, y, np.arange(len(y)), case.groups, case.folds)


def over_all(case: Case, features: NDArray[np.floating]) -> LabelEvidence | None:
    """Return how well features predict the label as without a split, where the split given trains
    on so few trials that it may not find out; None else.
    """
    if not case.whole:
        return None
    y, groups = case.touch.y, case.groups
    folds = trial_folds(y, groups, case.seed)
    learned = [float(np.mean([len(train) for train, _ in own])) for own in (case.folds, folds)]
    if learned[0] >= ENOUGH * learned[1]:
        return None
    return evidence_of(predict(features, y, folds, case.seed), y, np.arange(len(y)), groups, folds)


def _first_evidence(case: Case) -> LabelEvidence:
    """Return how well a trial's first row predicts the label, computed once in an audit."""
    if "first" not in case.known:
        case.known["first"] = trial_evidence(case, np.stack([rows[0] for rows in case.touch.rows]))
    return case.known["first"]


def cropped(case: Case) -> tuple[float, str]:
    """Return what cheap trees reach on crops of one length from each trial's start, and that in
    words.
    """
    rows = case.touch.rows
    length = min(map(len, rows))
    whole = trial_evidence(case, np.stack([sum_up(own) for own in rows])).accuracy
    left = trial_evidence(case, np.stack([sum_up(own[:length]) for own in rows])).accuracy
    return left, (f"Crops of the first {length} rows of every trial leave small trees at "
                  f"{left:.3f} (whole trials: {whole:.3f}).")  # fmt: skip


def _not_of_touch(case: Case, first: LabelEvidence) -> str:
    """Return why a first row that trials leave after a still start is not touch; empty if it may.

    Either what changes afterwards says little of the label, so that it sits in an offset, or the
    label shows in what changes while trials still stand: drift.
    """
    left, early = _tared_evidence(case)
    if _way(left) <= _way(first) / 2:
        return f"what changes afterwards predicts it less well ({left.accuracy:.3f})"
    if _way(early) >= MOSTLY * _way(first):
        return f"so does what changes while they still stand ({early.accuracy:.3f})"
    return ""


def _tared_evidence(case: Case) -> tuple[LabelEvidence, LabelEvidence]:
    """Return how well trials without their first row predict the label, and how well the row after
    a tenth of each does; computed once in an audit.
    """
    rows = case.touch.rows
    if "tared" not in case.known:
        early = np.stack([own[max(1, len(own) // _TENTH)] - own[0] for own in rows])
        whole = np.stack([sum_up(own - own[0]) for own in rows])
        case.known["early"] = trial_evidence(case, early)
        case.known["tared"] = trial_evidence(case, whole)
    return case.known["tared"], case.known["early"]


def taring_helps(case: Case) -> bool:
    """Return whether a first row that gives the label away no longer does once it is taken from the
    trial; True where it gives nothing away.

    Where trials move away from their first row, and the row after a tenth of each predicts the
    label all the same, what gives it away goes on.
    """
    first = _first_evidence(case)
    if not first.counts(first.p) or not leaves_its_start(case.touch):
        return True
    _, early = _tared_evidence(case)
    return not early.counts(early.p)


def _without_level(case: Case) -> str:
    """Return the beginning of an advice on levels: to take them away, where that helps."""
    return "take each trial's level at rest from it, " if taring_helps(case) else ""


def tared(case: Case) -> tuple[float, str]:
    """Return what cheap trees reach once each trial's first row is taken from it, and in words
    also what the row after a tenth of the trial then predicts: drift goes on before contact.
    """
    left, still = _tared_evidence(case)
    return left.accuracy, (
        f"Tared by its first row, small trees reach {left.accuracy:.3f}; the row after a tenth "
        f"of a trial, tared, still predicts {still.accuracy:.3f} "
        f"(majority {still.majority:.3f}).")  # fmt: skip


def leaves_its_start(touch: TouchSet) -> bool:
    """Return whether trials move away from their first row: it is unlike most others.

    So do trials that begin before contact, and those of a hold that settles, or of a press that
    goes on: values alone do not say which.
    """
    spread = _spread(touch)
    shares = []
    for rows in touch.rows:
        scaled = rows / np.where(spread > 0, spread, 1.0)
        far = np.linalg.norm(scaled - np.median(scaled, axis=0), axis=1)
        shares.append((far[1:] < far[0]).mean())
    return float(np.mean(shares)) >= AT_REST


def stands_still_first(touch: TouchSet) -> bool:
    """Return whether most trials stand still at first and then leave fast, as at an onset.

    A press that has begun leaves slowly, a hold that settles at once. Still trials need not be
    free of touch: a hand may lie around an object before it squeezes.
    """
    spread = _spread(touch)
    found = []
    for rows in touch.rows:
        away = np.linalg.norm((rows - rows[0]) / np.where(spread > 0, spread, 1.0), axis=1)
        still, half = (int(np.argmax(away > part * away.max())) for part in (STILL, 0.5))
        found.append(still >= LEAST_STILL and half <= 2 * still)
    return float(np.mean(found)) > 0.5


def _spread(touch: TouchSet) -> NDArray[np.floating]:
    """Return each channel's deviation over some rows of all trials, shape (channels,)."""
    some = [rows[:: max(1, len(rows) // 16)] for rows in touch.rows]
    return np.asarray(np.concatenate(some).std(axis=0))


def sum_up(rows: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return the statistics that the strong model sees, shape (9 · channels,)."""
    steps = np.diff(rows, axis=0) if len(rows) > 1 else np.zeros_like(rows)
    parts = [
        rows.mean(axis=0), rows.std(axis=0), rows.min(axis=0), rows.max(axis=0),
        rows[-1] - rows[0], np.abs(steps).mean(axis=0), *np.percentile(rows, (10, 50, 90), axis=0),
    ]  # fmt: skip
    return np.asarray(np.concatenate(parts), np.float32)


def _way(label_evidence: LabelEvidence) -> float:
    """Return how far from the majority class to 1 an accuracy goes, 0…1."""
    return (label_evidence.accuracy - label_evidence.majority) / max(
        1e-9, 1.0 - label_evidence.majority
    )
