"""A bundle at another level says of the new pad what it said of the old."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.contract import Contract
from taxel.bundles.files import bundle_at_level
from taxel.bundles.levels import measure_level
from taxel.bundles.reader import read_bundle
from taxel.bundles.writer import write_bundle
from taxel.errors import BadBundle, BadDataset
from taxel.models.cnn2d import Cnn2d
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples, SensorInfo
from taxel.training.loop import new_network
from taxel.windows.config import WindowConfig
from taxel.windows.reference import Reference
from taxel.windows.scaling import fit_scaling

RNG = np.random.default_rng(0)
VALUES = RNG.random((40, 6, 4)).astype(np.float32) + 0.5
MASK = np.ones((40, 6), bool)
SENSOR = SensorInfo(name="t", channels=tuple("abcd"), units=("V",) * 4, rate_hz=100.0)
OLD = np.array([1.0, 2.0, 0.5, 1.0], np.float32)


def contract(reference: bool = True) -> Contract:
    touches = "object=ball:2" if reference else None
    return Contract(
        target="shape",
        classes=("a", "b", "c"),
        window=WindowConfig(steps=6, stride=6, reference=touches),
        scaling=fit_scaling("standard", VALUES, MASK, None),
        channels=SENSOR.channels,
        units=SENSOR.units,
        rate_hz=100.0,
        model="cnn2d",
        parameters=1,
        data_digest="0" * 64,
        accuracy={},
        software="taxel test",
        parity=None,
        reference=Reference(touches=touches, level=OLD) if touches else None,
    )


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    path = tmp_path / "a.taxel"
    write_bundle(path, (new_network(lambda: Cnn2d(6, 4, 3), 0),), contract(), VALUES, MASK)
    return path


def record(path: Path, objects: list[str | None], level: np.ndarray) -> Path:
    """One touch of 24 scans an object, whose root mean square is `level`; None is unlabelled."""
    rows = 24
    values = np.tile(level, (rows * len(objects), 1))
    for index, name in enumerate(objects):
        if name == "box":
            values[index * rows : (index + 1) * rows] *= 7.0
    samples = Samples.from_values(values, np.arange(len(values)) / 100.0)
    with Recorder(path, Manifest.started_now(SENSOR, now_s=0.0)) as recorder:
        recorder.write(samples)
        for index, name in enumerate(objects):
            if name is not None:
                start = index * rows / 100.0
                groups = {"object": name}
                end = start + (rows - 1) / 100.0
                recorder.mark(Mark(start_s=start, end_s=end, labels={}, groups=groups))
    return path


def test_scaled_windows_give_the_same_probabilities_at_the_new_level(
    bundle: Path, tmp_path: Path
) -> None:
    change = np.array([0.5, 2.0, 1.0, 1.3], np.float32)

    found, data = bundle_at_level(bundle, OLD * change)

    other = tmp_path / "b.taxel"
    other.write_bytes(data)
    new = read_bundle(other)  # its own check windows are compared here
    np.testing.assert_allclose(
        new.probabilities(VALUES * change, MASK),
        read_bundle(bundle).probabilities(VALUES, MASK),
        atol=1e-5,
    )
    assert np.abs(new.probabilities(VALUES, MASK) - new.probabilities(VALUES * change, MASK)).max()
    assert found.reference is not None
    np.testing.assert_allclose(found.reference.level, OLD * change)


def test_a_bundle_without_reference_touches_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.taxel"
    networks = (new_network(lambda: Cnn2d(6, 4, 3), 0),)
    write_bundle(path, networks, contract(reference=False), VALUES, MASK)

    with pytest.raises(BadBundle, match="without"):
        bundle_at_level(path, OLD)
    with pytest.raises(BadBundle, match="without"):
        measure_level(path, contract(reference=False))


def test_only_the_known_object_counts_where_touches_are_labelled(tmp_path: Path) -> None:
    path = record(tmp_path / "t.mcap", ["box", "ball", "ball", "box"], OLD * 1.5)

    found = measure_level(path, contract())

    np.testing.assert_allclose(found.change, 1.5, rtol=1e-5)
    assert (found.touches, found.windows, found.warnings) == (2, 8, ())


def test_an_unlabelled_recording_counts_as_a_whole(tmp_path: Path) -> None:
    path = record(tmp_path / "t.mcap", [None, None], OLD * 0.8)

    assert measure_level(path, contract()).change == pytest.approx([0.8] * 4)


def test_a_recording_of_other_objects_only_is_refused(tmp_path: Path) -> None:
    path = record(tmp_path / "t.mcap", ["box"], OLD)

    with pytest.raises(BadDataset, match="object=ball"):
        measure_level(path, contract())


def test_a_silent_channel_keeps_its_level_and_a_large_change_is_warned_of(tmp_path: Path) -> None:
    level = OLD * np.array([1.0, 0.0, 0.01, 4.0])
    path = record(tmp_path / "t.mcap", ["ball", "ball"], level.astype(np.float32))

    found = measure_level(path, contract())

    assert found.silent.tolist() == [False, True, True, False]
    assert found.change == pytest.approx([1.0, 1.0, 1.0, 4.0])
    assert len(found.warnings) == 3
    assert "b gives nothing" in found.warnings[0]
    assert "d changed by a factor of 4.00" in found.warnings[2]


def test_another_sensor_is_refused(tmp_path: Path) -> None:
    path = record(tmp_path / "t.mcap", ["ball"], OLD)
    other = replace(contract(), channels=tuple("abcde"), units=("V",) * 5)

    with pytest.raises(BadBundle, match="5 channels"):
        measure_level(path, other)
