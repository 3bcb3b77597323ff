"""Claims about tuning: no inner fold sees an outer test side, and the result is a run as others."""

import json
import os
import sqlite3
import subprocess
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from forked import Forked

if find_spec("optuna") is None:
    pytest.skip("optuna is not installed: pip install 'taxel[tune]'", allow_module_level=True)

from taxel.cli.main import main
from taxel.errors import BadSplit
from taxel.evaluation.fold_jobs import Source, open_source
from taxel.evaluation.paired import compare_runs
from taxel.evaluation.splits import TrialFold
from taxel.evaluation.table_split import OWN_SPLIT
from taxel.evaluation.tune.inner import folds_inside
from taxel.sources.simulated.data_sets import write_sessions
from taxel.sources.simulated.teng_options import checked_config
from taxel.training.recipes import find_recipe
from taxel.training.run import load_run


@pytest.fixture(scope="module")
def sessions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sessions") / "s"
    config = checked_config(seed=1, scans_per_class=6000, rate_hz=100.0, sessions=6)
    write_sessions(folder, config, lambda _: None)
    return folder


def test_inner_folds_are_parts_of_the_outer_training_side(sessions: Path) -> None:
    source = Source(path=sessions, recipe=find_recipe("teng"), folds=2, given=OWN_SPLIT)
    opened = open_source(source)
    for number, fold in enumerate(opened.split.folds):
        assert isinstance(fold, TrialFold)
        inner = folds_inside(opened, "shape", number)
        tested = [trial for fold in inner for trial in fold.test]
        assert set(tested) == fold.train
        assert len(tested) == len(set(tested))
        for inner_fold in inner:
            assert inner_fold.train | inner_fold.test == fold.train
            assert not (inner_fold.train | inner_fold.test) & fold.test
            groups = [opened.dataset.trials[i].groups["session"] for i in inner_fold.test]
            others = [opened.dataset.trials[i].groups["session"] for i in inner_fold.train]
            assert not set(groups) & set(others), "inner folds hold out what the outer ones do"


def test_a_split_of_single_windows_is_refused(sessions: Path) -> None:
    from dataclasses import replace

    recipe = replace(find_recipe("teng"), split="random")
    opened = open_source(Source(path=sessions, recipe=recipe, folds=2, given=OWN_SPLIT))
    with pytest.raises(BadSplit, match="a split of whole trials, to search on"):
        folds_inside(opened, "shape", 0)


WORDS = ["--fold-count", "2", "--trials", "3", "--settings", "learning-rate", "--epochs", "2",
         "--json"]  # fmt: skip


def tune(sessions: Path, output: Path) -> list[str]:
    return ["tune", str(sessions), "--output", str(output), *WORDS]


@pytest.mark.slow
def test_a_tune_killed_and_started_again_ends_as_an_unbroken_one(
    sessions: Path, tmp_path: Path, forked: Forked
) -> None:
    """It loses at most the trial that ran; its result is a run that can be compared."""
    whole = forked.run(tune(sessions, tmp_path / "whole"), tmp_path)
    assert whole.code == 0, whole.err
    nowhere = Path(os.devnull)
    process = forked.start(tune(sessions, tmp_path / "broken"), tmp_path, nowhere, nowhere)
    database = tmp_path / "broken.tune.db"
    until_s = time.monotonic() + 120
    while states(database).count("COMPLETE") < 2:
        assert process.poll() is None
        assert time.monotonic() < until_s
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.02)
    process.kill()
    process.wait(30)
    finished = states(database).count("COMPLETE")
    again = forked.run(tune(sessions, tmp_path / "broken"), tmp_path)
    assert again.code == 0, again.err

    assert finished >= 2
    assert states(database).count("FAIL") <= 1
    assert states(database).count("COMPLETE") + states(database).count("PRUNED") == 9
    assert without_places(again.out) == without_places(whole.out)
    runs = [load_run(tmp_path / name) for name in ("whole", "broken")]
    assert compare_runs(*runs, None).difference == 0.0
    main(["report", str(tmp_path / "broken"), "--output", str(tmp_path / "page.html")])
    assert (tmp_path / "page.html").stat().st_size > 1000


def states(database: Path) -> list[str]:
    """Return the states of all trials; none where there is no table yet."""
    if not database.exists():
        return []
    with sqlite3.connect(f"file:{database}?mode=ro", uri=True, timeout=10) as connection:
        try:
            return [state for (state,) in connection.execute("SELECT state FROM trials")]
        except sqlite3.OperationalError:
            return []


def without_places(text: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(text)
    return {key: value for key, value in found.items() if key not in ("run", "storage")}
