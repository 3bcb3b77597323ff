"""A network tried on inner folds side by side: it takes longest, and no thread shall wait for it.

Knows nothing about other candidates, or about what is made of its logits.

Source: docs/decisions/0039.
"""

from __future__ import annotations

from contextlib import suppress
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from taxel.training.choose.budget import Budget
from taxel.training.choose.candidates import Candidate
from taxel.training.choose.inner_folds import learned_from, tested_folds
from taxel.training.choose.networks import predict_network, train_network, untrained
from taxel.training.choose.part import Part

FIRST_LOOK = 0.25
"""Share of a fold's training after which it is first seen how long all folds will take. Source: our
choice, 0039."""


class _OutOfTimeError(Exception):
    """All folds would take longer than there is time."""


class NetworkFolds:
    """One network's inner folds, each to be run once, in any thread.

    Args:
        part: The windows.
        candidate: The network.
        seed: Of weights, order and augmentation, the same in each fold.
        budget: Says whether the try may begin, and go on.
        must: Whether it is tried whatever the time.
    """

    def __init__(
        self, part: Part, candidate: Candidate, seed: int, budget: Budget, *, must: bool
    ) -> None:
        self._part, self._candidate, self._seed = part, candidate, seed
        self._budget, self._must = budget, must
        self.folds = tested_folds(part.fold, ordered=part.ordered)
        # First weights come from PyTorch's one generator: they are drawn before any is trained.
        self._networks = {
            fold: untrained(part.prepared, part.classes, candidate, seed) for fold in self.folds
        }
        self._logits = np.zeros((len(part.rows), part.classes))
        self._lock = Lock()
        self._started: float | None = None
        self._goes = True
        self._done = 0
        self.seconds = 0.0
        """That all folds took, one after another."""

    @property
    def name(self) -> tuple[Candidate, str]:
        """Return what the budget knows this try by."""
        return self._candidate, self._part.name

    def run(self, fold: int) -> None:
        """Train without an inner fold and predict it, if time allows."""
        clock, part = self._budget.clock, self._part
        if not self._allowed():
            return
        started = clock()
        learned = learned_from(part.fold, fold, ordered=part.ordered)
        test = (part.fold == fold) & part.scored
        if test.any():
            network, windows = self._networks[fold], part.windows[learned]
            with suppress(_OutOfTimeError):
                train_network(
                    network, part.prepared, windows, part.y[learned], self._candidate, self._seed,
                    lambda share: self._look(share, clock() - started),
                )  # fmt: skip
                self._logits[test] = predict_network(network, part.prepared, part.windows[test])
        with self._lock:
            self._done += 1
            self.seconds += clock() - started
            if self._done == len(self.folds) and self._started is not None:
                self._budget.took(self.name, clock() - self._started)

    def logits(self) -> NDArray[np.float64] | None:
        """Return logits of the scored windows; None where the time would not do."""
        return self._logits[self._part.scored] if self._goes else None

    def _look(self, share: float, spent: float) -> None:
        """Break off a fold, and so the whole try, that will take far too long.

        Args:
            share: Of this fold's training that is done, 0…1.
            spent: Seconds that it took.

        Raises:
            _OutOfTimeError: It was stopped.
        """
        with self._lock:
            if FIRST_LOOK <= share < 1.0 and not self._done and not self._must:
                each = spent / share
                turns = -(-len(self.folds) // self._budget.at_once)
                self._goes = self._goes and self._budget.lasts(turns * each - spent)
            if not self._goes:
                raise _OutOfTimeError

    def _allowed(self) -> bool:
        with self._lock:
            now = self._budget.clock()
            if self._started is None:
                self._started = now
                self._goes = self._must or self._budget.starts(self.name)
            elif self._goes and self._done and not self._must:
                left = self.seconds / self._done * (len(self.folds) - self._done)
                self._goes = self._budget.goes_on(now - self._started, left / self._budget.at_once)
            return self._goes
