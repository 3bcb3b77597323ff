"""Claims about options that verbs share."""

from pathlib import Path

import numpy as np
import pytest

from taxel.cli.options.arrays import RecipeOptions
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, SensorInfo


def test_a_gate_is_measured_from_a_recording_at_rest(tmp_path: Path) -> None:
    """Rest level 0.2 V and noise of 0.05 V give a gate of 0.2 + 6 × 0.05 V."""
    sensor = SensorInfo(name="t", channels=("a",), units=("V",), rate_hz=100.0)
    values = np.random.default_rng(0).normal(0.2, 0.05, (5000, 1))
    with Recorder(tmp_path / "rest.mcap", Manifest.started_now(sensor, now_s=0.0)) as recorder:
        recorder.write(Samples.from_values(values, np.arange(5000) / 100.0))
    window = RecipeOptions(window=((f"gate={tmp_path / 'rest.mcap'}",),)).resolve().window
    assert window.gate == pytest.approx(0.5, abs=0.02)
