"""Somebody else's split by the verbs alone: import, audit, train, evaluate, bundle, live."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taxel.cli.main import main

RECIPE = ["--target", "level", "--model", "cnn1d", "--epochs", "3",
          "--window", "steps=20", "grid=own", "gate=none"]  # fmt: skip
Refused = Callable[[list[str]], str]


def write_files(folder: Path, sessions: tuple[str, ...], seed: int) -> Path:
    """Write tables of presses of two strengths and the import table; return that."""
    folder.mkdir()
    rng = np.random.default_rng(seed)
    lines = ["file,label:level,group:session,group:object,channels,time"]
    for session in sessions:
        for level in ("2", "10"):
            for n in range(2):
                name = f"{session}_{level}_{n}.csv"
                values = rng.normal(float(level), 0.5, (80, 2))
                np.savetxt(folder / name, values, delimiter=",")
                lines.append(f"{name},{level},{session},cup{n},1[N] 2[N],rate:100Hz")
    (folder / "table.csv").write_text("\n".join(lines) + "\n")
    return folder / "table.csv"


def write_labels(folder: Path, levels: tuple[str, ...]) -> Path:
    """Import a trial for each level, which may be empty, beside another label; return where to."""
    rng = np.random.default_rng(2)
    column = "label:level," if any(levels) else ""
    lines = [f"file,{column}label:grip,group:session,channels,time"]
    for n, level in enumerate(levels):
        values = rng.normal(float(level or 5), 0.5, (80, 2))
        np.savetxt(folder / f"{n}.csv", values, delimiter=",")
        lines.append(f"{n}.csv,{column and f'{level},'}firm,d,1[N] 2[N],rate:100Hz")
    (folder / "table.csv").write_text("\n".join(lines) + "\n")
    main(["import", str(folder / "table.csv"), "--output", str(folder / "labels")])
    return folder / "labels"


def two_trials_each(folder: Path, parent: Path) -> Path:
    """Return the recordings, each of whose two halves is a trial now."""
    table = parent / "intervals.csv"
    lines = ["recording,start_s,end_s,label:level"]
    for path in sorted(folder.glob("*.mcap")):
        level = path.stem.split("_")[1]
        lines += [f"{path.stem},0.0,0.39,{level}", f"{path.stem},0.4,0.79,{level}"]
    table.write_text("\n".join(lines) + "\n")
    main(["label", str(folder), "--intervals", str(table), "--output", str(parent / "halves")])
    return parent / "halves"


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recordings of three sessions, those of another lab, a table of folds, a run and a bundle."""
    world = tmp_path_factory.mktemp("split")
    for name, sessions, seed in (("ours", ("a", "b", "c"), 0), ("theirs", ("a",), 1)):
        table = write_files(world / f"{name}-files", sessions, seed)
        main(["import", str(table), "--output", str(world / name)])
    (world / "folds.csv").write_text("group:session,side\na,train\nb,validation\nc,test\n")
    (world / "three.csv").write_text("group:session,fold\na,1\nb,2\nc,3\n")
    (world / "wrong.csv").write_text("recording,side\na_2_0,train\nd_2_0,test\n")
    (world / "both.csv").write_text("recording,side\na_2_0,train\na_2_0,test\n")
    main(["train", str(world / "ours"), "--folds", str(world / "folds.csv"), "--output",
          str(world / "run"), *RECIPE])  # fmt: skip
    main(["bundle", str(world / "run"), "--output", str(world / "b.taxel")])
    return world


def printed(capsys: pytest.CaptureFixture[str], *words: object) -> Any:
    """Return the JSON that a command prints."""
    capsys.readouterr()
    main([*map(str, words), "--json"])
    return json.loads(capsys.readouterr().out)


def test_a_run_keeps_the_tables_test_part_unseen(world: Path) -> None:
    """Its accuracy is that of the table; its bundle learned four recordings of twelve."""
    about = json.loads((world / "run" / "run.json").read_text())["contract"]

    assert list(about["accuracy"]) == ["folds.csv, session held out"]
    assert about["classes"] == ["2", "10"]
    assert len(about["learned"]) == 4


