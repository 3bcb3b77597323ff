"""`taxel sweep`: from a bundle and recordings to curves, and what it refuses."""

import json
from pathlib import Path

import pytest
import tyro

from taxel.cli.evaluation.sweep import Sweep
from taxel.cli.live.bundle import Bundle
from taxel.cli.recordings.simulate.teng import Teng
from taxel.cli.training.train import Train
from taxel.errors import BadBundle, BadInput, RecordingFailed

KEYS = {"fault", "level", "unit", "accuracy", "low", "high", "answered", "windows", "grasps",
        "grasps_answered", "outside", "draws", "base"}  # fmt: skip


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bundle with its recordings, and others."""
    folder = tmp_path_factory.mktemp("sweep")
    for name, seed in (("seen", 0), ("new", 4)):
        words = ["--output", str(folder / name), "--scans-per-class", "9000"]
        tyro.cli(Teng, args=[*words, "--sessions", "2", "--seed", str(seed), "--json"]).run()
    words = [str(folder / "seen"), "--output", str(folder / "run"), "--no-check", "--json"]
    tyro.cli(Train, args=[*words, "--epochs", "2", "--recipe", "teng-referenced"]).run()
    words = [str(folder / "run"), "--output", str(folder / "b.taxel"), "--json"]
    tyro.cli(Bundle, args=words).run()
    return folder


def sweep(*words: str | Path) -> None:
    tyro.cli(Sweep, args=list(map(str, words))).run()


def test_recordings_give_a_list_of_points_a_file_and_a_figure(
    place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    sweep(
        place / "b.taxel", "--data", place / "new", "--faults", "noise,missing", "--json",
        "--output", tmp_path / "curves.json", "--plot", tmp_path / "curves.png",
    )  # fmt: skip
    captured = capsys.readouterr()
    rows = json.loads(captured.out)

    assert all(set(row) == KEYS for row in rows)
    assert [row["fault"] for row in rows] == ["none", *["noise"] * 7, *["missing"] * 4]
    assert {row["draws"] for row in rows} == {1}
    assert rows[-1]["accuracy"] is None
    assert rows[-1]["answered"] == 0.0
    assert json.loads((tmp_path / "curves.json").read_text()) == rows
    assert (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")
    assert "not honest" not in captured.err


def test_numbers_do_not_take_the_place_of_a_picture_or_a_recording(place: Path, tmp_path: Path):
    with pytest.raises(BadInput, match=r"\.json for --output.*--plot"):
        sweep(place / "b.taxel", "--data", place / "new", "--output", tmp_path / "curves.png")


def test_curves_are_printed_even_where_their_file_cannot_be_written(
    place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    words = ("--data", place / "new", "--faults", "loss", "--levels", "10", "--json")
    (tmp_path / "taken.json").mkdir()
    with pytest.raises(RecordingFailed):
        sweep(place / "b.taxel", *words, "--output", tmp_path / "taken.json")

    assert len(json.loads(capsys.readouterr().out)) == 2


def test_the_recordings_that_were_learned_from_are_reported(
    place: Path, capsys: pytest.CaptureFixture[str]
):
    sweep(place / "b.taxel", "--data", place / "seen", "--faults", "loss", "--levels", "10")
    captured = capsys.readouterr()

    assert "the accuracies below are too high" in captured.err
    assert "loss, %" in captured.out


def test_conditions_are_simulated(place: Path, capsys: pytest.CaptureFixture[str]):
    sweep(
        place / "b.taxel", "--simulate", "--faults", "dust", "--levels", "0.5", "--sessions", "2",
        "--session-s", "130", "--json",
    )  # fmt: skip
    rows = json.loads(capsys.readouterr().out)

    assert [(row["fault"], row["level"]) for row in rows] == [("none", 0.0), ("dust", 0.5)]
    assert rows[1]["unit"] == "share of the pads"


@pytest.mark.slow
def test_a_grasp_bundle_is_swept_over_its_cameras(
    pour_made_once: Path, capsys: pytest.CaptureFixture[str]
):
    sweep("cup-pour", "--data", pour_made_once, "--faults", "blur", "--levels", "2", "--json")
    rows = json.loads(capsys.readouterr().out)

    assert [row["unit"] for row in rows] == ["", "px"]
    assert rows[0]["windows"] > 80


@pytest.mark.parametrize(
    ("words", "match"),
    [
        ((), "neither"),
        (("--data", "new", "--simulate"), "both"),
        (("--data", "new", "--faults", "rain"), "noise"),
        (("--data", "new", "--faults", "blur"), "noise"),
        (("--simulate", "--faults", "rain"), "temperature"),
        (("--simulate", "--faults", "dust", "--levels", "2"), "dust within 0 and 1"),
        (("--data", "new", "--levels", "2"), "one fault beside --levels"),
        (("--data", "new", "--faults", "noise", "--levels", "ten"), "numbers for --levels"),
        (("--data", "new", "--faults", "loss", "--levels", "120"), "within 0 and 99"),
        (("--data", "gone", "--faults", "loss", "--levels", "120"), "within 0 and 99"),
        (("--data", "gone", "--faults", "dead", "--levels", "13"), "within 0 and 12 channels"),
        (("--simulate", "--session-s", "20", "--sessions", "2"), "give a longer --session-s"),
        (("--data", "new", "--least-confidence", "2"), "least-confidence"),
        (("--data", "new", "--plot", "curves.pdf"), "png"),
        (("--simulate", "--seed", "-1"), "--seed"),
        (("--simulate", "--sessions", "0"), "--sessions"),
    ],
)
def test_what_cannot_be_measured_is_refused(place: Path, words: tuple[str, ...], match: str):
    given = [place / word if word == "new" else word for word in words]
    with pytest.raises(BadInput, match=match):
        sweep(place / "b.taxel", *given)


def test_cameras_cannot_be_simulated_by_conditions():
    with pytest.raises(BadInput, match="taxel simulate cup-pour"):
        sweep("cup-pour", "--simulate")


def test_levels_of_cameras_are_checked_before_the_recordings_are_read(place: Path):
    with pytest.raises(BadInput, match="levels of blur within 0 and 50"):
        sweep("cup-pour", "--data", place / "gone", "--faults", "blur", "--levels", "99")


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ("new/session-1.mcap", "another kind of file"),
        ("run", "run, a run; write one with: taxel bundle .*run --output FILE"),
        ("seen", "seen, a folder"),
        ("gone.taxel", "gone.taxel, which is not there"),
    ],
)
def test_what_is_no_bundle_is_refused(place: Path, given: str, match: str):
    with pytest.raises(BadBundle, match=match):
        sweep(place / given, "--data", place / "new")
