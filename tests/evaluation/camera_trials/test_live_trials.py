"""Bundles on trials: the very images, what they learned from, recordings without the cameras."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from trial_makers import as_avi, as_folder, few_small_members, write_trials

from taxel.actions.rule_table import RuleTable
from taxel.bundles.trials import (
    IN_RUN,
    TrialContract,
    contract_from_json,
    contract_to_json,
    read_trial_contract,
)
from taxel.cli.evaluation.evaluate_trials import EvaluateTrials
from taxel.cli.live.trials import live_trials
from taxel.cli.options.trials import TrialOptions
from taxel.cli.training.train_trials import TrainTrials
from taxel.errors import BadBundle, BadSource
from taxel.evaluation.camera_trials.learned_trials import trained_on
from taxel.frame_codec import decode_frame
from taxel.live.frame_loop import moments_and_marks
from taxel.live.station.station import Station
from taxel.live.station.wiring import StationConfig
from taxel.live.trial_replay import TrialReplay
from taxel.live.trial_watch import TrialWatch
from taxel.live.whole_trials import check_trials, predict_trials
from taxel.recordings.imports.video_rows import read_video_rows
from taxel.recordings.imports.videos import import_videos
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Samples, SensorInfo
from taxel.windows.camera_trials import read_camera_trials
from taxel.windows.pairs import FramePairer
from taxel.windows.trial_crops import FAMILIES


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few and small members: tests look at wiring, not at accuracy."""
    few_small_members(monkeypatch)


def test_live_names_a_recording_without_the_cameras_before_it_prints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing stands on stdout, and the line says which recording holds what."""
    sensor = SensorInfo(name="pad", channels=("a", "b"), units=("V", "V"), rate_hz=100.0)
    contract = SimpleNamespace(cameras=2)
    file = tmp_path / "touch.mcap"
    with Recorder(file, Manifest.started_now(sensor, {}, now_s=0.0)) as recorder:
        recorder.write(Samples.from_values(np.zeros((30, 2), "f4"), np.arange(30) / 100.0))
    monkeypatch.setattr(
        "taxel.bundles.trials.read_trial_bundle", lambda *_: SimpleNamespace(contract=contract)
    )
    words = {"as_json": False, "rules": RuleTable(()), "device": "cpu"}
    with pytest.raises(BadBundle, match=f"{file}, which holds 0 and an array of 2 channels"):
        live_trials(tmp_path / "a.taxel", str(tmp_path), None, 0.5, **words)
    assert capsys.readouterr().out == ""


def test_a_trial_of_another_camera_is_named_before_the_first_is_looked_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before, with --json the verdicts on those above it were lost, and it had no name."""
    for number, width in enumerate((30, 31)):
        np.save(tmp_path / f"{number}.npy", np.zeros((9, 20, width), np.uint8))
    table = tmp_path / "t.csv"
    table.write_text("camera:gel\n0.npy\n1.npy\n")
    contract = TrialContract(
        target="kind", classes=("a", "b"), crop=9, places=1, views=("pixels",), versions=("",),
        cameras=1, width=30, height=20, rate_hz=25.0, mm_per_px=0.065, sharpness=1.0,
        threshold=None, data_digest="", measured={}, software="",
    )  # fmt: skip
    bundle = SimpleNamespace(contract=contract)
    monkeypatch.setattr("taxel.bundles.trials.read_trial_bundle", lambda *_: bundle)
    words = {"as_json": False, "rules": RuleTable(()), "device": "cpu"}
    with pytest.raises(BadBundle, match="frames of 30×20; got 31×20 in 0002-1"):
        live_trials(tmp_path / "a.taxel", str(table), None, 0.5, **words)
    assert capsys.readouterr().out == ""
    with pytest.raises(BadBundle, match="31×20 in 0002-1"):
        next(predict_trials(bundle, read_camera_trials(table)))  # type: ignore[arg-type]


def test_trials_of_the_same_cameras_in_another_order_are_refused(tmp_path: Path) -> None:
    """Models know cameras by their place: swapped columns gave wrong verdicts without a word.

    Bundles that do not hold the names, and cameras of other names, are taken as they come.
    """
    cameras = ("left", "middle", "right")
    for name in cameras:
        np.save(tmp_path / f"{name}.npy", np.zeros((9, 20, 30), np.uint8))
    contract = TrialContract(
        target="kind", classes=("a", "b"), crop=9, places=1, views=("pixels",),
        versions=(FAMILIES["pixels"].key,), cameras=3, width=30, height=20, rate_hz=25.0,
        mm_per_px=0.065, sharpness=1.0, threshold=None, data_digest="", measured={}, software="",
        names=cameras,
    )  # fmt: skip
    contract = contract_from_json(contract_to_json(contract))
    assert contract.names == cameras
    older = contract_from_json(contract_to_json(replace(contract, names=())))
    for columns, held in (
        (("middle", "left", "right"), contract), (cameras, None), (cameras[::-1], contract)
    ):  # fmt: skip
        table = tmp_path / "t.csv"
        table.write_text(
            ",".join(f"camera:{name}" for name in columns)
            + "\n" + ",".join(f"{name}.npy" for name in columns) + "\n"
        )  # fmt: skip
        trials = read_camera_trials(table)
        check_trials(older, trials)
        check_trials(replace(contract, names=("a", "b", "c")), trials)
        if held is None:
            check_trials(contract, trials)
            continue
        wanted = f"order left, middle, right; got {', '.join(columns)} in 0001-{columns[0]}"
        with pytest.raises(BadBundle, match=wanted):
            check_trials(contract, trials)
        with TrialReplay(trials[0]) as source, pytest.raises(BadBundle, match="in the order left"):
            TrialWatch(SimpleNamespace(contract=contract), source.cameras)  # type: ignore[arg-type]
    with pytest.raises(BadBundle, match="number of cameras"):
        contract_from_json(contract_to_json(replace(contract, names=("left",))))


