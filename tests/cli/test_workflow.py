"""The path of the README: simulate, train, bundle, live, record, replay."""

import json
from pathlib import Path

import numpy as np
import pytest

from taxel.cli.main import main


def run(words: str, capsys: pytest.CaptureFixture[str]) -> object:
    main([*words.split(), "--json"])
    return json.loads(capsys.readouterr().out)


def test_from_nothing_to_a_replayed_decision(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    simulated = run("simulate teng --output data --scans-per-class 4000 --sessions 3", capsys)
    trained = run("train data --output runs/shape --epochs 2 --fold-count 3", capsys)
    bundled = run("bundle runs/shape --output shape.taxel", capsys)
    (live,) = run("live shape.taxel sim://teng?speed=max --seconds 12", capsys)
    main(["record", "sim://teng?speed=max", "--output", "touch.mcap", "--seconds", "12"])
    capsys.readouterr()
    (replayed,) = run("live shape.taxel replay://touch.mcap?speed=max", capsys)

    assert [row["session"] for row in simulated] == ["session-1", "session-2", "session-3"]
    assert trained["parameters"] == 5987
    confusion = np.array(trained["result"]["scores"]["confusion"])
    accuracy = trained["accuracy"]["session held out"]
    assert accuracy == pytest.approx(np.trace(confusion) / confusion.sum())
    assert trained["result"]["windows"] == confusion.sum() > 100
    assert bundled["parity"] < 1e-5
    assert live["windows"] > 3
    assert replayed["windows"] > 3
    assert set(live["answers"]) <= {"sphere", "cylinder", "rectangle", "UNKNOWN"}


def test_a_run_that_was_broken_off_resumes_to_the_same_weights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from taxel.training import loop

    monkeypatch.chdir(tmp_path)
    run("simulate teng --output data --scans-per-class 3000 --sessions 2", capsys)
    train = "train data --output runs/{} --epochs 3 --no-check"
    run(train.format("whole"), capsys)
    real, saved = loop.save_checkpoint, []

    def broken(*args: object) -> None:
        real(*args)
        saved.append(1)
        if len(saved) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(loop, "save_checkpoint", broken)
    with pytest.raises(SystemExit) as ended:
        main(train.format("broken").split())
    monkeypatch.setattr(loop, "save_checkpoint", real)
    capsys.readouterr()
    run(train.format("broken"), capsys)

    assert ended.value.code == 130
    weights = [Path("runs", name, "weights-0.safetensors") for name in ("whole", "broken")]
    assert weights[0].read_bytes() == weights[1].read_bytes()
    assert sorted(path.name for path in Path("runs").iterdir()) == ["broken", "whole"]


def test_models_are_listed_with_their_parameters(capsys: pytest.CaptureFixture[str]) -> None:
    rows = run("models", capsys)

    found = {row["name"]: row["parameters"] for row in rows}
    assert found["cnn2d"] == 5987
    assert found["minirocket"] is None


@pytest.mark.slow
def test_table_4_1_has_every_row_and_what_must_stand_beside_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    from taxel.evaluation.teng.table_4_1 import ROWS

    sections = run("reproduce table-4-1 --scans-per-class 5000 --epochs 1", capsys)

    assert [(s["preset"], s["task"], s["split"]) for s in sections] == [
        ("honest", "shape", "random windows (leaks)"),
        ("honest", "shape", "session held out"),
        ("honest", "material", "random windows (leaks)"),
        ("honest", "material", "session held out"),
        ("paper", "shape", "random windows (leaks)"),
        ("paper", "material", "random windows (leaks)"),
    ]
    for section in sections:
        assert set(section["columns"]) == {"cnn1d", "cnn2d", "minirocket"}
        assert {"majority", "session", "channel means", "length of the trial"} <= set(
            section["trivial"]
        )
        for column in section["columns"].values():
            assert tuple(column["rows"]) == ROWS
