"""What adapting gives is measured on sessions that nothing was learned from."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.bench.audit import adapt as audit_adapt
from taxel.bench.audit.adapt import adapt_time_rows, corrections_of, new_classes_of, pads_of
from taxel.errors import BadDataset
from taxel.evaluation.adaptation import pads
from taxel.evaluation.adaptation.held_sessions import METHODS, AdaptConfig, default_config
from taxel.evaluation.adaptation.new_class import first_grasps, measure_new_class
from taxel.evaluation.adaptation.online import OnlinePoint, measure_online
from taxel.evaluation.adaptation.pads import (
    ALL,
    ONE,
    PadPoint,
    change_pads,
    draw_gains,
    measure_pads,
)
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import list_recordings, read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, SensorInfo, Validity
from taxel.sources.simulated.data_sets import simulate_presets
from taxel.training.exemplars import all_exemplars
from taxel.training.loop import TrainConfig
from taxel.windows.dataset import load_dataset


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("honest")
    simulate_presets(folder, ("honest",), 20_000, 0)
    return folder / "honest"


def config() -> AdaptConfig:
    usual = default_config()
    window = replace(usual.recipe.window, reference="object=cylinder-glass:1")
    recipe = replace(usual.recipe, window=window, train=TrainConfig(epochs=4))
    return replace(usual, recipe=recipe, targets=("shape",), grasps=(5,), sessions=1, workers=1)


@pytest.mark.slow
def test_every_method_is_tested_on_the_same_held_out_windows(data: Path) -> None:
    points = measure_new_class([data], config())

    assert {point.method for point in points} == set(METHODS)
    assert {point.new_class for point in points} == {"cylinder", "rectangle", "sphere"}
    for name in {point.new_class for point in points}:
        own = [point for point in points if point.new_class == name]
        assert (
            len({(point.windows, point.before, point.full, point.full_old) for point in own}) == 1
        )
    best = [point for point in points if point.method == "taxel adapt"]
    assert all(point.new > 0.5 for point in best)
    assert all(point.seconds < 5.0 for point in best)


def test_grasps_to_learn_from_are_the_first_of_one_training_session(data: Path) -> None:
    dataset = load_dataset(data, config().recipe.window, target="shape")
    own = all_exemplars(dataset, dataset.classes("shape"), "shape")
    train = own[(own.session != "session-2") & (own.y == 0)]

    few = first_grasps(train, 3, "session-2", 0)

    assert set(few.session) == {"session-3"}
    every = list(dict.fromkeys(train.grasp[train.session == "session-3"]))
    assert list(dict.fromkeys(few.grasp)) == every[:3]


def test_a_changed_pad_scales_its_channel_and_clips_as_the_converter_does(
    data: Path, tmp_path: Path
) -> None:
    source = list_recordings(data)[0]
    gain = np.ones(12)
    gain[3] = 2.0

    change_pads(source, tmp_path / "changed.mcap", gain)

    old, new = read_recording(source), read_recording(tmp_path / "changed.mcap")
    full = old.manifest.sensor.full_scale
    assert full is not None
    np.testing.assert_allclose(
        new.samples.values, np.minimum(old.samples.values * gain, full), rtol=1e-6
    )
    assert new.marks == old.marks


def test_what_was_lost_or_stale_is_so_with_changed_pads_too(tmp_path: Path) -> None:
    """A lost scan is recorded as 0 V that is flagged: without its flag it would be a touch of 0."""
    sensor = SensorInfo(
        name="pads", channels=("a", "b"), units=("V", "V"), rate_hz=100.0, full_scale=3.3
    )
    samples = Samples.from_values(np.full((4, 2), 2.0, np.float32), np.arange(4) / 100.0, 3.3)
    samples.values[1, 0], samples.validity[1, 0] = 0.0, Validity.MISSING | Validity.RECONNECTING
    samples.validity[2, 0] = Validity.STALE
    samples.values[3, 0], samples.validity[3, 0] = 3.3, Validity.SATURATED
    with Recorder(tmp_path / "old.mcap", Manifest.started_now(sensor)) as recorder:
        recorder.write(samples)

    change_pads(tmp_path / "old.mcap", tmp_path / "new.mcap", np.array([0.5, 2.0]))

    validity = read_recording(tmp_path / "new.mcap").samples.validity
    missing = Validity.MISSING | Validity.RECONNECTING
    assert validity[:, 0].tolist() == [0, missing, Validity.STALE, 0]
    assert validity[:, 1].tolist() == [Validity.SATURATED] * 4


def test_one_pad_or_all_change_within_the_limits() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        single, every = draw_gains(rng, ONE, 12), draw_gains(rng, ALL, 12)
        assert len(np.unique(np.round(single, 9))) == 2  # one pad, and the humidity of all others
        assert 0.5 * 0.78 < every.min() < every.max() < 2.0 * 1.28


def test_grasps_that_a_changed_pad_loses_behind_the_gate_count_as_wrong(
    data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All channels so weak that only the strongest grasps give windows."""
    monkeypatch.setattr(pads, "draw_gains", lambda *_: np.full(12, 0.7))

    points = measure_pads([data], config())

    for point in points:
        assert point.found < point.found_unchanged - 0.2
        assert max(point.before, point.after) <= point.found
        assert point.unchanged <= point.found_unchanged
    assert len({(point.grasps, point.unchanged) for point in points if point.case == ONE}) == 1


def test_a_row_of_changed_pads_says_how_many_grasps_gave_windows() -> None:
    points = [PadPoint("shape", name, ONE, 3, 0.9, 0.4, 0.7, 1.0, found, 20)
              for name, found in (("a", 0.8), ("b", 0.7))]  # fmt: skip

    (row,) = audit_adapt._pad_rows("shape", points)

    assert row.value == pytest.approx(0.7)
    assert "40 grasps, of which 75.0% gave windows (100.0% as they were)" in row.note


def test_a_row_of_corrections_counts_the_grasps_of_all_sessions_and_has_the_majority() -> None:
    points = [
        OnlinePoint("shape", str(grasps), changed, grasps, 0.9, 0.8, 0.7, 0.6, 0.1, drift, tested)
        for grasps, drift, tested in ((1000, (5,), (30, 10)), (90, (), (5, 15)))
        for changed in (False, True)
    ]

    row, _ = audit_adapt._online_rows("shape", points)

    assert "1,090 grasps" in row.note
    assert "0.700 → 0.600 (majority 0.583)" in row.note
    assert "detected in 1 of 2 sessions" in row.note


@pytest.mark.parametrize("measure", [measure_new_class, measure_online, measure_pads])
def test_fewer_than_two_sessions_are_refused(
    data: Path, tmp_path: Path, measure: Callable[..., object]
) -> None:
    (tmp_path / "one.mcap").write_bytes(list_recordings(data)[0].read_bytes())

    with pytest.raises(BadDataset, match="two sessions, to hold one out"):
        measure([tmp_path], config())


@pytest.mark.slow
def test_learning_a_class_takes_seconds() -> None:
    (found,) = adapt_time_rows()

    assert found.unit == "s"
    assert found.ok


@pytest.mark.slow
def test_every_row_has_a_split_in_its_name_and_goals_where_they_are_set(data: Path) -> None:
    rows = [
        *new_classes_of([data], config()),
        *pads_of([data], config()),
        *corrections_of([data], config()),
    ]

    assert all("session held out" in row.name for row in rows)
    assert sum(bool(row.goal) for row in rows) == 3
    assert any("pads changed halfway" in row.name for row in rows)
    assert len({row.name for row in rows}) == len(rows)
