"""One search with Optuna: trials side by side, pruned by fold, kept where they survive a kill.

Every trial is kept in a database by its URL. What a killed search was at is tried again: what it
had finished stays. With one worker a search that was interrupted proposes what an uninterrupted one
proposes, since each proposal depends on the finished trials and a seed alone. Knows nothing about
recordings or settings.

Source: docs/decisions/0050.
"""

from __future__ import annotations

import math
import re
import threading
import warnings
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from taxel.errors import BadInput, BadSplit, MissingExtra, RecordingFailed
from taxel.held import only_writer
from taxel.jobs.call import JobResult
from taxel.jobs.running import result_of, submit, width
from taxel.plain_text import number_of

HEARTBEAT_S, GRACE_S = 30, 120
"""A trial's process says that it lives, and is given up after so long a silence, seconds. Source:
our choice, docs/decisions/0050."""
STARTUP = 5
"""Trials that are never pruned, to have a median to prune by. Source: Optuna's default."""
_AS_IS = "the recipe as it is"
_SQLITE = re.compile(r"sqlite(?:\+\w+)?:///([^?]*)")
"""The address of a file; what may follow are options."""


@dataclass(frozen=True, slots=True)
class BestSettings:
    """A search's best settings, with the scores by which they were chosen."""

    values: dict[str, Any]
    """The best trial's settings; empty where the recipe as it is was best."""
    accuracy: float
    """Its mean over the inner folds, 0…1: what was chosen by, so no honest estimate."""
    as_is: float
    """The same of the recipe as it is."""
    trials: int
    pruned: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """What is searched."""

    name: str
    """The study's name in the database: the same search has the same name on every machine."""
    trials: int
    """How many are finished in the end, pruned ones too."""
    folds: int
    """Inner folds of a trial."""
    seed: int
    propose: Callable[[Any], dict[str, Any]]
    """An Optuna trial → values."""
    work: Callable[[Any], float]
    """A job → the accuracy in one inner fold, 0…1; a function of a module."""
    job: Callable[[dict[str, Any], int], Any]
    """Values and an inner fold's number → the job."""


@dataclass(slots=True)
class _Running:
    trial: Any
    values: dict[str, Any]
    scores: list[float] = field(default_factory=list)


