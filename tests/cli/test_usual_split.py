"""`evaluate`, `learning-curve` and `tune` of recordings without sessions, and no split named."""

import json
from pathlib import Path

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.evaluation.outer_split import OuterSplit
from taxel.training.choose.base import load_base

QUICK = ["--model", "cnn1d", "--epochs", "1", "--window", "steps=20", "gate=none"]


@pytest.fixture(scope="module")
def persons(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recordings of two presses of two strengths by each of four persons."""
    folder = tmp_path_factory.mktemp("usual")
    rng = np.random.default_rng(0)
    lines = ["file,label:level,group:person,channels,time"]
    for n in range(16):
        values = rng.normal((2.0, 10.0)[n % 2], 0.5, (80, 2))
        np.savetxt(folder / f"t{n}.csv", values, delimiter=",")
        lines.append(f"t{n}.csv,{('2', '10')[n % 2]},p{n // 4},1[N] 2[N],rate:100Hz")
    (folder / "table.csv").write_text("\n".join(lines) + "\n")
    main(["import", str(folder / "table.csv"), "--output", str(folder / "set")])
    return folder / "set"


def test_evaluate_holds_out_and_names_what_training_holds_out(
    persons: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["evaluate", str(persons), "--no-comparators", *QUICK]
    main(words)
    printed = capsys.readouterr().out
    main([*words, "--json"])
    found = json.loads(capsys.readouterr().out)["result"]

    assert "level · split: person held out" in printed
    assert found["split"] == OuterSplit().of(load_base(persons, "level")).name
    assert (found["interval_group"], found["interval_groups"]) == ("person", 4)
    assert len(found["fold_accuracies"]) == 4


def test_a_named_split_or_recipe_is_taken_as_it_is(persons: Path, refused) -> None:
    """A split that was asked for is refused where it cannot be, whoever named it."""
    words = ["evaluate", str(persons), "--no-comparators", "--target", "level"]

    assert "the group 'session' on every trial" in refused(
        [*words, *QUICK, "--split", "group:session"]
    )
    assert "the group 'trial_number' on every trial" in refused([*words, "--recipe", "icub-grasp"])


def test_tune_names_the_split_that_it_took(
    persons: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("optuna")
    main(["tune", str(persons), "--trials", "1", "--fold-count", "2", "--settings", "noise",
          "--epochs", "1", "--window", "steps=20", "--output", str(tmp_path / "run")])  # fmt: skip

    assert "level: settings searched · split: person held out" in capsys.readouterr().out
