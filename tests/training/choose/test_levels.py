"""Levels that follow: when they are tried, when they are chosen, and that live equals offline."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest
from drifting_sessions import SESSIONS, TOUCHES, base_of, touches

from taxel.bundles.contract import MOST_JOINED, contract_from_json, contract_to_json, holding
from taxel.bundles.reader import read_bundle
from taxel.bundles.recordings import load_at_level
from taxel.cli.main import main
from taxel.errors import BadBundle
from taxel.evaluation import bundle_scores
from taxel.evaluation.baselines import trivial_right
from taxel.evaluation.nested import check_choosing
from taxel.evaluation.outer_split import OuterSplit
from taxel.live.recogniser import Recogniser, SessionLevels, follower_of
from taxel.recordings.reader import read_recording
from taxel.training.choose.base import Base
from taxel.training.choose.budget import Budget
from taxel.training.choose.inner_folds import Held
from taxel.training.choose.levels import FEWEST_TOUCHES, level_note, level_to_follow
from taxel.training.choose.preparations import prepare_all
from taxel.training.choose.search import Effort, choose
from taxel.training.unknown import fit_unknown
from taxel.windows.config import WindowConfig
from taxel.windows.scaling import Scaling
from taxel.windows.windower import Windows


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


def test_levels_are_not_followed_where_sessions_go_through_their_classes_in_turn(
    tmp_path: Path,
) -> None:
    """Live, the level of the hard touches before them would make the soft ones hard."""
    folder = touches(tmp_path, 0.1, in_turn=True)

    assert chosen(base_of(folder)) is None


def test_held_out_trials_are_tested_in_order_of_time(drifting: Path) -> None:
    dataset = prepare_all(base_of(drifting))[0].followed("session:10").dataset
    index = np.arange(len(dataset), dtype=np.intp)
    assert dataset.to_level is not None
    assert dataset.tested_level is not None
    measured = dataset.windows.values / dataset.to_level[dataset.trial, None, :]

    np.testing.assert_allclose(
        dataset.tested(index).values, measured * dataset.tested_level[dataset.trial, None, :],
        rtol=1e-5,
    )  # fmt: skip
    assert not np.allclose(dataset.to_level, dataset.tested_level)


def test_simple_baselines_and_novelty_see_held_out_trials_as_they_are_tested(
    drifting: Path,
) -> None:
    """With all of their values at 0, every one looks alike; or, far louder, like nothing known."""
    dataset = prepare_all(base_of(drifting))[0].followed("session:10").dataset
    assert dataset.tested_level is not None
    silent = replace(dataset, tested_level=np.zeros_like(dataset.tested_level))
    loud = replace(dataset, tested_level=50.0 * dataset.tested_level)
    y = dataset.class_numbers("kind")
    first = dataset.trial < len(dataset.trials) // 2
    folds = [(np.flatnonzero(first), np.flatnonzero(~first))]
    right, alike = (
        trivial_right(own, y, folds)["channel means", "trees"] for own in (dataset, silent)
    )
    none = np.zeros(2, np.float32)
    scaling = Scaling(kind="none", offset=none, factor=none + 1)
    usual, far = (fit_unknown(own, "kind", scaling) for own in (dataset, loud))

    assert alike in np.bincount(y[~first]).tolist()
    assert right not in np.bincount(y[~first]).tolist()
    assert far.densities[0].windows.max() > 2.0 * usual.densities[0].windows.max()


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


def test_an_array_that_repeats_one_scan_shows_no_level(bundle: Path, drifting: Path) -> None:
    """Its session would be at the level of that scan for long."""
    recording = read_recording(drifting / "s0.mcap")
    recogniser = Recogniser(read_bundle(bundle), recording.manifest.sensor)
    first = np.zeros(len(recording.samples), np.intp)
    hung = replace(recording.samples, values=recording.samples.values[first])
    answers = recogniser.push(hung)
    level = recogniser.level()

    assert answers
    assert all("repeat one scan" in answer.decision.reason for answer in answers)
    assert level is not None
    assert level.touches == 0


def test_in_a_score_it_shows_none_either(
    bundle: Path, drifting: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A score's levels differed from live ones where an array had hung."""
    opened = read_bundle(bundle)
    known: list[Any] = []

    def noted(*_: object, **words: Any) -> NoReturn:
        known.append(words["usual"])
        raise KeyboardInterrupt

    monkeypatch.setattr(bundle_scores, "load_dataset", noted)
    with pytest.raises(KeyboardInterrupt):
        bundle_scores.score_bundle(opened, drifting)
    (level,) = known
    assert level.usual == opened.contract.usual
    window, channels = opened.contract.window, len(opened.contract.channels)
    rows = np.random.default_rng(0).random((window.steps, channels)).astype(np.float32)
    assert [level.hung(own) for own in (rows, rows[:1].repeat(len(rows), axis=0))] == [False, True]


