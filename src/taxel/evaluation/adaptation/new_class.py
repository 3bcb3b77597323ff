"""What learning a new class from a few grasps gives, on sessions held out.

Each class in turn is kept from a network's training; a few grasps of it from one
training session are learned; the held-out session, with all classes, is the test.
Beside it stands the network that trained on all classes with all data. Knows nothing
about screens.

Background of our choices: docs/decisions/0028.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from taxel.evaluation.adaptation.held_sessions import (
    ALL_LAYERS,
    BODY,
    CHOSEN,
    NEAREST,
    SOFTMAX,
    STATISTICS,
    AdaptConfig,
    by_session,
    hold_out,
    predicted,
    renumbered,
    run_of,
    windows_of,
)
from taxel.models.catalogue import find_network
from taxel.training.adapt.last_layer import (
    FeatureKind,
    Solved,
    adapt_last_layer,
    body_of,
    features_of,
    with_last,
)
from taxel.training.exemplars import Exemplars
from taxel.training.loop import Labelled, TrainConfig, fit, new_network
from taxel.training.run import Run

_KINDS: dict[str, FeatureKind] = {CHOSEN: "auto", BODY: "body", STATISTICS: "statistics"}
_STEPS = 40
"""Steps of the softmax's solver (L-BFGS). Source: our choice."""
_WEIGHT_COST = 1e-2
"""Of its squared weights. Source: our choice."""
_REHEARSAL = TrainConfig(epochs=20, learning_rate=2e-3)
"""How all layers are trained on. Source: our choice."""


@dataclass(frozen=True, slots=True)
class GraspsPoint:
    """One new class, learned in one way, tested on one held-out session; shares 0…1."""

    data: str
    target: str
    new_class: str
    session: str
    """Held out."""
    method: str
    grasps: int
    accuracy: float
    """All classes."""
    old: float
    """Windows of the old classes predicted correctly, now that there is one class more."""
    new: float
    """Windows of the new class predicted correctly; NaN where none is above the gate."""
    before: float
    """Windows of the old classes predicted correctly by the network that knew no other."""
    full: float
    """All classes, by the network that trained on all."""
    full_old: float
    """The old classes by it."""
    windows: int
    seconds: float
    """To adapt, one thread."""
    full_seconds: float
    """To train on all classes with all data, one thread."""


def measure_new_class(
    paths: Sequence[Path], config: AdaptConfig, on_step: Callable[[str], None] = lambda _: None
) -> list[GraspsPoint]:
    """Measure learning a new class on data sets with several sessions.

    Raises:
        BadDataset: A data set has fewer than two sessions, or a target fewer than three classes.
    """
    return by_session(_one_session, paths, config, "new class", on_step, classes=3)


def _one_session(path: Path, config: AdaptConfig, target: str, session: str) -> list[GraspsPoint]:
    """Measure with one session held out; runs in a process of its own."""
    torch.set_num_threads(1)
    held = hold_out(path, config, target, session)
    dataset, classes, train, test = held.dataset, held.classes, held.train, held.windows
    started = perf_counter()
    full = run_of(dataset, train, classes, target, config.recipe)
    full_s = perf_counter() - started
    right = predicted(full, test) == test.y
    points = []
    for number, name in enumerate(classes):
        if config.new_classes and name not in config.new_classes:
            continue
        rest = [class_ for class_ in classes if class_ != name]
        old = test.y != number
        body = run_of(dataset, train[train.y != number], rest, target, config.recipe)
        mine = renumbered(test, classes, (*rest, name))
        before = float((predicted(body, mine) == mine.y)[old].mean())
        for grasps in config.grasps:
            new = first_grasps(train[train.y == number], grasps, session, number)
            for method in config.methods if grasps == 5 else (CHOSEN,):
                started = perf_counter()
                adapted = _adapt(body, new, name, method)
                seconds = perf_counter() - started
                good = predicted(adapted, mine) == mine.y
                points.append(
                    GraspsPoint(
                        str(path), target, name, session, method, grasps,
                        float(good.mean()), float(good[old].mean()), _share(good[~old]),
                        before, float(right.mean()), float(right[old].mean()), len(mine),
                        seconds, full_s,
                    )
                )  # fmt: skip
    return points


def _share(good: NDArray[np.bool_]) -> float:
    return float(good.mean()) if len(good) else float("nan")


