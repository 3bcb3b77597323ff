"""How well is the unknown told from the known: AUROC, false rejection, coverage against accuracy.

Known objects of groups held out, such as sessions, against objects that were never
learned; trivial scores beside. Knows nothing about screens.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import roc_auc_score
from sklearn.neighbors import NearestNeighbors

from taxel.decisions.unknown import Strangeness
from taxel.errors import BadDataset, BadInput
from taxel.evaluation.crossval import Job, fit_model
from taxel.evaluation.metrics import by_trial
from taxel.evaluation.splits import TrialFold, by_group
from taxel.labels.trials import coarsest_group
from taxel.training.loop import TrainConfig
from taxel.training.unknown import REJECTED, fit_unknown
from taxel.windows.dataset import Dataset

OURS = "density"
"""The score that a bundle carries (docs/decisions/0027); the others are there to compare."""
SCORES = (OURS, "max softmax", "weak touch", "unusual level", "1-NN on raw windows")
"""1 − largest probability; minus the mean of all values; its distance from the training part's;
distance to the nearest training window."""
COVERAGES = (1.0, 0.95, 0.9, 0.8, 0.7, 0.5)
"""Shares of known touch that are answered, of which the accuracy is told."""
RESAMPLES = 200
"""Bootstrap resamples of whole groups. Source: our choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UnknownConfig:
    """What to run."""

    target: str
    model: str
    """Whose answers the coverage curve counts, and whose largest probability is a score."""
    train: TrainConfig = field(default_factory=TrainConfig)
    group: str | None = None
    """What is held out as a whole, such as "file"; None takes sessions where there are some."""
    folds: int = 6
    """Parts of the known groups; with no more groups than parts each is held out once."""
    rejected: float = REJECTED
    """Share of known touch that may be called unknown, 0…1."""
    seed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Auroc:
    """How well one score tells one kind of unknown object from the known."""

    score: str
    kind: str
    """What was not learned, such as "prism"."""
    windows: float
    """Area under the ROC curve over windows, 0…1."""
    grasps: float
    """The same over trials, a trial's windows joined."""
    interval: tuple[float, float]
    """95 % of `grasps`, whole groups resampled; NaN for the scores beside ours."""
    found_windows: float
    """Share of the unknown windows that are told to be so, 0…1; NaN beside ours."""
    found_grasps: float
    """The same of trials."""
    unknown_windows: int
    unknown_grasps: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """Accuracy over the known touch that is answered, by how much of it is."""

    score: str
    windows: tuple[float, ...]
    """One a coverage of `COVERAGES`."""
    grasps: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class UnknownResult:
    """One target's figures."""

    target: str
    split: str
    groups: int
    known_windows: int
    known_grasps: int
    rejected_windows: float
    """Share of the known windows in held-out groups that are called unknown, 0…1."""
    rejected_grasps: float
    """The same of trials."""
    rejected_by_class: dict[str, float]
    """Class → share of its known trials that are called unknown."""
    aurocs: tuple[Auroc, ...]
    curves: tuple[Curve, ...]
    majority: Curve
    """Share of the commonest class among what `OURS` lets be answered: what `curves` must beat."""

    def auroc(self, kind: str, score: str = OURS) -> Auroc:
        """Return one kind's figures by one score."""
        return next(one for one in self.aurocs if (one.kind, one.score) == (kind, score))


@dataclass(frozen=True, slots=True)
class _Scored:
    """Test windows, or trials, of all folds."""

    index: NDArray[np.intp]
    """Which it is, shape (n,): what no fold learns may be tested in several."""
    kind: NDArray[np.str_]
    """Shape (n,): empty for the known."""
    group: NDArray[np.str_]
    scores: dict[str, NDArray[np.float64]]
    """Score → the larger the stranger, shape (n,)."""
    told_unknown: NDArray[np.bool_]
    truth: NDArray[np.str_]
    answer: NDArray[np.str_]


