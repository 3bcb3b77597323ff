"""Learn on the fly: answer a grasp, hear the right answer, learn from it beside old grasps.

The body stays; the last layer takes a few steps of gradient descent after each grasp, on its
windows and on as many rehearsed ones, so that no class is forgotten. Knows nothing about
files, clocks or sensors.

Source: reservoir sampling (Vitter, ACM TOMS 1985), one reservoir a class; our choices in
docs/decisions/0028.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from torch import nn

from taxel.bundles.contract import learned_too
from taxel.decisions.recognition import GraspVote, Quality, RecogniseConfig, decide
from taxel.errors import BadDataset
from taxel.models.catalogue import count_parameters
from taxel.training.adapt.last_layer import (
    Solved,
    body_of,
    exemplars_of,
    features_of,
    with_last,
)
from taxel.training.choose.blending import softmax
from taxel.training.exemplars import Exemplars, thin_out
from taxel.training.run import Run
from taxel.windows.windower import Windows


@dataclass(frozen=True, slots=True, kw_only=True)
class OnlineConfig:
    """How it learns. Source: chosen on a data set that no figure uses, docs/decisions/0028."""

    learning_rate: float = 0.02
    """Step size of plain gradient descent on standardised features."""
    steps: int = 10
    """Steps after each grasp."""
    rehearsed: int = 64
    """Old windows in each step, beside the new grasp's own."""
    reservoir: int = 300
    """Windows that are kept of each class."""
    seed: int = 0


@dataclass(frozen=True, slots=True)
class GraspAnswer:
    """The answer to one grasp."""

    label: str
    confidence: float
    """0…1: the mean over the windows, by `decisions.recognition`'s vote."""
    probabilities: NDArray[np.float64]
    """Shape (n, classes), each window's."""


@dataclass(slots=True)
class Reservoir:
    """Windows of one class, each that ever came with the same chance to be in it."""

    most: int
    rows: list[int] = field(default_factory=list)
    seen: int = 0

    def add(self, row: int, rng: np.random.Generator) -> None:
        """Take in a row, or leave it out, by chance."""
        self.seen += 1
        if len(self.rows) < self.most:
            self.rows.append(row)
            return
        place = int(rng.integers(self.seen))
        if place < self.most:
            self.rows[place] = row