def first_grasps(own: Exemplars, grasps: int, held_out: str, turn: int) -> Exemplars:
    """Return the first grasps of one training session; which session depends on `turn` alone."""
    names = sorted(set(own.session))
    after = [name for name in names if name > held_out] + [n for n in names if n < held_out]
    there = own[own.session == after[turn % len(after)]]
    _, first = np.unique(there.grasp, return_index=True)
    kept = there.grasp[np.sort(first)][:grasps]
    return there[np.isin(there.grasp, kept)]


def _adapt(run: Run, new: Exemplars, name: str, method: str) -> Run:
    names = [name] * len(new)
    if method in _KINDS:
        return adapt_last_layer(
            run, windows_of(new), names, list(new.grasp), list(new.session),
            features=_KINDS[method],
        ).run  # fmt: skip
    assert run.exemplars is not None
    classes = (*run.contract.classes, name)
    data = Exemplars.join([run.exemplars, replace(new, y=np.full(len(new), len(classes) - 1))])
    contract = replace(run.contract, classes=classes)
    learn = {SOFTMAX: _softmax, NEAREST: _nearest, ALL_LAYERS: _all_layers}[method]
    return replace(
        run, networks=tuple(learn(network, data, run, len(classes)) for network in run.networks),
        contract=contract,
    )  # fmt: skip


def _standard(
    network: nn.Module, data: Exemplars, run: Run
) -> tuple[nn.Module, NDArray[np.float64], NDArray[np.float64]]:
    body = body_of(network, data.values.shape[2], statistics=False)
    x = features_of(body, run.contract.scaling.apply(data.values, data.mask), data.mask)
    return body, x, 1.0 / (x.std(axis=0) + 1e-3)


def _softmax(network: nn.Module, data: Exemplars, run: Run, classes: int) -> nn.Module:
    """The thesis's way: gradient descent on the last layer alone, each class counting alike."""
    body, x, factor = _standard(network, data, run)
    last = nn.Linear(x.shape[1], classes)
    nn.init.zeros_(last.weight)
    nn.init.zeros_(last.bias)
    inputs, y = torch.from_numpy((x * factor).astype(np.float32)), torch.from_numpy(data.y)
    weight = 1.0 / torch.bincount(y, minlength=classes).clamp(min=1).float()
    optimiser = torch.optim.LBFGS(last.parameters(), max_iter=_STEPS, line_search_fn="strong_wolfe")

    def loss() -> torch.Tensor:
        optimiser.zero_grad()
        value = nn.functional.cross_entropy(last(inputs), y, weight=weight)
        value = value + _WEIGHT_COST * (last.weight**2).sum()
        value.backward()  # type: ignore[no-untyped-call]
        return value

    optimiser.step(loss)  # type: ignore[no-untyped-call]
    found = last.weight.detach().double().numpy() * factor
    return with_last(body, Solved(found, last.bias.detach().double().numpy(), 1.0))


def _nearest(network: nn.Module, data: Exemplars, run: Run, classes: int) -> nn.Module:
    """The class whose mean is nearest, each feature by its own deviation."""
    body, x, factor = _standard(network, data, run)
    mean = np.stack([(x * factor)[data.y == number].mean(axis=0) for number in range(classes)])
    return with_last(body, Solved(mean * factor, -0.5 * (mean**2).sum(axis=1), 1.0))


def _all_layers(network: nn.Module, data: Exemplars, run: Run, classes: int) -> nn.Module:
    """Train all layers on, from the old weights, with the new class repeated up to the others."""
    model, window = find_network(run.contract.model), run.contract.window
    build = new_network(
        lambda: model.build(window.steps, data.values.shape[2], classes), run.train.seed
    )
    weights = {k: v for k, v in network.state_dict().items() if not k.startswith("last.")}
    build.load_state_dict(weights, strict=False)
    count = np.bincount(data.y)
    times = np.maximum(1, count[:-1].mean() / np.maximum(count, 1)).astype(int)
    index = np.repeat(np.arange(len(data)), np.where(data.y == classes - 1, times[data.y], 1))
    scaled = run.contract.scaling.apply(data.values, data.mask)
    fit(build, Labelled(scaled[index], data.mask[index], data.y[index]), _REHEARSAL)
    return build
