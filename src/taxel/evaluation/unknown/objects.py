"""How well unknown is distinguished from known: trained, tested and scored fold by fold.

Known objects of groups held out, such as sessions, against objects that were never
learned; trivial scores beside. Knows nothing about screens.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from sklearn.neighbors import NearestNeighbors

from taxel.decisions.unknown import NoveltyTest
from taxel.errors import BadDataset, BadInput
from taxel.evaluation.metrics import by_trial
from taxel.evaluation.splits import TrialFold, by_group
from taxel.evaluation.unknown.scores import OURS, Scored, UnknownResult, join_scored, result_of
from taxel.labels.joined import parts_of
from taxel.labels.trials import coarsest_group
from taxel.training.fitting import Job, TrainingSet, fit_model
from taxel.training.loop import TrainConfig
from taxel.training.unknown import REJECTED, fit_unknown
from taxel.windows.dataset import Dataset


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


def kinds_of(dataset: Dataset, target: str, never: Sequence[str]) -> NDArray[np.str_]:
    """Return what is not learned about each trial, shape (trials,): empty for the known.

    A trial that is unknown only by a label that is not predicted is marked "-": neither known nor
    unknown (a rubber cylinder, where shapes are predicted).

    Args:
        dataset: Its trials.
        target: The label that is predicted; several joined by "+".
        never: Values that are not learned, of any label.
    """
    found = []
    parts = parts_of(target, (trial.labels for trial in dataset.trials))
    for trial in dataset.trials:
        mine = [trial.labels[part] for part in parts]
        hit = [value for value in mine if value in never]
        others = [value for key, value in trial.labels.items()
                  if key != target and value in never and value not in mine]  # fmt: skip
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
        kinds: Of each trial, shape (trials,), as `kinds_of` gives them.
        config: What to run.
        on_step: Called with a line after each fold.

    Raises:
        BadDataset: There are no unknown trials, or too few known ones.
    """
    if not np.any((kinds != "") & (kinds != "-")):
        raise BadDataset("trials that are not learned", "none", "name values that the labels have")
    known = dataset.only_trials(np.flatnonzero(kinds == "").tolist())
    if (left := len(known.classes(config.target))) < 2:
        raise BadDataset("two or more classes to learn", f"{left}", "name fewer with --never")
    key = config.group or coarsest_group(known.trials)
    split = by_group(known, config.target, key, config.folds, config.seed)
    windows, grasps = [], []
    for number, fold in enumerate(split.trial_folds, 1):
        result = _one_fold(dataset, np.flatnonzero(kinds == ""), kinds, fold, key, config)
        windows.append(result[0])
        grasps.append(result[1])
        on_step(f"{config.target} · {fold.name} ({number} of {len(split.folds)})")
    return result_of(config.target, split.name, join_scored(windows), join_scored(grasps))


def leave_each_out(
    dataset: Dataset, config: UnknownConfig, on_step: Callable[[str], None] = lambda _: None
) -> tuple[dict[str, UnknownResult], dict[str, str]]:
    """Leave each class out of the training in turn.

    Returns:
        Class → how well it is found unknown, and class → why that could not be measured.

    Raises:
        BadDataset: There are fewer than three classes.
        BadInput: None of them can be left out.
    """
    classes = dataset.classes(config.target)
    if len(classes) < 3:
        raise BadDataset(
            "at least three classes, so that two are left to learn", f"{len(classes)}",
            "name values that are never learned instead",
        )  # fmt: skip
    results: dict[str, UnknownResult] = {}
    refused: dict[str, str] = {}
    for name in classes:
        kinds = kinds_of(dataset, config.target, [name])

        def say(line: str, name: str = name) -> None:
            on_step(f"without {name} · {line}")

        try:
            results[name] = find_unknown(dataset, kinds, config, say)
        except BadInput as error:
            if len(refused) == len(classes) - 1:
                raise
            refused[name] = str(error)
    return results, refused


