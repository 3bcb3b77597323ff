"""Claims about slow sensors and rates that differ: nothing is lost to a limit made for fast ones,
and what live takes as too old is what the data set took.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.contract import Contract, contract_from_json, contract_to_json
from taxel.cli.options.arrays import RecipeOptions, only_label
from taxel.errors import BadDataset, BadSplit
from taxel.evaluation.splits import by_group
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, SensorInfo
from taxel.training.choose.base import load_base
from taxel.training.choose.preparations import candidate_windows
from taxel.windows.config import LARGEST_AGE_S, WindowConfig, largest_age_s
from taxel.windows.dataset import Dataset, load_dataset
from taxel.windows.rates import differ, with_common_grid
from taxel.windows.scaling import Scaling
from taxel.windows.windower import Windower, Windows, cut_windows

RATES_HZ = (15.8, 12.2, 16.5, 15.9, 13.0, 16.1, 15.9, 16.0)
"""Of one board whose clock jitters, as a public set has them."""


def record_slow(
    folder: Path, rates_hz: tuple[float, ...] = RATES_HZ, hold: tuple[int, ...] = ()
) -> Path:
    """Record a trial of 40 scans at each rate; those named in `hold` pause 1 s at each fifth."""
    rng = np.random.default_rng(3)
    for number, rate_hz in enumerate(rates_hz):
        steps_s = rng.uniform(0.8, 1.2, 40) / rate_hz
        if number in hold:
            steps_s[::5] = 1.0
        time_s = np.cumsum(steps_s)
        values = number % 2 + rng.normal(0, 0.1, (40, 2))
        sensor = SensorInfo(name="foot", channels=("p1", "p2"), units=("N", "N"), rate_hz=rate_hz)
        manifest = Manifest(
            sensor=sensor, labels={"grit": ("fine", "coarse")[number % 2]},
            groups={"session": f"s{number // 2}"},
        )  # fmt: skip
        with Recorder(folder / f"t{number}.mcap", manifest) as recorder:
            recorder.write(Samples.from_values(values, time_s))
    return folder


@pytest.mark.parametrize(
    ("rate_hz", "age_s"), [(0.0, 0.03), (1000.0, 0.03), (100.0, 0.03), (50.0, 0.06), (15.0, 0.2)]
)
def test_a_scan_is_too_old_after_three_periods_and_never_before_30_ms(rate_hz: float, age_s: float):
    assert largest_age_s(rate_hz) == pytest.approx(age_s)


@pytest.mark.parametrize("grid_hz", [12.2, 15.0, 30.0, 100.0])
def test_a_slow_sensor_loses_no_window_to_the_age_of_its_scans(tmp_path: Path, grid_hz: float):
    config = WindowConfig(steps=10, stride=10, grid_hz=grid_hz)
    dataset = load_dataset(record_slow(tmp_path), config, target="grit")
    assert len(dataset.trials) == len(RATES_HZ)
    assert not [note for note in dataset.notes if "left out" in note]
    assert dataset.config.max_age_s == pytest.approx(3 / 15.9)


def test_sensors_of_100_hz_and_faster_keep_their_30_ms(tmp_path: Path):
    for rate_hz in (100.0, 500.0):
        folder = tmp_path / f"{rate_hz:g}"
        folder.mkdir()
        dataset = load_dataset(record_slow(folder, (rate_hz,) * 4), WindowConfig(steps=2, stride=2))
        assert dataset.config.max_age_s == LARGEST_AGE_S


def test_a_limit_that_is_stated_stays_as_in_bundles_of_before(tmp_path: Path):
    config = WindowConfig(steps=10, stride=10, grid_hz=30.0, max_age_s=0.03)
    with pytest.raises(BadDataset, match=r"latest scan is over 30 ms old.*grid=own"):
        load_dataset(record_slow(tmp_path), config)


def contract(dataset: Dataset) -> Contract:
    """Return a contract as a training writes it."""
    return Contract(
        target="grit", classes=("coarse", "fine"), window=dataset.config,
        scaling=Scaling(kind="none", offset=np.zeros(2, np.float32), factor=np.ones(2, np.float32)),
        channels=("p1", "p2"), units=("N", "N"), rate_hz=dataset.sensor.rate_hz, model="m",
        parameters=0, data_digest="", accuracy={}, software="", parity=None,
    )  # fmt: skip


def test_live_takes_the_limit_that_the_bundle_stores(tmp_path: Path):
    """Scan by scan, with the window as a bundle keeps it, come the windows of the data set."""
    dataset = load_dataset(
        record_slow(tmp_path, hold=(2,)), WindowConfig(steps=5, stride=5, grid_hz=20.0)
    )
    window = contract_from_json(contract_to_json(contract(dataset))).window
    assert window.max_age_s == dataset.config.max_age_s
    for number, trial in enumerate(dataset.trials):
        recording = read_recording(tmp_path / trial.recording)
        windower = Windower(window, recording.manifest.sensor)
        scans = recording.samples
        parts = [windower.push(scans[i : i + 1]) for i in range(len(scans))]
        live = Windows.join([*parts, windower.flush()])
        offline = dataset.windows.values[dataset.trial == number]
        np.testing.assert_array_equal(live.values[live.ready], offline)
        assert live.ready.all() == (trial.recording != "t2.mcap")


def test_without_a_limit_the_sensor_s_own_rate_gives_it(tmp_path: Path):
    recording = read_recording(record_slow(tmp_path, (15.0,)) / "t0.mcap")
    windows = cut_windows(
        recording.samples,
        WindowConfig(steps=10, stride=10, grid_hz=30.0),
        recording.manifest.sensor,
    )
    assert len(windows) >= 7
    assert windows.ready.all()


def test_rates_that_differ_are_put_on_the_grid_of_the_middle_one(tmp_path: Path):
    own = WindowConfig(steps=10, stride=10, grid_hz=None)
    mixed = record_slow(tmp_path)
    assert with_common_grid(own, mixed).grid_hz == 15.9
    assert with_common_grid(replace(own, grid_hz=30.0), mixed).grid_hz == 30.0
    (note,) = load_dataset(mixed, with_common_grid(own, mixed)).notes
    assert "from 12.2 to 16.5 scans/s: put on one grid of 15.9 rows/s" in note


@pytest.mark.parametrize("rates_hz", [(10.0, 20.0), (20.0, 10.0), (10.0, 20.0, 20.0)])
def test_rates_are_compared_with_the_first_one(rates_hz: tuple[float, ...]):
    assert differ(rates_hz)
    assert not differ([10.0, 12.5, 8.0])


def test_the_grid_is_that_of_the_recordings_to_learn_from(tmp_path: Path):
    learn, test = tmp_path / "learn", tmp_path / "test"
    learn.mkdir()
    test.mkdir()
    record_slow(learn, (12.2, 15.8, 16.5))
    record_slow(test, (30.0, 31.0, 32.0))
    own = WindowConfig(steps=10, stride=10, grid_hz=None)
    assert with_common_grid(own, learn, test).grid_hz == 15.8
    assert with_common_grid(own, test, learn).grid_hz == 31.0


def test_rates_that_are_alike_keep_own_scans_as_rows(tmp_path: Path):
    own = WindowConfig(steps=10, stride=10, grid_hz=None)
    assert with_common_grid(own, record_slow(tmp_path, (15.0, 15.9, 13.0, 16.0))) is own


def test_the_default_search_and_named_recipes_take_such_recordings(tmp_path: Path):
    folder = record_slow(tmp_path)
    assert only_label(folder) == "grit"
    base = load_base(folder, "grit")
    assert len(base.trials) == len(RATES_HZ)
    assert {config.grid_hz for config in candidate_windows(base)} == {15.9}
    assert {config.max_age_s for config in candidate_windows(base)} == {3 / 15.9}
    options = RecipeOptions()
    assert options.resolve(default="array", data=folder).window.grid_hz == 15.9
    own = RecipeOptions(window=(("grid=own",),)).resolve(default="array", data=folder)
    assert own.window.grid_hz is None
    with pytest.raises(BadDataset, match=r"--window grid=12\.2"):
        load_dataset(folder, own.window)


def test_one_class_is_said_only_where_the_others_are_not_there(tmp_path: Path):
    """Coarse trials are there; all their windows hold a pause."""
    config = WindowConfig(steps=20, stride=20, grid_hz=20.0)
    folder = record_slow(tmp_path, hold=(1, 3, 5, 7))
    with pytest.raises(BadDataset) as refused:
        load_dataset(folder, config, target="grit")
    assert "one class only (fine): 4 trials of other classes gave no window" in str(refused.value)
    assert "record or import" not in str(refused.value)


def test_one_group_is_said_only_where_the_others_are_not_there(tmp_path: Path):
    config = WindowConfig(steps=20, stride=20, grid_hz=20.0)
    dataset = load_dataset(record_slow(tmp_path, hold=(3, 5, 7)), config, target="grit")
    with pytest.raises(BadSplit) as refused:
        by_group(dataset, "grit", "session", 5, 0)
    assert "one (s0) for 'coarse': 3 trials of its other groups gave no window" in str(
        refused.value
    )
    assert "record 'coarse' in another" not in str(refused.value)


def test_scans_slower_than_the_usual_pause_are_rows_of_one_window(tmp_path: Path):
    """At half a scan a second each scan was a window of its own, padded to ten rows."""
    folder = record_slow(tmp_path, rates_hz=(0.5,) * 4)

    dataset = load_dataset(folder, WindowConfig(steps=10, stride=10, grid_hz=None, max_gap_s=1.0))

    assert len(dataset.windows) == 4 * 4
    assert dataset.config.max_gap_s == pytest.approx(20.0)


def test_quicker_scans_keep_the_pause_that_is_asked_for(tmp_path: Path):
    folder = record_slow(tmp_path, rates_hz=(15.0,) * 2)
    asked = WindowConfig(steps=10, stride=10, grid_hz=None, max_gap_s=1.0)

    assert load_dataset(folder, asked).config.max_gap_s == 1.0
