"""A new class from a few grasps: the body stays, the last layer is solved anew.

Each class is a normal distribution in the body's features, all with one covariance, which
the run's exemplars of the old classes give; a few grasps are enough for a mean. Three
corrections make the few grasps count for what they are: the session's own shift is taken
off where old classes were touched in it too; the part of the new mean that old classes'
differences do not explain is shrunk by what grasps and sessions scatter (James and Stein);
and each class is as likely as its grasps give windows. The solution is a linear layer, so
that the network stays a network. Knows nothing about files of recordings.

Source: linear discriminant analysis (Fisher 1936); positive-part shrinkage (James and
Stein 1961; Efron and Morris 1973); our choices in docs/decisions/0028.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from taxel.bundles.contract import learned_too
from taxel.errors import BadDataset, BadInput
from taxel.models.catalogue import WITH_STATISTICS, count_parameters
from taxel.models.with_statistics import WithStatistics
from taxel.plain_text import number_of
from taxel.training.exemplars import Exemplars, thin_out
from taxel.training.run import Run
from taxel.windows.windower import Windows

SHRINK = 0.3
"""Share of the covariance that is its own mean variance, 0…1. Source: chosen on one simulated
data set that no reported figure uses, docs/decisions/0028."""
STANDS_OUT = 0.65
"""From here on a class's statistics carry more signal than noise: 1 − noise / distance².
Source: half-way between a class that they recognise (0.83) and one that they do not (0.43) on that
same data set."""
FeatureKind = Literal["auto", "body", "statistics"]
"""body: what the network learned; statistics: each channel's statistics beside it; auto: the
latter where the new class stands out in them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Adapted:
    """A run that learned a class, and how."""

    run: Run
    statistics: bool
    """True where channels' statistics stand beside the body's features now."""
    stands_out: float
    """By how much the new class stands out beside the old, 0…1: see `STANDS_OUT`."""
    seconds: float
    """Time that it took."""


@dataclass(frozen=True, slots=True)
class Solved:
    """A last layer."""

    weight: NDArray[np.float64]
    """Shape (classes, features)."""
    bias: NDArray[np.float64]
    """Shape (classes,)."""
    stands_out: float


def adapt_last_layer(
    run: Run,
    windows: Windows,
    y_new: Sequence[str],
    grasp: Sequence[str],
    session: Sequence[str],
    *,
    features: FeatureKind = "auto",
    recordings: Collection[str] = (),
) -> Adapted:
    """Return a run that also predicts new classes, from a few grasps of each.

    The run's networks are not changed. Its accuracies, predictions and test for unknown touch
    are left out of the new run: they were made without the new classes.

    Args:
        run: Trained, with exemplars.
        windows: Unscaled windows of the run's own window and level, n of them; of new classes,
            and of old ones too where there are more of them.
        y_new: Each window's class by name, n of them; names that the run does not know become
            new classes, behind the old ones, sorted.
        grasp: Each window's grasp, by a name of its own.
        session: Each window's session, by a name of its own; one that the exemplars hold too, or
            that has windows of old classes here, gives its own shift.
        features: What the last layer sees.
        recordings: A fingerprint of each recording that the windows are from.

    Raises:
        BadInput: The run has no exemplars, or its model has no last layer.
        BadDataset: No window is there.
    """
    started = perf_counter()
    known_classes = run.contract.classes
    classes = (*known_classes, *sorted(set(y_new) - set(known_classes)))
    old = exemplars_of(run)
    _check(run, windows)
    data = Exemplars.join([old, labelled(windows, y_new, grasp, session, classes)])
    scaled = run.contract.scaling.apply(data.values, data.mask)
    kinds = [False, True] if features == "auto" else [features == "statistics"]
    if run.contract.model.endswith(WITH_STATISTICS):
        kinds = [False]  # the network holds them already
    by_kind = {
        kind: [_adapted(network, scaled, data, len(known_classes), len(classes), kind)
               for network in run.networks]
        for kind in kinds
    }  # fmt: skip
    stands_out = float(np.mean([solved.stands_out for _, solved in by_kind[kinds[-1]]]))
    chosen = kinds[-1] if len(kinds) == 1 or stands_out >= STANDS_OUT else kinds[0]
    networks = tuple(network for network, _ in by_kind[chosen])
    contract = replace(
        learned_too(run.contract, recordings, windows.values.tobytes()),
        classes=classes,
        model=run.contract.model + (WITH_STATISTICS if chosen else ""),
        parameters=sum(map(count_parameters, networks)),
        accuracy={},
        parity=None,
        unknown=None,
    )
    adapted = replace(
        run, networks=networks, contract=contract, predictions=None, trivial={},
        exemplars=thin_out(data),
    )  # fmt: skip
    return Adapted(
        run=adapted, statistics=chosen, stands_out=stands_out, seconds=perf_counter() - started
    )


