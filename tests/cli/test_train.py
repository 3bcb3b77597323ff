"""`taxel train` says what its accuracy is worth, and what it will turn away."""

from pathlib import Path

import pytest
import tyro

from taxel.cli.live.bundle import Bundle
from taxel.cli.recordings.simulate.teng import Teng
from taxel.cli.training.train import Train
from taxel.errors import BadInput
from taxel.evaluation.run_scores import GroupInterval, beside_baselines, few_groups


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
    found, said = beside_baselines("net", accuracy, interval, "session", trivial)

    assert found == standing
    assert "“means”" in said
    assert (few_groups("session", groups) is None) == (groups > 5)
