"""Claims about data sets: a window lies in one trial or in none; what is left out is said."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.errors import BadDataset, BadRecording
from taxel.labels.trials import Trial, ends_of_rows
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples, SensorInfo, Validity
from taxel.windows.checks import nothing_usable
from taxel.windows.config import WindowConfig
from taxel.windows.dataset import load_dataset
from taxel.windows.recut import recut
from taxel.windows.stretches import whole_stretches

INFO = SensorInfo(name="t", channels=("n", "x"), units=("V", "V"), rate_hz=100.0)
CONFIG = WindowConfig(steps=10, stride=10)


def scans(n: int = 200, first: int = 0) -> Samples:
    """Channel n holds the scan's number, so that a window shows where it was cut."""
    number = first + np.arange(n)
    return Samples.from_values(np.stack([number, number % 7], axis=1), number / 100.0)


def record(
    folder: Path, name: str, marks: list[Mark], samples: Samples | None = None,
    sensor: SensorInfo = INFO, labels: dict[str, str] | None = None,
) -> None:  # fmt: skip
    manifest = Manifest(sensor=sensor, labels=labels or {}, groups={"session": name})
    with Recorder(folder / f"{name}.mcap", manifest) as recorder:
        recorder.write(scans() if samples is None else samples)
        for mark in marks:
            recorder.mark(mark)


def grasp(start: int, end: int, shape: str) -> Mark:
    """Return a mark from one scan to another, both inside."""
    return Mark(start_s=start / 100, end_s=end / 100, labels={"shape": shape})


def test_a_window_across_a_border_is_left_out_and_said(tmp_path: Path):
    """Scans 0…94 are one trial, 95…199 the next: only the window of scans 90…99 has two owners."""
    record(tmp_path, "a", [grasp(0, 94, "sphere"), grasp(95, 199, "cylinder")])
    dataset = load_dataset(tmp_path, CONFIG, target="shape")
    firsts = dataset.windows.values[:, 0, 0]
    assert sorted(firsts.tolist()) == [float(s) for s in range(0, 200, 10) if s != 90]
    (note,) = dataset.notes
    assert note.startswith("1 window across a trial's border or between trials, without a label")
    np.testing.assert_array_equal(
        np.array(dataset.classes("shape"))[dataset.class_numbers("shape")],
        ["sphere" if first < 95 else "cylinder" for first in firsts],
    )


@pytest.mark.parametrize("large", [9.91e37, -1e30])
def test_a_number_that_stands_for_an_overload_is_refused_by_its_place(
    tmp_path: Path, large: float
) -> None:
    """As 9.91E37 of many instruments; squared, it would be infinite."""
    samples = scans()
    samples.values[123, 1] = large
    record(tmp_path, "a", [grasp(0, 94, "sphere"), grasp(95, 199, "cylinder")], samples)

    with pytest.raises(BadDataset, match=r"channel 'x' in a.mcap, in the window from 1.20 s"):
        load_dataset(tmp_path, CONFIG, target="shape")

    assert len(load_dataset(tmp_path, CONFIG, target="shape", unusable=True))
    own = replace(CONFIG, channels=("n",))
    assert len(load_dataset(tmp_path, own, target="shape"))