def kinds_of(dataset: Dataset, target: str, never: Sequence[str]) -> NDArray[np.str_]:
    """Return what is not learned about each trial, shape (trials,): empty for the known.

    A trial that is unknown only by a label that is not told is marked "-": neither known nor
    unknown (a rubber cylinder, to one who tells shapes).

    Args:
        dataset: Its trials.
        target: The label that is told; several joined by "+".
        never: Values that are not learned, of any label.
    """
    found = []
    for trial in dataset.trials:
        mine = [trial.labels[part] for part in target.split("+")]
        hit = [value for value in mine if value in never]
        others = [value for key, value in trial.labels.items()
                  if "+" not in key and value in never and value not in mine]  # fmt: skip
        found.append("-" if others else "+".join(hit))
    return np.array(found)


def find_unknown(
    dataset: Dataset,
    kinds: NDArray[np.str_],
    config: UnknownConfig,
    on_step: Callable[[str], None] = lambda _: None,
) -> UnknownResult:
    """Train on known objects, test on known and unknown ones in groups held out.

    Args:
        dataset: Known and unknown trials.
        kinds: As `kinds_of` gives them.
        config: What to run.
        on_step: Called with a line after each fold.

    Raises:
        BadDataset: There are no unknown trials, or too few known ones.
    """
    if not np.any((kinds != "") & (kinds != "-")):
        raise BadDataset("trials that are not learned", "none", "name values that the labels have")
    known = _subset(dataset, kinds == "")
    key = config.group or coarsest_group(known.trials)
    split = by_group(known, config.target, key, config.folds, config.seed)
    windows, grasps = [], []
    for number, fold in enumerate(split.folds, 1):
        assert isinstance(fold, TrialFold)
        one = _one_fold(dataset, np.flatnonzero(kinds == ""), kinds, fold, key, config)
        windows.append(one[0])
        grasps.append(one[1])
        on_step(f"{config.target} · {fold.name} ({number} of {len(split.folds)})")
    return _result(config, split.name, _join(windows), _join(grasps))


def leave_each_out(
    dataset: Dataset, config: UnknownConfig, on_step: Callable[[str], None] = lambda _: None
) -> tuple[dict[str, UnknownResult], dict[str, str]]:
    """Leave each class out of the training in turn.

    Returns:
        Class → how well it is found unknown, and class → why that could not be measured.

    Raises:
        BadInput: There are fewer than three classes, or none can be left out.
    """
    classes = dataset.classes(config.target)
    if len(classes) < 3:
        raise BadDataset(
            "at least three classes, so that two are left to learn", f"{len(classes)}",
            "name values that are never learned instead",
        )  # fmt: skip
    found: dict[str, UnknownResult] = {}
    refused: dict[str, str] = {}
    for name in classes:
        kinds = kinds_of(dataset, config.target, [name])
        try:
            found[name] = find_unknown(
                dataset, kinds, config,
                lambda line, name=name: on_step(f"without {name} · {line}"),  # type: ignore[misc]
            )  # fmt: skip
        except BadInput as error:
            if len(refused) == len(classes) - 1:
                raise
            refused[name] = str(error)
    return found, refused


def _subset(dataset: Dataset, trials: NDArray[np.bool_]) -> Dataset:
    index = np.cumsum(trials) - 1
    kept = trials[dataset.trial]
    return replace(
        dataset,
        windows=dataset.windows[kept],
        trial=index[dataset.trial[kept]].astype(np.intp),
        trials=tuple(one for one, own in zip(dataset.trials, trials, strict=True) if own),
    )


