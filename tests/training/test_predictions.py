"""A run keeps what its cross-validation said, and gives it back."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from make_dataset import make_dataset

from taxel.errors import BadInput
from taxel.evaluation.crossval import predictions_of, run_fold
from taxel.evaluation.splits import by_group
from taxel.training.environment import Provenance
from taxel.training.fitting import Job
from taxel.training.loop import TrainConfig
from taxel.training.predictions import Predictions
from taxel.training.run import Run, contract_of, load_run, save_run
from taxel.windows.scaling import fit_scaling


@pytest.fixture(scope="module")
def run() -> Run:
    dataset = make_dataset(sessions=3)
    split = by_group(dataset, "shape", "session", 3, 0)
    job = Job(model="extra-trees", target="shape")
    results = [run_fold(dataset, fold, job) for fold in split.folds]
    scaling = fit_scaling("none", dataset.windows.values, dataset.windows.mask, None)
    return Run(
        networks=(),
        contract=contract_of(dataset, "shape", "extra-trees", (), scaling, {}),
        train=TrainConfig(),
        history=(),
        data="data",
        predictions=predictions_of(dataset, split, results, "shape"),
        trivial={"majority": 0.4},
        made=Provenance.now(["train", "data"]),
    )


def test_predictions_know_which_windows_were_trained_on_in_each_fold(run: Run):
    found = run.predictions
    assert found is not None
    for fold in range(3):
        tested = np.bincount(found.trial[found.fold == fold], minlength=len(found.trials))
        assert not ((tested > 0) & (found.trained[fold] > 0)).any()
        assert (tested + found.trained[fold] == 3).all()


def test_predictions_know_which_windows_stand_at_the_limit():
    dataset = make_dataset(sessions=3)
    last = np.arange(len(dataset)) == len(dataset) - 1
    windows = replace(dataset.windows, saturated=last.astype(np.float32))
    split = by_group(dataset, "shape", "session", 3, 0)
    job = Job(model="extra-trees", target="shape")
    results = [run_fold(dataset, fold, job) for fold in split.folds]

    found = predictions_of(replace(dataset, windows=windows), split, results, "shape")

    assert found.at_limit is not None
    assert np.array_equal(found.at_limit, last[np.concatenate([own.test for own in results])])


def test_a_run_comes_back_with_its_predictions_baselines_and_command(run: Run, tmp_path: Path):
    save_run(tmp_path / "run", run)

    back = load_run(tmp_path / "run", weights=False)

    found, kept = back.predictions, run.predictions
    assert found is not None
    assert kept is not None
    for name in ("trained", "trial", "start_s", "fold", "y", "probabilities"):
        assert np.array_equal(getattr(found, name), getattr(kept, name)), name
    assert found.trials == kept.trials
    assert (found.split, found.classes, found.folds) == (kept.split, kept.classes, kept.folds)
    assert back.trivial == {"majority": 0.4}
    assert back.made == run.made
    assert back.made.command == "taxel train data"


def test_a_run_of_an_older_version_still_loads(run: Run, tmp_path: Path):
    save_run(tmp_path / "run", replace(run, predictions=None))
    path = tmp_path / "run" / "run.json"
    about = json.loads(path.read_text())
    del about["trivial"], about["made"]
    path.write_text(json.dumps(about))

    back = load_run(tmp_path / "run", weights=False)

    assert back.predictions is None
    assert back.trivial == {}
    assert back.made == Provenance()


def test_a_run_that_was_only_evaluated_has_no_weights_to_load(run: Run, tmp_path: Path):
    save_run(tmp_path / "run", run)

    with pytest.raises(BadInput, match="only evaluated"):
        load_run(tmp_path / "run")


@pytest.mark.parametrize("damage", ["cut", "index", "shape", "none"])
def test_damaged_predictions_are_refused_in_one_line(run: Run, tmp_path: Path, damage: str):
    save_run(tmp_path / "run", run)
    path = tmp_path / "run" / "predictions.npz"
    found = run.predictions
    assert found is not None
    arrays = {
        name: getattr(found, name)
        for name in ("trained", "trial", "start_s", "fold", "y", "probabilities")
    }
    if damage == "cut":
        path.write_bytes(path.read_bytes()[:200])
    elif damage == "index":
        np.savez(path, **(arrays | {"y": arrays["y"] + 7}))
    elif damage == "shape":
        np.savez(path, **(arrays | {"fold": arrays["fold"][:-1]}))
    else:
        path.unlink()

    with pytest.raises(BadInput, match="predictions"):
        load_run(tmp_path / "run", weights=False)


def test_a_group_that_trials_lack_is_named(run: Run):
    found = run.predictions
    assert isinstance(found, Predictions)
    with pytest.raises(BadInput, match="'pad'"):
        found.group("pad")


def test_a_command_line_is_kept_only_where_taxel_was_called():
    assert Provenance.now(["report", "a b"]).command == "taxel report 'a b'"
    from taxel.training.environment import _command

    assert _command(["/usr/bin/pytest", "-q"]) == ""
    assert _command(["/x/src/taxel/cli/main.py", "models"]) == "taxel models"
    assert _command(["/x/src/taxel/__main__.py", "report", "a b"]) == "taxel report 'a b'"