@pytest.mark.parametrize("stride", [1, 3, 10])
def test_no_scan_is_in_windows_of_two_trials_that_touch(tmp_path: Path, stride: int):
    """Scan 100 ends the first mark and begins the second: it is the second one's alone."""
    record(tmp_path, "a", [grasp(0, 100, "sphere"), grasp(100, 199, "cylinder")])
    dataset = load_dataset(tmp_path, replace(CONFIG, stride=stride), target="shape")
    first, second = (dataset.windows.values[dataset.trial == trial, :, 0] for trial in range(2))

    assert first.max() == 90 // stride * stride + 9 <= 99
    assert second.min() == -(-100 // stride) * stride


def test_where_rows_of_trials_that_touch_or_overlap_end():
    """A mark that ends where the one after the next begins, and one without length."""
    times = [(0.0, 1.0), (0.5, 2.0), (1.0, 3.0), (3.0, 3.0), (3.0, 4.0)]
    own = [Trial(recording="a", start_s=a, end_s=b, labels={}, groups={}) for a, b in times]

    assert ends_of_rows(own, 1e-6) == pytest.approx([1.0, 2.0, 3.0, 3.0, 4.0], abs=2e-6)
    assert (ends_of_rows(own, 1e-6) > [1.0, 2.0, 3.0, 3.0, 4.0]).tolist() == [
        False, True, False, True, True,
    ]  # fmt: skip


def test_what_lies_in_no_trial_is_no_training_window(tmp_path: Path):
    record(tmp_path, "a", [grasp(20, 59, "sphere"), grasp(100, 139, "cylinder")])
    dataset = load_dataset(tmp_path, CONFIG, target="shape")
    assert dataset.windows.values[:, 0, 0].tolist() == [20, 30, 40, 50, 100, 110, 120, 130]
    assert "12 windows" in dataset.notes[0]


def test_a_window_with_an_unusable_value_is_left_out_and_said(tmp_path: Path):
    samples = scans()
    samples.validity[57, 1] = Validity.MISSING
    samples.validity[3, 0] = Validity.SATURATED
    record(tmp_path, "a", [grasp(0, 99, "sphere"), grasp(100, 199, "cylinder")], samples)
    dataset = load_dataset(tmp_path, CONFIG, target="shape")
    assert 50.0 not in dataset.windows.values[:, 0, 0]
    assert 0.0 in dataset.windows.values[:, 0, 0]
    assert dataset.notes == ("1 window with missing values or NaN: left out",)
    assert dataset.missing == 1
    (tmp_path / "whole").mkdir()
    record(tmp_path / "whole", "a", [])
    assert load_dataset(tmp_path / "whole", CONFIG).missing == 0


def test_windows_left_out_are_counted_by_cause_and_so_are_trials(tmp_path: Path):
    """A gap of 50 ms in each of sphere's windows; one missing value in one of cylinder's."""
    samples = scans(400)
    samples.validity[356, 1] = Validity.MISSING
    kept = np.ones(400, bool)
    kept[:200] = np.arange(200) % 10 < 5
    record(tmp_path, "a", [grasp(0, 199, "sphere"), grasp(200, 399, "cylinder"),
                           grasp(400, 404, "cone")], samples[kept])  # fmt: skip
    dataset = load_dataset(tmp_path, replace(CONFIG, grid_hz=50.0))
    stale, missing, trials = dataset.notes
    assert stale.startswith("10 windows with rows whose latest scan is over 30 ms old")
    assert missing.startswith("1 window with missing values")
    assert trials.startswith("2 of 3 trials without a window")


def test_a_grid_far_slower_than_the_sensor_is_said(tmp_path: Path):
    record(tmp_path, "a", [])
    (note,) = load_dataset(tmp_path, replace(CONFIG, grid_hz=30.0)).notes
    assert "30 of 100 scans/s" in note
    assert load_dataset(tmp_path, replace(CONFIG, grid_hz=40.0)).notes == ()
    assert load_dataset(tmp_path, replace(CONFIG, grid_hz=None)).notes == ()


def test_rates_that_differ_are_refused_where_own_scans_are_rows(tmp_path: Path):
    for name, rate_hz in (("a", 100.0), ("b", 120.0), ("c", 130.0)):
        record(tmp_path, name, [], sensor=replace(INFO, rate_hz=rate_hz))
    assert len(load_dataset(tmp_path, CONFIG).trials) == 3
    with pytest.raises(BadDataset, match=r"got 130 in c\.mcap"):
        load_dataset(tmp_path, replace(CONFIG, grid_hz=None))


def test_a_rate_that_is_not_known_differs_from_none(tmp_path: Path):
    for name, rate_hz in (("a", 0.0), ("b", 100.0)):
        record(tmp_path, name, [], sensor=replace(INFO, rate_hz=rate_hz))
    assert len(load_dataset(tmp_path, replace(CONFIG, grid_hz=None)).trials) == 2


def test_a_class_with_hardly_any_trials_is_said(tmp_path: Path):
    for name in "abcde":
        record(tmp_path, name, [], labels={"shape": "sphere"})
    record(tmp_path, "f", [], labels={"shape": "cone"})
    (note,) = load_dataset(tmp_path, CONFIG, target="shape").notes
    assert "of 6 trials only 1 of cone" in note
    assert load_dataset(tmp_path, CONFIG).notes == ()


def test_nothing_usable_at_all_is_refused(tmp_path: Path):
    samples = scans()
    samples.validity[:] = Validity.MISSING
    record(tmp_path, "a", [grasp(0, 199, "sphere")], samples)
    with pytest.raises(BadDataset, match="usable values"):
        load_dataset(tmp_path, CONFIG)


def with_losses(trial: int, every: int, lost: int, name: str, folder: Path) -> None:
    """Record a trial of so many scans in which the last `lost` of each `every` are missing."""
    samples = scans(trial)
    samples.validity[np.arange(trial) % every >= every - lost] = Validity.MISSING
    record(folder, name, [], samples, labels={"shape": name})


def test_where_a_gap_is_in_every_window_the_length_that_would_do_is_advised(tmp_path: Path):
    """Seven whole rows between gaps hold a window of four, wherever the first began."""
    with_losses(200, 10, 3, "cone", tmp_path)
    with_losses(200, 20, 3, "sphere", tmp_path)
    with_losses(200, 10, 3, "cube", tmp_path)

    with pytest.raises(BadDataset) as error:
        load_dataset(tmp_path, replace(CONFIG, steps=40, stride=40))

    assert "each window of 40 rows holds missing" in error.value.got
    assert "7 rows in a row that are whole, enough for --window steps=4" in error.value.mend
    advised = load_dataset(tmp_path, replace(CONFIG, steps=4, stride=4))
    assert len(advised.trials) == 3


@pytest.mark.parametrize(
    ("config", "stretches", "mend"),
    [
        (CONFIG, [3, 3, 9], ": taxel info, or choose .* have 3 rows .* --window steps=2$"),
        (CONFIG, [3, 9], "have 9 rows .* --window steps=5$"),
        (CONFIG, [8, 8], "steps=4$"),
        (CONFIG, [40, 40], "steps=9$"),
        (CONFIG, [2, 2], "at most 2 rows in a row that are whole, too few for shorter windows$"),
        (CONFIG, [], "taxel info$"),
        (replace(CONFIG, steps=2), [9], "taxel info$"),
        (replace(CONFIG, steps=3), [9], "steps=2$"),
        (replace(CONFIG, layout="A", gate=1.0), [9], "taxel info$"),
    ],
)
def test_the_length_advised_is_for_half_of_the_trials_and_shorter_than_what_was_tried(
    config: WindowConfig, stretches: list[int], mend: str
):
    assert re.search(mend, nothing_usable(4, 3, config, stretches).mend)
    assert nothing_usable(4, 4, config, stretches).mend.endswith("--window grid=own")


def test_where_no_shorter_window_would_do_that_is_the_advice(tmp_path: Path):
    for name in ("cone", "sphere"):
        with_losses(200, 4, 2, name, tmp_path)
    with pytest.raises(BadDataset, match="at most 2 rows in a row that are whole, too few"):
        load_dataset(tmp_path, CONFIG)


def test_a_pause_or_a_trial_s_border_ends_a_stretch_of_whole_rows(tmp_path: Path):
    samples = scans(100)
    samples.validity[70] = Validity.MISSING
    kept = np.arange(100) < 90
    kept[20:35] = False
    record(tmp_path, "a", [grasp(0, 49, "sphere"), grasp(50, 99, "cone")], samples[kept])
    trials = load_dataset(tmp_path, replace(CONFIG, steps=2, stride=2, max_gap_s=0.1)).trials

    assert whole_stretches([tmp_path / "a.mcap"], CONFIG, trials) == [35, 20]
    short = replace(CONFIG, max_gap_s=0.1, wavelet="db2")  # which no single row is long enough for
    assert whole_stretches([tmp_path / "a.mcap"], short, trials) == [20, 20]


def test_a_short_trial_is_padded_where_asked_and_said(tmp_path: Path):
    record(tmp_path, "a", [], scans(6), labels={"shape": "sphere"})
    record(tmp_path, "b", [], scans(30), labels={"shape": "cylinder"})
    with pytest.raises(BadDataset, match="one class only"):
        load_dataset(tmp_path, CONFIG, target="shape")
    dataset = load_dataset(tmp_path, replace(CONFIG, pad=True), target="shape")
    assert dataset.windows.padded == 1
    assert dataset.notes == ("1 of 4 sequences shorter than 10 rows: padded and masked",)


def test_only_the_trials_asked_for_are_taken(tmp_path: Path):
    for name in ("one", "two"):
        record(tmp_path, name, [grasp(0, 99, "sphere"), grasp(100, 199, "cylinder")])
    by_group = load_dataset(tmp_path, CONFIG, where={"session": "two"})
    assert {trial.recording for trial in by_group.trials} == {"two.mcap"}
    both = load_dataset(tmp_path, CONFIG, where={"session": "two", "shape": "sphere"})
    assert len(both.trials) == 1
    with pytest.raises(BadDataset, match="session=three"):
        load_dataset(tmp_path, CONFIG, where={"session": "three"})


def test_a_group_that_a_trial_lacks_is_refused_by_name(tmp_path: Path):
    record(tmp_path, "a", [grasp(0, 99, "sphere"), grasp(100, 199, "cylinder")])
    dataset = load_dataset(tmp_path, CONFIG)
    assert dataset.group("session").tolist() == ["a", "a"]
    with pytest.raises(BadDataset, match=r"'moon'.*session"):
        dataset.group("moon")


def test_a_target_that_is_missing_or_has_one_class_is_refused(tmp_path: Path):
    record(tmp_path, "a", [grasp(0, 99, "sphere"), grasp(100, 199, "sphere")])
    with pytest.raises(BadDataset, match="colour"):
        load_dataset(tmp_path, CONFIG, target="colour")
    with pytest.raises(BadDataset, match="one class only"):
        load_dataset(tmp_path, CONFIG, target="shape")


def test_sensors_that_differ_do_not_make_one_set(tmp_path: Path):
    record(tmp_path, "a", [grasp(0, 199, "sphere")])
    record(tmp_path, "b", [grasp(0, 199, "cube")], sensor=replace(INFO, units=("V", "count")))
    with pytest.raises(BadDataset, match=r"b\.mcap"):
        load_dataset(tmp_path, CONFIG)


def test_a_folder_without_recordings_is_refused(tmp_path: Path):
    with pytest.raises(BadRecording, match=r"\*\.mcap"):
        load_dataset(tmp_path, CONFIG)


def test_the_digest_is_that_of_the_values(tmp_path: Path):
    for name in ("x", "y", "z"):
        (tmp_path / name).mkdir()
        marks = [grasp(0, 99, "sphere"), grasp(100, 199, "cylinder")]
        record(tmp_path / name, "a", marks, scans(first=name == "z"))
    x, y, z = (load_dataset(tmp_path / name, CONFIG).digest for name in ("x", "y", "z"))
    assert x == y != z


def test_cutting_again_keeps_the_trials_and_their_windows_owners(tmp_path: Path):
    for name in ("one", "two"):
        record(tmp_path, name, [grasp(0, 99, "sphere"), grasp(100, 199, "cylinder")])
    dataset = load_dataset(tmp_path, CONFIG, where={"session": "two"})
    again = recut(tmp_path, dataset, stride=3, steps=10)
    assert again.trials == dataset.trials
    assert len(again) > 3 * len(dataset) - 10
    for first, last, owner in zip(
        again.windows.values[:, 0, 0], again.windows.values[:, -1, 0], again.trial, strict=True
    ):
        trial = again.trials[owner]
        assert trial.recording == "two.mcap"
        assert trial.start_s <= first / 100 + 1e-6
        assert last / 100 <= trial.end_s + 1e-6


def test_two_labels_joined_are_one_to_predict(tmp_path: Path):
    marks = [
        Mark(start_s=start / 100, end_s=(start + 59) / 100, labels={"shape": s, "material": m})
        for start, s, m in [(0, "sphere", "glass"), (60, "sphere", "plastic")]
    ]
    record(tmp_path, "a", marks)
    dataset = load_dataset(tmp_path, CONFIG, target="shape+material")
    assert dataset.classes("shape+material") == ["sphere glass", "sphere plastic"]
    with pytest.raises(BadDataset, match="size"):
        load_dataset(tmp_path, CONFIG, target="shape+size")


@pytest.mark.parametrize(("steps", "noun"), [(1, "scan"), (10, "window")])
def test_what_is_left_out_of_windows_of_one_row_is_called_scans(
    tmp_path: Path, steps: int, noun: str
):
    samples = scans()
    samples.validity[57, 1] = Validity.MISSING
    record(tmp_path, "a", [], samples)
    (note,) = load_dataset(tmp_path, WindowConfig(steps=steps, stride=steps)).notes
    assert note == f"1 {noun} with missing values or NaN: left out"


def test_the_key_time_orders_the_trials_of_one_recording_by_their_starts(tmp_path: Path):
    record(tmp_path, "a", [grasp(0, 94, "sphere"), grasp(100, 199, "cylinder")])
    dataset = load_dataset(tmp_path, CONFIG, target="shape")
    assert [float(start) for start in dataset.group("time")] == [0.0, 1.0]


def test_a_group_called_time_must_stand_on_every_trial(tmp_path: Path):
    named = replace(grasp(0, 94, "sphere"), groups={"time": "9"})
    record(tmp_path, "a", [named, grasp(100, 199, "cylinder")])
    dataset = load_dataset(tmp_path, CONFIG, target="shape")
    with pytest.raises(BadDataset, match="the group 'time' on every trial"):
        dataset.group("time")


def test_trials_that_a_data_set_does_not_have_are_refused(tmp_path: Path):
    record(tmp_path, "a", [grasp(0, 94, "sphere"), grasp(100, 199, "cylinder")])
    dataset = load_dataset(tmp_path, CONFIG, target="shape")
    assert len(dataset.only_trials([])) == 0
    with pytest.raises(BadDataset, match="indices of trials from 0 to 1; got 0 to 2"):
        dataset.only_trials([0, 2])


def test_two_rows_last_a_time_so_that_rates_that_differ_are_refused(tmp_path: Path):
    """One row lasts none, and takes recordings of any rate."""
    fast = replace(INFO, rate_hz=400.0)
    number = np.arange(200)
    samples = Samples.from_values(np.stack([number, number % 7], axis=1), number / 400.0)
    record(tmp_path, "a", [], labels={"shape": "cone"})
    record(tmp_path, "b", [], samples, sensor=fast, labels={"shape": "ball"})
    single, double = (WindowConfig(steps=n, stride=n, grid_hz=None) for n in (1, 2))
    assert len(load_dataset(tmp_path, single, target="shape")) == 400
    with pytest.raises(BadDataset, match="about 100 scans/s in every recording"):
        load_dataset(tmp_path, double, target="shape")