def _one_fold(
    dataset: Dataset,
    known: NDArray[np.intp],
    kinds: NDArray[np.str_],
    fold: TrialFold,
    key: str,
    config: UnknownConfig,
) -> tuple[Scored, Scored]:
    """Fit on a fold's known trials; score its known test trials and the unknown of other groups."""
    groups = dataset.group(key)
    training, tested = _sides(known, kinds, fold, groups)
    labels = np.array([trial.labels[config.target] for trial in dataset.trials])
    classes = sorted(set(labels[training]))
    train, test = (np.flatnonzero(own[dataset.trial]) for own in (training, tested))
    y = np.searchsorted(classes, labels[dataset.trial[train]])
    job = Job(model=config.model, target=config.target, train=config.train)
    learned, windows = dataset.windows[train], dataset.tested(test)
    fitted = fit_model(TrainingSet(learned, y, len(classes), dataset.sensor.full_scale), job)
    p = fitted.probabilities(windows.values, windows.mask)
    scaled = fitted.scaling.apply(windows.values, windows.mask)
    test_of = NoveltyTest(
        fit_unknown(dataset, config.target, fitted.scaling, config.rejected, training)
    )
    novelty = np.array([
        test_of.of_window(window[own]) for window, own in zip(scaled, windows.mask, strict=True)
    ])  # fmt: skip
    p_window = np.array([test_of.p_window(own) for own in novelty.tolist()])
    owner = dataset.trial[test]
    trial, _, joined = by_trial(owner, np.zeros(len(owner), np.intp), p)
    means, counts = _means(novelty, owner)
    p_grasp = np.array([
        test_of.p_contact(own, int(n)) for own, n in zip(means.tolist(), counts, strict=True)
    ])  # fmt: skip
    trivial = _trivial(
        fitted.scaling.apply(learned.values, learned.mask), scaled, learned.mask, windows.mask
    )
    names = np.array(classes)

    def scored(
        index: NDArray[np.intp],
        rows: NDArray[np.intp],
        by_us: tuple[NDArray[np.float64], NDArray[np.float64]],
        probability: NDArray[np.float64],
        others: dict[str, NDArray[np.float64]],
    ) -> Scored:
        """Put together windows or grasps; `rows` are their trials, `by_us` p and novelty."""
        return Scored(
            index=index,
            kind=kinds[rows],
            group=groups[rows],
            scores={OURS: _ranked(*by_us), "max softmax": 1.0 - probability.max(axis=1), **others},
            rejected=by_us[0] <= config.rejected,
            truth=labels[rows],
            answer=names[probability.argmax(axis=1)],
        )

    by_grasp = {name: _means(own[:, None], owner)[0][:, 0] for name, own in trivial.items()}
    return (
        scored(test, owner, (p_window, novelty), p, trivial),
        scored(trial, trial, (p_grasp, means), joined, by_grasp),
    )


def _sides(
    known: NDArray[np.intp], kinds: NDArray[np.str_], fold: TrialFold, groups: NDArray[np.str_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which trials are learned from, and which are tested, each of shape (trials,)."""
    training, tested = np.zeros(len(kinds), bool), np.zeros(len(kinds), bool)
    training[known[sorted(fold.train)]] = True
    tested[known[sorted(fold.test)]] = True
    unknown = (kinds != "") & (kinds != "-")
    return training, tested | (unknown & ~np.isin(groups, groups[training]))


def _ranked(p: NDArray[np.float64], novelty: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return p, which a user sees, as a score; at its end, by the novelty score."""
    return np.asarray(-p + 1e-9 * np.clip(novelty.max(axis=1), -1e4, 1e4))


def _means(
    values: NDArray[np.float64], owner: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return the mean over each trial's windows, trials in order, and their numbers."""
    _, index, count = np.unique(owner, return_inverse=True, return_counts=True)
    total = np.zeros((len(count), values.shape[1]))
    np.add.at(total, index, values)
    return total / count[:, None], count.astype(np.intp)


def _trivial(
    train: NDArray[np.float32],
    test: NDArray[np.float32],
    learned: NDArray[np.bool_],
    measured: NDArray[np.bool_],
) -> dict[str, NDArray[np.float64]]:
    """Return the scores that need no learning, each of shape (n,).

    Args:
        train: Scaled windows that were learned from; 0 where padded.
        test: Those to score, likewise.
        learned: Which rows of the former were measured, shape (n, steps).
        measured: The same of the latter.
    """
    level, usual = _level(test, measured), _level(train, learned)
    near = NearestNeighbors(n_neighbors=1).fit(train.reshape(len(train), -1))
    distance, _ = near.kneighbors(test.reshape(len(test), -1))
    return {
        "weak touch": -level,
        "unusual level": np.abs(level - usual.mean()),
        "1-NN on raw windows": np.asarray(distance[:, 0], float),
    }


def _level(values: NDArray[np.float32], mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return each window's mean over channels and measured rows, shape (n,): padding is no 0."""
    if mask.all():
        return np.asarray(values.mean(axis=(1, 2), dtype=float))
    kept = np.where(mask[:, :, None], values, 0.0).sum(axis=(1, 2), dtype=float)
    return np.asarray(kept / (np.maximum(mask.sum(axis=1), 1) * values.shape[2]))