def test_a_recording_of_swapped_cameras_is_named_before_the_first_is_replayed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With --json the verdicts on the recordings before it were lost."""
    left, right = (
        CameraInfo(name=name, width=30, height=20, rate_hz=25.0) for name in ("left", "right")
    )
    for name, cameras in (("0", (left, right)), ("1", (right, left))):
        with Recorder(tmp_path / f"{name}.mcap", Manifest(sensor=NO_ARRAY, cameras=cameras)):
            pass
    contract = TrialContract(
        target="kind", classes=("a", "b"), crop=9, places=1, views=("pixels",), versions=("",),
        cameras=2, width=30, height=20, rate_hz=25.0, mm_per_px=0.065, sharpness=1.0,
        threshold=None, data_digest="", measured={}, software="", names=("left", "right"),
    )  # fmt: skip
    bundle = SimpleNamespace(contract=contract)
    monkeypatch.setattr("taxel.bundles.trials.read_trial_bundle", lambda *_: bundle)
    words = {"as_json": False, "rules": RuleTable(()), "device": "cpu"}
    with pytest.raises(BadBundle, match="got right, left in "):
        live_trials(tmp_path / "a.taxel", str(tmp_path), None, 0.5, **words)
    assert capsys.readouterr().out == ""


@pytest.mark.slow
def test_a_score_on_the_training_trials_says_so_beside_the_commonest_class(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Training trials are known again in place and imported; other trials and older bundles are
    not taken for them."""
    table = write_trials(tmp_path / "a", objects=2, each=4, frames=14, write=as_avi)
    options = TrialOptions(fold_count=2, cache=tmp_path / "cache")
    TrainTrials(trials=table, output=tmp_path / "run", options=options, check=False).run()
    bundle = tmp_path / "run" / IN_RUN
    import_videos(read_video_rows(table, table.parent), tmp_path / "imported")
    TrainTrials(
        trials=tmp_path / "imported", output=tmp_path / "other", options=options, check=False
    ).run()
    for own in (bundle, tmp_path / "other" / IN_RUN):
        for data in (table, tmp_path / "imported"):
            capsys.readouterr()
            EvaluateTrials(trials=own, data=data).run()
            printed = " ".join(capsys.readouterr().out.split())
            assert "commonest class 0.500" in printed
            assert "warning: the bundle was trained on 8 of these trials" in printed
            unknown = int(printed.split("UNKNOWN ")[1].split()[0])
            assert "with an alarm" not in printed
            answered = float(printed.split("counted as wrong ")[1].split()[0])
            assert answered <= 1 - unknown / 8 + 1e-3
            words = {"as_json": False, "rules": RuleTable(()), "device": "cpu"}
            live_trials(own, str(data), None, 0.5, **words)
            printed = " ".join(capsys.readouterr().out.split())
            assert "warning: the bundle was trained on 8 of these trials" in printed

    label = read_trial_contract(bundle).classes[0]
    EvaluateTrials(trials=bundle, data=table, alarm=label, json=True).run()
    alarms = json.loads(capsys.readouterr().out)["alarms"]
    assert (alarms["label"], alarms["levels"][0]["right"]["of"]) == (label, 4)
    assert alarms["levels"][0]["right"]["alarmed"] >= alarms["levels"][-1]["right"]["alarmed"]

    address = f"replay://{tmp_path / 'imported'}?speed=max"
    live_trials(bundle, address, None, 0.5, as_json=True, rules=RuleTable(()), device="cpu")
    live = json.loads(capsys.readouterr().out)
    assert len(live["trials"]) == 8
    assert live["warning"].startswith("the bundle was trained on 8 of these trials")

    # In a station, as a process beside others: the very verdict.
    name, notes = live["trials"][0]["trial"], list[dict[str, Any]]()
    source = f"replay://{tmp_path / 'imported' / name}.mcap"
    with Station(StationConfig(sources=(source,), bundles=(bundle,)), notes.append) as station:
        station.run()
    (whole,) = [note for note in notes if note.get("last")]
    assert whole["confidence"] == live["trials"][0]["confidence"]
    assert whole["truth"] == live["trials"][0]["truth"]
    (row,) = station.answers.summary()
    assert row["trials"] == 1

    others = tmp_path / "others"
    others.mkdir()
    shutil.copytree(tmp_path / "imported", others / "trials")
    first = min((others / "trials").glob("*.mcap"))
    for file in (others / "trials").glob("*.mcap"):
        if file != first:
            file.unlink()
    contract = read_trial_contract(bundle)
    read = read_camera_trials(others / "trials")
    assert trained_on(contract, read) == (first.name.removesuffix(".mcap"),)
    assert trained_on(replace(contract, learned=("0" * 16,)), read) == ()
    older = json.loads(contract_to_json(contract))
    del older["learned"]
    assert contract_from_json(json.dumps(older)).learned == ()