def labelled(
    windows: Windows,
    y: Sequence[str],
    grasp: Sequence[str],
    session: Sequence[str],
    classes: Sequence[str],
) -> Exemplars:
    """Return windows with their classes as numbers; arguments as for `adapt_last_layer`."""
    return Exemplars(
        values=windows.values,
        mask=windows.mask,
        y=np.array([list(classes).index(name) for name in y], np.intp),
        session=np.array(session, str),
        grasp=np.array(grasp, str),
    )


def exemplars_of(run: Run) -> Exemplars:
    """Return a run's exemplars.

    Raises:
        BadInput: It has none.
    """
    if run.exemplars is None or not len(run.exemplars):
        raise BadInput(
            "a run with exemplars to rehearse by",
            "one without: it is older, or taxel train chose its model by a search",
            "train one that keeps them: taxel train RECORDINGS --recipe NAME",
        )  # fmt: skip
    return run.exemplars


def body_of(network: nn.Module, channels: int, *, statistics: bool) -> nn.Module:
    """Return a copy of a network without its last layer: forward(values, mask) → features.

    Raises:
        BadInput: The network ends in no linear layer.
    """
    if not isinstance(getattr(network, "last", None), nn.Linear):
        raise BadInput(
            "a network that ends in a linear layer", type(network).__name__,
            "train cnn1d, cnn2d, cnn3d, lstm, touchnet or inception-time",
        )  # fmt: skip
    body = deepcopy(network)
    if statistics:
        body = WithStatistics(body, channels, 1)
    body.last = nn.Identity()
    return body.eval()


