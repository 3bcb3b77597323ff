"""Claims about a search: it goes on where it was broken off, and proposes what it would have."""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("optuna", reason="optuna is not installed: pip install 'taxel[tune]'")

from taxel.errors import BadInput, RecordingFailed
from taxel.evaluation.tune import study as study_module
from taxel.evaluation.tune.space import SETTINGS, Space
from taxel.evaluation.tune.study import BestSettings, Search, Store, open_store
from taxel.jobs.call import JobResult
from taxel.training.recipes import find_recipe

RECIPE = find_recipe("teng")


class Broken(Exception):
    """The search was broken off."""


def score(job: tuple[dict[str, Any], int]) -> float:
    """Best at x = 0.7; the recipe as it is gives 0.4; later folds are a little worse."""
    values, fold = job
    return (1.0 - abs(values["x"] - 0.7) if values else 0.4) - 0.01 * fold


class Work:
    """Counts jobs, and breaks off at one of them."""

    __name__ = "work"

    def __init__(self, break_at: int | None = None) -> None:
        self.jobs: list[tuple[dict[str, Any], int]] = []
        self.break_at = break_at

    def __call__(self, job: tuple[dict[str, Any], int]) -> float:
        self.jobs.append(job)
        if len(self.jobs) == self.break_at:
            raise Broken
        return score(job)


def search(work: Callable[[Any], float], trials: int = 7, folds: int = 2) -> Search:
    return Search(
        name="one", trials=trials, folds=folds, seed=3, work=work,
        propose=lambda trial: {"x": trial.suggest_float("x", 0.0, 1.0)},
        job=lambda values, fold: (values, fold),
    )  # fmt: skip


def run(url: str, what: Search) -> BestSettings:
    with open_store(url) as store:
        return store.search(what, lambda _: None)


@pytest.fixture
def url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path / 'tune.db'}"


def test_the_best_trial_is_found_and_the_recipe_as_it_is_comes_first(url: str) -> None:
    work = Work()
    found = run(url, search(work))
    assert work.jobs[:2] == [({}, 0), ({}, 1)]
    assert found.as_is == pytest.approx(0.395)
    assert found.accuracy > found.as_is
    assert found.accuracy == pytest.approx(sum(score((found.values, k)) for k in range(2)) / 2)
    assert found.trials == 7


def test_a_search_that_was_broken_off_gives_what_an_unbroken_one_gives(
    url: str, tmp_path: Path
) -> None:
    """At most the trial that ran is lost; it is proposed again."""
    whole, first, second = Work(), Work(break_at=9), Work()
    expected = run(f"sqlite:///{tmp_path / 'whole.db'}", search(whole))
    with pytest.raises(Broken):
        run(url, search(first))
    found = run(url, search(second))

    assert found == expected
    finished = [job for job in first.jobs if job[0] != first.jobs[-1][0]]
    assert finished + second.jobs == whole.jobs


@pytest.mark.parametrize(
    ("break_at", "trials"), [(6, 2), (2 * study_module.STARTUP + 2, study_module.STARTUP)]
)
def test_the_recipe_as_it_is_is_tried_again_on_all_folds_where_a_kill_ended_it_alone(
    url: str, monkeypatch: pytest.MonkeyPatch, break_at: int, trials: int
) -> None:
    """Side by side, others may be finished before the first; behind better ones it would be pruned,
    and its score be that of its first fold alone.
    """

    def submit(work: Work, job: tuple[dict[str, Any], int], name: str) -> Future[JobResult]:
        return Future() if not job[0] else here(work, job, name=name)

    here = study_module.submit
    with monkeypatch.context() as patched:
        patched.setattr(study_module, "submit", submit)
        patched.setattr(study_module, "width", lambda: 2)
        with pytest.raises(Broken):
            run(url, search(Work(break_at=break_at)))
    again = Work()
    found = run(url, search(again, trials=trials))

    assert again.jobs == [({}, 0), ({}, 1)]
    assert found.as_is == pytest.approx(0.395)


def test_a_finished_search_runs_nothing_again(url: str) -> None:
    found = run(url, search(Work(), trials=2))
    again = Work()
    assert run(url, search(again, trials=2)) == found
    assert again.jobs == []


def test_trials_that_are_behind_after_a_fold_are_pruned(url: str) -> None:
    work = Work()
    found = run(url, search(work, trials=12))
    assert found.pruned > 0
    assert len(work.jobs) < 12 * 2


