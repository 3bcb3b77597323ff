"""Which camera trials are learned from and which are tested on; whole trials, whole groups.

Knows nothing about images, models or metrics.

Background of our choices: docs/decisions/0041.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadSplit
from taxel.evaluation.first_share import by_class_too, first_share, group_numbers, names_share
from taxel.evaluation.fold_summary import SplitSummary, summary_of_trials
from taxel.evaluation.fold_table import FoldRow, FoldTable, RowFold, read_fold_table, refuse_twice
from taxel.evaluation.shared_values import on_both_sides
from taxel.evaluation.splits import TrialFold
from taxel.labels.trials import USUAL_GROUPS, Trial, as_numbers
from taxel.plain_text import noun_of, number_of, several
from taxel.recordings.imports.video_rows import SPLIT, TEST
from taxel.training.camera_trials.inner_folds import inner_folds
from taxel.training.choose.inner_folds import what_is_held

RANDOM: Final = "random trials"
"""Name of the split that holds out single trials drawn at random."""
_USUAL: Final = ("object", "session")
"""Groups that are held out unless something else is named. Source: our choice."""
Groups = Sequence[Mapping[str, str]]


@dataclass(frozen=True, slots=True)
class TrialSplit:
    """How camera trials are parted."""

    name: str
    """Printed beside every accuracy, such as "object held out"."""
    folds: tuple[TrialFold, ...]
    group: str
    """What is held out whole on inner folds, and resampled for intervals."""


def split_trials(
    groups: Groups,
    y: NDArray[np.intp],
    text: str | None,
    folds: int,
    seed: int,
    classes: Sequence[str] = (),
) -> TrialSplit:
    """Return the split that a text names: split, group:KEY, order:KEY:LAST, random or
    order:KEY:70%[:by-class].

    Without a text: the trials' own column `split` where it names test trials, else by object, by
    session, or by what else groups them.

    Args:
        groups: Of each trial.
        y: Shape (trials,): class.
        text: The split's name.
        folds: How many folds, where groups are held out in turn.
        seed: Of their assignment.
        classes: Names of the classes, for messages; their numbers unless given.

    Raises:
        BadSplit: There is no such split, or it leaves a side without trials or classes.
    """
    given = any(own.get(SPLIT) == TEST for own in groups)
    text = text or (SPLIT if given else _usual(groups))
    words = text.split(":")
    if words == [SPLIT]:
        tested = np.array([own.get(SPLIT) == TEST for own in groups])
        return _one("test trials given", groups, (y, classes), tested)
    if words[0] == "group" and len(words) == 2:
        return _by_group(groups, y, words[1], (folds, seed), classes)
    if names_share(words):
        of_class = np.array(classes)[y] if len(classes) else y
        first, name = first_share(words[1], values_of(groups, words[1]), of_class, words[2],
                                  by_class=len(words) == 4)  # fmt: skip
        return _one(name, groups, (y, classes), ~first)
    if words[0] == "order" and len(words) == 3:
        return _by_order(groups, (y, classes), words[1], words[2])
    if words == ["random"]:
        names = np.arange(len(y)).astype(str)
        parts = _folds(names, y, (folds, seed), classes)
        return TrialSplit(RANDOM, parts, interval_group(groups) or "trial")
    raise BadSplit(
        "a split: group:KEY, order:KEY:LAST, order:KEY:70%[:by-class], random, or split for the "
        "column of that name", repr(text),
        f"say group:{text}" if text in _shared(groups)
        else f"groups are {', '.join(_shared(groups)) or 'none'}",
    )  # fmt: skip


def split_by_table(
    names: Sequence[str],
    groups: Groups,
    y: NDArray[np.intp],
    path: Path,
    classes: Sequence[str] = (),
) -> TrialSplit:
    """Return the split that a table of folds writes down.

    A row's recording is a trial's name, or the path or name of its first camera's file.
    Validation rows are learned from: inner folds choose, as everywhere.

    Args:
        names: Of each trial.
        groups: Of each trial.
        y: Shape (trials,): class.
        path: The table, as `taxel.evaluation.fold_table` describes it.
        classes: Names of the classes, for messages; their numbers unless given.

    Raises:
        BadTable: The table is not as it should be.
        BadSplit: A row names no trial, a side lacks trials or classes, or a trial is tested twice.
    """
    table = read_fold_table(path)
    matching = [_named(row, table, names, groups) for row in table.rows]
    sides = []
    for fold in table.folds:
        _refuse_unused(table, fold, dict(enumerate(matching)), names)
        train, test = (
            np.array(sorted({at for row in rows for at in matching[row]}), np.intp)
            for rows in ((*fold.train, *fold.validation), fold.test)
        )
        if lacking := sorted(set(y.tolist()) - set(y[train].tolist())):
            raise BadSplit(
                f"every class on the training side of {fold.name}",
                f"none of {_called(lacking[0], classes)} there",
                "name some of them for training, or leave them out of the recordings",
            )  # fmt: skip
        sides.append(TrialFold.of(fold.name, train, test))
    often = Counter(at for fold in sides for at in fold.test)
    refuse_twice(table.name, names, [often[at] for at in range(len(names))])
    key = interval_group(groups)
    if table.rows[0].key != "recording":
        key = table.rows[0].key
    return TrialSplit(f"folds of {table.name}", tuple(sides), key or "trial")


def summary_of_sides(
    target: str, labels: Sequence[str], groups: Groups, split: TrialSplit
) -> SplitSummary:
    """Return what a split of camera trials holds out.

    Args:
        target: The label that is predicted.
        labels: Each trial's class.
        groups: Of each trial.
        split: How they are parted.
    """
    values = [own.get(split.group) for own in groups]
    return summary_of_trials(target, split.name, split.folds, labels, split.group, values)


def left_out(split: TrialSplit, trials: int) -> str | None:
    """Return a note of trials that a table of folds does not name; None where it names all.

    Args:
        split: Of the table.
        trials: How many there are.
    """
    named = {at for fold in split.folds for at in fold.train | fold.test}
    if len(named) == trials:
        return None
    left = trials - len(named)
    stand = "stands" if left == 1 else "stand"
    return f"{left} of {number_of(trials, 'trial')} {stand} on no side of {split.name}: left out"


def trials_to_score(names: Sequence[str], groups: Groups, table: FoldTable) -> list[int]:
    """Return the trials of a table's only test part, as indices, to score what is trained already.

    Rows of the other sides may name what is not there.

    Args:
        names: Of each trial.
        groups: Of each trial.
        table: Rows and one fold, as it is read to score.

    Raises:
        BadSplit: A row to test names no trial, or a trial stands on both sides.
    """
    (fold,) = table.folds
    named = {row: _named(table.rows[row], table, names, groups) for row in fold.test}
    tested = {at for found in named.values() for at in found}
    for number in (*fold.train, *fold.validation, *fold.unused):
        row = table.rows[number]
        named[number] = _matching(row.key, row.value, names, groups)
    _refuse_unused(table, fold, named, names)
    others = {at for row in (*fold.train, *fold.validation) for at in named[row]}
    return sorted(TrialFold(fold.name, frozenset(others), frozenset(tested)).test)


def _refuse_unused(
    table: FoldTable, fold: RowFold, named: Mapping[int, list[int]], names: Sequence[str]
) -> None:
    """Refuse a trial that a fold's rows put on a side and name as unused, if by another name."""
    unused = {at for row in fold.unused for at in named[row]}
    for number in (*fold.train, *fold.validation, *fold.test):
        if both := sorted(unused & set(named[number])):
            row = table.rows[number]
            raise BadSplit(
                "each trial on one side", f"{names[both[0]]} as {row.side} in {table.where(row)}, "
                "and as unused in another", "leave one of these lines out",
            )  # fmt: skip


