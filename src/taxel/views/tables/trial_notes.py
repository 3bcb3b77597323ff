"""Notes beside the scores of camera trials: short ones, still ones, bars and controls ahead.

Knows nothing about how anything was made or is drawn.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite

from taxel.evaluation.camera_trials.contenders import MAJORITY, nothing_moves
from taxel.evaluation.camera_trials.crossval import TrialResult
from taxel.evaluation.camera_trials.cut_choice import CutTrials
from taxel.evaluation.camera_trials.trial_set import TrialSet
from taxel.evaluation.run_scores import learned_note
from taxel.labels.trials import SESSIONS
from taxel.plain_text import noun_of, number_of, several
from taxel.windows.trial_crops import LEAST_CROP, PLACES
from taxel.windows.trial_picture import brightest

_BLACK = 4095 / 257
"""Grey levels, 0…255, that an image never exceeds whose file of 16 bits holds values of 12. Source:
12 bits are at most 4095, and decoders divide 16 bits by 257."""

CROP_AHEAD = 0.05
"""By so much accuracy, 0…1, must a crop alone be ahead of all for a note. Source: our choice,
docs/decisions/0041."""


def frames_note(lengths: Sequence[int], crop: int) -> str | None:
    """Return what short trials leave to be seen; None where a crop is long enough.

    Args:
        lengths: Frames of each trial.
        crop: Frames of each that are seen together.
    """
    short = sum(frames == crop for frames in lengths)
    if crop >= LEAST_CROP:
        return None
    seen = "1 frame: pictures alone, no motion" if crop == 1 else (
        f"{crop} frames, the last one repeated up to {LEAST_CROP}: little motion"
    )  # fmt: skip
    if short == len(lengths):
        return f"trials of {seen}"
    return (
        f"{short} of {len(lengths)} trials {'have' if short > 1 else 'has'} "
        f"{number_of(crop, 'frame')}: of each trial, so that no length shows, crops of {seen}; "
        "leave those out to see motion in the others"
    )


def black_note(level: float) -> str | None:
    """Return what nearly black images may be; None where they are not.

    Args:
        level: The highest mean of a small part of an image, grey levels, 0…255.
    """
    if level > _BLACK:
        return None
    return (
        f"nearly black: no part of an image is brighter than {level:.0f} of 255; if its file holds "
        "10 or 12 bits in 16, scale the values to all 16 bits, or save them as 8 bits"
    )


def one_class_note(
    groups: Sequence[Mapping[str, str]], y: Sequence[int], target: str
) -> str | None:
    """Return what sessions of one class each make doubtful; None where a session has several.

    Args:
        groups: Of each trial.
        y: Each trial's class.
        target: The label, which may be the session itself, such as the person.
    """
    for key in SESSIONS:
        if key == target or any(key not in own for own in groups):
            continue
        pairs = {(own[key], kind) for own, kind in zip(groups, y, strict=True)}
        if len(pairs) == len({value for value, _ in pairs}) > 1:
            return (
                f"each {noun_of(key)} holds trials of one class only, so that anything else that "
                f"differs between {several(key)}, such as light, names the class too; record "
                f"every class in several {several(key)}"
            )
    return None


def trial_notes(trials: TrialSet) -> list[str]:
    """Return notes on what trials show: their frames, and where nothing moves or all is dark; and
    on sessions of one class.
    """
    found = [frames_note(trials.lengths.tolist(), trials.layout.crop)]
    if trials.layout.crop > 1 and nothing_moves(trials):
        found.append("nothing moves: all frames of each crop are alike")
    if "picture" in trials.cut.shown:
        found.append(black_note(brightest(trials.cut.shown["picture"])))
    found.append(one_class_note(trials.groups, trials.y.tolist(), trials.target))
    return [note for note in found if note is not None]


def crop_notes(ours: TrialResult) -> list[str]:
    """Return a note where a crop alone is better than all of a trial's together.

    In log-loss, and by `CROP_AHEAD` or more in accuracy; few trials may show that by chance.

    Args:
        ours: The recogniser's result.
    """
    if not ours.places:
        return []
    best = min(range(len(ours.places)), key=lambda place: ours.places[place].loss)
    alone, whole = ours.places[best], ours.whole
    if alone.loss >= whole.loss or alone.accuracy < whole.accuracy + CROP_AHEAD:
        return []
    return [
        f"the {PLACES[best]} crop alone is more accurate ({100 * alone.accuracy:.1f} %) than all "
        f"of a trial's crops together ({100 * whole.accuracy:.1f} %): if little happens in the "
        f"others, cut the trials to the touch"
    ]


def cut_line(cut: CutTrials) -> str:
    """Return which part of the trials crops are taken from, as inner folds chose; empty where there
    was nothing to choose.

    Args:
        cut: The trials.
    """
    if not cut.losses:
        return ""
    known = [pair for pair in cut.losses if all(map(isfinite, pair))]
    if not known:
        return "crops: of whole trials, for no trial could be held out to choose a part"
    whole, part = (sum(each) / len(known) for each in zip(*known, strict=True))
    count = len(cut.sides)
    where = f"in {cut.moving} of {number_of(count, 'training side')}"
    if cut.moving in (0, count):
        where = "in each training side" if count > 1 else "in training"
    part_of = "the part in which something moves" if cut.moving else "whole trials"
    return (
        f"crops: of {part_of} {where}, as inner folds chose (log-loss there {whole:.3f} with crops "
        f"of whole trials, {part:.3f} of the part in which something moves)"
    )


def control_warnings(results: Sequence[TrialResult]) -> list[str]:
    """Return a warning where a control is as good as the recogniser, or better; empty otherwise.

    Args:
        results: Of the recogniser first; controls are those that leak.
    """
    controls = [result for result in results[1:] if result.leaks]
    if not controls:
        return []
    ours, found = results[0].whole, []
    best = max(controls, key=lambda control: control.whole.accuracy)
    if best.whole.accuracy >= ours.accuracy:
        constant = [r for r in controls if r.name == MAJORITY.name]
        classes = results[0].probabilities.shape[1]
        compared = "is more accurate" if best.whole.accuracy > ours.accuracy else "is as accurate"
        found.append(
            f"{best.name} {compared} ({100 * best.whole.accuracy:.1f} %, taxel "
            f"{100 * ours.accuracy:.1f} %): do not claim the recogniser's accuracy"
            + ("; the recogniser is not better than always naming the commonest class"
               f"{learned_note(ours.balanced, classes, 'trial')}"
               if constant and constant[0].whole.accuracy >= ours.accuracy else "")
        )  # fmt: skip
    best = min(controls, key=lambda control: control.whole.loss)
    if best.whole.loss <= ours.loss:
        compared = (
            "has a lower log-loss" if best.whole.loss < ours.loss else "has as low a log-loss"
        )
        found.append(
            f"{best.name} {compared} ({best.whole.loss:.3f}, taxel {ours.loss:.3f}): "
            "do not claim the recogniser's probabilities"
        )
    return found


def bar_warnings(results: Sequence[TrialResult]) -> list[str]:
    """Return a warning where a bar, a simple method, is ahead of the recogniser; empty otherwise.

    Args:
        results: Of the recogniser first; bars are those that do not leak.
    """
    bars = [result for result in results[1:] if not result.leaks]
    if not bars:
        return []
    ours, found = results[0].whole, []
    best = max(bars, key=lambda result: result.whole.accuracy)
    if best.whole.accuracy > ours.accuracy:
        found.append(
            f"{best.name} is more accurate ({100 * best.whole.accuracy:.1f} %, taxel "
            f"{100 * ours.accuracy:.1f} %): a simple method names these trials better"
        )
    best = min(bars, key=lambda result: result.whole.loss)
    if best.whole.loss < ours.loss:
        found.append(
            f"{best.name} has a lower log-loss ({best.whole.loss:.3f}, taxel {ours.loss:.3f}): "
            "a simple method has better probabilities here"
        )
    return found
