"""What `taxel live` says where a recogniser's verdicts are on trials that it was trained on."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import cv2
import numpy as np
import pytest

from taxel.bundles.reader import Bundle
from taxel.bundles.trials import TrialContract
from taxel.cli.live.arrays import _trained_on_warning
from taxel.cli.live.summaries import print_station_summary
from taxel.cli.live.trained_trials import trained_on_warning, warn_of_training
from taxel.errors import BadBundle
from taxel.evaluation.camera_trials.learned_trials import fingerprints
from taxel.recordings.manifest import NO_ARRAY, Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import CameraInfo, Frame, Mark
from taxel.windows.camera_trials import read_camera_trials

CAMERA = CameraInfo(name="gel", width=8, height=6, rate_hz=10.0)


def recording(path: Path, marks: int) -> Path:
    """Write 20 frames, in so many marks one after another."""
    pixels = np.random.default_rng(marks).integers(0, 255, (20, 6, 8, 3), dtype=np.uint8)
    with Recorder(path, Manifest.started_now(NO_ARRAY, {}, cameras=(CAMERA,))) as recorder:
        for number, image in enumerate(pixels):
            time_s = number / 10
            jpeg = cv2.imencode(".jpg", image)[1].tobytes()
            recorder.frame(Frame(camera=0, jpeg=jpeg, counter=number, device_s=time_s,
                                 arrival_s=time_s, fitted_s=time_s))  # fmt: skip
        for number in range(marks):
            start_s = 2.0 * number / marks
            end_s = start_s + 2.0 / marks - 0.1
            recorder.mark(Mark(start_s=start_s, end_s=end_s, labels={"slipped": "1"}, groups={}))
    return path


def contract(*learned: str) -> TrialContract:
    return cast("TrialContract", SimpleNamespace(learned=learned or ("0" * 16,)))


def test_a_replay_of_several_grasps_is_no_trial_that_was_trained_on(tmp_path: Path):
    """The summary was lost: one labelled stretch in each recording was asked for after the run."""
    several = recording(tmp_path / "several.mcap", 3)
    assert trained_on_warning(contract(), str(several)) is None
    single = recording(tmp_path / "single.mcap", 1)
    learned = contract(*fingerprints(read_camera_trials(single)))
    for source in (str(single), f"replay://{tmp_path}?speed=max"):
        found = trained_on_warning(learned, source)
        assert found == "the bundle was trained on single: accuracy on it is not a test"
    assert trained_on_warning(learned, str(several)) is None
    assert trained_on_warning(learned, "sim://cup-pour") is None


def test_a_station_warns_as_the_terminal_alone_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """With a page, a recording or alarms, an accuracy on training trials stood there as a test."""
    single = recording(tmp_path / "single.mcap", 1)
    learned = contract(*fingerprints(read_camera_trials(single)))
    monkeypatch.setattr("taxel.bundles.trials.read_trial_contract", lambda *_: learned)
    monitor = SimpleNamespace(bundles=[{"who": "recogniser/0"}],
                              feed=SimpleNamespace(url=str(single)))  # fmt: skip
    station = cast("Any", SimpleNamespace(
        wiring=SimpleNamespace(monitors=[monitor]), config=SimpleNamespace(trust=None)
    ))  # fmt: skip

    def answers(marked: int) -> list[dict[str, Any]]:
        return [{"who": "recogniser/0", "bundle": "b.taxel", "target": "slipped", "trials": 1,
                 "marked": marked, "right": marked, "answers": {"1": 1},
                 "actions": {}}]  # fmt: skip

    found, unmarked, gone = answers(1), answers(0), answers(1)
    warn_of_training(station, found)
    warn_of_training(station, unmarked)
    assert unmarked[0]["warning"] is None
    print_station_summary({
        "answers": found, "alarms": {"counts": {"raised": 0, "acknowledged": 0}}, "state": "NONE",
        "trials": [], "processes": {}, "latency_ms": {}, "outputs": {}, "recording": {},
    })  # fmt: skip
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "warning: the bundle was trained on single: accuracy on it is not a test"

    def refuse(*_: object) -> TrialContract:
        raise BadBundle("a bundle", "nothing", "put it back")

    monkeypatch.setattr("taxel.bundles.trials.read_trial_contract", refuse)
    warn_of_training(station, gone)
    expected = "whether the bundle was trained on these trials could not be checked (nothing)"
    assert gone[0]["warning"].startswith(expected)


@pytest.mark.parametrize("name", ["gone.mcap", "gone/"])
def test_a_replay_that_was_deleted_meanwhile_costs_no_summary(tmp_path: Path, name: str):
    """The run was over, and all that it had found was replaced by one line about the path."""
    source = str(tmp_path / name)
    bundle = cast("Bundle", SimpleNamespace(contract=contract()))
    for found, what in (
        (trained_on_warning(contract(), f"replay://{source}"), "trials"),
        (_trained_on_warning(bundle, f"replay://{source}"), "recordings"),
    ):
        assert found is not None
        assert f"trained on these {what} could not be checked" in found
        assert "gone" in found
