"""Scaling or statistics that were fitted on the test part too.

Two ways to see it: values that stand at mean 0 and deviation 1 over everything, and a run's
stored scaling that fits all windows rather than the training ones. Knows nothing about models.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from sklearn.neighbors import KNeighborsClassifier

from taxel.errors import BadInput
from taxel.evaluation.audit.case import Case, rows_folds
from taxel.evaluation.audit.evidence import majority
from taxel.evaluation.audit.finding import Finding
from taxel.evaluation.audit.touch_set import TouchSet
from taxel.foreign.json_text import Fields, read_json
from taxel.labels.trials import SESSIONS
from taxel.plain_text import number_of

_NEAR = 1e-3
"""Deviations within which an offset or a factor counts as equal. Our choice, decision 23."""
_FAR = 0.02
"""Deviations beyond which a scaling was fitted on something else. Our choice, decision 23."""
_MOST = 0.8
"""Share of channels that must be so."""

Table = NDArray[np.float64]


def scaled_values(case: Case) -> Finding:
    """Return the finding on values that were standardised as a whole before any split."""
    touch = case.touch
    scans = list(touch.scans.values())
    if not _standard(touch, np.arange(len(touch))) and not _plain(*_over_scans(scans)):
        return Finding(kind="scaling", verdict="clear",
                       message="The values were not standardised as a whole.")  # fmt: skip
    units = {"trial": np.arange(len(touch)).astype(str)}
    units |= {key: own for key in touch.keys(("recording", *SESSIONS))
              if (own := touch.group(key)) is not None and len(set(own)) > 1}  # fmt: skip
    for unit, names in units.items():
        each = [_standard(touch, np.flatnonzero(names == name), unit != "trial")
                for name in set(names)]  # fmt: skip
        if np.mean(each) >= _MOST:
            return Finding(
                kind="scaling", verdict="note",
                message=f"Each {unit} has mean 0 and deviation 1 by itself: nothing crosses to "
                        f"others, but live a whole {unit} is known only at its end.",
                mend="say so, and scale live by what is known then",
            )  # fmt: skip
    inner, outer, usual = _near_neighbours(case)
    return Finding(
        kind="scaling", verdict="leak", alone=outer, majority=usual,
        message="The values have mean 0 and deviation 1 over all recordings: they were scaled with "
                f"the test part in view (a nearest-neighbour rule reaches {outer:.3f} with it, and "
                f"{inner:.3f} with scaling fitted within the fold).",
        mend="keep raw values, and fit scaling on the training part of each fold",
    )  # fmt: skip


def scaled_run(case: Case, run: Path) -> Finding:
    """Return the finding on a run's stored scaling.

    Raises:
        BadInput: The folder holds no run of an array recogniser, or of other channels.
    """
    offset, factor, kind, known = _stored(run, case.touch)
    if kind != "standard":
        return Finding(kind="scaling of the run", verdict="clear",
                       message=f"The run's scaling is {kind!r}: nothing in it is fitted.",
                       )  # fmt: skip
    folds = case.sides.folds if case.sides is not None else rows_folds(
        case.folds, case.pieces.trial)  # fmt: skip
    whole = _distance(case, offset, factor, np.arange(len(case.pieces)))
    nearest = min(_distance(case, offset, factor, train) for train, _ in folds)
    inner, outer, usual = _near_neighbours(case)
    if nearest <= whole <= _FAR:
        return Finding(kind="scaling of the run", verdict="clear",
                       message="The run's scaling fits a training part better than all windows.",
                       )  # fmt: skip
    if whole > min(_FAR, nearest / 2):
        return Finding(kind="scaling of the run", verdict="not checked",
                       message="The run's scaling fits neither all windows nor a training part: it "
                               "is from other recordings or windows.",
                       mend="name the recordings that it was trained on")  # fmt: skip
    refitted = case.sides is None or case.sides.name in known
    return Finding(
        kind="scaling of the run", verdict="note" if refitted else "leak", alone=outer,
        majority=usual,
        message="The run's scaling is that of all windows "
                f"({whole:.4f} deviations away, the nearest training part {nearest:.4f}): it was "
                "fitted on every test part too (a nearest-neighbour rule reaches "
                f"{outer:.3f} with it, and {inner:.3f} with scaling fitted within the fold).",
        mend="quote accuracies of models refitted in each fold, never of this run itself",
    )  # fmt: skip


def _stored(run: Path, touch: TouchSet) -> tuple[Table, Table, str, list[str]]:
    if touch.kind == "camera":
        raise BadInput("recordings of an array beside --run", "cameras, whose runs scale features",
                       "leave --run out")  # fmt: skip
    try:
        contract = Fields(read_json(run / "run.json"), "run.json").fields("contract")
        scaling = contract.fields("scaling")
        offset, factor = scaling.array("offset", (None,)), scaling.array("factor", (None,))
        kind = scaling.text("kind")
        known = list(contract.numbers("accuracy"))  # splits of its cross-validation, refitted
    except (OSError, ValueError) as error:  # BadFile is a ValueError
        raise BadInput("a run's folder for --run", f"{run}, which holds none",
                       "train one with: taxel train") from error  # fmt: skip
    if offset.shape != (len(touch.views),):
        raise BadInput(f"a run of {number_of(len(touch.views), 'channel')}",
                       f"one of {offset.size} in {run}",
                       "name a run of these recordings and of all their channels")  # fmt: skip
    return offset, factor, kind, known


def _figures(touch: TouchSet, trials: NDArray[np.intp]) -> tuple[Table, Table]:
    """Return mean and deviation of each channel over some trials' rows."""
    count = sum(len(touch.rows[i]) for i in trials)
    sums = sum(touch.rows[i].sum(axis=0, dtype=np.float64) for i in trials)
    mean = np.asarray(sums / count)
    squares = sum(((touch.rows[i] - mean) ** 2).sum(axis=0) for i in trials)
    return mean, np.sqrt(np.asarray(squares / count))


