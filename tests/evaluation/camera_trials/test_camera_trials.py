"""Somebody else's camera trials: read in place, judged beside what is trivial, told live."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from trial_makers import (
    as_avi,
    as_folder,
    as_mp4,
    by_colour,
    few_small_members,
    some_trials,
    trial_images,
    write_trials,
)

from taxel.actions.rule_table import RuleTable
from taxel.bundles.trials import (
    IN_RUN,
    contract_from_json,
    contract_to_json,
    read_trial_contract,
)
from taxel.cli.evaluation.evaluate_trials import EvaluateTrials
from taxel.cli.live.trials import live_trials
from taxel.cli.options.trials import TrialOptions
from taxel.cli.training.train_trials import TrainTrials
from taxel.decisions.recognition import UNKNOWN
from taxel.errors import BadBundle, BadDataset, BadInput, BadSplit, BadTable
from taxel.evaluation.camera_trials.contenders import BAR, FIRST_FRAME, OURS, contenders_for
from taxel.evaluation.camera_trials.crossval import difference, judge_trials, score_trials
from taxel.evaluation.camera_trials.sides import split_by_table, split_trials
from taxel.evaluation.camera_trials.trial_set import Sight, load_trial_set
from taxel.recordings.imports.video_rows import read_video_rows
from taxel.recordings.imports.videos import import_videos
from taxel.windows.camera_trials import are_camera_trials, read_camera_trials
from taxel.windows.trial_crops import (
    FAMILIES,
    Scene,
    look_at,
    row_of,
)
from taxel.windows.trial_layout import Layout, choose_layout


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few and small members: tests look at wiring, not at accuracy."""
    few_small_members(monkeypatch)