def _named(row: FoldRow, table: FoldTable, names: Sequence[str], groups: Groups) -> list[int]:
    """Return the trials that a row of a table names.

    Raises:
        BadSplit: There are none.
    """
    if not (found := _matching(row.key, row.value, names, groups)):
        raise BadSplit("rows that name trials of this data", f"{row.value!r} in "
                       f"{table.where(row)}", "correct or remove it")  # fmt: skip
    return found


def _matching(key: str, value: str, names: Sequence[str], groups: Groups) -> list[int]:
    """Return the trials that a row of a table of folds names."""
    if key != "recording":
        return [at for at, own in enumerate(groups) if own.get(key) == value]
    return [
        at
        for at, (name, own) in enumerate(zip(names, groups, strict=True))
        if value in (name, own.get("file"), Path(own.get("file", "")).stem, own.get("recording"))
    ]


def values_of(groups: Groups, key: str) -> NDArray[np.str_]:
    """Return a group's value of each trial, shape (trials,).

    Raises:
        BadSplit: A trial has no such group.
    """
    if any(key not in own for own in groups):
        raise BadSplit(
            f"the group {key!r} on every trial",
            f"groups {', '.join(_shared(groups)) or 'none'}", "name one of those, or add a column",
        )  # fmt: skip
    return np.array([own[key] for own in groups])


def order_of(split: TrialSplit, groups: Groups, y: NDArray[np.intp]) -> NDArray[np.float64] | None:
    """Return numbers that grow from earlier to later trials, shape (trials,), if later are tested.

    Those of a group whose numbers are larger on the only test side, in each class, than all that
    are learned from. None where there is no such group, or a coarser one is new on the test side.

    Args:
        split: How the trials are parted.
        groups: Of each trial.
        y: Shape (trials,): class.
    """
    if len(split.folds) != 1:
        return None
    (fold,) = split.folds
    trials = [
        Trial(recording="", start_s=0.0, end_s=0.0, labels={}, groups={**own, "trial": str(at)})
        for at, own in enumerate(groups)
    ]
    held = what_is_held(trials, y, fold.train_rows.tolist(), fold.test_rows.tolist())
    if held.key is None or not held.ordered:
        return None
    return as_numbers(own.get(held.key) or "nan" for own in groups)


def interval_group(groups: Groups) -> str | None:
    """Return the group to resample for intervals; None where each trial stands alone."""
    key = _usual(groups).removeprefix("group:")
    return None if key == "random" else key