def _one_fold(
    dataset: Dataset,
    known: NDArray[np.intp],
    kinds: NDArray[np.str_],
    fold: TrialFold,
    key: str,
    config: UnknownConfig,
) -> tuple[_Scored, _Scored]:
    """Fit on a fold's known trials; score its known test trials and the unknown of other groups."""
    groups = dataset.group(key)
    training = np.zeros(len(dataset.trials), bool)
    training[known[sorted(fold.train)]] = True
    tested = np.zeros(len(dataset.trials), bool)
    tested[known[sorted(fold.test)]] = True
    unknown = (kinds != "") & (kinds != "-")
    tested |= unknown & ~np.isin(groups, groups[training])
    labels = np.array([trial.labels[config.target] for trial in dataset.trials])
    classes = sorted(set(labels[training]))
    train, test = (np.flatnonzero(own[dataset.trial]) for own in (training, tested))
    y = np.searchsorted(classes, labels[dataset.trial[train]])
    job = Job(model=config.model, target=config.target, train=config.train)
    learned, windows = dataset.windows[train], dataset.windows[test]
    fitted = fit_model(learned, y, len(classes), dataset.sensor.full_scale, job)
    p = fitted.probabilities(windows.values, windows.mask)
    scaled = fitted.scaling.apply(windows.values, windows.mask)
    test_of = Strangeness(
        fit_unknown(dataset, config.target, fitted.scaling, config.rejected, training)
    )
    strange = np.array([
        test_of.of_window(one[own]) for one, own in zip(scaled, windows.mask, strict=True)
    ])  # fmt: skip
    p_window = np.array([test_of.p_window(own) for own in strange.tolist()])
    owner = dataset.trial[test]
    trial, _, joined = by_trial(owner, np.zeros(len(owner), np.intp), p)
    means, counts = _means(strange, owner)
    p_grasp = np.array([
        test_of.p_contact(own, int(n)) for own, n in zip(means.tolist(), counts, strict=True)
    ])  # fmt: skip
    trivial = _trivial(fitted.scaling.apply(learned.values, learned.mask), scaled)
    names = np.array(classes)
    each = [
        _Scored(
            index=index,
            kind=kinds[rows],
            group=groups[rows],
            scores={
                OURS: _ranked(p_known, own_strange),
                "max softmax": 1.0 - probability.max(axis=1),
                **own_trivial,
            },
            told_unknown=p_known <= config.rejected,
            truth=labels[rows],
            answer=names[probability.argmax(axis=1)],
        )
        for index, rows, p_known, own_strange, probability, own_trivial in (
            (test, owner, p_window, strange, p, trivial),
            (trial, trial, p_grasp, means, joined,
             {name: _means(own[:, None], owner)[0][:, 0] for name, own in trivial.items()}),
        )
    ]  # fmt: skip
    return each[0], each[1]