def test_evaluate_prints_windows_trials_classes_and_groups(
    world: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The same counts in the table and in JSON."""
    words = ["evaluate", world / "ours", "--folds", world / "folds.csv", "--no-comparators"]
    found = printed(capsys, *words, *RECIPE)["result"]
    main([*map(str, words), *RECIPE])
    output = capsys.readouterr().out

    assert (found["windows"], found["trials"]) == (16, 4)
    assert [part["name"] for part in found["parts"]["classes"]] == ["2", "10"]
    assert [part["trials"] for part in found["parts"]["groups"]["object"]] == [2, 2]
    assert "split: folds.csv, session held out" in output
    assert "cup1" in output


def test_another_folder_is_tested(world: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = printed(capsys, "evaluate", world / "ours", "--test", world / "theirs",
                    "--no-comparators", *RECIPE)  # fmt: skip

    assert found["result"]["split"] == "trained elsewhere, tested on theirs"
    assert found["result"]["trials"] == 4
    assert "minirocket" not in found["bars"]


def test_a_bundle_is_scored_and_says_what_it_learned_from(
    world: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """On another lab's recordings no warning; on its own it names one of them."""
    theirs = printed(capsys, "evaluate", world / "b.taxel", world / "theirs")
    ours = printed(capsys, "evaluate", world / "b.taxel", world / "ours")
    main(["evaluate", str(world / "b.taxel"), str(world / "ours")])
    output = capsys.readouterr().out

    assert theirs["warning"] is None
    assert (theirs["windows"], theirs["trials"], theirs["majority"]) == (16, 4, 0.5)
    assert len(ours["learned_from"]) == 4
    assert "trained on 4 of these recordings" in output


def test_a_bundle_is_scored_on_a_tables_test_part(
    world: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The session that the table tests, and no other: four unseen recordings, so no warning."""
    words = ["evaluate", world / "b.taxel", world / "ours", "--folds", world / "folds.csv"]
    found = printed(capsys, *words)
    main([*map(str, words)])
    output = " ".join(capsys.readouterr().out.split())

    assert (found["windows"], found["trials"]) == (16, 4)
    assert found["split"] == "folds.csv, session held out"
    assert found["warning"] is None
    assert found["learned_from"] == []
    assert "level · test part of folds.csv, session held out" in output
    assert "8 of 12 trials are not in the test part of folds.csv: left out" in output
    assert "warning" not in output


def test_a_test_part_that_the_bundle_was_trained_on_is_said(
    world: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Another table tests what this bundle has seen; training rows that are not there are none of
    a score's business."""
    other = tmp_path / "other.csv"
    other.write_text("recording,side\na_2_0,test\nc_10_1.mcap,test\nelsewhere,train\n")
    found = printed(capsys, "evaluate", world / "b.taxel", world / "ours", "--folds", other)

    assert found["trials"] == 2
    assert found["learned_from"] == ["a_2_0.mcap"]
    assert found["warning"].startswith("the bundle was trained on a_2_0.mcap")


def test_live_replays_a_folder_and_agrees_with_the_score(
    world: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As many windows, and as many of them correct, as `evaluate` counts."""
    scored = printed(capsys, "evaluate", world / "b.taxel", world / "theirs")
    (live,) = printed(capsys, "live", world / "b.taxel",
                      f"replay://{world / 'theirs'}?speed=max")  # fmt: skip

    assert (live["windows"], live["grasps"]) == (scored["windows"], scored["trials"])
    assert live["right"] == round(scored["accuracy"] * scored["windows"])
    assert live["answers"].get("UNKNOWN", 0) == round(scored["unknown"] * scored["windows"])


def test_runs_are_compared_on_a_tables_test_part_and_on_other_recordings(
    world: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A run against itself: no window differs."""
    pair = ["compare", world / "run", world / "run"]
    table = printed(capsys, *pair, "--folds", world / "folds.csv")
    fresh = printed(capsys, *pair, "--test", world / "theirs")

    assert (table["windows"], fresh["windows"]) == (16, 16)
    assert table["difference"] == fresh["difference"] == 0
    assert fresh["split"] == "trained elsewhere, tested on theirs"


@pytest.mark.slow
def test_the_same_table_and_folder_are_audited(
    world: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Both sides hold the same objects; validation is seen before the test."""
    table = printed(capsys, "audit", world / "ours", "--folds", world / "folds.csv", "--unseen",
                    "object")  # fmt: skip
    fresh = printed(capsys, "audit", world / "ours", "--test", world / "theirs")

    assert {finding["kind"]: finding["verdict"] for finding in table["findings"]}[
        "same object"
    ] == "leak"
    assert fresh["split"] == "trained on ours, tested on theirs"
    assert table["groups"]["object"] == {"cup0": 6, "cup1": 6}


def test_a_recording_of_tested_and_other_trials_is_said_where_the_bundle_learned_from_it(
    world: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What it learned from is known by recording only. A table of the test side alone will do."""
    folder = two_trials_each(world / "ours", tmp_path)
    table = tmp_path / "tested.csv"
    notes = {}
    for name in ("a_2_0", "c_2_0"):
        table.write_text(f"recording,start_s,side\n{name},0.1,test\n")
        found = printed(capsys, "evaluate", world / "b.taxel", folder, "--folds", table)
        assert found["trials"] == 1
        notes[name] = [note for note in found["notes"] if "hold other trials too" in note]

    assert notes["c_2_0"] == []
    (note,) = notes["a_2_0"]
    assert note.startswith("1 of the tested recordings hold other trials too")


def test_runs_are_compared_on_the_trials_that_have_the_label(
    world: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Those without are left out and counted, as everywhere."""
    folder = write_labels(tmp_path, ("2", "10", "2", ""))
    words = ["compare", world / "run", world / "run", "--test", folder]
    found = printed(capsys, *words)
    main([*map(str, words)])
    output = capsys.readouterr().out

    assert found["windows"] == 12
    assert found["notes"] == ["1 of 4 trials lack the label 'level': left out"]
    assert "1 of 4 trials lack the label 'level': left out" in output


def test_recordings_without_the_label_are_named_with_what_helps(
    world: Path, tmp_path: Path, refused: Refused
) -> None:
    """A bundle's target cannot be chosen, so that no other label is advised."""
    folder = write_labels(tmp_path, ("", "", "", ""))
    lines = [
        refused(["evaluate", str(world / "b.taxel"), str(folder)]),
        refused(["evaluate", str(world / "ours"), "--test", str(folder), *RECIPE]),
        refused(["compare", str(world / "run"), str(world / "run"), "--test", str(folder)]),
    ]

    for line in lines:
        assert (
            f"trials with the label 'level'; got trials with the labels grip in {folder};" in line
        )
        assert "label the recordings: taxel label RECORDINGS --intervals TABLE" in line
        assert "name one of those" not in line


@pytest.mark.parametrize(
    ("words", "needed"),
    [
        (["evaluate", "ours", "--folds", "folds.csv", "--test", "theirs"], "--folds and --test"),
        (["audit", "ours", "--folds", "folds.csv", "--split", "random"], "--split and --folds"),
        (["evaluate", "ours", "--folds", "folds.csv", "--fold-count", "3"], "--fold-count"),
        (["evaluate", "ours", "--test", "ours"], "which holds the values of"),
        (["evaluate", "b.taxel"], "recordings to score b.taxel on"),
        (["evaluate", "b.taxel", "ours", "--epochs", "3"], "beside --epochs"),
        (["evaluate", "b.taxel", "ours", "--test", "theirs"], "beside --test"),
        (["evaluate", "b.taxel", "--folds", "folds.csv"], "recordings to score b.taxel on"),
        (
            ["evaluate", "b.taxel", "ours", "--folds", "three.csv"],
            "got 3 folds in three.csv, each of which needs a model of its own",
        ),
        (
            ["evaluate", "b.taxel", "ours", "--folds", "three.csv"],
            "give the column side, with test in each row to score",
        ),
        (["evaluate", "b.taxel", "ours", "--folds", "wrong.csv"], "'d_2_0' in wrong.csv, line 3"),
        (["evaluate", "b.taxel", "ours", "--folds", "both.csv"], "a_2_0#0 on two sides of test"),
        (["evaluate", "ours", "theirs"], "a bundle before the recordings"),
        (["evaluate", "ours", "--folds", "5"], "--fold-count 5"),
        (["evaluate", "ours", "--folds", "none.csv"], "a table of folds (CSV) that can be read"),
        (["train", "ours", "--output", "x", "--no-check", "--test", "theirs"], "--test"),
        (["compare", "run", "run", "--test", "ours"], "recordings that neither run was trained on"),
        (["live", "b.taxel", "empty"], "empty"),
        (
            ["train", "ours", "--output", "x", "--fold-count", "y"],
            "a whole number, in the range that its help gives, for --fold-count; got y",
        ),
        (
            ["train", "ours", "--output", "x", "--epochs", "y"],
            "a whole number, in the range that its help gives, for --epochs; got y",
        ),
        (
            ["train", "ours", "--output", "x", "--reject-novel", "y"],
            "a number, in the range that its help gives, for --reject-novel",
        ),
        (["evaluate", "ours", "--window", "fill=2"], "at least 0 and below 1"),
    ],
)
def test_each_mistake_is_one_plain_line(
    world: Path, refused: Refused, monkeypatch: pytest.MonkeyPatch, words: list[str], needed: str
) -> None:
    monkeypatch.chdir(world)
    (world / "empty").mkdir(exist_ok=True)
    recipe = RECIPE if words[:2] == ["evaluate", "ours"] and "--window" not in words else []

    assert needed in refused([*words, *recipe])
    assert not (world / "x").exists()
