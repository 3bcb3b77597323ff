"""Claims about `taxel split`: it holds out what training holds out, and its table does so again."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from trial_makers import write_trials

from taxel.cli.long_work import LongWork
from taxel.cli.main import main
from taxel.cli.options.trials import TrialOptions
from taxel.cli.printing import progress
from taxel.evaluation.expert import Task, read_and_part
from taxel.evaluation.outer_split import OuterSplit
from taxel.evaluation.table_split import GivenSplit
from taxel.training.run import load_run

Split = Callable[..., Any]


@pytest.fixture(scope="module")
def days(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two presses of a cup and of a jar on each of seven days, but for the jar on the first."""
    folder = tmp_path_factory.mktemp("split")
    rng = np.random.default_rng(0)
    lines = ["file,label:object,group:session,group:take,channels,time"]
    for number in range(28):
        name, day = ("cup", "jar")[number % 2], number // 4 + 1
        if (name, day) != ("jar", 1):
            values = rng.normal(number % 2, 0.5, (60, 2))
            np.savetxt(folder / f"{number}.csv", values, delimiter=",")
            lines.append(f"{number}.csv,{name},day{day},{day},1[N] 2[N],rate:100Hz")
    (folder / "table.csv").write_text("\n".join(lines) + "\n")
    main(["import", str(folder / "table.csv"), "--output", str(folder / "set")])
    return folder / "set"


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One recording of twelve touches, of which each ends where the next begins."""
    folder = tmp_path_factory.mktemp("long")
    np.savetxt(folder / "a.csv", np.random.default_rng(0).normal(0, 1, (600, 2)), delimiter=",")
    (folder / "table.csv").write_text("file,channels,time\na.csv,1[N] 2[N],rate:100Hz\n")
    lines = [f"a.csv,{n / 2},{n / 2 + 0.5},{('cup', 'jar')[n % 2]}" for n in range(12)]
    (folder / "i.csv").write_text("\n".join(["file,start_s,end_s,label:object", *lines]) + "\n")
    main(["import", str(folder / "table.csv"), "--intervals", str(folder / "i.csv"), "--output",
          str(folder / "set")])  # fmt: skip
    return folder / "set"


@pytest.fixture
def split(capsys: pytest.CaptureFixture[str]) -> Split:
    """Return what `taxel split --json` prints for some words."""

    def run(*words: object) -> Any:
        capsys.readouterr()
        main(["split", *map(str, words), "--json"])
        return json.loads(capsys.readouterr().out)

    return run


def test_why_files_are_held_out_where_sessions_are_named_is_said_before_and_in_training(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each object was pressed on a day of its own: a new day of it cannot be tested."""
    lines = ["file,label:object,group:session,channels,time"]
    for number in range(12):
        name = ("cup", "jar")[number % 2]
        np.savetxt(tmp_path / f"{number}.csv", np.random.default_rng(number).normal(size=(30, 2)))
        lines.append(f"{number}.csv,{name},{name}-day,1[N] 2[N],rate:100Hz")
    (tmp_path / "table.csv").write_text("\n".join(lines) + "\n")
    folder = tmp_path / "set"
    main(["import", str(tmp_path / "table.csv"), "--output", str(folder)])
    reason = "sessions cannot be held out: needed at least two groups 'session'"
    capsys.readouterr()

    main(["split", str(folder)])
    before = capsys.readouterr().out
    main(["split", str(folder), "--json"])
    (note,) = json.loads(capsys.readouterr().out)["notes"]
    _, split = read_and_part(Task(data=folder, target="object"))

    assert "split: file held out" in before
    assert f"note: {reason}" in before
    assert note.startswith(reason)
    assert split.notes == (note,)


def test_a_cross_validation_tests_what_the_split_held_out(
    days: Path, tmp_path: Path, split: Split
) -> None:
    """Each fold's days and trials are those that the run's own predictions are of."""
    words = ["--recipe", "array", "--window", "steps=20", "stride=20"]
    main(["evaluate", str(days), *words, "--model", "course-forest", "--no-comparators",
          "--output", str(tmp_path / "run")])  # fmt: skip
    run = load_run(tmp_path / "run", weights=False).predictions
    assert run is not None

    found = split(days, *words)

    assert [fold["name"] for fold in found["folds"]] == list(run.folds)
    assert len(run.folds) == 5
    for number, fold in enumerate(found["folds"]):
        tested = [run.trials[i] for i in set(run.trial[run.fold == number].tolist())]
        assert set(fold["held_out"]) == {trial.groups["session"] for trial in tested}
        assert sum(fold["test"].values()) == len(tested)
        assert sum(fold["train"].values()) == int((run.trained[number] > 0).sum())


