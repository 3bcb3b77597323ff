"""Claims about precisions: what is compared is one head; 8-bit features stay close to it."""

from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.engine import EngineName, Precision
from taxel.evaluation.transitions.data import cup_folds, load_camera_set
from taxel.evaluation.transitions.precisions import Ways, compare_precisions
from taxel.training.frames.extractors import BackboneExtractor, CameraImages, open_backbone
from taxel.training.frames.heads import HeadConfig
from taxel.training.frames.quantising import calibration_frames
from taxel.windows.camera_recordings import CameraRecording, read_camera_recordings

EDGE = "edge"


def test_calibration_frames_come_from_all_recordings_and_both_cameras(few_pours: Path) -> None:
    pours = read_camera_recordings(few_pours)
    frames = calibration_frames(pours, 24)
    assert len(frames) == 24
    assert len({frame.tobytes() for frame in frames}) > 20


@pytest.mark.slow
def test_the_first_way_loses_nothing_and_the_others_are_told_apart(
    few_pours: Path, tmp_path: Path
) -> None:
    pytest.importorskip("nncf")
    pytest.importorskip("openvino")
    pours = load_camera_set(few_pours, "change", tmp_path)
    calibrated: list[set[str]] = []

    def open_way(engine: EngineName, precision: Precision, training: object) -> BackboneExtractor:
        assert isinstance(training, list)
        recordings: list[CameraRecording] = training
        calibrated.append({pour.groups["cup"] for pour in recordings})
        frames = calibration_frames(recordings, 8) if precision == "int8" else ()
        return open_backbone(
            EDGE, engine=engine, precision=precision, images=CameraImages(calibration=frames)
        )

    ways: list[tuple[EngineName, Precision]] = [
        ("onnxruntime", "f32"), ("openvino", "f32"), ("onnxruntime", "int8"),
    ]  # fmt: skip
    fold = cup_folds(pours.cups())[-1]
    head = HeadConfig(head="lstm", frames=4, epochs=2)

    first, second, small = compare_precisions(pours, fold, head, open_way, Ways(ways), tmp_path)

    assert (first.lost, first.differ, first.largest_difference) == (0.0, 0.0, 0.0)
    assert second.largest_difference < 1e-4
    assert 0.0 < small.largest_difference < 0.5
    assert fold.name not in set().union(*calibrated)
    windows = sum(len(pours.labels[i]) - head.frames + 1 for i in fold.test_rows)
    assert {row.windows for row in (first, second, small)} == {windows}
    assert np.isfinite([row.step_ms for row in (first, second, small)]).all()
