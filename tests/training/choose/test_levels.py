"""Levels that follow: when they are tried, when they are chosen, and that live equals offline."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.contract import contract_from_json, contract_to_json, holding
from taxel.bundles.reader import read_bundle
from taxel.bundles.recordings import load_at_level
from taxel.cli.live.arrays import MANY_TOUCHES, _summary_lines
from taxel.cli.main import main
from taxel.errors import BadBundle
from taxel.evaluation.nested import check_choosing
from taxel.evaluation.outer_split import OuterSplit
from taxel.live.recogniser import Recogniser, SessionLevels
from taxel.recordings.imports.importing import ImportRow, import_rows
from taxel.recordings.reader import read_recording
from taxel.training.choose.base import Base, load_base
from taxel.training.choose.budget import Budget
from taxel.training.choose.inner_folds import Held
from taxel.training.choose.levels import FEWEST_TOUCHES, level_note, level_to_follow
from taxel.training.choose.preparations import prepare_all
from taxel.training.choose.search import Effort, choose
from taxel.windows.config import WindowConfig

SESSIONS, TOUCHES, ROWS = 6, 40, 20


def touches(folder: Path, spread: float) -> Path:
    """Write sessions of touches of a soft and a hard thing, 1.5 s apart; channels' gains differ.

    Hard is 1.4 times soft on the first channel: what a gain of another session hides.
    """
    rng = np.random.default_rng(5)
    spans, files = ["file,start_s,end_s,label:kind"], []
    for session in range(SESSIONS):
        gain = np.exp(rng.normal(0.0, spread, 2))
        rows = ["t,a,b"]
        for number in range(TOUCHES):
            hard = int(rng.integers(0, 2))
            level = np.array([1.4 if hard else 1.0, 1.0]) * gain * rng.normal(1.0, 0.05)
            values = level * (1.0 + rng.normal(0.0, 0.02, (ROWS, 2)))
            start = number * 1.5
            rows += [f"{start + 0.01 * i:.2f},{x:.4f},{y:.4f}" for i, (x, y) in enumerate(values)]
            kind = ("soft", "hard")[hard]
            spans.append(f"s{session},{start:.3f},{start + 0.2:.3f},{kind}")
        files.append(folder / f"s{session}.csv")
        files[-1].write_text("\n".join(rows) + "\n")
    import_rows(
        [ImportRow(file=file, labels={}, groups={"session": file.stem, "day": f"d{place // 3}"},
                   time="t[s]", sensor="pad", channels="a[V] b[V]")
         for place, file in enumerate(files)], folder / "raw",
    )  # fmt: skip
    (folder / "spans.csv").write_text("\n".join(spans) + "\n")
    main(["label", str(folder / "raw"), "--intervals", str(folder / "spans.csv"), "--output",
          str(folder / "recordings")])  # fmt: skip
    return folder / "recordings"


@pytest.fixture(scope="module")
def drifting(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return touches(tmp_path_factory.mktemp("drifting"), 0.3)


def base_of(folder: Path) -> Base:
    return load_base(folder, "kind")


def quick() -> Effort:
    """Return an effort whose time is up once what must be tried was tried."""
    begun: list[str] = []
    clock = lambda: 0.0 if len(begun) <= 6 else 1e9  # noqa: E731
    return Effort(budget=Budget(60.0, clock=clock, at_once=1), on_step=begun.append)


def chosen(base: Base) -> str | None:
    found = choose(base, prepare_all(base), range(len(base.trials)), Held("session"), quick())
    return found.part.prepared.config.level_follow


def test_levels_are_followed_where_gains_of_sessions_hide_the_label(drifting: Path) -> None:
    assert chosen(base_of(drifting)) == "session:10"


def test_levels_are_not_followed_where_sessions_are_alike(tmp_path: Path) -> None:
    assert chosen(base_of(touches(tmp_path, 0.0))) is None


def test_levels_of_few_or_short_sessions_of_objects_or_of_nothing_are_not_tried(
    drifting: Path,
) -> None:
    base = base_of(drifting)
    every = range(len(base.trials))
    short = [i for i in every if i % TOUCHES < FEWEST_TOUCHES - 1]

    assert level_to_follow(base, every, Held("session")) == "session:10"
    assert level_to_follow(base, every, Held("day")) == "session:10"
    assert level_to_follow(base, every, Held("object")) == "session:10"
    assert level_to_follow(base, range(2 * TOUCHES), Held("session")) is None
    assert level_to_follow(base, short, Held(None)) is None


def test_levels_of_sessions_of_one_class_are_not_tried(drifting: Path) -> None:
    """What is common to such a session is the class."""
    base = base_of(drifting)
    session = [int(trial.groups["session"].removeprefix("s")) for trial in base.trials]
    pure = [i for i, own in enumerate(session) if base.y[i] == own % 2]

    assert level_to_follow(base, pure, Held("session")) is None


def test_simple_models_beside_are_judged_on_values_as_measured(drifting: Path) -> None:
    """They would have the followed levels for nothing otherwise."""
    base = base_of(drifting)
    split = OuterSplit(named="group:session", folds=2).of(base)
    effort = Effort(budget=Budget(2.0, 2))
    nested = check_choosing(base, prepare_all(base), split, effort, ("channel means",))

    assert nested.choices[0].window.level_follow == "session:10"
    assert nested.scores.scores.accuracy > nested.trivial["channel means"]
    assert nested.scores.scores.accuracy > nested.bars["channel means"][0].scores.accuracy


@pytest.fixture(scope="module")
def bundle(drifting: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    main(["train", str(drifting), "--target", "kind", "--split", "group:session", "--minutes",
          "0.05", "--no-check", "--output", str(folder / "run")])  # fmt: skip
    main(["bundle", str(folder / "run"), "--output", str(folder / "b.taxel")])
    return folder / "b.taxel"


def test_live_follows_as_a_score_of_recordings_does(
    bundle: Path, drifting: Path, tmp_path: Path
) -> None:
    """Live, scans come ten at a time; a new session begins at the usual level."""
    opened = read_bundle(bundle)
    last = drifting / f"s{SESSIONS - 1}.mcap"
    (tmp_path / last.name).write_bytes(last.read_bytes())
    recording = read_recording(last)
    recogniser = Recogniser(opened, recording.manifest.sensor)
    live = []
    for start in range(0, len(recording.samples), 10):
        live += recogniser.push(recording.samples[start : start + 10])
    live += recogniser.flush()
    dataset = load_at_level(tmp_path, opened.contract, target="kind")
    offline = opened.probabilities(dataset.windows.values, dataset.windows.mask)

    assert opened.contract.window.level_follow == "session:10"
    assert len(live) == len(dataset) == 2 * TOUCHES
    assert dataset.to_level is not None
    assert np.ptp(dataset.to_level[:, 0]) > 0.1
    found = np.stack([answer.decision.probabilities for answer in live])
    np.testing.assert_allclose(found, offline, atol=1e-5)


def test_of_a_folder_recordings_of_one_session_share_a_level(bundle: Path) -> None:
    contract = read_bundle(bundle).contract
    levels = SessionLevels(contract)
    first = levels.of({"session": "a"})

    assert first is not None
    assert levels.of({"session": "a"}) is first
    assert levels.of({"session": "b"}) is not first
    window = replace(contract.window, level_follow=None)
    assert SessionLevels(replace(contract, window=window)).of({"session": "a"}) is None


def test_live_prints_where_the_level_stands(
    bundle: Path, drifting: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """All but the last of a session's touches have ended by a pause."""
    source = f"replay://{drifting / 's0.mcap'}?speed=max"
    capsys.readouterr()

    main(["live", str(bundle), source, "--json"])
    (result,) = json.loads(capsys.readouterr().out)
    main(["live", str(bundle), source])
    printed = " ".join(capsys.readouterr().out.split())

    level = result["level"]
    assert level["touches"] == TOUCHES - 1
    assert 0 < level["least"] < level["most"]
    assert (
        f"levels followed over {TOUCHES - 1} touches: channels stand at {level['least']:.2f} to "
        f"{level['most']:.2f} of the usual level"
    ) in printed