def _over_scans(scans: Sequence[Table]) -> tuple[Table, Table]:
    """Return mean and deviation of each channel over all scans of some recordings."""
    if not scans:
        return np.zeros(0), np.zeros(0)
    count, total, squares = np.sum(scans, axis=0)
    mean = total / np.maximum(count, 1.0)
    return mean, np.sqrt(np.maximum(squares / np.maximum(count, 1.0) - mean**2, 0.0))


def _standard(touch: TouchSet, trials: NDArray[np.intp], files: bool = False) -> bool:
    """Return whether some trials' rows, or their files' scans, have mean 0 and deviation 1."""
    names = {touch.trials[i].recording for i in trials} & touch.scans.keys() if files else set()
    return _plain(*_figures(touch, trials)) or _plain(
        *_over_scans([touch.scans[name] for name in names]))  # fmt: skip


def _plain(offset: Table, spread: Table) -> bool:
    """Return whether most channels have mean 0 and deviation 1."""
    alive = spread > 0
    plain = (np.abs(offset) < _NEAR) & (np.abs(spread - 1.0) < _NEAR) & alive
    return bool(len(alive) and plain.sum() >= max(min(2, len(alive)), _MOST * alive.sum()))


def _distance(case: Case, offset: Table, factor: Table, which: NDArray[np.intp]) -> float:
    """Return how far a scaling is from that of some pieces, or of their whole trials: deviations.

    The median over channels; the lesser of the two, since a run may have had other windows.
    """
    pieces, touch = case.pieces, case.touch
    rows = [touch.rows[pieces.trial[i]][pieces.first[i] : pieces.stop[i]] for i in which]
    cut = np.concatenate(rows).astype(np.float64)
    whole = _figures(touch, np.unique(pieces.trial[which]))
    found = []
    for mean, spread in ((cut.mean(axis=0), cut.std(axis=0)), whole):
        alive = spread > 0
        off = np.abs(offset - mean)[alive] / spread[alive]
        change = np.abs(factor[alive] * spread[alive] - 1.0)
        found.append(float(np.median(np.maximum(off, change))))
    return min(found)


def _near_neighbours(case: Case) -> tuple[float, float, float]:
    """Return a neighbour rule's accuracy scaled within the fold and outside, and the majority."""
    touch = case.touch
    features = np.stack([np.concatenate([r.mean(axis=0), r.std(axis=0)]) for r in touch.rows])
    y = touch.y
    inner = outer = total = 0
    for train, test in case.folds:
        for where in (train, np.arange(len(y))):
            mean, spread = features[where].mean(axis=0), features[where].std(axis=0)
            scaled = (features - mean) / np.where(spread > 0, spread, 1.0)
            rule = KNeighborsClassifier(min(5, len(train))).fit(scaled[train], y[train])
            right = int((rule.predict(scaled[test]) == y[test]).sum())
            if where is train:
                inner += right
            else:
                outer += right
        total += len(test)
    return inner / total, outer / total, majority(y, case.folds)