def features_of(
    body: nn.Module, values: NDArray[np.float32], mask: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return what a body makes of scaled windows, shape (n, features)."""
    parts = []
    with torch.inference_mode():
        for start in range(0, len(values), 1024):
            part = slice(start, start + 1024)
            found = body(torch.from_numpy(values[part]), torch.from_numpy(mask[part]))
            parts.append(found.double().numpy())
    return np.concatenate(parts)


def with_last(body: nn.Module, solved: Solved) -> nn.Module:
    """Return the network that a body and a solved last layer make."""
    classes, features = solved.weight.shape
    last = nn.Linear(features, classes)
    with torch.no_grad():
        last.weight.copy_(torch.from_numpy(solved.weight))
        last.bias.copy_(torch.from_numpy(solved.bias))
    network = deepcopy(body)
    network.last = last
    return network.eval()


def _adapted(
    network: nn.Module,
    scaled: NDArray[np.float32],
    data: Exemplars,
    known: int,
    classes: int,
    statistics: bool,
) -> tuple[nn.Module, Solved]:
    body = body_of(network, scaled.shape[2], statistics=statistics)
    solved = solve_last(features_of(body, scaled, data.mask), data, known, classes)
    return with_last(body, solved), solved


def solve_last(features: NDArray[np.float64], data: Exemplars, known: int, classes: int) -> Solved:
    """Return the last layer for features of known and new classes.

    Args:
        features: Shape (n, features).
        data: Their classes, sessions and grasps; its values are not looked at.
        known: How many classes are old, those numbered below it.
        classes: How many there are in all.
    """
    y, old = data.y, data.y < known
    offset, spread = features[old].mean(axis=0), features[old].std(axis=0)
    # What never moves says nothing, and must not when it moves for the first time.
    factor = np.where(spread > 1e-4 * spread.max(), 1.0 / np.maximum(spread, 1e-12), 0.0)
    x = (features - offset) * factor
    mean = _means(x, y, classes)
    for number in range(known, classes):
        x[y == number] -= _session_shift(x, mean, data, known, y == number)
    mean = _means(x, y, classes)
    whiten = _whitening((x - mean[y])[old], y[old])
    z, centre = x @ whiten, mean @ whiten
    stands_out = []
    basis = _differences(centre[:known])
    for number in range(known, classes):
        middle = centre[:known].mean(axis=0)
        away = centre[number] - middle
        explained = basis @ (basis.T @ away)
        rest = away - explained
        noise = _noise(z, centre, basis, data, known, number)
        share = max(0.0, 1.0 - noise / max(float(rest @ rest), 1e-12))
        centre[number] = middle + explained + share * rest
        stands_out.append(share)
    grasps = np.array([len(np.unique(data.grasp[y == c])) for c in range(classes)])
    a_grasp = np.bincount(y, minlength=classes) / np.maximum(grasps, 1)
    bias = np.log(a_grasp) - 0.5 * (centre**2).sum(axis=1)
    weight = (centre @ whiten.T) * factor
    return Solved(weight, bias - weight @ offset, float(np.mean(stands_out or [1.0])))


def _means(x: NDArray[np.float64], y: NDArray[np.intp], classes: int) -> NDArray[np.float64]:
    return np.stack([x[y == number].mean(axis=0) for number in range(classes)])


def _session_shift(
    x: NDArray[np.float64],
    mean: NDArray[np.float64],
    data: Exemplars,
    known: int,
    own: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Return for each window of a new class by how much old classes lie off in its session."""
    shift = np.zeros((int(own.sum()), x.shape[1]))
    for name in np.unique(data.session[own]):
        there = data.session == name
        found = [x[there & (data.y == c)].mean(axis=0) - mean[c]
                 for c in range(known) if (there & (data.y == c)).any()]  # fmt: skip
        if found:
            shift[data.session[own] == name] = np.mean(found, axis=0)
    return shift


def _whitening(rest: NDArray[np.float64], y: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return W, shape (features, features): rest @ W has about unit covariance."""
    weight = 1.0 / np.bincount(y)[y]
    covariance = (rest * weight[:, None]).T @ rest / weight.sum()
    size = len(covariance)
    own = float(np.trace(covariance)) / size
    covariance = (1.0 - SHRINK) * covariance + SHRINK * own * np.eye(size)
    variance, direction = np.linalg.eigh(covariance)
    return np.asarray(direction / np.sqrt(np.maximum(variance, 1e-12)))


def _differences(centre: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a basis of the old classes' differences, orthonormal columns."""
    return np.asarray(np.linalg.qr((centre - centre.mean(axis=0))[:-1].T)[0])


def _noise(
    z: NDArray[np.float64],
    centre: NDArray[np.float64],
    basis: NDArray[np.float64],
    data: Exemplars,
    known: int,
    number: int,
) -> float:
    """Return the squared length that chance alone gives a new class's unexplained mean."""
    own = data.y == number
    total = 0.0
    for key in (data.grasp, data.session):
        off = []
        for c in range(known):
            for name in np.unique(key[data.y == c]):
                offset = z[(data.y == c) & (key == name)].mean(axis=0) - centre[c]
                off.append(offset - basis @ (basis.T @ offset))
        scatter = float((np.array(off) ** 2).sum(axis=1).mean())
        total += scatter / len(np.unique(key[own]))
    return total


def _check(run: Run, windows: Windows) -> None:
    if not len(windows):
        raise BadDataset("at least one window of a new grasp", "none", "grasp it longer or harder")
    shape = (run.contract.window.steps, len(run.contract.channels))
    if windows.values.shape[1:] != shape:
        raise BadDataset(
            f"windows of {number_of(shape[0], 'row')} of {number_of(shape[1], 'channel')}",
            f"{windows.values.shape[1:]}",
            "cut them with the run's own window",
        )  # fmt: skip
