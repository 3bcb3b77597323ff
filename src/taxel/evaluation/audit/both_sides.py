"""What stands on both sides of a split: moments, trials, sessions, objects, views.

Each is a fact, not a guess, so that one piece is enough for an alarm. The accuracy beside it is
what looking up the label of the training part's own gives, and elsewhere the test parts' commonest
class, so that it is never below the majority for want of a partner. Knows nothing about values;
copies are in `copy_findings`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taxel.evaluation.audit.case import Case
from taxel.evaluation.audit.evidence import majority
from taxel.evaluation.audit.finding import Finding
from taxel.labels.trials import OBJECTS, SESSIONS, TIMES
from taxel.plain_text import several

Partners = Sequence[NDArray[np.intp]]
"""For each test piece of a fold: the training pieces that give it away."""
SESSIONS_UNKNOWN = Finding(
    kind="same session", verdict="not checked",
    message="The recordings name no session (or day, operator, device).",
    mend="record it as a group; without it no session can be held out",
)  # fmt: skip


def shared_moments(case: Case) -> list[Finding]:
    """Return the findings on overlap, and on views of one moment in different folds."""
    assert case.sides is not None
    start, end = case.pieces.start_s(case.touch), case.pieces.end_s(case.touch)
    recording = np.array([trial.recording for trial in case.touch.trials])[case.pieces.trial]
    view = case.pieces.view

    def partners(train: NDArray[np.intp], test: NDArray[np.intp], other_view: bool) -> Partners:
        by_name = {name: train[recording[train] == name] for name in set(recording[test])}
        found = []
        for piece in test:
            near = by_name[recording[piece]]
            near = near[(start[near] < end[piece]) & (start[piece] < end[near])]
            differs = (view[near] != view[piece]) & (view[near] != "") & (view[piece] != "")
            found.append(near[differs == other_view])
        return found

    overlap = looked_up(case, [partners(*fold, False) for fold in case.sides.folds])
    findings = [
        _fact(
            "overlap", overlap, "windows of the test part share rows with training windows",
            "No window shares rows with the other side.",
            "split by recording or trial first, and cut windows afterwards",
        )
    ]  # fmt: skip
    if len(set(view)) > 1:
        views = looked_up(case, [partners(*fold, True) for fold in case.sides.folds])
        findings.append(
            _fact(
                "views", views,
                "pieces of the test part are seen by another finger or camera in training",
                "Fingers or cameras of one moment stay together.",
                "keep all views of one trial on one side",
            )
        )  # fmt: skip
    else:
        together = "All fingers or cameras of a moment stay together."
        findings.append(Finding(kind="views", verdict="clear", message=together))
    return findings


def shared_names(case: Case) -> list[Finding]:
    """Return the findings on trials, sessions and objects on both sides."""
    assert case.sides is not None
    touch = case.touch
    trial = np.array([t.groups["trial"] for t in touch.trials])
    findings = [
        _name(case, "trial", "trial", trial,
              "give every trial, with all of its windows, to one side")
    ]  # fmt: skip
    sessions = touch.keys(SESSIONS)
    if not sessions:
        findings.append(SESSIONS_UNKNOWN)
    found = {key: _name(case, f"same {key}", key, _of(case, key),
                        f"hold out whole {several(key)}, as with --split group:{key}")
             for key in sessions}  # fmt: skip
    single = [key for key in sessions if len(set(_of(case, key))) == 1]
    apart = {key for key in sessions if key not in single and not found[key].alarm}
    for key, finding in found.items():
        # Sessions are apart: that their operator or sensor is known is no leak, but a limit.
        limit = key in single or (apart & set(TIMES) if key in TIMES else apart)
        claimed = key in case.sides.claimed
        findings.append(
            _known_only(finding, key) if finding.alarm and limit and not claimed else finding
        )
    for key in dict.fromkeys((*touch.keys(OBJECTS), *case.sides.claimed)):
        values = touch.group(key)
        if values is None or key in sessions:
            continue
        kind = "same object" if key in OBJECTS else f"same {key}"
        finding = _name(case, kind, key, values, f"hold out whole {several(key)}")
        claimed = key in case.sides.claimed
        findings.append(finding if claimed or not finding.alarm else _known_only(finding, key))
    return findings


def _known_only(finding: Finding, key: str) -> Finding:
    """Return a finding as the note that the figure holds for what training has seen."""
    return replace(
        finding, verdict="note",
        message=f"The same {several(key)} stand on both sides: the figure holds for known "
                "ones only.",
        mend=f"say so, or hold out whole {several(key)} and add --unseen {key}",
    )  # fmt: skip


def _of(case: Case, key: str) -> NDArray[np.str_]:
    values = case.touch.group(key)
    assert values is not None
    return values


def one_class_folds(case: Case) -> Finding:
    """Return the finding on folds whose test part holds one class, or whose training lacks one."""
    assert case.sides is not None
    y = case.touch.y[case.pieces.trial]
    every = set(y.tolist())
    names = case.touch.classes
    problems, right, total = [], 0, 0
    for number, (train, test) in enumerate(case.sides.folds, 1):
        tested, trained = set(y[test].tolist()), set(y[train].tolist())
        right += int(np.bincount(y[test]).max())
        total += len(test)
        if len(tested) == 1 and len(every) > 1:
            problems.append(f"the test part of fold {number} holds {names[y[test[0]]]!r} only")
        if tested - trained:
            lacks = names[min(tested - trained)]
            problems.append(f"the training part of fold {number} lacks {lacks!r}")
        elif len(trained) == 1:
            problems.append(f"the training part of fold {number} holds {names[y[train[0]]]!r} only")
    if not problems:
        return Finding(kind="one-class folds", verdict="clear",
                       message="Every fold tests several classes, all of them trained.",
                       )  # fmt: skip
    more = f", and {len(problems) - 1} more" if len(problems) > 1 else ""
    why, mend = _of_groups(case)
    return Finding(
        kind="one-class folds", verdict="leak", alone=right / total,
        majority=majority(y, case.sides.folds),
        message=f"{problems[0][0].upper()}{problems[0][1:]}{more}: one constant answer per fold "
                f"is enough, without touch.{why}",
        mend=mend or "deal out groups so that each fold holds every class, or pool the folds' "
                     "predictions",
        examples=tuple(problems[:3]),
    )  # fmt: skip


def _of_groups(case: Case) -> tuple[str, str]:
    """Return why folds of whole groups test one class, and what to do; nothing of other folds."""
    assert case.sides is not None
    key, count = case.sides.key, case.sides.fold_count
    if key is None:
        return "", ""
    groups, folds = _of(case, key), len(case.sides.folds)
    names = sorted(set(groups))
    single = sum(len(set(case.touch.y[groups == name].tolist())) == 1 for name in names)
    why = f" {single} of {len(names)} {several(key)} hold one class each, and the split makes " \
          f"{folds} folds of them: accuracy in such a fold shows how often that class is named, " \
          "not whether classes are distinguished."  # fmt: skip
    if count:
        return why, f"choose --fold-count {count}, the most found with which each fold tests " \
                    f"several classes; or record several classes in each {key}"  # fmt: skip
    mend = f"hold out another group, or record several classes in each {key}"
    searched = ": no smaller --fold-count was found that mends it" if count == 0 else ""
    return why, f"{mend}{searched}. Or pool the folds' predictions"


def future_labels(case: Case) -> Finding:
    """Return the finding on windows that reach beyond the moment whose label they carry."""
    assert case.sides is not None
    label_s = case.pieces.label_s
    if np.isnan(label_s).all():
        return Finding(kind="future", verdict="not checked",
                       message="The split does not say for which moment a window is labelled.",
                       mend="add a column label_s to the table of --folds")  # fmt: skip
    over = case.pieces.end_s(case.touch) - label_s
    late = over > 1e-3
    if not late.any():
        return Finding(
            kind="future",
            verdict="clear",
            message="No window reaches beyond the moment whose label it carries.",
        )
    y = case.touch.y[case.pieces.trial]
    right = total = 0
    usual = commonest(case)
    for _, test in case.sides.folds:
        right += int((late[test] | (y[test] == usual)).sum())
        total += len(test)
    return Finding(
        kind="future", verdict="leak", alone=right / total,
        majority=majority(y, case.sides.folds),
        message=f"{int(late.sum())} of {len(late)} windows hold moments after the one whose label "
                f"they carry, up to {np.nanmax(over):.2f} s: they have seen the answer.",
        mend="end each window at or before the moment whose label it is to predict",
    )  # fmt: skip


def _name(case: Case, kind: str, key: str, values: NDArray[np.str_], mend: str) -> Finding:
    assert case.sides is not None
    own = values[case.pieces.trial]
    partners = []
    for train, test in case.sides.folds:
        members = {name: train[own[train] == name] for name in set(own[test])}
        partners.append([members[name] for name in own[test]])
    what = f"pieces of the test part share their {key} with training"
    return _fact(kind, looked_up(case, partners), what, f"No {key} stands on both sides.", mend)


def looked_up(case: Case, partners: Sequence[Partners]) -> tuple[float, float, int, int]:
    """Return accuracy, majority's accuracy, how many test pieces have partners, and how many."""
    assert case.sides is not None
    y = case.touch.y[case.pieces.trial]
    right = count = total = 0
    usual = commonest(case)
    for (_, test), own in zip(case.sides.folds, partners, strict=True):
        for piece, found in zip(test, own, strict=True):
            named = int(np.bincount(y[found]).argmax()) if len(found) else usual
            right += named == y[piece]
            count += len(found) > 0
        total += len(test)
    return right / total, majority(y, case.sides.folds), count, total


def commonest(case: Case) -> int:
    """Return the commonest class of all test parts, pieces counted: the best single answer."""
    assert case.sides is not None
    y = case.touch.y[case.pieces.trial]
    return int(np.bincount(np.concatenate([y[test] for _, test in case.sides.folds])).argmax())


def _fact(
    kind: str, looked_up: tuple[float, float, int, int], what: str, clear: str, mend: str
) -> Finding:
    alone, usual, count, total = looked_up
    if not count:
        return Finding(kind=kind, verdict="clear", message=clear)
    return Finding(kind=kind, verdict="leak", message=f"{count} of {total} {what}.", mend=mend,
                   alone=alone, majority=usual, at_most=count / total)  # fmt: skip