def test_in_a_shared_database_a_silent_trial_is_tried_again(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in PostgreSQL: another machine may live, so only silence tells; here none is allowed."""
    monkeypatch.setattr(study_module, "HEARTBEAT_S", 1)
    monkeypatch.setattr(study_module, "GRACE_S", 1)
    store = Store(url, alone=False)
    first = Work(break_at=9)
    try:
        with pytest.raises(Broken):
            store.search(search(first), lambda _: None)
        (trial,) = [t for t in _trials(store) if t.state.name == "RUNNING"]
        _silent(store, trial._trial_id)
        found = store.search(search(Work()), lambda _: None)
    finally:
        store.close()
    states = [t.state.name for t in _trials(store)]
    assert states.count("FAIL") == 1
    assert "RUNNING" not in states
    assert found.trials == 7
    again = [t for t in _trials(store) if t.params == trial.params]
    assert len(again) == 2


def test_a_trial_that_another_gave_up_meanwhile_is_left_and_the_search_goes_on(url: str) -> None:
    """As of a machine that slept: its trial was tried again elsewhere."""
    store = Store(url, alone=False)
    lines: list[str] = []

    class Sleeping(Work):
        def __call__(self, job: tuple[dict[str, Any], int]) -> float:
            if len(self.jobs) in (4, 9):  # in a first fold, and in a last
                (trial,) = [t for t in _trials(store) if t.state.name == "RUNNING"]
                store.storage.set_trial_state_values(trial._trial_id, type(trial.state).FAIL)
            return super().__call__(job)

    try:
        found = store.search(search(Sleeping()), lines.append)
        states = [t.state.name for t in _trials(store)]
    finally:
        store.close()
    assert found.trials == 7
    assert states.count("FAIL") == 2
    assert sum("given up by another process" in line for line in lines) == 2


def test_a_file_of_sqlite_is_for_one_search_at_a_time(tmp_path: Path) -> None:
    """However its path is written; another file, and one whose search has ended, are free."""
    (tmp_path / "link.db").symlink_to(tmp_path / "tune.db")
    url, link = (f"sqlite:///{tmp_path / name}" for name in ("tune.db", "link.db"))
    with open_store(url) as store:
        study = store.storage.create_new_study([study_direction()])
        trial = store.storage.create_new_trial(study)
        for same in (url, link, url.replace("sqlite:", "sqlite+pysqlite:")):
            with pytest.raises(BadInput, match=r"this process alone.*another --storage"):
                open_store(same).__enter__()
        assert store.storage.get_trial(trial).state.name == "RUNNING"
        with open_store(f"sqlite:///{tmp_path / 'other.db'}"):
            pass
    with open_store(link):
        pass


def study_direction() -> Any:
    import optuna

    return optuna.study.StudyDirection.MAXIMIZE


@pytest.mark.parametrize(
    "url", ["sqlite://", "sqlite:///:memory:", "postgresql://host/name", "no address", "x://"]
)
def test_what_is_no_file_of_sqlite_is_not_locked(url: str) -> None:
    assert study_module._file_of(url) is None


def _trials(store: Store) -> list[Any]:
    study_id = store.storage.get_study_id_from_name("one")
    return list(store.storage.get_all_trials(study_id))


def _silent(store: Store, trial_id: int) -> None:
    """Let a trial have said an hour ago that it lives."""
    import sqlalchemy

    store.storage.record_heartbeat(trial_id)
    with store.storage.engine.begin() as connection:
        connection.execute(
            sqlalchemy.text("UPDATE trial_heartbeats SET heartbeat = datetime(0, 'unixepoch')")
        )


def test_a_database_that_cannot_be_opened_is_reported_in_one_line(tmp_path: Path) -> None:
    with (
        pytest.raises(BadInput, match="a database for --storage") as refused,
        open_store(f"sqlite:///{tmp_path / 'none' / 'tune.db'}"),
    ):
        pass
    assert len(str(refused.value).splitlines()) == 1


def test_a_database_that_takes_no_more_is_reported_in_one_line(url: str) -> None:
    """As on a full disk, in the middle of a search; more room, and the search goes on."""

    class Full(Work):
        def __call__(self, job: tuple[dict[str, Any], int]) -> float:
            if len(self.jobs) == 4:
                _most_pages(store, 1)
            return super().__call__(job)

    with open_store(url) as store:
        with pytest.raises(RecordingFailed, match=r"keep trials in sqlite:.*full") as refused:
            store.search(search(Full(), trials=200), lambda _: None)
        assert len(str(refused.value).splitlines()) == 1
        _most_pages(store, 100_000)
        assert store.search(search(Work()), lambda _: None).trials >= 7


def _most_pages(store: Store, pages: int) -> None:
    """Let the file of SQLite grow to so many pages, but never below what it has."""
    import sqlalchemy

    with store.storage.engine.connect() as connection:
        connection.execute(sqlalchemy.text(f"PRAGMA max_page_count = {pages}"))


@pytest.mark.parametrize(
    "space",
    [Space(settings=("speed",)), Space(models=("none",)), Space(settings=()),
     Space(settings=(), models=("lstm",))],
)  # fmt: skip
def test_what_cannot_be_searched_is_refused(space: Space) -> None:
    with pytest.raises(BadInput):
        space.check()


@pytest.mark.parametrize("name", list(SETTINGS))
def test_each_setting_changes_the_recipe_within_its_limits(name: str) -> None:
    class Least:
        def suggest_float(self, _: str, low: float, high: float, **__: object) -> float:
            return (low + high) / 2

        def suggest_int(self, _: str, low: int, high: int, **__: object) -> int:
            return (low + high) // 2

        def suggest_categorical(self, _: str, choices: tuple[Any, ...]) -> Any:
            return choices[0]

    space = Space(settings=(name,))
    values = space.propose(Least())
    changed = space.apply(RECIPE, values)
    assert changed != RECIPE
    assert replace(changed, train=RECIPE.train) == RECIPE
    assert space.apply(RECIPE, {}) == RECIPE
