"""Pages about people and data: reaction times, training curves, accuracy against amount of data."""

import json
from pathlib import Path

import pytest

from taxel.cli.main import main
from taxel.recordings.trial_log import GraspTrial, append_trial
from taxel.training.curves import Curve, Epoch, curves_to_json
from taxel.views.report.curves_part import curves_part

CURVES = tuple(
    Curve(f"fold {n}", (Epoch(1, 1.2, 1.1, 0.5, 1.0, 0.55), Epoch(2, 0.6, 0.9, 0.6, 0.4, 0.9)))
    for n in (1, 2)
)
AMOUNT = {"groups": 1, "windows": 40, "accuracy": 0.5, "low": 0.4, "high": 0.6,
          "fold_accuracies": [0.5],
          "trivial": {"majority": 0.3, "channel means": 0.45}}  # fmt: skip
CURVE = {"target": "shape", "model": "cnn2d", "split": "session held out", "group": "session",
         "seed": 0, "amounts": [AMOUNT, AMOUNT | {"groups": 4, "accuracy": 0.8, "low": None,
                                                  "high": None}]}  # fmt: skip


def report(tmp_path: Path, *words: str) -> str:
    page = tmp_path / "page.html"
    main(["report", "--output", str(page), *words])
    return page.read_text()


def test_a_log_becomes_reaction_times_and_outcomes(tmp_path: Path) -> None:
    log = tmp_path / "pour.trials.csv"
    for number, after_s in enumerate((0.4, 0.6, None), 1):
        append_trial(
            log,
            GraspTrial(
                number=number, began_s=0.0, ended_s=6.0, alarm="danger", alarm_s=2.0,
                advice="PUT DOWN", reaction="put down" if after_s else "",
                reaction_s=2.0 + after_s if after_s else None,
                outcome="held" if after_s else "dropped", outcome_by="source",
            ),
        )  # fmt: skip
    page = report(tmp_path, "--reactions", str(log))

    assert "The person in the loop" in page
    assert "<b>0.50 s</b><span>median reaction time</span>" in page
    assert "<b>67 %</b><span>of 3 alarms with a reaction after it</span>" in page
    assert "<td>alarm, no reaction</td><td>1</td><td>0 (0 %)</td><td>0 (0 %)</td>" in page


def test_a_file_that_is_no_log_is_refused_and_no_page_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(SystemExit) as ended:
        report(tmp_path, "--reactions", str(tmp_path / "other.csv"))

    assert ended.value.code == 2
    assert "a log of trials" in capsys.readouterr().err
    assert not (tmp_path / "page.html").exists()


def test_the_gap_between_learned_and_held_out_is_said() -> None:
    page = curves_part(CURVES)

    assert "Gap after the last epoch: 0.500 nats, 30.0 points." in page
    assert "2 folds: mean, least to most" in page
    assert page.count("<svg") == 2


def test_training_alone_claims_no_gap() -> None:
    page = curves_part([Curve("all", (Epoch(1, 1.2), Epoch(2, 0.6)))])

    assert "nothing was held out" in page
    assert "Gap" not in page


def test_saved_curves_are_drawn(tmp_path: Path) -> None:
    (tmp_path / "amounts.json").write_text(json.dumps(CURVE))
    monitor = {"bundle": "cup.taxel", "curves": curves_to_json(CURVES), "parity": 0.0}
    (tmp_path / "monitor.json").write_text(json.dumps(monitor))
    files = [str(tmp_path / name) for name in ("amounts.json", "monitor.json")]
    page = report(tmp_path, "--tables", *files)

    assert "Accuracy against amount of data: shape" in page
    assert "channel means" in page
    assert "Training: cup.taxel" in page
