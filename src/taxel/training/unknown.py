"""Learn what is usual, so that the rest can be called unknown.

No network takes part: densities of touch statistics, fitted a label at a time, and
calibrated on sessions that their fit has not seen. Knows nothing about screens, files
or networks (docs/decisions/0027).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taxel.decisions.unknown import (
    SMALLEST,
    Density,
    NoveltyTest,
    Unknown,
    summaries,
)
from taxel.errors import BadDataset
from taxel.labels.joined import parts_of
from taxel.labels.trials import coarsest_group
from taxel.plain_text import number_of
from taxel.windows.dataset import Dataset
from taxel.windows.scaling import Scaling

REJECTED = 0.05
"""Share of known touch that may be called unknown, 0…1: 95 % are answered. Source: our choice."""
PARTS = 6
"""Parts of the sessions, of which each calibrates what the others fit. Source: our choice."""
COUNTS = (1, 2, 4, 8, 16)
"""Windows of a contact at which its mean is calibrated. Source: our choice, 0027."""
LEAST_VARIANCE = 0.1
"""A direction is used where the classes' means vary at least this much, as a share of the
variance within a class: below it, it separates nothing and only adds noise. Source: 0027."""
_KEPT = 999
"""Calibration scores kept at the most, unless the test needs more: p in steps of a thousandth."""
_RIDGE = 0.05
"""Share of an even scatter in the covariance, so that it can be inverted. Source: our choice."""
_STILL = 1e-6
"""Least variance and change of a channel that stood still in training, in units of its level's
own wander; any other channel's are measured by its own. Source: our choice."""
_LEAST_SPREAD = 0.02
"""Spread of a summary, a logarithm, that is as good as none: 2 %. What never varied in training
must not be magnified. Source: our choice."""
_LONG = 64
"""From so many rows on, change is measured over 4 rows, as TouchNet does (0011), else over 1."""


def fit_unknown(
    dataset: Dataset,
    target: str,
    scaling: Scaling,
    rejected: float = REJECTED,
    trials: NDArray[np.bool_] | None = None,
) -> Unknown:
    """Return the test for touch that is unlike all that a data set holds.

    Args:
        dataset: Windows to learn from.
        target: The label that is predicted; several joined by "+" are judged each.
        scaling: The bundle's own.
        rejected: Share of known touch that may be called unknown, 0…1.
        trials: Which trials may be used, shape (trials,); all unless given.

    Raises:
        BadDataset: There are too few groups, windows or contacts to calibrate on.
    """
    used = np.ones(len(dataset.trials), bool) if trials is None else trials
    mine = np.flatnonzero(used[dataset.trial])
    windows, tested = dataset.windows[mine], dataset.tested(mine)
    values, mask = scaling.apply(windows.values, windows.mask), windows.mask
    held_out = scaling.apply(tested.values, tested.mask)
    owner = dataset.trial[mine]
    labels = {part: np.array([trial.labels[part] for trial in dataset.trials])[owner]
              for part in parts_of(target, (trial.labels for trial in dataset.trials))}  # fmt: skip
    part = _parts(dataset, target, used)[owner]
    scored: list[tuple[NDArray[np.intp], NDArray[np.float64]]] = []
    for number in np.unique(part):
        rest = part != number
        if not all(set(own[rest]) == set(own) for own in labels.values()):
            continue
        test = NoveltyTest(_fit(values[rest], mask[rest], _of(labels, rest), rejected))
        out = np.flatnonzero(~rest)
        scored.append((out, np.array([test.of_window(held_out[i][mask[i]]) for i in out])))
    needed = _least_scores(len(labels), rejected)
    index = np.concatenate([np.zeros(0, np.intp), *(part for part, _ in scored)])
    check_enough(len(set(owner[index])), len(labels), rejected)
    order = np.argsort(index)  # windows of a trial come in their order
    scores = np.concatenate([part for _, part in scored])[order]
    whole = _fit(values, mask, labels, rejected)
    return _calibrated(whole, scores, owner[index[order]], needed)


def _of(
    labels: dict[str, NDArray[np.str_]], rows: NDArray[np.bool_]
) -> dict[str, NDArray[np.str_]]:
    return {name: own[rows] for name, own in labels.items()}


def _least_scores(labels: int, rejected: float) -> int:
    """Return how many known scores let the least p of so many labels reach `rejected`."""
    needed = max(1, int(np.ceil(labels / rejected)) - 1)
    # The same sum as the test's own, for rounding must not keep it from firing.
    return needed + (labels * (1 / (1 + needed)) > rejected)


def check_enough(contacts: int, labels: int, rejected: float) -> None:
    """Refuse fewer contacts than the share needs; say which share they would do for.

    Args:
        contacts: That could be held out.
        labels: That are judged, each by itself.
        rejected: Share of known touch that may be called unknown, 0…1.

    Raises:
        BadDataset: There are too few.
    """
    needed = _least_scores(labels, rejected)
    if contacts < needed:
        each = (percent / 100 for percent in range(1, 51))
        share = next(
            (candidate for candidate in each if _least_scores(labels, candidate) <= contacts), None
        )
        raise BadDataset(
            f"at least {number_of(needed, 'contact')} in sessions held out, to call "
            f"{rejected:g} of them unknown",
            f"{contacts}",
            "record each class in more sessions"
            + (f", or let {share:g} of known touch be rejected (--reject-novel)" if share else ""),
        )


