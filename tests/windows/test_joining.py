"""Trials of a second folder join a data set under their own names, at its level (0049)."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadDataset
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples, SensorInfo
from taxel.windows.checks import check_classes
from taxel.windows.config import WindowConfig
from taxel.windows.dataset import load_dataset, only_labelled
from taxel.windows.joining import TEST_PREFIX, join_datasets

PAD = SensorInfo(name="pad", channels=("x", "y"), units=("V", "V"), rate_hz=100.0)
PLAIN = WindowConfig(steps=4, stride=4, grid_hz=None)
LEVELLED = replace(PLAIN, reference="object=block:1")


def folder_of(
    parent: Path, name: str, gain: float, sensor: SensorInfo = PAD, label: str = "kind"
) -> Path:
    """Write one session of a ball and two blocks, eight scans each."""
    folder = parent / name
    folder.mkdir()
    course = np.tile([0.5, 1.0, 0.7, 0.2], 2)[:, None] * np.array([1.0, 2.0])
    manifest = Manifest(sensor=sensor, groups={"session": name})
    with Recorder(folder / "a.mcap", manifest) as recorder:
        for index, touched in enumerate(["ball", "block", "block"]):
            time_s = (index * 10 + np.arange(8)) / 100.0
            recorder.write(Samples.from_values(gain * course, time_s))
            recorder.mark(Mark(
                start_s=float(time_s[0]), end_s=float(time_s[-1]), labels={label: touched},
                groups={"object": touched},
            ))  # fmt: skip
    return folder


def test_windows_trials_and_fingerprints_of_both_stand_one_after_another(tmp_path: Path):
    first = load_dataset(folder_of(tmp_path, "one", 1.0), PLAIN)
    joined = join_datasets(first, folder_of(tmp_path, "two", 3.0), "kind")

    assert joined.trial.tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5]
    np.testing.assert_array_equal(joined.windows.values[:6], first.windows.values)
    np.testing.assert_allclose(joined.windows.values[6:], 3.0 * first.windows.values, rtol=1e-6)
    assert [trial.recording for trial in joined.trials[3:]] == [f"{TEST_PREFIX}a.mcap"] * 3
    assert joined.trials[3].groups["recording"].startswith(TEST_PREFIX)
    assert joined.trials[3].groups["session"] == "two"
    assert len(joined.fingerprints) == 2
    assert [name.startswith(TEST_PREFIX) for name in joined.fingerprints] == [False, True]
    assert joined.to_level is None


def test_with_reference_touches_the_second_folder_comes_to_the_first_s_level(tmp_path: Path):
    first = load_dataset(folder_of(tmp_path, "one", 1.0), LEVELLED)
    joined = join_datasets(first, folder_of(tmp_path, "two", 4.0), "kind")
    half = len(first.windows)

    np.testing.assert_allclose(
        joined.windows.values[half:], joined.windows.values[:half], rtol=1e-5
    )
    assert joined.to_level is not None
    np.testing.assert_allclose(joined.to_level, [[1.0, 1.0]] * 2 + [[0.25, 0.25]] * 2, rtol=1e-5)


def test_a_folder_of_the_same_values_another_sensor_or_without_the_label_is_refused(
    tmp_path: Path,
):
    first = load_dataset(folder_of(tmp_path, "one", 1.0), PLAIN)
    other = replace(PAD, channels=("x", "z"))
    for folder, needed in (
        (folder_of(tmp_path, "again", 1.0), "holds the values of"),
        (folder_of(tmp_path, "other", 2.0, sensor=other), "x, z in"),
        (folder_of(tmp_path, "unnamed", 2.0, label="shape"), "with the labels shape"),
    ):
        with pytest.raises(BadDataset, match=needed):
            join_datasets(first, folder, "kind")


def test_a_folder_of_another_rate_is_refused_unless_a_grid_makes_its_windows_as_long(
    tmp_path: Path,
):
    """Four scans of 25 a second last four times as long as four of 100."""
    own = folder_of(tmp_path, "one", 1.0)
    slow = folder_of(tmp_path, "slow", 2.0, sensor=replace(PAD, rate_hz=25.0))
    near = folder_of(tmp_path, "near", 3.0, sensor=replace(PAD, rate_hz=90.0))
    first = load_dataset(own, PLAIN)

    with pytest.raises(BadDataset, match=r"25 in .*slow.* --window grid=25"):
        join_datasets(first, slow, "kind")
    assert len(join_datasets(first, near, "kind").trials) == 6
    on_grid = load_dataset(own, replace(PLAIN, grid_hz=100.0))
    assert len(join_datasets(on_grid, slow, "kind").trials) == 6


def test_trials_without_the_label_are_left_out_and_counted(tmp_path: Path):
    whole = load_dataset(folder_of(tmp_path, "one", 1.0), PLAIN)
    first, *others = whole.trials
    mixed = replace(whole, trials=(replace(first, labels={"grip": "2"}), *others))

    kept = only_labelled(mixed, "kind", tmp_path)
    assert kept.trials == tuple(others)
    np.testing.assert_array_equal(kept.windows.values, whole.windows.values[whole.trial > 0])
    assert f"1 of {len(whole.trials)} trials lack the label 'kind': left out" in kept.notes[-1]
    assert only_labelled(whole, "kind", tmp_path).trials == whole.trials


def test_where_no_trial_has_the_label_those_that_they_have_are_named(tmp_path: Path):
    whole = load_dataset(folder_of(tmp_path, "one", 1.0), PLAIN)
    with pytest.raises(BadDataset, match=r"with the labels kind in .*; name one of"):
        only_labelled(whole, "shape", tmp_path)
    bare = replace(whole, trials=tuple(replace(trial, labels={}) for trial in whole.trials))
    with pytest.raises(BadDataset, match="with the labels none in "):
        only_labelled(bare, "shape", tmp_path)
    with pytest.raises(BadDataset, match=r"one class only \(ball\)"):
        check_classes(whole.trials[:1], "kind")


@pytest.mark.parametrize(
    ("channels", "units", "needed", "mend"),
    [
        (("y", "x"), ("V", "V"), r"x, y, in this order.*got y, x in", "channels in this order"),
        (("x", "y"), ("V", "N"), r"channels in V .*got y in N \(not V\) in", "this unit"),
        (("x", "z"), ("V", "V"), r"x, y, in this order.*got x, z in", "name recordings of this"),
    ],
)
def test_a_folder_of_another_order_or_unit_is_refused_by_what_differs(
    tmp_path: Path, channels: tuple[str, ...], units: tuple[str, ...], needed: str, mend: str
):
    first = load_dataset(folder_of(tmp_path, "one", 1.0), PLAIN)
    other = replace(PAD, channels=channels, units=units)

    with pytest.raises(BadDataset, match=f"{needed}.*{mend}"):
        join_datasets(first, folder_of(tmp_path, "two", 3.0, other), "kind")
