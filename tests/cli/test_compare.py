"""`taxel compare`: from two trainings to a verdict, and what it refuses."""

import json
from pathlib import Path

import pytest
import tyro

from taxel.cli.evaluation.compare import Compare
from taxel.cli.recordings.simulate.teng import Teng
from taxel.cli.training.train import Train
from taxel.errors import BadInput

TRAIN = "--epochs 1 --fold-count 3 --json"


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two networks on three simulated sessions, and one that was not checked."""
    folder = tmp_path_factory.mktemp("runs")
    data = str(folder / "data")
    words = ["--output", data, "--scans-per-class", "3000", "--sessions", "3"]
    tyro.cli(Teng, args=[*words, "--json"]).run()
    for name in ("cnn1d", "cnn2d"):
        words = [data, "--output", str(folder / name), "--model", name, *TRAIN.split()]
        tyro.cli(Train, args=words).run()
    words = [data, "--output", str(folder / "blind"), "--no-check", *TRAIN.split()]
    tyro.cli(Train, args=words).run()
    return folder


def compare(*words: str) -> None:
    tyro.cli(Compare, args=list(words)).run()


def test_two_trained_runs_are_compared(runs: Path, capsys: pytest.CaptureFixture[str]):
    compare(str(runs / "cnn2d"), str(runs / "cnn1d"), "--json")
    found = json.loads(capsys.readouterr().out)

    assert found["smallest_p"] == 0.25
    assert len(found["groups"]) == 3
    assert found["difference"] == pytest.approx(found["second"] - found["first"])
    assert sum(group["windows"] for group in found["groups"]) == found["windows"]
    assert "3 sessions" in found["verdict"] or "very same" in found["verdict"]


def test_the_printed_comparison_names_both_tests(runs: Path, capsys: pytest.CaptureFixture[str]):
    compare(str(runs / "cnn2d"), str(runs / "cnn1d"), "--group", "grasp")
    printed = capsys.readouterr().out

    assert "McNemar" in printed
    assert "sign-flip" in printed
    assert "over 20 grasps (sign-flip permutation)" in printed


def test_a_run_without_predictions_is_refused(runs: Path):
    with pytest.raises(BadInput, match="without --no-check"):
        compare(str(runs / "cnn2d"), str(runs / "blind"))


def test_a_folder_that_is_no_run_is_refused(runs: Path):
    with pytest.raises(BadInput, match="a run in"):
        compare(str(runs / "cnn2d"), str(runs / "data"))


@pytest.mark.slow
def test_a_library_model_that_was_only_evaluated_is_compared_too(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """Its cross-validation is kept as a run without weights."""
    from dataclasses import replace

    from taxel.evaluation.checked import check_recipe, run_of_check
    from taxel.training.recipes import find_recipe
    from taxel.training.run import save_run

    recipe = replace(find_recipe("teng"), model="extra-trees")
    checked = check_recipe(runs / "data", recipe, folds=3, bars=())
    save_run(tmp_path / "trees", run_of_check(runs / "data", checked))

    compare(str(runs / "cnn2d"), str(tmp_path / "trees"), "--json")

    found = json.loads(capsys.readouterr().out)
    assert found["second"] == pytest.approx(checked.pooled.scores.accuracy)