@pytest.mark.slow
def test_a_bundle_is_scored_on_the_test_part_that_it_did_not_learn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Trained under a table, scored on its test part: no warning; on its training part there is."""
    table = write_trials(tmp_path / "a", objects=3, each=4, frames=14, write=as_avi)
    folds, turned = tmp_path / "folds.csv", tmp_path / "turned.csv"
    folds.write_text("group:object,side\nobject 0,train\nobject 1,train\nobject 2,test\n")
    turned.write_text("group:object,side\nobject 0,test\nobject 1,unused\nobject 2,train\n")
    options = TrialOptions(folds=folds, cache=tmp_path / "cache")
    TrainTrials(trials=table, output=tmp_path / "run", options=options, check=False).run()
    bundle = tmp_path / "run" / IN_RUN
    capsys.readouterr()
    found = []
    for own in (folds, turned):
        EvaluateTrials(trials=bundle, data=table, options=TrialOptions(folds=own), json=True).run()
        found.append(json.loads(capsys.readouterr().out))
    EvaluateTrials(trials=bundle, data=table, options=TrialOptions(folds=folds)).run()
    printed = " ".join(capsys.readouterr().out.split())

    assert [own["trials"] for own in found] == [4, 4]
    assert found[0]["split"] == "folds.csv, object held out"
    assert found[0]["warning"] is None
    assert found[1]["warning"].startswith("the bundle was trained on 4 of these trials")
    assert "slipped · test part of folds.csv, object held out: accuracy" in printed
    assert " [one object], commonest class 0.500, AUC " in printed

    folds.write_text("recording,side\nt8c0,test\n")
    EvaluateTrials(trials=bundle, data=table, options=TrialOptions(folds=folds)).run()
    printed = " ".join(capsys.readouterr().out.split())
    assert "test part of folds.csv: accuracy " in printed
    assert " [one trial], commonest class 1.000, no AUC (a class has no trial), log-loss" in printed
    assert " on 1 trial; UNKNOWN" in printed
    assert "nan" not in printed


@pytest.mark.parametrize("grey", [False, True])
def test_a_table_is_replayed_with_the_very_images_that_training_sees(
    tmp_path: Path, grey: bool
) -> None:
    """No loss between a folder of images and the live path, for grey cameras as for colour."""
    random = np.random.default_rng(0)
    for camera in ("left", "right"):
        (tmp_path / camera).mkdir()
        for number in range(9):
            image = random.integers(0, 256, (48, 64, 3), np.uint8)
            if grey:
                image[...] = image[..., :1]
            cv2.imwrite(str(tmp_path / camera / f"frame{number}.png"), image)
    table = tmp_path / "trials.csv"
    table.write_text("left,right,label:slipped,group:object,rate\nleft,right,1,mug,30\n")
    (trial,) = read_camera_trials(table)

    with TrialReplay(trial) as source:
        found = list(moments_and_marks(source, FramePairer(2), lambda frame: None))

    sets, mark = found[:-1], found[-1]
    assert (mark.labels, mark.groups["object"]) == ({"slipped": "1"}, "mug")
    for camera in range(2):
        seen = [decode_frame(own.frames[camera].jpeg, source.cameras[camera]) for own in sets]
        np.testing.assert_array_equal(seen, list(trial.read(camera)))
    assert np.diff([own.time_s for own in sets]) == pytest.approx(1 / 30)


def test_a_long_trial_is_replayed_as_jpeg_and_a_frame_of_another_size_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is kept of a trial in memory stays bounded."""
    table = write_trials(tmp_path / "a", objects=1, each=2, frames=12, write=as_folder)
    trial = read_camera_trials(table)[0]
    with TrialReplay(trial) as source:
        source.read()
        image, camera = source.frames()[0].jpeg, source.cameras[0]
    assert image.startswith(b"\x89PNG")
    with pytest.raises(BadSource, match=f"frames of {camera.width + 1}×"):
        decode_frame(image, replace(camera, width=camera.width + 1))
    monkeypatch.setattr("taxel.live.trial_replay.LARGEST_LOSSLESS", 1000)
    with TrialReplay(trial) as source:
        source.read()
        assert source.frames()[0].jpeg.startswith(b"\xff\xd8")
