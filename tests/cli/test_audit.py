"""`taxel audit` prints a verdict first, the same in JSON, and refuses bad input in one line."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from taxel.cli.recordings.audit import Audit
from taxel.errors import BadInput
from taxel.evaluation.audit import evidence
from taxel.sim.teng.hand import TengHandConfig
from taxel.sources.simulated.data_sets import write_sessions


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four short sessions of the simulated hand."""
    folder = tmp_path_factory.mktemp("audit") / "hand"
    config = TengHandConfig(sessions=4, rate_hz=100.0, scans_per_class=6000)
    write_sessions(folder, config, lambda _: None)
    return folder


@pytest.fixture(autouse=True)
def _few_trees(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evidence, "TREES", 4)


def test_a_random_split_is_called_a_leak_first(
    hand: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The verdict stands first; what alone gives which accuracy and what to do follow."""
    Audit(data=hand, target="shape", split="random").run()

    lines = capsys.readouterr().out.splitlines()
    assert "do not publish yet" in lines[0]
    text = "\n".join(lines)
    assert "trial" in text
    assert "→ give every trial, with all of its windows, to one side" in text
    assert "looked for and not found" in text


def test_json_holds_every_finding_and_the_verdict(
    hand: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Sessions held out of clean recordings: no alarm, and all kinds are listed."""
    Audit(data=hand, target="shape", split="group:session", json=True).run()

    found = json.loads(capsys.readouterr().out)
    assert found["alarms"] == 0
    assert found["verdict"].startswith("No leak found under the split 'session held out'")
    kinds = {finding["kind"] for finding in found["findings"]}
    assert {"length", "first frame", "overlap", "duplicates", "scaling", "order"} <= kinds


def test_a_table_of_folds_is_audited(
    hand: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Half of the sessions in training, and one of them in the test part again."""
    table = tmp_path / "folds.csv"
    rows = ["session-1,train", "session-2,train", "session-3,test", "session-4,test",
            "session-1,test"]  # fmt: skip
    table.write_text("\n".join(["recording,side", *rows]) + "\n")

    Audit(data=hand, target="shape", folds=table, json=True).run()

    found = json.loads(capsys.readouterr().out)
    leaks = {finding["kind"] for finding in found["findings"] if finding["verdict"] == "leak"}
    assert {"trial", "overlap", "same session"} <= leaks


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda hand: Audit(data=hand / "none"), "check the path"),
        (lambda hand: Audit(data=hand, target="colour"), "--target"),
        (lambda hand: Audit(data=hand, split="by-hand"), "for group:KEY, groups are "),
        (lambda hand: Audit(data=hand, split="random", folds=hand), "one of --split"),
        (lambda hand: Audit(data=hand, unseen=("object",)), "--split, --folds"),
        (lambda hand: Audit(data=hand, split="random", unseen=("colour",)), "'colour'"),
        (
            lambda hand: Audit(data=hand, target="shape", split="random", unseen=("shape",)),
            "with it as group:shape, too",
        ),
        (lambda hand: Audit(data=hand, folds=hand / "none.csv"), "check the path"),
        (lambda hand: Audit(data=hand, trained=hand), "taxel train"),
        (lambda hand: Audit(data=hand, steps=1), "--steps"),
        (lambda hand: Audit(data=hand, fold_count=1), "--fold-count"),
    ],
)
def test_bad_input_is_one_plain_line(
    hand: Path, make: Callable[[Path], Audit], message: str
) -> None:
    """Each says what was needed, what was got and how to mend it."""
    with pytest.raises(BadInput) as error:
        make(hand).run()

    assert message in str(error.value)
    assert "\n" not in str(error.value)