@pytest.mark.parametrize(
    ("data", "named", "columns"),
    [("days", None, "group:session,fold"), ("days", "group:file", "group:file,fold"),
     ("days", "order:take:3", "group:take,side"),
     ("long", "order:time:50%", "recording,start_s,side")],
)  # fmt: skip
def test_the_table_parts_as_the_split_did(
    request: pytest.FixtureRequest, tmp_path: Path, split: Split, data: str, named: str | None,
    columns: str,
) -> None:  # fmt: skip
    """And both as a search is parted: `train` asks the same function."""
    path, table = request.getfixturevalue(data), tmp_path / "f.csv"
    words = [] if named is None else ["--split", named]
    base, own = read_and_part(Task(data=path, target="object", split=OuterSplit(named=named)))

    made = split(path, *words, "--output", table)
    given = OuterSplit(given=GivenSplit(table=table))
    _, again = read_and_part(Task(data=path, target="object", split=given))

    assert [fold.test for fold in again.folds] == [fold.test for fold in own.folds]
    assert [fold.train for fold in again.folds] == [fold.train for fold in own.folds]
    assert [sum(fold["test"].values()) for fold in made["folds"]] == [
        len(fold.test) for fold in own.folds
    ]
    first, *rows = table.read_text().splitlines()
    assert (first, len(rows)) == (columns, made["rows_written"])
    assert made["total"] == len(base.trials)


def test_it_names_what_each_fold_holds_out_and_what_a_side_lacks(
    days: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    main(["split", str(days), "--split", "group:session", "--fold-count", "7"])

    lines = capsys.readouterr().out.splitlines()
    assert lines[:5] == [
        "object · split: session held out · 26 trials in 7 folds",
        "without day1: holds out 1 session, day1",
        "  trained on: 24 trials, cup=12, jar=12",
        "  tested: 2 trials, cup=2",
        "  not tested: jar",
    ]


def test_moments_that_are_held_out_are_a_range(
    long: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    main(["split", str(long), "--split", "order:time:50%"])
    line = capsys.readouterr().out.splitlines()[1]
    assert re.search(r": holds out [0-9]+ times, from [0-9.]+ to [0-9.]+$", line), line


def test_trials_on_no_side_are_counted_and_single_windows_are_no_table(
    days: Path, tmp_path: Path, split: Split, refused: Callable[[list[str]], str]
) -> None:
    found = split(days, "--split", "order:take:2:4")
    assert (found["left_out"], found["total"]) == (12, 26)

    windows = split(days, "--split", "random", "--window", "steps=20", "stride=20")
    assert windows["counted"] == "window"
    assert sum(windows["folds"][0]["train"].values()) == 62
    words = ["split", str(days), "--split", "random", "--output", str(tmp_path / "f.csv")]
    message = refused([*words, "--window", "steps=20"])
    assert "needed a split of whole trials, to write it as a table" in message
    assert not (tmp_path / "f.csv").exists()


def test_a_table_that_is_there_stays(
    days: Path, tmp_path: Path, refused: Callable[[list[str]], str]
) -> None:
    (tmp_path / "f.csv").write_text("mine")
    line = refused(["split", str(days), "--output", str(tmp_path / "f.csv")])
    assert line.startswith("taxel: needed a new file for --output; got ")
    assert (tmp_path / "f.csv").read_text() == "mine"


@pytest.mark.parametrize("named", [None, "random"])
def test_camera_trials_are_parted_as_they_are_trained(
    tmp_path: Path, split: Split, refused: Callable[[list[str]], str], named: str | None
) -> None:
    """`evaluate-trials` and `train-trials` ask the same function; the table gives the same."""
    data, table = write_trials(tmp_path / "trials"), tmp_path / "f.csv"
    words = [] if named is None else ["--split", named]

    found = split(data, "--target", "slipped", *words, "--fold-count", "3", "--output", table)
    with progress() as bar:
        parted = [TrialOptions(target="slipped", split=named, fold_count=3), TrialOptions(
            target="slipped", folds=table)]  # fmt: skip
        own, again = (
            options.read_and_part(data, LongWork(bar))[1].folds for options in parted
        )  # fmt: skip

    assert [(fold.train, fold.test) for fold in again] == [(f.train, f.test) for f in own]
    assert [sum(fold["test"].values()) for fold in found["folds"]] == [len(f.test) for f in own]
    assert "recordings of an array beside --recipe" in refused(
        ["split", str(data), "--recipe", "array"]
    )


@pytest.mark.parametrize("verb", ["split", "audit", "train", "evaluate"])
@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("camera:g,label:k\ncafé.avi,0\n".encode("latin-1"), "needed text in UTF-8; got another"),
        (b"video,label\na.avi,0\n", "label:NAME and group:NAME; got the columns 'video', 'label' "),
    ],
)
def test_a_table_that_no_trials_can_be_read_from_is_refused_by_its_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str, table: bytes, message: str
) -> None:
    """Before, it was called no recording, and a person was sent to taxel import."""
    (tmp_path / "trials.csv").write_bytes(table)
    with pytest.raises(SystemExit, match="2"):
        main([verb, str(tmp_path / "trials.csv")])
    assert message in capsys.readouterr().err