def _shared(groups: Groups) -> list[str]:
    return sorted(set.intersection(*(set(own) for own in groups)))


def _usual(groups: Groups) -> str:
    """Return the split by the coarsest group that parts the trials: object, session, or another."""
    counts = {key: len({own[key] for own in groups}) for key in _shared(groups) if key != SPLIT}
    parting = {key: count for key, count in counts.items() if 1 < count < len(groups)}
    for key in _USUAL:
        if key in parting:
            return f"group:{key}"
    if parting:
        return f"group:{min(parting, key=lambda key: (parting[key], key))}"
    return "random"


def shared_values(split: TrialSplit, groups: Groups, y: NDArray[np.intp]) -> str | None:
    """Return a warning where objects, or other resampled groups, are on both sides; else None."""
    if split.group not in USUAL_GROUPS or any(split.group not in own for own in groups):
        return None
    values = [own[split.group] for own in groups]
    return on_both_sides(split.group, values, y, split.folds)


def _by_group(
    groups: Groups, y: NDArray[np.intp], key: str, how: tuple[int, int], classes: Sequence[str]
) -> TrialSplit:
    folds, seed = how
    values = values_of(groups, key)
    found = len(set(values.tolist()))
    if found < 2:
        raise BadSplit(f"two or more values of {key!r}, so that one can be held out",
                       f"only {values[0]!r}", "name another group")  # fmt: skip
    if folds < 2:
        raise BadSplit("two or more folds", str(folds), "choose more folds")
    folds = min(folds, found)
    return TrialSplit(f"{key} held out", _folds(values, y, (folds, seed), classes, key), key)


def _folds(
    values: NDArray[np.str_],
    y: NDArray[np.intp],
    how: tuple[int, int],
    classes: Sequence[str],
    key: str | None = None,
) -> tuple[TrialFold, ...]:
    """Return folds (how many, seed) over values of a group, or over trials where there is none."""
    folds, seed = how
    known = np.unique(y)
    rarest = int(known[np.bincount(y)[known].argmin()])
    count = int((y == rarest).sum())
    name = _called(rarest, classes)
    parts = inner_folds(y, values, seed, folds) if folds <= count else []
    if count == 1:
        raise BadSplit("two or more trials of every class", f"1 of {name}",
                       "correct the label if it is mistyped; else record more, or leave it out",
                       )  # fmt: skip
    owners = {kind: len(set(values[y == kind].tolist())) for kind in known.tolist()}
    lone = min(owners, key=lambda kind: (owners[kind], kind))
    if not parts and key and owners[lone] == 1:
        raise BadSplit(
            f"each class in two {several(key)} or more, so that one can be held out",
            f"all {number_of(int((y == lone).sum()), 'trial')} of {_called(lone, classes)} in one",
            f"record it in another {noun_of(key)} too, or hold out something else with --split",
        )
    if not parts:
        own = owners[rarest]
        among = f" in {number_of(own, key)}" if key else ""
        raise BadSplit(
            f"at least {folds} trials of each class for {folds} folds" if folds > count
            else f"every class in every training part of {folds} folds",
            f"{number_of(count, 'trial')} of {name}, the rarest{among}",
            f"choose a --fold-count of at most {count}, or record more" if folds > count
            else "choose a smaller --fold-count, or record more",
        )  # fmt: skip
    return tuple(TrialFold.of(f"fold {i}", train, test) for i, (train, test) in enumerate(parts, 1))


def _by_order(
    groups: Groups, labels: tuple[NDArray[np.intp], Sequence[str]], key: str, last: str
) -> TrialSplit:
    numbers = group_numbers(key, values_of(groups, key))
    try:
        limit = float(last)
    except ValueError as error:
        raise BadSplit("a number behind the group, as in order:day:3", repr(last),
                       "correct it, or write a share such as 70%") from error  # fmt: skip
    name = f"{key} up to {limit:g} → above"
    return _one(name, groups, labels, numbers > limit, by_class_too(key))


def _one(
    name: str,
    groups: Groups,
    labels: tuple[NDArray[np.intp], Sequence[str]],
    held: NDArray[np.bool_],
    also: str = "",
) -> TrialSplit:
    (y, classes), (train, test) = labels, (np.flatnonzero(~held), np.flatnonzero(held))
    if not len(train) or not len(test):
        raise BadSplit(
            "trials on both sides", f"{len(train)} to train on and {len(test)} to test",
            "name another split",
        )  # fmt: skip
    if unknown := sorted(set(y[test].tolist()) - set(y[train].tolist())):
        raise BadSplit(
            "every class in the training part",
            f"none of {_called(unknown[0], classes)} there, {int((y == unknown[0]).sum())} to test",
            f"train on some of them too, leave them out, or name another split{also}",
        )  # fmt: skip
    return TrialSplit(name, (TrialFold.of(name, train, test),), interval_group(groups) or "trial")


def _called(number: int, classes: Sequence[str]) -> str:
    """Return what a class is called in a message: by its number where no names are known."""
    return repr(classes[number]) if classes else f"class {number}"
