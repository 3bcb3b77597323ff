"""`taxel live` without a station: Ctrl-C or SIGTERM ends it with the summary of what there was."""

from __future__ import annotations

import json
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_live import SENSOR, touch_bundle

from taxel.actions.rule_table import RuleTable
from taxel.cli.live.grasps import live_grasps
from taxel.cli.live.trials import live_trials
from taxel.cli.main import main
from taxel.live.grasp_session import GraspTally
from taxel.live.trial_session import TrialTally
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Samples

SIGNALS = ("SIGINT", "SIGTERM")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two recordings of a touch of 0.3 s."""
    values = np.random.default_rng(0).random((30, 3))
    (tmp_path / "touches").mkdir()
    first = tmp_path / "touches" / "a.mcap"
    with Recorder(first, Manifest.started_now(SENSOR, {"shape": "ball"}, now_s=0.0)) as recorder:
        recorder.write(Samples.from_values(values, np.arange(30) / 100.0))
    shutil.copy(first, tmp_path / "touches" / "b.mcap")
    return tmp_path / "touches"


@pytest.mark.parametrize("name", SIGNALS)
def test_an_array_is_summed_up_and_no_further_recording_is_begun(
    folder: Path, name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The signal comes with the first scans; what they held is still decided."""
    number = getattr(signal, name)
    before = signal.getsignal(number)
    monkeypatch.setattr(
        "taxel.cli.live.arrays._InputNotices.show", lambda *_: signal.raise_signal(number)
    )
    bundle = touch_bundle(folder.parent / "b.taxel")
    main(["live", bundle, f"replay://{folder}?speed=max", "--json"])

    captured = capsys.readouterr()
    (found,) = json.loads(captured.out)
    assert (found["windows"], found["grasps"]) == (1, 1)
    assert "stopping: the summary follows" in captured.err
    assert signal.getsignal(number) is before


def stopped_by(number: int, tally: object) -> Callable[..., Any]:
    """Stand in for a session that runs until it is stopped."""

    def run(*_: object, stopped: Callable[[], bool] | None = None, **__: object) -> object:
        assert stopped is not None
        assert not stopped()
        signal.raise_signal(number)
        assert stopped()
        return tally

    return run


@pytest.mark.parametrize("name", SIGNALS)
def test_grasps_are_summed_up(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run = stopped_by(getattr(signal, name), GraspTally(moments=3))
    monkeypatch.setattr("taxel.bundles.grasp.read_grasp_bundle", lambda *_, **__: None)
    monkeypatch.setattr("taxel.live.grasp_session.run_grasp_session", run)
    live_grasps(Path("a.taxel"), "sim://teng", None, True, None, "cpu")

    assert json.loads(capsys.readouterr().out)["moments"] == 3


@pytest.mark.parametrize("name", SIGNALS)
def test_trials_are_summed_up_and_no_further_trial_is_begun(
    folder: Path, name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tally = TrialTally("shape", trials=[{"verdict": "ball", "truth": None}])
    run = stopped_by(getattr(signal, name), tally)
    bundle = SimpleNamespace(contract=SimpleNamespace(cameras=0, crop=2, check=lambda *_: None))
    monkeypatch.setattr("taxel.bundles.trials.read_trial_bundle", lambda *_: bundle)
    monkeypatch.setattr("taxel.live.trial_session.run_trial_session", run)
    live_trials(
        Path("a.taxel"), str(folder), None, 0.5, as_json=True, rules=RuleTable(()), device="cpu"
    )

    assert [trial["trial"] for trial in json.loads(capsys.readouterr().out)["trials"]] == ["a"]
