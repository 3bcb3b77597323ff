"""Tables 1 to 3 of the grasp-transition paper, with the published values beside.

The paper's single split (one cup held out) and every cup held out in turn, and the trivial
baselines on the same windows. Knows nothing about screens.

Source: Zhao, Zheng and Chen, Sensors 2024, 24, 5080, section 5.2.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.stats import binomtest
from sklearn.metrics import balanced_accuracy_score, roc_auc_score
from sklearn.tree import DecisionTreeClassifier

from taxel.evaluation.intervals import Interval, ratio_interval
from taxel.evaluation.splits import TrialFold
from taxel.evaluation.transitions.data import (
    DIFFERENCE,
    CameraSet,
    Judged,
    cup_folds,
    judge_fold,
    trivial_features,
)
from taxel.jobs.running import side_by_side
from taxel.models.transition import (
    FRAMES,
    PUBLISHED_BY_FRAMES,
    TRANSITION_MODELS,
    TransitionModel,
    find_transition,
)
from taxel.training.frames.features import FrameFeatures
from taxel.training.frames.heads import HeadConfig
from taxel.windows.rest import Tare
from taxel.windows.sequence import label_windows

OWN_HEADS = ("lstm", "lstm2", "lstm4", "transformer")
"""Heads tried on our own backbone, so that each table has rows with trained weights."""
LARGEST_DIFFERENCE = "largest difference to first frames in the window"
"""A trivial baseline."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RowPlan:
    """A row of the paper's tables, before it is measured."""

    tables: tuple[int, ...]
    """In which of the paper's tables it stands."""
    model: str
    """backbone+head."""
    frames: int
    """k."""
    published: float | None
    """Accuracy in per cent; None for ours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowScores:
    """Windows of test pours, judged."""

    accuracy: float
    """0…1."""
    interval: tuple[float, float]
    """95 %: binomial over windows for the single split; over cups where each was held out."""
    balanced: float
    """Balanced accuracy, 0…1."""
    auc: float
    """Area under the ROC curve; NaN where a class is absent."""
    windows: int


@dataclass(frozen=True, slots=True, kw_only=True)
class TableRow:
    """A row, measured."""

    plan: RowPlan
    weights: str
    """ImageNet, file:NAME or RANDOM."""
    origin: str
    """Where the weights come from; empty where nothing is known of it."""
    tare: Tare
    """How features were taken against the grasp at rest."""
    parameters: int
    published_ms: float | None
    """Milliseconds a step on the paper's RTX 4090."""
    published_mb: float | None
    size_mb: float
    """Of the network's numbers as 32-bit floats."""
    single: WindowScores
    """The paper's split: the last cup held out."""
    every_cup: WindowScores | None
    """Each cup held out in turn, pooled; None where only the single split was asked for."""
    training_s: float
    """All trainings of this row."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrivialRow:
    """A trivial answer on the same windows."""

    name: str
    single: WindowScores
    every_cup: WindowScores


def plan_rows(backbones: Sequence[str]) -> list[RowPlan]:
    """Return the rows of Tables 1 to 3 for some backbones, each training once.

    Args:
        backbones: Names in `BACKBONES`; the paper's and ours.
    """
    plans = [
        RowPlan(
            tables=_tables_of(model), model=model.name, frames=FRAMES,
            published=model.published.accuracy_percent if model.published else None,
        )
        for model in TRANSITION_MODELS.values() if model.backbone in backbones
    ]  # fmt: skip
    for backbone in ("densenet121", "efficientnet-lite0"):
        if backbone in backbones:
            known = {plan.model for plan in plans}
            plans += [plan for plan in _other_heads(backbone) if plan.model not in known]
            plans += _other_frames(backbone)
    return plans


def _tables_of(model: TransitionModel) -> tuple[int, ...]:
    if model.name == "densenet121+lstm" or model.published is None:
        return (1, 2, 3)
    return (2,) if model.head in ("lstm2", "lstm4") else (1,)


def _other_heads(backbone: str) -> list[RowPlan]:
    return [
        RowPlan(tables=(1,) if head == "transformer" else (2,), model=f"{backbone}+{head}",
                frames=FRAMES, published=None)
        for head in OWN_HEADS
    ]  # fmt: skip


def _other_frames(backbone: str) -> list[RowPlan]:
    """Return the rows of Table 3; what it publishes is of DenseNet121."""
    return [
        RowPlan(tables=(3,), model=f"{backbone}+lstm", frames=frames,
                published=accuracy if backbone == "densenet121" else None)
        for frames, accuracy in PUBLISHED_BY_FRAMES.items() if frames != FRAMES
    ]  # fmt: skip


@dataclass(frozen=True, slots=True)
class BackboneSeen:
    """What one backbone saw in all pours."""

    weights: str
    """Label of its weights."""
    features: list[FrameFeatures]
    """One a pour, in their order."""
    origin: str = ""
    """Where the weights come from; empty where nothing is known of it."""
    tare: Tare | None = None
    """How its features were taken against the grasp at rest; None: as the settings say."""


def measure_rows(
    data: CameraSet,
    seen: Mapping[str, BackboneSeen],
    plans: Sequence[RowPlan],
    base: HeadConfig,
    *,
    every_cup: bool = True,
    on_row: Callable[[str], None] = lambda _: None,
) -> list[TableRow]:
    """Train and judge rows, two side by side.

    Args:
        data: Pours with labels.
        seen: What each backbone saw in the pours, by its name; by its model's name, such as
            resnet50+transformer, where a model has a backbone of its own.
        plans: Which rows.
        base: How heads are trained; head and frames come from the plan.
        every_cup: Also hold out each cup in turn, for rows of `FRAMES` frames.
        on_row: Called with a model's name when it is done.
    """
    folds = cup_folds(data.cups())
    jobs = []
    for plan in plans:
        head = find_transition(plan.model).head
        backbone = _seen_by(plan.model, seen)
        config = replace(base, head=head, frames=plan.frames, tare=backbone.tare or base.tare)
        wanted = folds if every_cup and plan.frames == FRAMES else folds[-1:]
        jobs.append((backbone.features, data.labels, wanted, config, plan.model))
    done = side_by_side(_judge_folds, jobs, lambda result: on_row(result[2]))
    rows = []
    for plan, (judged, seconds, _) in zip(plans, done, strict=True):
        model = find_transition(plan.model)
        backbone = _seen_by(plan.model, seen)
        parameters = model.parameters
        rows.append(
            TableRow(
                plan=plan,
                weights=backbone.weights,
                origin=backbone.origin,
                tare=backbone.tare or base.tare,
                parameters=parameters,
                published_ms=model.published.step_ms if model.published else None,
                published_mb=model.published.size_mb if model.published else None,
                size_mb=parameters * 4 / 2**20,
                single=score_windows(judged[-1:]),
                every_cup=score_windows(judged) if len(judged) > 1 else None,
                training_s=seconds,
            )
        )
    return rows


def _seen_by(model: str, seen: Mapping[str, BackboneSeen]) -> BackboneSeen:
    return seen[model] if model in seen else seen[find_transition(model).backbone]


def _judge_folds(
    features: list[FrameFeatures],
    labels: Sequence[NDArray[np.int8]],
    folds: list[TrialFold],
    config: HeadConfig,
    name: str,
) -> tuple[list[Judged], float, str]:
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    import torch

    torch.set_num_threads(1)
    started = perf_counter()
    judged = [judge_fold(features, labels, fold, config)[0] for fold in folds]
    return judged, perf_counter() - started, name


def trivial_rows(data: CameraSet) -> list[TrivialRow]:
    """Return the trivial baselines: one number a window, thresholds learned on training cups.

    That number is the last frame's. Of the difference there is also the largest of the window's
    frames: a window counts as unstable when one of its frames does.
    """
    folds = cup_folds(data.cups())
    columns = [trivial_features(data, index) for index in range(len(data.pours))]
    known: dict[str, list[NDArray[np.float64]] | None] = {
        name: [column[name][FRAMES - 1 :] for column in columns] for name in columns[0]
    }
    known[LARGEST_DIFFERENCE] = [
        sliding_window_view(column[DIFFERENCE], FRAMES).max(axis=1) for column in columns
    ]
    known["the commonest class"] = None
    rows = []
    for name, values in known.items():
        judged = [_judge_trivial(data, values, fold) for fold in folds]
        rows.append(
            TrivialRow(
                name=name, single=score_windows(judged[-1:]), every_cup=score_windows(judged)
            )
        )
    return rows


def _judge_trivial(
    data: CameraSet, values: list[NDArray[np.float64]] | None, fold: TrialFold
) -> Judged:
    """Judge one number a window by a small tree; without numbers, by the commonest class."""
    rows = (*fold.train_rows, *fold.test_rows)
    labels = {i: label_windows(data.labels[i], FRAMES) for i in rows}
    whole = {i: data.pours[i].whole(FRAMES) for i in rows}
    tested = tuple(labels[i] for i in fold.test_rows)
    wanted = np.concatenate([labels[i][whole[i]] for i in fold.train_rows])
    if values is None or len(np.unique(wanted)) == 1:
        share = float(wanted.mean())
        found = [np.full(len(own), share, np.float32) for own in tested]
    else:
        seen = np.concatenate([values[i][whole[i]] for i in fold.train_rows])[:, None]
        tree = DecisionTreeClassifier(max_depth=3, min_samples_leaf=50).fit(seen, wanted)
        each = [tree.predict_proba(values[i][:, None])[:, 1] for i in fold.test_rows]
        found = [own.astype(np.float32) for own in each]
    judged = (
        np.where(whole[i], p, np.float32(np.nan))
        for i, p in zip(fold.test_rows, found, strict=True)
    )
    return Judged(fold, tuple(judged), tested)


def score_windows(judged: Sequence[Judged]) -> WindowScores:
    """Return the scores of all test windows; the interval is over folds where there are several."""
    pairs = [pair for fold in judged for pair in fold.scored()]
    labels = np.concatenate([label for _, label in pairs])
    found = np.concatenate([probability for probability, _ in pairs])
    right = (found > 0.5) == labels
    if len(judged) == 1:
        band = binomtest(int(right.sum()), len(right)).proportion_ci(0.95, "wilson")
        interval = (float(band.low), float(band.high))
    else:
        interval = _over_folds(judged)
    both = 0 < labels.mean() < 1
    return WindowScores(
        accuracy=float(right.mean()),
        interval=interval,
        balanced=float(balanced_accuracy_score(labels, found > 0.5)) if both else float("nan"),
        auc=float(roc_auc_score(labels, found)) if both else float("nan"),
        windows=len(labels),
    )


def _over_folds(judged: Sequence[Judged]) -> Interval:
    """Return 95 % of the accuracy when cups are drawn again, seeded."""
    right = np.array(
        [
            [
                sum(int(((p > 0.5) == y).sum()) for p, y in fold.scored()),
                sum(len(y) for _, y in fold.scored()),
            ]
            for fold in judged
        ],
        np.float64,
    )
    return ratio_interval(right[:, 0], right[:, 1])
