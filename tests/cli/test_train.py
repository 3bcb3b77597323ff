"""`taxel train` says what its accuracy is worth, and what it will turn away."""

from pathlib import Path

import numpy as np
import pytest
import tyro

from taxel.cli.evaluation.evaluate import Evaluate
from taxel.cli.live.bundle import Bundle
from taxel.cli.main import main
from taxel.cli.recordings.simulate.teng import Teng
from taxel.cli.training.train import Train
from taxel.errors import BadInput
from taxel.evaluation.metrics import Scores, near_chance, score
from taxel.evaluation.run_scores import (
    GroupInterval,
    baseline_warning,
    beside_baselines,
    few_groups,
)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three short sessions of the simulated hand."""
    folder = tmp_path_factory.mktemp("train") / "data"
    words = ["--output", str(folder), "--scans-per-class", "3000", "--sessions", "3"]
    tyro.cli(Teng, args=[*words, "--json"]).run()
    return folder


def test_a_network_behind_a_baseline_is_warned_of_and_what_is_unknown_is_reported_in_words(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """One epoch teaches nothing."""
    words = [str(data), "--output", str(tmp_path / "run"), "--epochs", "1", "--fold-count", "3"]
    capsys.readouterr()
    tyro.cli(Train, args=[*words, "--reject-novel", "0.2"]).run()

    lines = capsys.readouterr().out.splitlines()
    warned = [line for line in lines if line.startswith("warning: ")]
    assert "is no better than the baseline “" in warned[0]
    assert any(line.startswith("3 sessions: the interval is about") for line in lines)
    assert any(line.startswith("worse than always guessing the majority class") for line in lines)
    assert any(line.startswith("confusion") for line in lines)
    (novel,) = (line for line in lines if line.startswith("rejects novel touch (UNKNOWN)"))
    assert "expected false rejection rate 0.2 on known touch" in novel
    assert not any("run, replaced: " in line for line in lines)

    tyro.cli(Train, args=[*words, "--no-check"]).run()
    assert "run, replaced: " in capsys.readouterr().out


def test_trials_without_a_window_are_noted_without_a_check_too(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    words = [str(data), "--output", str(tmp_path / "run"), "--epochs", "1", "--no-check"]
    capsys.readouterr()
    tyro.cli(Train, args=[*words, "--window", "steps=120", "stride=120", "--model", "cnn1d"]).run()
    assert " without a window: too short" in capsys.readouterr().out


def test_an_older_bundle_is_replaced_and_anything_else_is_left(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    words = [str(data), "--output", str(tmp_path / "run"), "--epochs", "1", "--no-check"]
    tyro.cli(Train, args=words).run()
    words = [str(tmp_path / "run"), "--output", str(tmp_path / "b.taxel")]
    capsys.readouterr()
    tyro.cli(Bundle, args=words).run()
    assert "b.taxel: " in capsys.readouterr().out
    tyro.cli(Bundle, args=words).run()
    assert "b.taxel, replaced: " in capsys.readouterr().out

    kept = tmp_path / "notes.txt"
    kept.write_text("mine")
    with pytest.raises(BadInput, match="holds something else"):
        tyro.cli(Bundle, args=[*words[:2], str(kept)]).run()
    assert kept.read_text() == "mine"


@pytest.mark.parametrize(
    ("accuracy", "low", "groups", "standing"),
    [
        (0.6, 0.5, 9, "behind"),
        (0.7, 0.55, 9, "near"),
        (0.7, float("nan"), 1, "few"),
        (0.7, 0.61, 5, "few"),
        (0.7, 0.61, 6, "clear"),
    ],
)
def test_a_network_stands_clear_where_its_whole_interval_does_and_runs_could_be_compared(
    accuracy: float, low: float, groups: int, standing: str
):
    """Of fewer than six groups, taxel compare claims nothing."""
    interval = GroupInterval(low, 0.8, groups)
    trivial = {"majority": 0.3, "means": 0.6}
    found, comparison = beside_baselines("net", accuracy, interval, "session", trivial)

    assert found == standing
    assert "“means”" in comparison
    assert (few_groups("session", groups) is None) == (groups > 5)
    assert str(few_groups("cut_from", 4)).startswith("4 files: ")


def scores_of(confusion: list[list[int]]) -> Scores:
    """Return scores of predictions of which each is sure."""
    pairs = [(c, named) for c, row in enumerate(confusion) for named, n in enumerate(row)
             for _ in range(n)]  # fmt: skip
    y, named = np.array(pairs).T
    return score(y, np.eye(len(confusion))[named])


@pytest.mark.parametrize(
    ("confusion", "trivial", "words"),
    [
        ([[40, 10], [50, 0]], {"majority": 0.5, "session": 0.5}, "“majority” (50.0 %): not better "
         "than always naming the commonest class, with a balanced accuracy of 40.0 % (chance 50.0 "
         "%): nothing was learned that holds on the tested days; train longer, or record more "
         "days"),
        ([[40, 10], [50, 0]], {"majority": 0.5, "session": 0.8}, "“session” (80.0 %): not better "
         "than always naming the commonest class (50.0 %), with a balanced accuracy of 40.0 % "),
        ([[70, 5, 5], [3, 7, 0], [3, 0, 7]], {"majority": 0.85}, "“majority” (85.0 %): not better "
         "than always naming the commonest class, with a balanced accuracy of 75.8 % (chance 33.3 "
         "%); train longer"),
        ([[8, 2], [0, 0]], {"majority": 1.0}, "always naming the commonest class; train longer"),
        ([[35, 15], [15, 35]], {"majority": 0.5, "channel means": 0.7}, "“channel means” (70.0 %): "
         "do not claim this accuracy for more than the channels' means; train longer"),
        ([[35, 15], [15, 35]], {"majority": 0.5, "session": 0.8}, "“session” (80.0 %): do not "
         "claim this accuracy; run taxel audit to see whether something gives the label away, "
         "train longer"),
    ],
)  # fmt: skip
def test_a_warning_sends_to_the_audit_only_where_a_baseline_that_hardly_sees_touch_is_as_good(
    confusion: list[list[int]], trivial: dict[str, float], words: str
):
    """An accuracy below the majority class is no sign of a leak: it may be that nothing was
    learned, though not where rare classes are found. Of one class nothing is known.
    """
    line = baseline_warning("net", scores_of(confusion), GroupInterval(0.1, 0.9, 9), "day", trivial)

    assert line is not None
    assert words in line
    assert ("audit" in line) == ("audit" in words)


@pytest.mark.parametrize(("balanced", "near"), [(0.3, True), (0.366, True), (0.367, False)])
def test_near_chance_is_up_to_a_tenth_above_it(balanced: float, near: bool):
    assert near_chance(balanced, 3) is near


@pytest.mark.parametrize(
    ("file", "words", "reason"),
    [
        ("expert.json", ["--split", "random"], "a run that a search chose"),
        ("weights.json", [], "the run of a recipe"),
        ("weights.json", ["--split", "random"], ""),
        ("expert.json", [], ""),
    ],
)
def test_a_run_of_the_other_kind_is_named_before_it_is_replaced(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str], file: str, words: list[str], reason: str,
) -> None:  # fmt: skip
    """Both have the place runs/DATA-TARGET; nothing is replaced before the work is done."""
    run = tmp_path / "runs" / "data-shape"
    run.mkdir(parents=True)
    for name in ("run.json", file):
        (run / name).touch()

    def begin(*_: object, **__: object) -> None:
        raise BadInput("a", "b", "begun")

    monkeypatch.setattr("taxel.evaluation.checked.check_recipe", begin)
    monkeypatch.setattr("taxel.evaluation.expert.train_expert", begin)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadInput, match="begun"):
        tyro.cli(Train, args=[str(data), "--target", "shape", *words]).run()

    note = (
        f"note: runs/data-shape, {reason}, will be replaced; to keep it, choose another --output\n"
    )
    assert capsys.readouterr().err == (note if reason else "")
    assert (run / file).exists()


@pytest.mark.parametrize("file", ["weights-0.safetensors", "predictions.json"])
def test_trained_weights_are_named_before_an_evaluation_replaces_them(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str], file: str,
) -> None:  # fmt: skip
    """Its run has none: hours of training would be gone without a word."""
    run = tmp_path / "run"
    run.mkdir()
    for name in ("run.json", file):
        (run / name).touch()

    def begin(*_: object, **__: object) -> None:
        raise BadInput("a", "b", "begun")

    monkeypatch.setattr("taxel.evaluation.checked.check_recipe", begin)
    words = [str(data), "--target", "shape", "--output", str(run)]
    with pytest.raises(BadInput, match="begun"):
        tyro.cli(Evaluate, args=words).run()

    printed = "a run with trained weights, will be replaced" in capsys.readouterr().err
    assert printed is file.startswith("weights")


@pytest.mark.parametrize(
    ("words", "other"),
    [
        (["--split", "random"], "--split random"),
        (["--model", "cnn2d"], "--model cnn2d"),
        (["--recipe", "teng"], "--recipe teng"),
        (["--window", "steps=50"], "--window"),
        (["--epochs", "3"], "--epochs 3"),
    ],
)
def test_an_option_of_the_search_beside_a_recipe_is_refused_by_both_names(
    words: list[str], other: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["train", "recordings", "--minutes", "1", *words])

    assert ended.value.code == 2
    assert capsys.readouterr().err == (
        f"taxel: needed --minutes or {other}; got both; beside {other}, --minutes would change "
        "nothing; leave one of the two out.\n"
    )