@pytest.mark.slow
def test_a_set_goes_from_a_table_to_a_live_verdict_without_glue(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Table → train → bundle → evaluate → live; live, at a trial's end, is what evaluate says."""
    table = write_trials(tmp_path / "a", objects=3, each=4, frames=14, write=as_avi)
    options = TrialOptions(fold_count=3, cache=tmp_path / "cache", split="group:object")
    TrainTrials(trials=table, output=tmp_path / "run", options=options, json=True).run()
    printed = json.loads(capsys.readouterr().out)
    assert printed["target"] == "slipped"
    assert printed["classes"] == ["0", "1"]
    assert (printed["crop"], printed["crops_a_trial"]) == (14, 1)
    assert printed["rows"][0]["trials"]["trials"] == 12
    assert [row["name"] for row in printed["rows"][2:]] == [
        "bar: random forest on 8×6 changes", "bar: random forest on 8×8 colours",
        "bar: five nearest neighbours in 8×8 colours", "control: the trial's first frame, 8×6 grey",
        "control: the commonest class",
    ]  # fmt: skip
    folds = {own["trial"]: own["fold"] for own in printed["predictions"]}
    assert len(folds) == 12
    assert set(Counter(folds.values()).values()) == {4}
    bars = [row for row in printed["rows"][1:] if not row["leaks"]]
    best = max(bars, key=lambda row: row["trials"]["accuracy"])
    assert printed["differences"][0]["other"] == best["name"]
    assert printed["parity"] < 1e-4

    import_videos(read_video_rows(table, table.parent), tmp_path / "imported")
    bundle = tmp_path / "run" / IN_RUN
    EvaluateTrials(trials=bundle, data=tmp_path / "imported", json=True).run()
    offline = json.loads(capsys.readouterr().out)
    live_trials(
        bundle,
        str(tmp_path / "imported"),
        None,
        0.5,
        as_json=True,
        rules=RuleTable(()),
        device="cpu",
    )
    live = json.loads(capsys.readouterr().out)
    assert [t["verdict"] for t in live["trials"]] == [v["verdict"] for v in offline["verdicts"]]
    assert [t["confidence"] for t in live["trials"]] == pytest.approx(
        [v["confidence"] for v in offline["verdicts"]], abs=1e-6
    )
    assert live["marked"] == 12


@pytest.mark.slow
def test_a_verdict_is_unknown_before_a_crop_and_builds_up(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """UNKNOWN until a crop is full; then each half crop adds one; the last rests on three."""
    table = write_trials(tmp_path / "a", objects=2, each=4, frames=26, shorter=14, write=as_avi)
    options = TrialOptions(fold_count=2, cache=tmp_path / "cache")
    TrainTrials(trials=table, output=tmp_path / "run", options=options, check=False).run()
    capsys.readouterr()
    live_trials(
        tmp_path / "run" / IN_RUN,
        str(table),
        None,
        0.0,
        as_json=False,
        rules=RuleTable(()),
        device="cpu",
    )
    first = capsys.readouterr().out.splitlines()
    assert "UNKNOWN" in first[1]
    assert "1 of the 12 frames" in first[1]
    own = first[1 : next(i for i, line in enumerate(first[1:], 1) if line.endswith(":"))]
    assert [line.split("(")[1].split()[0] for line in own if "crop" in line][-1] == "3"


@pytest.mark.slow
def test_at_a_trial_s_end_live_takes_crops_from_where_evaluate_does(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of the part in which something moves, and of a fast camera one image in two."""
    table = write_trials(tmp_path / "a", objects=2, each=4, frames=34, shorter=10, write=as_avi)
    lines = table.read_text().splitlines()
    table.write_text("\n".join([lines[0] + ",rate", *(line + ",60" for line in lines[1:])]) + "\n")
    options = TrialOptions(fold_count=2, crop=8, part="moving", cache=tmp_path / "cache")
    TrainTrials(trials=table, output=tmp_path / "run", options=options, check=False).run()
    bundle = tmp_path / "run" / IN_RUN
    contract = read_trial_contract(bundle)
    assert contract.layout == Layout(8, 3, moving=True, step=2)
    assert contract_from_json(contract_to_json(contract)) == contract
    capsys.readouterr()
    EvaluateTrials(trials=bundle, data=table, json=True).run()
    offline = json.loads(capsys.readouterr().out)
    rules = RuleTable(())
    live_trials(bundle, str(table), None, 0.5, as_json=True, rules=rules, device="cpu")
    live = json.loads(capsys.readouterr().out)
    assert [t["confidence"] for t in live["trials"]] == pytest.approx(
        [v["confidence"] for v in offline["verdicts"]], abs=1e-6
    )


@pytest.mark.parametrize("write", [as_avi, as_mp4, as_folder])
def test_videos_and_folders_of_images_are_read_in_place(tmp_path: Path, write) -> None:
    """All frames, in the order of their numbers, and nothing is copied."""
    table = write_trials(tmp_path, objects=2, each=1, frames=11, cameras=2, write=write)
    before = sorted(tmp_path.rglob("*"))
    assert are_camera_trials(table)
    trials = read_camera_trials(table)
    assert [trial.frames for trial in trials] == [11, 11]
    assert trials[0].cameras == ("left", "right")
    true = trial_images(False, 11, 1, 90)
    shown = trials[0].images(1, [2, 10])
    for number in (2, 10):
        assert np.abs(shown[number].astype(int) - true[number]).mean() < 12
    assert sorted(tmp_path.rglob("*")) == before
    assert trials[0].digest != trials[1].digest


def test_imported_and_in_place_trials_hold_the_same_labels(tmp_path: Path) -> None:
    table = write_trials(tmp_path / "a", objects=2, each=2, frames=12, test_objects=1)
    import_videos(read_video_rows(table, table.parent), tmp_path / "b")
    assert are_camera_trials(tmp_path / "b")
    pairs = zip(read_camera_trials(table), read_camera_trials(tmp_path / "b"), strict=True)
    for own, other in pairs:
        assert dict(own.labels) == dict(other.labels)
        assert own.groups["split"] == other.groups["split"]
        assert own.frames == other.frames


def test_a_table_of_arrays_is_no_table_of_camera_trials(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("file,channels\nx.csv,a[V]\n")
    assert not are_camera_trials(tmp_path / "a.csv")
    assert not are_camera_trials(tmp_path)


def test_a_side_of_no_name_is_refused(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("left,label:x,split\na.avi,1,dev\n")
    with pytest.raises(BadTable, match="train, validation, test"):
        read_camera_trials(tmp_path / "t.csv")


def test_the_crop_fits_the_shortest_trial_and_equal_trials_have_one() -> None:
    assert choose_layout([21, 21, 21]) == Layout(21, 1)
    assert choose_layout([49, 450]) == Layout(48, 3)
    assert choose_layout([30, 90]) == Layout(30, 3)
    assert Layout(20, 3).starts(range(100)) == [0, 40, 80]
    assert Layout(21, 1).starts(range(21)) == [0]
    with pytest.raises(BadInput, match="--crop of 8 to 30"):
        choose_layout([30, 90], 31)
    assert choose_layout([5, 90]) == Layout(5, 3)


def test_a_crop_gives_the_same_numbers_wherever_it_was_cut() -> None:
    images = trial_images(True, 20, 0, 100)
    whole = row_of(look_at(tuple(FAMILIES), [Scene(images[4:14], 25.0, 0.065, by_colour)]))
    alone = row_of(look_at(tuple(FAMILIES), [Scene(list(images[4:14]), 25.0, 0.065, by_colour)]))
    for name in FAMILIES:
        assert np.array_equal(whole[name], alone[name])
        assert np.isfinite(whole[name]).all()


def test_which_camera_is_left_does_not_matter() -> None:
    scenes = [Scene(trial_images(slips, 10, 1, 100), 25.0, 0.065) for slips in (True, False)]
    first, other = (row_of(look_at(("pixels", "stills"), s)) for s in (scenes, scenes[::-1]))
    assert all(np.array_equal(first[name], other[name]) for name in first)


def test_no_object_stands_on_both_sides_and_each_is_tested_once() -> None:
    trials = some_trials()
    split = split_trials(trials.groups, trials.y, "group:object", 3, 0)
    assert split.name == "object held out"
    objects = np.array([own["object"] for own in trials.groups])
    for fold in split.folds:
        assert not set(objects[fold.train_rows]) & set(objects[fold.test_rows])
    assert sorted(np.concatenate([s.test_rows for s in split.folds])) == list(range(24))


def test_test_trials_given_by_a_column_are_the_default() -> None:
    trials = some_trials()
    groups = [{**own, "split": "test" if i >= 16 else "train"}
              for i, own in enumerate(trials.groups)]  # fmt: skip
    split = split_trials(groups, trials.y, None, 5, 0)
    assert split.name == "test trials given"
    assert split.group == "object"
    assert split.folds[0].test_rows.tolist() == list(range(16, 24))


def test_a_table_of_folds_is_followed(tmp_path: Path) -> None:
    trials = some_trials()
    path = tmp_path / "folds.csv"
    lines = [f"o{i},{'train' if i < 3 else 'validation' if i == 3 else 'test'}" for i in range(6)]
    path.write_text("group:object,side\n" + "\n".join(lines) + "\n")
    split = split_by_table(trials.names, trials.groups, trials.y, path)
    assert split.group == "object"
    assert split.folds[0].train_rows.tolist() == list(range(16))
    assert split.folds[0].test_rows.tolist() == list(range(16, 24))
    path.write_text("recording,side\nt0,train\nt1,train\nnone,test\n")
    with pytest.raises(BadSplit, match="'none'"):
        split_by_table(trials.names, trials.groups, trials.y, path)


@pytest.mark.parametrize("text", ["objects", "group:nothing", "order:object:3", "split"])
def test_a_split_that_cannot_be_is_refused_in_one_line(text: str) -> None:
    trials = some_trials()
    with pytest.raises(BadSplit) as caught:
        split_trials(trials.groups, trials.y, text, 3, 0)
    assert "\n" not in str(caught.value)


def test_controls_see_what_they_are_named_for() -> None:
    """Length tells where lengths differ; a first frame without information does not."""
    trials = some_trials()
    split = split_trials(trials.groups, trials.y, "group:object", 3, 0)
    results = judge_trials(trials, split, 0, contenders_for(trials)[1:])
    by_name = {result.name: result.whole for result in results}
    assert by_name["control: the trial's length"].auc == 1.0
    assert by_name["control: the crop's first frame, 8×6 grey"].auc < 0.9
    assert by_name["control: the commonest class"].accuracy == 0.5
    assert by_name[BAR.name].accuracy > 0.9
    assert FIRST_FRAME.rows(trials).shape == (72, 2 * 48)


def test_an_auc_has_no_interval_where_many_draws_of_sessions_lack_a_class() -> None:
    """Of two sessions half of the draws hold one alone, which lacks a class."""
    y, found = np.array([0, 0, 1, 1] * 6), np.tile([[0.7, 0.3], [0.4, 0.6]], (12, 1))
    two, many = y.astype(str), np.repeat([f"s{i}" for i in range(6)], 4)

    assert np.isnan(score_trials(y, found, two).auc_interval).all()
    assert np.isfinite(score_trials(y, found, many).auc_interval).all()
    assert np.isnan(score_trials(y, found, np.full(24, "a")).auc_interval).all()


def test_identical_crops_and_equal_lengths_are_not_judged_again() -> None:
    names = [
        contender.name for contender in contenders_for(some_trials(places=1, lengths=(20, 20)))
    ]
    assert not [name for name in names if "length" in name or "crop's" in name]
    trials = some_trials(places=1, lengths=(20, 20))
    split = split_trials(trials.groups, trials.y, "group:object", 3, 0)
    assert judge_trials(trials, split, 0, (BAR,))[0].places == ()


@pytest.mark.slow
def test_a_difference_to_itself_is_nothing_and_has_an_interval_around_it() -> None:
    trials = some_trials()
    split = split_trials(trials.groups, trials.y, "group:object", 3, 0)
    ours, bar = judge_trials(trials, split, 0, (OURS, BAR))
    same = difference(trials, split, ours, ours)
    assert (same.accuracy, same.auc, same.loss) == (0.0, 0.0, 0.0)
    assert same.accuracy_interval == (0.0, 0.0)
    other = difference(trials, split, ours, bar)
    low, high = other.loss_interval
    assert low <= other.loss <= high


@pytest.mark.slow
def test_nothing_of_a_test_trial_reaches_training() -> None:
    """Test trials with other labels and rows leave the predictions on others unchanged."""
    trials = some_trials()
    split = split_trials(trials.groups, trials.y, "group:object", 3, 0)
    first_fold = replace(split, folds=split.folds[:1])
    held = first_fold.folds[0].test_rows
    before = judge_trials(trials, first_fold, 0, (OURS,))[0].probabilities[held]
    y = trials.y.copy()
    y[held] = 1 - y[held]
    after = judge_trials(replace(trials, y=y), first_fold, 0, (OURS,))[0].probabilities[held]
    assert np.array_equal(before, after)


@pytest.mark.slow
def test_a_damaged_bundle_is_refused(tmp_path: Path) -> None:
    table = write_trials(tmp_path / "a", objects=2, each=2, frames=8)
    options = TrialOptions(fold_count=2, cache=tmp_path / "cache")
    TrainTrials(trials=table, output=tmp_path / "run", options=options, check=False).run()
    path = tmp_path / "run" / IN_RUN
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(bytes(data))
    with pytest.raises(BadBundle):
        EvaluateTrials(trials=path, data=table).run()


def test_a_label_that_is_missing_or_of_one_class_is_refused(tmp_path: Path) -> None:
    table = write_trials(tmp_path / "a", objects=1, each=1, frames=8)
    trials = read_camera_trials(table)
    with pytest.raises(BadDataset, match="labels are slipped"):
        load_trial_set(trials, "outcome", tmp_path)
    with pytest.raises(BadDataset, match="two or more classes"):
        load_trial_set(trials, "slipped", tmp_path)


def test_unknown_is_said_of_a_trial_shorter_than_a_crop(tmp_path: Path) -> None:
    from taxel.bundles.trials import read_trial_bundle
    from taxel.live.whole_trials import predict_trials

    table = write_trials(tmp_path / "a", objects=2, each=2, frames=10)
    options = TrialOptions(fold_count=2, cache=tmp_path / "cache")
    TrainTrials(trials=table, output=tmp_path / "run", options=options, check=False).run()
    short = write_trials(tmp_path / "b", objects=1, each=1, frames=8)
    bundle = read_trial_bundle(tmp_path / "run" / IN_RUN)
    verdict = next(predict_trials(bundle, read_camera_trials(short)))
    assert verdict.label == UNKNOWN
    assert "fewer than a crop" in verdict.reason


def test_images_of_two_sizes_are_refused_by_a_trial_of_each(tmp_path: Path) -> None:
    for number, side in enumerate((32, 32, 40)):
        images = np.random.default_rng(number).integers(0, 256, (3, 24, side), np.uint8)
        np.save(tmp_path / f"t{number}.npy", images)
    (tmp_path / "t.csv").write_text("camera:gel,label:kind\nt0.npy,a\nt1.npy,b\nt2.npy,b\n")
    trials = read_camera_trials(tmp_path / "t.csv")
    with pytest.raises(BadDataset, match="got 32×24 in 0001-t0 and 40×24 in 0003-t2; bring"):
        load_trial_set(trials, "kind", tmp_path / "cache")


def test_images_that_are_nearly_a_line_are_refused(tmp_path: Path) -> None:
    """Before, the picture that movement is followed in had no row, and OpenCV's error came up."""
    for number in range(2):
        images = np.random.default_rng(number).integers(0, 256, (3, 2, 640), np.uint8)
        np.save(tmp_path / f"{number}.npy", images)
    (tmp_path / "t.csv").write_text("camera:gel,label:kind\n0.npy,a\n1.npy,b\n")
    with pytest.raises(BadDataset, match="by a factor of at most 100; got 640×2"):
        load_trial_set(read_camera_trials(tmp_path / "t.csv"), None, tmp_path / "cache")


def test_trials_are_loaded_without_their_looks_whatever_their_lengths(tmp_path: Path) -> None:
    """Of equal lengths, the first frames of the first crops were asked of a view not there."""
    table = write_trials(tmp_path / "a", objects=2, each=2, frames=9, write=as_avi)
    read = read_camera_trials(table)
    views = Sight(views=("pixels",))
    whole = load_trial_set(read, "slipped", tmp_path / "kept")
    alone = load_trial_set(read, "slipped", tmp_path / "kept", sight=views)
    assert alone.layout == Layout(9, 1)
    assert np.array_equal(alone.first, whole.first)