def test_of_a_folder_recordings_of_one_session_share_a_level(bundle: Path) -> None:
    contract = read_bundle(bundle).contract
    levels = SessionLevels(contract)
    first = levels.of({"session": "a"})

    assert first is not None
    assert levels.of({"session": "a"}) is first
    assert levels.of({"session": "b"}) is not first
    window = replace(contract.window, level_follow=None)
    assert SessionLevels(replace(contract, window=window)).of({"session": "a"}) is None


def test_without_a_gate_a_live_touch_has_as_many_windows_as_a_usual_trial(bundle: Path) -> None:
    """However few of them are joined to one answer."""
    contract = replace(read_bundle(bundle).contract, trial_windows=MOST_JOINED + 4)
    follower = follower_of(contract)
    assert contract.window.gate is None
    assert follower is not None
    assert contract.usual is not None
    loud = np.sqrt(contract.usual.array)[None, None].astype(np.float32)
    window = Windows(loud, np.ones((1, 1), bool), np.ones(1, np.float32), np.zeros(1, np.float32),
                  np.zeros(1), np.zeros(1))  # fmt: skip
    ended = []
    for _ in range(MOST_JOINED + 5):
        follower.begin(window)
        follower.add(window)
        ended.append(follower.touches)

    assert ended == [0] * (MOST_JOINED + 4) + [1]


def test_a_session_may_be_a_recording(
    bundle: Path, drifting: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """As recordings are scored, each of a folder then begins at the usual level."""
    opened = read_bundle(bundle)
    window = replace(opened.contract.window, level_follow="recording:10")
    opened.contract = replace(opened.contract, window=window)
    monkeypatch.setattr("taxel.bundles.reader.read_bundle", lambda *_, **__: opened)
    capsys.readouterr()

    main(["live", str(bundle), f"replay://{drifting}?speed=max", "--json"])

    (result,) = json.loads(capsys.readouterr().out)
    assert result["level"]["touches"] == TOUCHES - 1


def test_live_prints_where_the_level_stands(
    bundle: Path, drifting: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """All but the last of a session's touches have ended by a pause."""
    source = f"replay://{drifting / 's0.mcap'}?speed=max"
    capsys.readouterr()

    main(["live", str(bundle), source, "--json"])
    (result,) = json.loads(capsys.readouterr().out)
    main(["live", str(bundle), source])
    main(["info", str(bundle)])
    printed = " ".join(capsys.readouterr().out.split())

    level = result["level"]
    assert level["touches"] == TOUCHES - 1
    assert 0 < level["least"] < level["most"]
    assert (
        f"levels followed over {TOUCHES - 1} touches: channels stand at {level['least']:.2f} to "
        f"{level['most']:.2f} of the usual level"
    ) in printed
    assert "at 100 scans/s, levels followed (session:10)" in printed


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


def test_training_says_what_levels_need() -> None:
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
        ('"squares": [', '"squares": [NaN, '),
        ('"level_follow": "session:10"', '"level_follow": "session"'),
        ('"level_follow": "session:10"', f'"level_follow": "session:{5000 * "9"}"'),
        ('"level_follow": "session:10"', '"level_follow": "trial:10"'),
    ):
        assert old in text
        with pytest.raises(BadBundle):
            contract_from_json(text.replace(old, new))
