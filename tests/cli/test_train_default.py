"""`taxel train RECORDINGS` with nothing else: chosen, judged, bundled, live; no hand's gate."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taxel.cli.main import main
from taxel.recordings.imports.importing import ImportRow, import_rows


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two kinds of touch on a foreign array in newtons, three sessions, 20 rows a trial."""
    folder = tmp_path_factory.mktemp("pad")
    rng = np.random.default_rng(0)
    rows = []
    for number in range(18):
        kind, session = number % 2, number // 6
        course = np.linspace(0, 1 + kind, 20)[:, None] * np.array([1.0, 0.5, 0.2])
        values = course + session + rng.normal(0, 0.02, (20, 3))
        file = folder / f"t{number}.csv"
        lines = ["a,b,c", *(",".join(f"{v:.4f}" for v in row) for row in values)]
        file.write_text("\n".join(lines) + "\n")
        rows.append(
            ImportRow(file=file, labels={"push": ("weak", "firm")[kind]},
                      groups={"session": f"s{session}"}, channels="a[N] b[N] c[N]",
                      time="rate:50Hz", sensor="pad")
        )  # fmt: skip
    import_rows(rows, folder / "recordings")
    return folder / "recordings"


@pytest.fixture(scope="module")
def trained(recordings: Path) -> Path:
    run = recordings.parent / "run"
    main(["train", str(recordings), "--output", str(run), "--minutes", "0.02"])
    return run


def test_the_run_holds_what_was_chosen_and_what_it_is_worth(trained: Path):
    about = json.loads((trained / "run.json").read_text())
    choice = json.loads((trained / "expert.json").read_text())

    assert about["contract"]["accuracy"]["session held out"] > 0.9
    assert choice["window"]["gate"] is None
    assert choice["target"] == "push"
    assert choice["leaderboard"]


def test_its_bundle_runs_live(trained: Path, recordings: Path, capsys: pytest.CaptureFixture[str]):
    bundle = trained.with_suffix(".taxel")
    main(["bundle", str(trained), "--output", str(bundle), "--json"])
    parity: Any = json.loads(capsys.readouterr().out)["parity"]
    main(["live", str(bundle), f"replay://{recordings / 't1.mcap'}?speed=max", "--json"])
    (printed,) = json.loads(capsys.readouterr().out)

    assert parity < 1e-5
    assert printed["answers"] == {"firm": 1}


def test_trials_that_a_table_does_not_name_are_counted(
    trained: Path, recordings: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
):
    """As `evaluate` notes it, also where an earlier choice is taken."""
    (tmp_path / "folds.csv").write_text("group:session,side\ns0,train\ns1,test\n")
    main(["train", str(recordings), "--output", str(tmp_path / "run"), "--like",
          str(trained / "expert.json"), "--folds", str(tmp_path / "folds.csv")])  # fmt: skip
    printed = " ".join(capsys.readouterr().out.split())

    assert "6 of 18 trials stand on no side of folds.csv, session held out: left out" in printed


