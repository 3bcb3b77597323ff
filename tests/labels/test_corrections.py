"""A person's corrections survive the disk, and never leave the video."""

import json
from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadInput
from taxel.labels.corrections import (
    Correction,
    apply_correction,
    corrections_path,
    read_corrections,
    remove_correction,
    write_correction,
)

TIME = 100.0 + np.arange(10) / 10


def test_what_is_written_is_read(tmp_path: Path) -> None:
    recording = tmp_path / "pour.mcap"
    late = Correction(rule="change", onset_s=0.5, author="Ada", note="glare, not slip")
    write_correction(recording, Correction(rule="change", onset_s=0.1), duration_s=0.9)
    write_correction(recording, Correction(rule="slip", onset_s=None), duration_s=0.9)
    path = write_correction(recording, late, duration_s=0.9)

    assert path == tmp_path / "pour.labels.json" == corrections_path(recording)
    assert read_corrections(recording, 0.9) == {
        "change": late,
        "slip": Correction(rule="slip", onset_s=None),
    }
    assert [path.name for path in tmp_path.iterdir()] == ["pour.labels.json"]


def test_no_file_is_no_correction(tmp_path: Path) -> None:
    assert read_corrections(tmp_path / "pour.mcap", 1.0) == {}


def test_labels_follow_the_correction() -> None:
    labels = np.ones(10, np.int8)

    assert apply_correction(labels, TIME, None) is labels
    assert not apply_correction(labels, TIME, Correction(rule="slip", onset_s=None)).any()
    at_four = Correction.at_frame("slip", 4, TIME)
    assert apply_correction(labels, TIME, at_four).tolist() == [0] * 4 + [1] * 6


@pytest.mark.parametrize("onset", [-0.1, 1.0, float("nan"), float("inf")])
def test_an_onset_outside_the_video_is_refused(tmp_path: Path, onset: float) -> None:
    outside = Correction(rule="slip", onset_s=onset)
    recording = tmp_path / "pour.mcap"

    with pytest.raises(BadInput, match="inside the video"):
        write_correction(recording, outside, duration_s=0.9)
    assert not list(tmp_path.iterdir())
    with pytest.raises(BadInput, match="inside the video"):
        apply_correction(np.zeros(10, np.int8), TIME, outside)
    stored = {"format": "1", "corrections": [{"rule": "slip", "onset_s": onset}]}
    corrections_path(recording).write_text(json.dumps(stored))
    with pytest.raises(BadInput, match="inside the video"):
        read_corrections(recording, 0.9)


def test_a_frame_outside_the_video_is_refused() -> None:
    with pytest.raises(BadInput, match="from 0 to 9"):
        Correction.at_frame("slip", 10, TIME)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "JSON"),
        ("[]", "format"),
        ('{"format": "2"}', "format"),
        ('{"format": "1", "corrections": 3}', "list"),
        ('{"format": "1", "corrections": [3]}', "rule and onset_s"),
        ('{"format": "1", "corrections": [{"rule": "wobble", "onset_s": 0.1}]}', "among change"),
        ('{"format": "1", "corrections": [{"rule": "slip", "onset_s": "x"}]}', "seconds or null"),
        ('{"format": "1", "corrections": [{"rule": 3, "onset_s": null}]}', "texts"),
        ('{"format": "1", "corrections": [{"rule": "slip", "onset_s": 0, "x": 1}]}', "known"),
    ],
)
def test_a_damaged_file_is_one_plain_line(tmp_path: Path, text: str, message: str) -> None:
    recording = tmp_path / "pour.mcap"
    corrections_path(recording).write_text(text)

    with pytest.raises(BadInput, match=message) as caught:
        read_corrections(recording, 1.0)
    assert "\n" not in str(caught.value)
    with pytest.raises(BadInput):
        write_correction(recording, Correction(rule="slip", onset_s=None), 1.0)
    assert corrections_path(recording).read_text() == text


def test_what_is_removed_is_gone_and_the_rest_stays(tmp_path: Path) -> None:
    recording = tmp_path / "pour.mcap"
    kept = Correction(rule="slip", onset_s=0.5)
    write_correction(recording, kept, duration_s=0.9)
    write_correction(recording, Correction(rule="change", onset_s=None), duration_s=0.9)

    assert remove_correction(recording, "change", duration_s=0.9)
    assert not remove_correction(recording, "change", duration_s=0.9)
    assert read_corrections(recording, 0.9) == {"slip": kept}
    assert remove_correction(recording, "slip", duration_s=0.9)
    assert not list(tmp_path.iterdir())
    with pytest.raises(BadInput, match="among change"):
        remove_correction(recording, "wobble", duration_s=0.9)
