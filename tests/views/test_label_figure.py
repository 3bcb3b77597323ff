"""Labels are drawn whoever says them, and where nobody does."""

from dataclasses import replace
from pathlib import Path

import pytest

from taxel.labels.corrections import Correction
from taxel.training.frames.label_sheet import PourLabels, label_sheet
from taxel.views.figures.labels import label_figure
from taxel.windows.camera_recordings import read_camera_recording


@pytest.fixture
def labels(pour: Path, tmp_path: Path) -> PourLabels:
    (entry,) = label_sheet([read_camera_recording(pour)], tmp_path / "cache")
    return entry


@pytest.mark.parametrize("onset_s", [None, 0.0, 1.35])
def test_a_person_has_a_lane_of_their_own(labels: PourLabels, onset_s: float | None) -> None:
    corrected = replace(labels, corrections={"change": Correction(rule="change", onset_s=onset_s)})

    drawn = label_figure(corrected, "change")
    assert drawn.startswith(b"\x89PNG")
    assert drawn != label_figure(labels, "change")


def test_a_rule_without_truth_is_drawn_without_its_lane(labels: PourLabels) -> None:
    bare = replace(labels, by_rule={"change": labels.by_rule["change"]})

    assert label_figure(bare, "slip").startswith(b"\x89PNG")