class Store:
    """The database of all trials; use it in a `with` block of `open_store`.

    Args:
        url: Its address.
        alone: Whether no other process uses it meanwhile; true of a file of SQLite unless given.
    """

    def __init__(self, url: str, alone: bool | None = None) -> None:
        try:
            import optuna
        except ModuleNotFoundError as error:
            raise MissingExtra("optuna", "tune", "a search for settings") from error
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        self.alone = url.startswith("sqlite") if alone is None else alone
        self._optuna, self._url = optuna, url
        kind: dict[str, Any] = {"engine_kwargs": {"connect_args": {"timeout": 60.0}}}
        if not self.alone:
            kind = {
                "heartbeat_interval": HEARTBEAT_S, "grace_period": GRACE_S,
                "heartbeat_stale_trial_callback": _retry(optuna),
            }  # fmt: skip
        try:
            with _quiet():
                self.storage = optuna.storages.RDBStorage(url, **kind)
        except Exception as error:  # SQLAlchemy's and each driver's own errors share no base
            raise BadInput(
                "a database for --storage, such as sqlite:///tune.db or postgresql://HOST/NAME",
                f"{url}, which cannot be opened ({_first_line(error)})",
                "check the address and that its driver is installed",
            ) from error
        self._beating: set[int] = set()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._beat, name="taxel-heartbeat", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop saying that trials live."""
        self._ended.set()
        self._thread.join()

    def search(self, what: Search, on_step: Callable[[str], None]) -> BestSettings:
        """Search until as many trials are finished as are wanted; return the best.

        Args:
            what: What is searched.
            on_step: Called with a line after each trial.

        Raises:
            BadSplit: No trial could be scored.
            RecordingFailed: The database took no more, as on a full disk.
        """
        from sqlalchemy.exc import SQLAlchemyError

        try:
            return self._search(what, on_step)
        except (self._optuna.exceptions.StorageInternalError, SQLAlchemyError) as error:
            got = _first_line(error.__cause__ or error)
            raise RecordingFailed(
                f"needed to keep trials in {self._url}; got {got}; "
                "make room or mend the database, and run the same command again."
            ) from error

    def _search(self, what: Search, on_step: Callable[[str], None]) -> BestSettings:
        optuna = self._optuna
        study = optuna.create_study(
            storage=self.storage, study_name=what.name, direction="maximize", load_if_exists=True,
            pruner=optuna.pruners.MedianPruner(n_startup_trials=STARTUP),
        )  # fmt: skip
        self._give_up_the_dead(study)
        running: dict[Future[JobResult], _Running] = {}
        try:
            while True:
                left = what.trials - len(self._finished(study)) - len(running)
                left = max(left, self._lacks_as_is(study, running.values()))
                for _ in range(min(left, width() - len(running))):
                    trial = self._ask(study, what, running.values())
                    running[self._next_fold(what, trial)] = trial
                if not running:
                    return self._best(study)
                done, _ = wait(running, timeout=HEARTBEAT_S, return_when=FIRST_COMPLETED)
                for future in done:
                    trial = running.pop(future)
                    trial.scores.append(result_of(_name(what, trial), future))
                    if self._goes_on(study, what, trial, on_step):
                        running[self._next_fold(what, trial)] = trial
        finally:
            self._beating.clear()

    def _ask(self, study: Any, what: Search, running: Collection[_Running]) -> _Running:
        """Begin a trial; the first is the recipe as it is, again where a kill ended it."""
        begun = len(self._finished(study)) + len(running)
        state = np.random.SeedSequence([what.seed, begun]).generate_state(1)
        study.sampler = self._optuna.samplers.TPESampler(seed=int(state[0]))
        with _quiet():
            trial = study.ask()
        self._beating.add(trial._trial_id)
        if trial.user_attrs.get(_AS_IS) or self._lacks_as_is(study, running):
            trial.set_user_attr(_AS_IS, True)
            return _Running(trial, {})
        return _Running(trial, what.propose(trial))

    def _lacks_as_is(self, study: Any, running: Collection[_Running]) -> bool:
        """Return whether the recipe as it is was neither finished nor is among what runs here."""
        trials = [*self._finished(study), *(own.trial for own in running)]
        return not any(trial.user_attrs.get(_AS_IS) for trial in trials)

    def _next_fold(self, what: Search, running: _Running) -> Future[JobResult]:
        job = what.job(running.values, len(running.scores))
        return submit(what.work, job, name=_name(what, running))

    def _goes_on(
        self, study: Any, what: Search, running: _Running, on_step: Callable[[str], None]
    ) -> bool:
        """Report a fold; return whether the trial's next fold is worth its time."""
        mean = _mean(running.scores)
        states = self._optuna.trial.TrialState
        last = len(running.scores) == what.folds
        state = states.COMPLETE if last else states.PRUNED
        stored = None
        try:
            if not last:
                if math.isfinite(mean):
                    running.trial.report(mean, len(running.scores))
                if not running.values or not running.trial.should_prune():
                    return True  # the recipe as it is has all folds: others are compared with it
            elif not math.isfinite(mean):
                raise BadSplit(
                    "inner folds with all classes in training",
                    "none",
                    "record more of each class",
                )
            stored = study.tell(running.trial, mean if last else None, state, skip_if_finished=True)
        except self._optuna.exceptions.UpdateFinishedTrialError:
            pass  # another process gave it up, since this one was silent for too long
        self._beating.discard(running.trial._trial_id)
        ended = (
            f"{mean:.4f}"
            if last
            else f"{mean:.4f}, pruned after {number_of(len(running.scores), 'fold')}"
        )
        if stored is None or stored.state != state:
            ended = "given up by another process, since this one was silent for too long"
        on_step(f"{what.name} · trial {running.trial.number + 1} · {ended}")
        return False

    def _finished(self, study: Any) -> list[Any]:
        states = self._optuna.trial.TrialState
        found: list[Any] = study.get_trials(deepcopy=False, states=(states.COMPLETE, states.PRUNED))
        return found

    def _best(self, study: Any) -> BestSettings:
        best, finished = study.best_trial, self._finished(study)
        as_is = [trial.value for trial in finished if trial.user_attrs.get(_AS_IS)]
        return BestSettings(
            values=dict(best.params),
            accuracy=float(best.value),
            as_is=float(as_is[0]),
            trials=len(finished),
            pruned=sum(trial.state.name == "PRUNED" for trial in finished),
        )

    def _give_up_the_dead(self, study: Any) -> None:
        """Mark trials whose process was killed: at once in a file that one process uses at a time,
        elsewhere those that were silent for too long.
        """
        if not self.alone:
            with _quiet():
                self._optuna.storages.fail_stale_trials(study)
            return
        states = self._optuna.trial.TrialState
        for trial in study.get_trials(deepcopy=False, states=(states.RUNNING,)):
            study.tell(trial.number, state=states.FAIL)

    def _beat(self) -> None:
        while not self._ended.wait(HEARTBEAT_S):
            for trial_id in () if self.alone else tuple(self._beating):
                self.storage.record_heartbeat(trial_id)


@contextmanager
def open_store(url: str) -> Iterator[Store]:
    """Open the database of trials; a file of SQLite for this process alone.

    Raises:
        BadInput: It cannot be opened, or is a file that another process uses.
        MissingExtra: Optuna is not installed.
        RecordingFailed: The disk refused.
    """
    file = _file_of(url)
    with nullcontext() if file is None else only_writer(file, "--storage"):
        store = Store(url)
        try:
            yield store
        finally:
            store.close()


def _file_of(url: str) -> Path | None:
    """Return the file of a database of SQLite, links followed; None where there is none, or its
    folder is not there, which opening it says.
    """
    found = _SQLITE.match(url)
    name = found[1].removeprefix("file:") if found else ""
    if name in ("", ":memory:"):
        return None
    file = Path(name).resolve()
    return file if file.parent.is_dir() else None


def _retry(optuna: Any) -> Any:
    """Return what tries a trial again whose process fell silent."""
    with _quiet():
        return optuna.storages.RetryHeartbeatStaleTrialCallback(max_retry=3)


@contextmanager
def _quiet() -> Iterator[None]:
    """Let Optuna use its heartbeat, which it calls experimental, without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def _name(what: Search, running: _Running) -> str:
    return f"{what.name} · trial {running.trial.number + 1} · inner fold {len(running.scores) + 1}"


def _mean(scores: list[float]) -> float:
    known = [score for score in scores if math.isfinite(score)]
    return float(np.mean(known)) if known else math.nan


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