def _parts(dataset: Dataset, target: str, used: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return each trial's part, shape (trials,): whole sessions, or files where there are none."""
    key = coarsest_group([dataset.trials[i] for i in np.flatnonzero(used)])
    names = np.array([trial.groups.get(key, "") for trial in dataset.trials])
    parts = parts_of(target, (trial.labels for trial in dataset.trials))
    classes = [tuple(trial.labels[part] for part in parts) for trial in dataset.trials]
    first = dict(zip(names[::-1], classes[::-1], strict=True))
    ordered = sorted(set(names[used]), key=lambda name: (first[name], name))
    part = {name: number % PARTS for number, name in enumerate(ordered)}
    return np.array([part.get(name, 0) for name in names], np.intp)


def _fit(
    values: NDArray[np.float32],
    mask: NDArray[np.bool_],
    labels: dict[str, NDArray[np.str_]],
    rejected: float,
) -> Unknown:
    """Return the densities of windows, not calibrated yet."""
    lag = 4 if values.shape[1] >= _LONG else 1
    rows = [window[own].astype(float) for window, own in zip(values, mask, strict=True)]
    means = np.array([row.mean(axis=0) for row in rows])
    level = np.median(means, axis=0)
    wander = np.abs(means - level).mean(axis=0)
    least = np.minimum(1e-9, 1e-6 * wander)  # signals may be as small
    wander = wander + np.where(least > 0, least, 1e-9)
    variance = np.median([row.var(axis=0) for row in rows], axis=0) / wander**2
    changes = [np.abs(row[lag:] - row[:-lag]).mean(axis=0) for row in rows if len(row) > lag]
    change = np.median(changes, axis=0) / wander if changes else np.zeros_like(wander)
    bare = Unknown(
        rejected=rejected,
        lag=lag,
        level=level,
        wander=wander,
        least=np.stack([_least(SMALLEST**2 * variance), _least(SMALLEST * change)]),
        densities=(),
    )
    summed = summaries(bare, values, mask)
    return replace(
        bare, densities=tuple(_density(name, summed, own) for name, own in labels.items())
    )


def _least(usual: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(usual > 0, usual, _STILL)


def _density(label: str, summed: NDArray[np.float64], classes: NDArray[np.str_]) -> Density:
    """Return a Gaussian about each class in the directions that tell the classes apart."""
    names, y, count = np.unique(classes, return_inverse=True, return_counts=True)
    share = count / count.sum()
    middle, scale = summed.mean(axis=0), np.maximum(summed.std(axis=0), _LEAST_SPREAD)
    whole = (summed - middle) / scale
    means = np.stack([whole[y == number].mean(axis=0) for number in range(len(names))])
    apart = whole - means[y]
    scatter = apart.T @ apart / len(apart)
    even = np.trace(scatter) / len(scatter)
    size, axes = np.linalg.eigh((1 - _RIDGE) * scatter + _RIDGE * even * np.eye(len(scatter)))
    whiten = axes / np.sqrt(size)
    between = (means - share @ means) @ whiten * np.sqrt(share)[:, None]
    _, spread, directions = np.linalg.svd(between, full_matrices=False)
    kept = min(max(1, int((spread**2 >= LEAST_VARIANCE).sum())), max(1, len(names) - 1))
    onto = whiten @ directions[:kept].T
    projection = onto / scale[:, None]
    # `of_window` takes no middle away: the centres hold it.
    return Density(
        label=label,
        projection=projection,
        centres=means @ onto + middle @ projection,
        log_share=np.log(share),
        windows=np.zeros(0),
        contacts={},
    )


def _calibrated(
    whole: Unknown, scores: NDArray[np.float64], owner: NDArray[np.intp], needed: int
) -> Unknown:
    """Return the test with the novelty scores of known windows and contacts, `needed` or more."""
    starts = [scores[owner == grasp] for grasp in np.unique(owner)]
    densities = []
    for number, density in enumerate(whole.densities):
        contacts = {}
        for count in COUNTS:
            means = [own[:count, number].mean() for own in starts if len(own) >= count]
            if len(means) >= needed:
                contacts[count] = _thinned(np.array(means), needed)
        known = _thinned(scores[:, number], needed)
        densities.append(replace(density, windows=known, contacts=contacts))
    return replace(whole, densities=tuple(densities))


def _thinned(scores: NDArray[np.float64], needed: int) -> NDArray[np.float64]:
    """Return the scores sorted; of many, evenly spaced ones, each the larger of two."""
    scores, kept = np.sort(scores), max(_KEPT, needed)
    if len(scores) <= kept:
        return scores
    place = np.ceil(np.arange(1, kept + 1) / (kept + 1) * (len(scores) + 1)).astype(int) - 1
    return np.asarray(scores[place])