def _ranked(p: NDArray[np.float64], strange: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what a user is told, p, as a score; where p has come to its end, by strangeness."""
    return np.asarray(-p + 1e-9 * np.clip(strange.max(axis=1), -1e4, 1e4))


def _means(
    values: NDArray[np.float64], owner: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return the mean over each trial's windows, trials in order, and their numbers."""
    _, index, count = np.unique(owner, return_inverse=True, return_counts=True)
    total = np.zeros((len(count), values.shape[1]))
    np.add.at(total, index, values)
    return total / count[:, None], count.astype(np.intp)


def _trivial(
    train: NDArray[np.float32], test: NDArray[np.float32]
) -> dict[str, NDArray[np.float64]]:
    """Return the scores that need no learning, each of shape (n,)."""
    level = test.mean(axis=(1, 2), dtype=float)
    usual = train.mean(axis=(1, 2), dtype=float)
    near = NearestNeighbors(n_neighbors=1).fit(train.reshape(len(train), -1))
    distance, _ = near.kneighbors(test.reshape(len(test), -1))
    return {
        "weak touch": -level,
        "unusual level": np.abs(level - usual.mean()),
        "1-NN on raw windows": np.asarray(distance[:, 0], float),
    }


def _join(parts: list[_Scored]) -> _Scored:
    return _Scored(
        np.concatenate([one.index for one in parts]),
        np.concatenate([one.kind for one in parts]),
        np.concatenate([one.group for one in parts]),
        {name: np.concatenate([one.scores[name] for one in parts]) for name in SCORES},
        np.concatenate([one.told_unknown for one in parts]),
        np.concatenate([one.truth for one in parts]),
        np.concatenate([one.answer for one in parts]),
    )


def _result(config: UnknownConfig, split: str, windows: _Scored, grasps: _Scored) -> UnknownResult:
    known = grasps.kind == ""
    return UnknownResult(
        target=config.target,
        split=split,
        groups=len(set(grasps.group[known])),
        known_windows=int((windows.kind == "").sum()),
        known_grasps=int(known.sum()),
        rejected_windows=float(windows.told_unknown[windows.kind == ""].mean()),
        rejected_grasps=float(grasps.told_unknown[known].mean()),
        rejected_by_class={
            str(name): float(grasps.told_unknown[known & (grasps.truth == name)].mean())
            for name in sorted(set(grasps.truth[known]))
        },
        aurocs=tuple(
            _auroc(name, kind, windows, grasps)
            for kind in sorted(set(grasps.kind) - {""})
            for name in SCORES
        ),
        curves=tuple(
            Curve(score=name, windows=_curve(windows, name), grasps=_curve(grasps, name))
            for name in (OURS, "max softmax")
        ),
        majority=Curve(score=OURS, windows=_commonest(windows), grasps=_commonest(grasps)),
    )


def _auroc(score: str, kind: str, windows: _Scored, grasps: _Scored) -> Auroc:
    told = [
        float(own.told_unknown[own.kind == kind].mean()) if score == OURS else float("nan")
        for own in (windows, grasps)
    ]
    return Auroc(
        score=score,
        kind=kind,
        windows=_area(windows, score, kind),
        grasps=_area(grasps, score, kind),
        interval=_interval(grasps, score, kind) if score == OURS else (np.nan, np.nan),
        found_windows=told[0],
        found_grasps=told[1],
        unknown_windows=len(set(windows.index[windows.kind == kind])),
        unknown_grasps=len(set(grasps.index[grasps.kind == kind])),
    )


def _area(one: _Scored, score: str, kind: str) -> float:
    part = (one.kind == "") | (one.kind == kind)
    return float(roc_auc_score(one.kind[part] == kind, one.scores[score][part]))


def _interval(one: _Scored, score: str, kind: str) -> tuple[float, float]:
    """Return a 95 % interval by resampling whole groups; NaN where there are too few."""
    part = (one.kind == "") | (one.kind == kind)
    names, group = np.unique(one.group[part], return_inverse=True)
    truth, value = one.kind[part] == kind, one.scores[score][part]
    rows = [np.flatnonzero(group == number) for number in range(len(names))]
    rng = np.random.default_rng(0)
    areas = []
    for _ in range(RESAMPLES):
        drawn = np.concatenate([rows[i] for i in rng.integers(0, len(names), len(names))])
        if 0 < truth[drawn].sum() < len(drawn):
            areas.append(roc_auc_score(truth[drawn], value[drawn]))
    if len(names) < 2 or not areas:
        return float("nan"), float("nan")
    low, high = np.percentile(areas, [2.5, 97.5])
    return float(low), float(high)


def _curve(one: _Scored, score: str) -> tuple[float, ...]:
    """Return the accuracy over the least strange shares of the known."""
    right = one.answer == one.truth
    return tuple(float(right[rows].mean()) for rows in _answered(one, score))


def _commonest(one: _Scored) -> tuple[float, ...]:
    """Return the share of the commonest class among them."""
    _, classes = np.unique(one.truth, return_inverse=True)
    return tuple(
        float(np.bincount(classes[rows]).max() / len(rows)) for rows in _answered(one, OURS)
    )


def _answered(one: _Scored, score: str) -> list[NDArray[np.intp]]:
    """Return the rows of the known that are answered, the least strange, one a coverage."""
    known = np.flatnonzero(one.kind == "")
    order = known[np.argsort(one.scores[score][known], kind="stable")]
    return [order[: max(1, round(share * len(order)))] for share in COVERAGES]
