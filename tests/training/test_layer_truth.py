"""Recordings of gels of version 2 are labelled as those of version 1."""

from pathlib import Path

import numpy as np

from taxel.sim.pour.cup_pour import CupPourConfig, list_runs
from taxel.sim.pour.state import LAYER_CHANNELS, TRUTH_CHANNELS
from taxel.sources.simulated.pour_sets import write_run
from taxel.training.frames.label_sheet import rules_of
from taxel.training.frames.labels import truth_of
from taxel.windows.camera_recordings import read_camera_recording


def test_the_further_truth_of_version_2_is_recorded_and_disturbs_no_rule(tmp_path: Path) -> None:
    pours = []
    for gel in (1, 2):
        config = CupPourConfig(cups=1, forces_n=(15.0,), positions=("middle",), duration_s=1.0,
                               gel=gel)  # type: ignore[arg-type]  # fmt: skip
        folder = tmp_path / str(gel)
        folder.mkdir()
        run = list_runs(config)[0]
        write_run(folder, run, config, 10.0)
        pours.append(read_camera_recording(folder / f"{run.name}.mcap"))
    first, second = pours
    assert second.sensor.channels == TRUTH_CHANNELS + LAYER_CHANNELS
    assert second.beside.shape[1] == 14
    np.testing.assert_array_equal(truth_of(second), truth_of(first))
    assert rules_of(second) == rules_of(first)
    assert second.cameras[0].details["gel"] == "2"
    assert "gel" not in first.cameras[0].details
