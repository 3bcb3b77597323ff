"""Slip on objects never seen: no crop crosses trials, no object stands on both sides."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.cli.reproduce.slip_trials import SlipTrials
from taxel.errors import BadDataset, BadInput, BadSplit
from taxel.evaluation.slip_crops import (
    GREY_COLUMNS,
    MOTION,
    PLACES,
    THUMB,
    CropExtractor,
    SlipCrops,
    crop_starts,
    cut_crops,
)
from taxel.evaluation.slip_trials import (
    CONTENDERS,
    Contender,
    forest,
    judge_slips,
    object_folds,
    score_slips,
)
from taxel.gel.slip_features import SLIP_FEATURES
from taxel.recordings.known import gelsight_slip_rows
from taxel.recordings.videos import import_videos
from taxel.training.features import FrameFeatures

CROP = 16
WIDTH = CropExtractor(CROP).features


def trial_features(frames: int, value: float, seed: int = 0) -> FrameFeatures:
    """Features of one trial and two cameras: `value` everywhere, and a little noise."""
    noise = np.random.default_rng(seed).normal(0, 0.01, (frames * 2, WIDTH))
    return FrameFeatures(
        np.asarray(value + noise, np.float32), np.arange(frames * 2).reshape(frames, 2)
    )


def same(value: float) -> FrameFeatures:
    features = trial_features(CROP, 0.0)
    features.values[:] = value
    return features


def some_crops(objects: int = 8, per_object: int = 3) -> SlipCrops:
    """Trials in which slip shows as larger values, and slip trials are shorter."""
    slipped = [(o + t) % 2 == 0 for o in range(objects) for t in range(per_object)]
    names = [f"object {o}" for o in range(objects) for _ in range(per_object)]
    lengths = [CROP * (2 if slip else 5) + 3 for slip in slipped]
    features = [
        trial_features(frames, 1.0 + slip, seed)
        for seed, (frames, slip) in enumerate(zip(lengths, slipped, strict=True))
    ]
    return cut_crops(features, slipped, names, CROP)


def test_no_crop_crosses_trials_and_each_trial_has_three() -> None:
    crops = cut_crops(
        [trial_features(CROP * 2 + 7, 10.0), trial_features(CROP, -10.0)],
        [True, False], ["a", "b"], CROP,
    )  # fmt: skip
    assert crops.trial.tolist() == [0, 0, 0, 1, 1, 1]
    assert crops.place.tolist() == [0, 1, 2] * 2
    columns = crops.movement.shape[1] // 24
    means = crops.movement[:, :columns]
    assert np.allclose(means[:3], 10.0, atol=0.1)
    assert np.allclose(means[3:], -10.0, atol=0.1)


def test_a_crop_tells_nothing_of_the_frames_around_it(drifting: list[NDArray[np.uint8]]) -> None:
    extractor = CropExtractor(CROP)
    whole = extractor.of(drifting)[:CROP]
    assert not extractor.of(drifting)[CROP:].any()
    row = extractor.features // len(PLACES)
    for number, start in enumerate(crop_starts(len(drifting), CROP)):
        alone = extractor.of(drifting[start : start + CROP])[:, :row]
        assert np.array_equal(whole[:, number * row : (number + 1) * row], alone)


def test_crops_lie_at_the_start_the_middle_and_the_end() -> None:
    assert crop_starts(100, 20) == [0, 40, 80]
    assert crop_starts(20, 20) == [0, 0, 0]


def test_the_bars_columns_are_the_statistics_of_grey_differences() -> None:
    features = trial_features(CROP, 0.0)
    grey = len(SLIP_FEATURES) + np.arange(len(MOTION))
    features.values[:, grey] = 7.0
    crops = cut_crops([features], [True], ["a"], CROP)
    means = crops.movement[:, GREY_COLUMNS][:, : len(MOTION)]
    assert np.allclose(means[0], 7.0)
    others = np.setdiff1d(np.arange(crops.movement.shape[1] // 24), grey)
    assert np.abs(crops.movement[0, others]).max() < 1.0


def test_which_camera_is_left_does_not_matter_to_movement() -> None:
    one = trial_features(CROP, 1.0)
    mirrored = FrameFeatures(one.values, one.row[:, ::-1])
    both = cut_crops([one, mirrored], [True, False], ["a", "b"], CROP)
    assert np.array_equal(both.movement[:3], both.movement[3:])


def test_crops_of_one_object_never_stand_on_both_sides() -> None:
    crops = some_crops()
    parts = object_folds(crops, 4, seed=3)
    assert np.array_equal(np.sum(parts, axis=0), np.ones(len(crops.trial)))
    for test in parts:
        assert not set(crops.groups[test].tolist()) & set(crops.groups[~test].tolist())


def test_controls_are_judged_and_say_what_leaks() -> None:
    crops = some_crops()
    bars = [
        Contender(name=one.name, rows=one.rows, model=forest, leaks=one.leaks)
        for one in CONTENDERS[:1]
    ]
    results = judge_slips(crops, 4, 0, [*bars, *CONTENDERS[2:]])
    by_name = {one.name: one for one in results}
    assert results[0].crops.accuracy == 1.0
    length = by_name["control: trial's length"]
    assert length.leaks
    assert length.crops.auc == 1.0
    majority = by_name["control: majority class"]
    assert majority.crops.accuracy == pytest.approx(1 - crops.y.mean())
    assert len(results) == len(CONTENDERS) - 1


def test_a_trials_first_frame_is_that_of_its_first_crop() -> None:
    features = trial_features(CROP * 2, 0.0)
    row = features.values.shape[1] // len(PLACES)
    features.values[:] = np.arange(len(PLACES)).repeat(row)[None]
    crops = cut_crops([features, same(5.0)], [True, False], ["a", "b"], CROP)
    control = next(one for one in CONTENDERS if "trial's first frame" in one.name)
    rows = control.rows(crops)
    assert rows.shape == (6, 2 * THUMB[0] * THUMB[1])
    assert not rows[:3].any()
    assert np.all(rows[3:] == 5.0)
    assert np.all(crops.first_frame[1] == 1.0)


def test_the_interval_holds_the_score_and_resamples_objects() -> None:
    y = np.array([0, 0, 0, 1, 1, 1] * 4)
    slip = np.where(y == 1, 0.8, 0.3)
    slip[::5] = 0.6
    scores = score_slips(y, slip, np.repeat(["a", "b", "c", "d"], 6))
    low, high = scores.accuracy_interval
    assert low <= scores.accuracy <= high
    assert scores.balanced == pytest.approx((0.75 + 1.0) / 2, abs=0.1)


@pytest.mark.parametrize("folds", [1, 99])
def test_folds_that_cannot_be_made_are_refused(folds: int) -> None:
    with pytest.raises(BadSplit, match="folds"):
        object_folds(some_crops(), folds, seed=0)


def test_one_outcome_only_is_refused() -> None:
    crops = cut_crops(
        [trial_features(CROP, 0.0)] * 4, [False] * 4, ["a", "b", "c", "d"], CROP
    )  # fmt: skip
    with pytest.raises(BadSplit, match="of each outcome"):
        object_folds(crops, 2, seed=0)


def test_a_short_trial_is_refused_in_one_line() -> None:
    with pytest.raises(BadDataset, match="at least 16 frames") as caught:
        cut_crops([trial_features(CROP - 1, 0.0)], [True], ["a"], CROP)
    assert "\n" not in str(caught.value)


def test_without_data_or_with_a_crop_of_nothing_it_says_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="taxel import gelsight-slip"):
        SlipTrials().run()
    with pytest.raises(BadInput, match="--crop"):
        SlipTrials(data=tmp_path, crop=1).run()


@pytest.mark.real
@pytest.mark.slow
def test_six_real_trials_are_judged_and_the_shortest_may_be_too_short(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = Path(os.environ.get("TAXEL_DATA", Path(__file__).parents[2] / "../shared/data"))
    if not (data / "gelsight-slip" / "trials").is_dir():
        pytest.skip(f"no real recordings at {data}; set TAXEL_DATA to have them read")
    rows = sorted(
        gelsight_slip_rows(data / "gelsight-slip"),
        key=lambda row: row.files["left"].stat().st_size,
    )
    of_objects = {(row.groups["object"], row.labels["outcome"]): row for row in reversed(rows)}
    chosen = [
        row
        for outcome in ("slip", "hold")
        for row in sorted(
            (one for one in of_objects.values() if one.labels["outcome"] == outcome),
            key=rows.index,
        )[:3]
    ]
    import_videos(chosen, tmp_path / "slips")
    SlipTrials(data=tmp_path / "slips", json=True, cache=tmp_path / "cache", fold_count=2).run()
    found = json.loads(capsys.readouterr().out)
    assert found["trials"] == 6
    assert len(found["rows"]) == len(CONTENDERS)
    assert all(0 <= one["crops"]["accuracy"] <= 1 for one in found["rows"])
    with pytest.raises(BadDataset, match="at least one crop of 5000 frames"):
        SlipTrials(data=tmp_path / "slips", cache=tmp_path / "cache", crop=5000, fold_count=2).run()


@pytest.fixture(scope="module")
def drifting() -> list[NDArray[np.uint8]]:
    """Frames of a smooth pattern that drifts, 60×80, two crops and a bit."""
    y, x = np.mgrid[:60, :80]
    return [
        np.repeat(
            np.rint(120 + 60 * np.sin((x + 0.4 * i) / 5) * np.cos(y / 7))[..., None], 3, axis=2
        ).astype(np.uint8)
        for i in range(2 * CROP + 5)
    ]