def test_a_bundle_may_hold_the_usual_level(
    bundle: Path, drifting: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its accuracy is not known then; values are as measured, for `evaluate` and `live` alike."""
    held = tmp_path / "held.taxel"
    main(["bundle", str(bundle.parent / "run"), "--output", str(held), "--hold-level"])
    contract = read_bundle(held).contract

    assert (contract.window.level_follow, contract.usual, contract.accuracy) == (None, None, {})
    assert load_at_level(drifting, contract).to_level is None
    with pytest.raises(BadBundle, match="levels are followed"):
        holding(contract)


def test_training_says_what_levels_need_and_live_warns_of_a_session_of_one_answer() -> None:
    result = {
        "marked": 0, "grasps_without": 0, "filled": 0, "gate_moves": [], "still_channels": [],
        "rate_changes": [], "outages": [], "windows": 0, "answers": {"hard": 9, "soft": 1},
        "level": {"touches": MANY_TOUCHES, "least": 0.5, "most": 2.0}, "warning": None,
    }  # fmt: skip
    mixed = result | {"answers": {"hard": 8, "soft": 2}}
    few = result | {"level": {"touches": MANY_TOUCHES - 1, "least": 0.5, "most": 2.0}}

    assert any("90% of the answers are hard" in line for line, _ in _summary_lines(result))
    for fine in (mixed, few):
        assert not any("--hold-level" in line for line, _ in _summary_lines(fine))
    (note,) = level_note(WindowConfig(level_follow="session:10"))
    assert "--hold-level" in note
    assert level_note(WindowConfig()) == ()


def test_a_contract_keeps_the_usual_level_and_refuses_one_that_does_not_fit(bundle: Path) -> None:
    contract = read_bundle(bundle).contract
    text = contract_to_json(contract)

    assert contract_from_json(text).usual == contract.usual
    for old, new in (
        ('"level_follow": "session:10"', '"level_follow": null'),
        ('"quietest": ', '"quietest": -'),
        ('"squares": [', '"squares": [1.0, '),
    ):
        assert old in text
        with pytest.raises(BadBundle):
            contract_from_json(text.replace(old, new))