@pytest.mark.parametrize(
    ("words", "need"),
    [
        ("--minutes 0", "--minutes above 0"),
        ("--recipe array --minutes 3", "--minutes or --recipe array; got both"),
        ("--like nothing.json", "expert.json"),
        ("--split random --target push --max-mb 3", "--max-mb or --split random; got both"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(
    words: str, need: str, recordings: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
):
    with pytest.raises(SystemExit) as ended:
        main(["train", str(recordings), "--output", str(tmp_path / "r"), *words.split()])

    message = capsys.readouterr().err
    assert ended.value.code == 2
    assert need in message
    assert not (tmp_path / "r").exists()


def trials_in(folder: Path, rows_of: Any, label: str = "push") -> Path:
    """Import 16 trials of two kinds in four sessions; `rows_of(kind)` gives their values."""
    rows = []
    for number in range(16):
        kind, session = number % 2, number // 4
        file = folder / f"t{number}.csv"
        lines = ["a,b", *(f"{a:.4f},{b:.4f}" for a, b in rows_of(kind))]
        file.write_text("\n".join(lines) + "\n")
        rows.append(
            ImportRow(file=file, labels={label: ("weak", "firm")[kind]},
                      groups={"session": f"s{session}"}, channels="a[N] b[N]",
                      time="rate:50Hz", sensor="pad")
        )  # fmt: skip
    import_rows(rows, folder / "recordings")
    return folder / "recordings"


@pytest.mark.slow
def test_trivial_baselines_stand_beside_the_score_and_a_leaking_length_is_warned_of(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    noise = np.random.default_rng(1)
    data = trials_in(tmp_path, lambda kind: noise.normal(0, 1, (20 + 20 * kind, 2)))
    words = ["train", str(data), "--output", str(tmp_path / "run"), "--minutes", "0.02"]
    main([*words, "--json"])
    nested = json.loads(capsys.readouterr().out)["nested"]
    main(words)
    printed = " ".join(capsys.readouterr().out.split())

    assert nested["trivial"]["length of the trial"] == 1.0
    assert nested["trivial"]["majority"] == 0.5
    assert "no better than the baseline “length of the trial”" in nested["warning"]
    assert "do not claim this accuracy" in printed
    assert "length of the trial 1.0000" in printed


@pytest.mark.slow
def test_channels_that_never_change_are_named_and_alone_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    half, still = tmp_path / "half", tmp_path / "still"
    for folder in (half, still):
        folder.mkdir()
    random = np.random.default_rng(2)
    data = trials_in(half, lambda kind: [(kind + random.normal(0, 0.1), 3.0) for _ in range(20)])
    main(["train", str(data), "--output", str(half / "run"), "--minutes", "0.02", "--no-check"])
    assert "channels that never change: b" in capsys.readouterr().out

    data = trials_in(still, lambda _: np.ones((20, 2)))
    with pytest.raises(SystemExit) as ended:
        main(["train", str(data), "--output", str(still / "run")])
    assert ended.value.code == 2
    assert "channels whose values change" in capsys.readouterr().err


@pytest.mark.slow
def test_a_test_folder_does_not_count_as_learned_from(
    recordings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    random = np.random.default_rng(3)
    data = trials_in(tmp_path, lambda kind: kind + random.normal(0, 0.1, (20, 2)))
    other = tmp_path / "other"
    other.mkdir()
    tested = trials_in(other, lambda kind: kind + random.normal(0, 0.1, (20, 2)))
    run, bundle = tmp_path / "run", tmp_path / "run.taxel"
    main(["train", str(data), "--test", str(tested), "--output", str(run), "--minutes", "0.02"])
    main(["bundle", str(run), "--output", str(bundle)])
    capsys.readouterr()
    main(["evaluate", str(bundle), str(tested)])
    first = capsys.readouterr()
    main(["evaluate", str(bundle), str(data)])
    second = capsys.readouterr()

    assert "was trained on" not in first.out + first.err
    assert "was trained on 16" in second.out + second.err


@pytest.mark.slow
def test_a_repeated_choice_is_judged_on_the_split_that_is_asked_for(
    trained: Path, recordings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    words = ["train", str(recordings), "--like", str(trained / "expert.json")]
    words += ["--output", str(tmp_path / "again")]
    main([*words, "--json"])
    nested = json.loads(capsys.readouterr().out)["nested"]
    main(words)
    printed = " ".join(capsys.readouterr().out.split())

    assert nested["fixed"] is True
    assert nested["scores"]["default"]["accuracy"] > 0.9
    assert "in the run that is repeated" in printed
    assert "chosen before, then trained on each training part" in printed
    assert "--minutes allows more" not in printed


def test_a_recipe_predicts_the_only_label_that_recordings_have(
    recordings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    main(["train", str(recordings), "--window", "steps=20", "--epochs", "1", "--no-check",
          "--output", str(tmp_path / "run"), "--json"])  # fmt: skip
    assert json.loads(capsys.readouterr().out)["target"] == "push"