class OnlineLearner:
    """A run that learns from corrected grasps.

    Args:
        run: Trained, with exemplars; it is not changed.
        config: How it learns.

    Raises:
        BadInput: The run has no exemplars, or a network without a last layer.
    """

    def __init__(self, run: Run, config: OnlineConfig | None = None) -> None:
        self._run = run
        self._contract = run.contract
        self._config = config or OnlineConfig()
        self._rng = np.random.default_rng(self._config.seed)
        self._data = exemplars_of(run)
        self._learners = [_Layer(network, run, self._data) for network in run.networks]
        classes = len(run.contract.classes)
        self._reservoirs = [Reservoir(self._config.reservoir) for _ in range(classes)]
        for row in self._rng.permutation(len(self._data)):
            self._reservoirs[self._data.y[row]].add(int(row), self._rng)

    def answer(self, windows: Windows) -> GraspAnswer:
        """Return what the run predicts for one grasp, as it has learned so far.

        Args:
            windows: Unscaled windows of one grasp, at the run's level, n ≥ 1.
        """
        contract = self._run.contract
        scaled = contract.scaling.apply(windows.values, windows.mask)
        each = [layer.probabilities(scaled, windows.mask) for layer in self._learners]
        probabilities = np.asarray(np.mean(each, axis=0))
        vote = GraspVote(contract.classes, float("inf"), joining=contract.joining)
        anything = RecogniseConfig(least_confidence=0.0, least_usable=0.0, most_saturated=1.0)
        label, confidence = "", 0.0
        for probability in probabilities:
            label, confidence = vote.add(
                decide(probability.astype(np.float32), Quality(), contract.classes, anything)
            )
        return GraspAnswer(label, confidence, probabilities)

    def correct(
        self, windows: Windows, label: str, grasp: str, session: str, recording: str = ""
    ) -> None:
        """Learn the right answer of one grasp.

        Args:
            windows: As for `answer`.
            label: The right class.
            grasp: A name of the grasp's own.
            session: Its session.
            recording: The fingerprint of its recording; empty where there is none.

        Raises:
            BadDataset: The run has no such class.
        """
        classes = self._run.contract.classes
        if label not in classes:
            raise BadDataset(
                f"one of the classes {', '.join(classes)}", repr(label),
                "learn a new class first with: taxel adapt RUN --new RECORDINGS",
            )  # fmt: skip
        recordings = {recording} - {""}
        self._contract = learned_too(self._contract, recordings, windows.values.tobytes())
        number = classes.index(label)
        scaled = self._run.contract.scaling.apply(windows.values, windows.mask)
        y = np.full(len(windows), number, np.intp)
        rows = [self._rehearsal() for _ in range(self._config.steps)]
        for layer in self._learners:
            layer.learn(scaled, windows.mask, y, rows, self._config.learning_rate)
        first = len(self._data)
        self._data = Exemplars.join(
            [
                self._data,
                Exemplars(
                    values=windows.values,
                    mask=windows.mask,
                    y=y,
                    session=np.full(len(y), session),
                    grasp=np.full(len(y), grasp),
                ),
            ]
        )
        for row in range(first, len(self._data)):
            self._reservoirs[number].add(row, self._rng)

    def learned(self) -> Run:
        """Return the run as it is now; its accuracies are left out: they were measured before."""
        networks = tuple(layer.network() for layer in self._learners)
        contract = replace(
            self._contract, accuracy={}, parity=None,
            parameters=sum(map(count_parameters, networks)),
        )  # fmt: skip
        return replace(
            self._run, networks=networks, contract=contract, predictions=None, trivial={},
            exemplars=thin_out(self._data),
        )  # fmt: skip

    def _rehearsal(self) -> NDArray[np.intp]:
        """Return rows of all classes alike, drawn at random."""
        each = -(-self._config.rehearsed // len(self._reservoirs))
        drawn = [
            self._rng.choice(reservoir.rows, each)
            for reservoir in self._reservoirs
            if reservoir.rows
        ]
        rows: NDArray[np.intp] = np.concatenate(drawn).astype(np.intp)
        return rows


class _Layer:
    """One network's body, its last layer on standardised features, and all windows so far."""

    def __init__(self, network: nn.Module, run: Run, data: Exemplars) -> None:
        self._body = body_of(network, data.values.shape[2], statistics=False)
        scaled = run.contract.scaling.apply(data.values, data.mask)
        x = features_of(self._body, scaled, data.mask)
        self._offset, spread = x.mean(axis=0), x.std(axis=0)
        moves = spread > 1e-4 * spread.max()
        self._factor = np.where(moves, 1.0 / np.where(moves, spread, 1.0), 0.0)
        last = network.last
        assert isinstance(last, nn.Linear)
        weight = last.weight.detach().double().numpy()
        # The same function, of standardised features.
        self._weight = weight * np.where(moves, spread, 0.0)
        self._bias = last.bias.detach().double().numpy() + weight @ self._offset
        self._x = self._standard(x)
        self._y = data.y

    def _standard(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray((x - self._offset) * self._factor)

    def probabilities(
        self, scaled: NDArray[np.float32], mask: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Return class probabilities, shape (n, classes), of scaled windows."""
        x = self._standard(features_of(self._body, scaled, mask))
        return softmax(x @ self._weight.T + self._bias)

    def learn(
        self,
        scaled: NDArray[np.float32],
        mask: NDArray[np.bool_],
        y: NDArray[np.intp],
        rehearsed: list[NDArray[np.intp]],
        learning_rate: float,
    ) -> None:
        """Step along the cross-entropy's gradient; the grasp and the rehearsed count alike."""
        own = self._standard(features_of(self._body, scaled, mask))
        for rows in rehearsed:
            x = np.concatenate([own, self._x[rows]])
            right = np.concatenate([y, self._y[rows]])
            off = softmax(x @ self._weight.T + self._bias)
            off[np.arange(len(x)), right] -= 1.0
            off *= np.repeat([0.5 / len(own), 0.5 / len(rows)], [len(own), len(rows)])[:, None]
            self._weight -= learning_rate * off.T @ x
            self._bias -= learning_rate * off.sum(axis=0)
        self._x = np.concatenate([self._x, own])
        self._y = np.concatenate([self._y, y])

    def network(self) -> nn.Module:
        """Return the network with the last layer as it is now."""
        weight = self._weight * self._factor
        return with_last(self._body, Solved(weight, self._bias - weight @ self._offset, 1.0))
