"""A bundle at another level says of the new pad what it said of the old."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.avr import write as avr
from taxel.bundles.contract import Contract
from taxel.bundles.files import bundle_at_level
from taxel.bundles.levels import measure_level
from taxel.bundles.reader import read_bundle
from taxel.bundles.recordings import load_at_level, load_by_session
from taxel.bundles.writer import write_bundle
from taxel.cli.main import main
from taxel.decisions.unknown import Density, Unknown
from taxel.errors import BadBundle, BadDataset
from taxel.models.cnn2d import Cnn2d
from taxel.models.forest import CourseForest
from taxel.recordings.manifest import Manifest
from taxel.recordings.writer import Recorder
from taxel.signals import Mark, Samples, SensorInfo
from taxel.training.loop import TrainConfig, new_network
from taxel.training.run import Run, save_run
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


def record(
    path: Path, objects: list[str | None], level: np.ndarray, session: str | None = None
) -> Path:
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
                groups = {"object": name} | ({"session": session} if session else {})
                end = start + (rows - 1) / 100.0
                recorder.mark(
                    Mark(start_s=start, end_s=end, labels={"shape": "ab"[index % 2]}, groups=groups)
                )
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


@pytest.mark.parametrize("nothing", [0.0, np.nan])
def test_a_silent_channel_keeps_its_level_in_the_check_windows_too(
    bundle: Path, tmp_path: Path, nothing: float
) -> None:
    """Else the bundle could be written and never read again."""
    level = OLD * np.array([2.0, 0.5, nothing, 1.0], np.float32)

    (tmp_path / "b.taxel").write_bytes(bundle_at_level(bundle, level)[1])

    reference = read_bundle(tmp_path / "b.taxel").contract.reference
    assert reference is not None
    np.testing.assert_allclose(reference.level, [2.0, 1.0, 0.5, 1.0])


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


def test_touches_of_several_sessions_are_one_level_and_warned_of(tmp_path: Path) -> None:
    """Their mean is the level of none of them; nothing was said."""
    for number in (2, 10):
        record(tmp_path / f"{number}.mcap", ["ball"], OLD * number, session=f"day {number}")
    assert not any("session" in line for line in measure_level(
        tmp_path / "2.mcap", contract()).warnings)  # fmt: skip
    assert measure_level(tmp_path, contract()).warnings[-1] == (
        "touches of 2 sessions (day 2, day 10) give one level together: name the recordings of "
        "one session"
    )


def test_another_sensor_is_refused(tmp_path: Path) -> None:
    path = record(tmp_path / "t.mcap", ["ball"], OLD)
    other = replace(contract(), channels=tuple("abcde"), units=("V",) * 5)

    with pytest.raises(BadBundle, match="5 channels"):
        measure_level(path, other)


CHANGE = np.array([0.5, 2.0, 1.3, 1.0], np.float32)
GRASPS: list[str | None] = ["ball", "ball", "can", "can"]
"""Two touches that tell the level, and two grasps."""


def volts(values: np.ndarray) -> np.ndarray:
    """Return the windows' own level, shape (channels,)."""
    return np.sqrt(np.square(values, dtype=float).mean(axis=(0, 1)))


@pytest.mark.parametrize("target", [None, "shape"])
def test_recordings_of_another_level_are_brought_to_the_bundles(
    tmp_path: Path, target: str | None
) -> None:
    path = record(tmp_path / "a.mcap", GRASPS, OLD * CHANGE)

    dataset = load_at_level(path, contract(), target=target)

    assert len(dataset) == 8
    np.testing.assert_allclose(volts(dataset.windows.values), OLD, rtol=1e-5)
    np.testing.assert_allclose(dataset.to_level, np.tile(1 / CHANGE, (2, 1)), rtol=1e-5)
    assert dataset.reference is not None
    np.testing.assert_array_equal(dataset.reference.level, OLD)


def test_touches_given_beside_recordings_give_their_level(tmp_path: Path) -> None:
    path = record(tmp_path / "a.mcap", ["can", "can"], OLD * CHANGE)
    touches = measure_level(record(tmp_path / "t.mcap", [None], OLD * CHANGE), contract())

    values = load_at_level(path, contract(), touches).windows.values

    np.testing.assert_allclose(volts(values), OLD, rtol=1e-5)


@pytest.mark.parametrize("session", [None, "today"])
def test_only_sessions_without_touches_of_their_own_have_those_given(
    tmp_path: Path, session: str | None
) -> None:
    """One recording with its own touches at one level, one without at that of --touches."""
    touches = measure_level(record(tmp_path / "t.mcap", ["ball"], OLD * 3, session), contract())
    (tmp_path / "test").mkdir()
    record(tmp_path / "test" / "1.mcap", ["can", "can"], OLD * 3, session)
    record(tmp_path / "test" / "2.mcap", GRASPS, OLD * CHANGE, session and "before")

    dataset = load_by_session(tmp_path / "test", contract(), touches)

    assert [trial.groups["trial"] for trial in dataset.trials] == ["1#0", "1#1", "2#2", "2#3"]
    np.testing.assert_allclose(dataset.windows.values, np.broadcast_to(OLD, (16, 6, 4)), rtol=1e-5)


@pytest.mark.parametrize("session", [None, "today"])
def test_touches_are_not_lent_to_a_session_of_another_name(
    tmp_path: Path, session: str | None
) -> None:
    touches = measure_level(record(tmp_path / "t.mcap", ["ball"], OLD, session), contract())
    path = record(tmp_path / "a.mcap", ["can", "ball"], OLD, "before")

    with pytest.raises(BadDataset, match="got 1 in before"):
        load_by_session(path, contract(), touches)


def test_channels_in_another_order_are_refused_wherever_recordings_are_cut(tmp_path: Path) -> None:
    path = record(tmp_path / "a.mcap", GRASPS, OLD)
    other = replace(contract(), channels=tuple("bacd"))
    touches = measure_level(record(tmp_path / "t.mcap", ["ball"], OLD), contract())

    with pytest.raises(BadBundle, match="a, b"):
        load_at_level(path, other)
    with pytest.raises(BadBundle, match="a, b"):
        load_by_session(path, other, touches)


def test_recordings_of_a_bundle_without_touches_stay_as_measured(tmp_path: Path) -> None:
    path = record(tmp_path / "a.mcap", GRASPS, OLD * CHANGE)

    values = load_at_level(path, contract(reference=False)).windows.values

    np.testing.assert_allclose(volts(values), OLD * CHANGE, rtol=1e-5)


def test_the_boards_scales_and_its_report_are_measured_at_the_bundles_level(
    bundle: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = record(tmp_path / "a.mcap", GRASPS, OLD * CHANGE)
    seen = []
    monkeypatch.setattr(avr, "without_board", lambda: "not asked")
    for name in ("quantise", "compare"):
        real = getattr(avr, name)
        monkeypatch.setattr(
            avr, name, lambda *given, real=real: seen.append(given[3]) or real(*given)
        )

    avr.write_avr(bundle, tmp_path / "c", path, reference_mv=3300)

    assert len(seen) == 2
    for values in seen:
        np.testing.assert_allclose(volts(values), OLD, rtol=1e-5)


def test_parity_is_measured_at_the_runs_level(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = record(tmp_path / "a.mcap", GRASPS, OLD * CHANGE)
    networks = (new_network(lambda: Cnn2d(6, 4, 3), 0),)
    run = Run(networks=networks, contract=contract(), train=TrainConfig(), history=(),
              data=str(path))  # fmt: skip
    save_run(tmp_path / "run", run)
    seen = []
    monkeypatch.setattr(
        "taxel.bundles.writer.write_bundle",
        lambda *given: seen.append(given[3]) or write_bundle(*given),
    )

    main(["bundle", str(tmp_path / "run"), "--output", str(tmp_path / "x.taxel")])

    np.testing.assert_allclose(volts(seen[0]), OLD, rtol=1e-5)


def test_a_forest_is_compared_with_the_trained_model_and_called_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its trees were grown by scikit-learn, so that "PyTorch's" would say little."""
    path = record(tmp_path / "a.mcap", GRASPS, OLD)
    forest = CourseForest(6, 4, 3)
    forest.grow(VALUES, MASK, np.arange(len(VALUES)) % 3, seed=0)
    save_run(tmp_path / "run", Run(networks=(forest,), train=TrainConfig(), history=(),
             contract=replace(contract(), model="course-forest"), data=str(path)))  # fmt: skip

    main(["bundle", str(tmp_path / "run"), "--output", str(tmp_path / "x.taxel")])

    printed = capsys.readouterr().out
    assert "probabilities differ from the trained model's by at most" in printed
    assert "PyTorch" not in printed


@pytest.mark.parametrize("tested", [False, True])
def test_c_and_report_say_that_the_board_does_not_test_for_the_unknown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tested: bool
) -> None:
    density = Density(
        label="shape", projection=np.ones((12, 1)), centres=np.zeros((3, 1)),
        log_share=np.log(np.full(3, 1 / 3)), windows=np.arange(50.0), contacts={1: np.arange(50.0)},
    )  # fmt: skip
    unknown = Unknown(rejected=0.05, lag=1, level=np.zeros(4), wander=np.ones(4),
                      least=np.ones((2, 4)), densities=(density,))  # fmt: skip
    own = replace(contract(reference=False), unknown=unknown if tested else None)
    path = tmp_path / "a.taxel"
    write_bundle(path, (new_network(lambda: Cnn2d(6, 4, 3), 0),), own, VALUES, MASK)
    monkeypatch.setattr(avr, "without_board", lambda: "not asked")

    report = avr.write_avr(
        path, tmp_path / "c", record(tmp_path / "a.mcap", GRASPS, OLD), reference_mv=3300
    )

    test_name = "novel touch"
    assert (test_name in "\n".join(report.lines())) == tested
    assert (test_name in (tmp_path / "c" / "avr_report.json").read_text()) == tested
    assert (test_name in (tmp_path / "c" / "taxel_model.h").read_text()) == tested


@pytest.mark.parametrize("tare", [False, True])
def test_a_channel_at_the_converters_limit_is_warned_of(tmp_path: Path, tare: bool) -> None:
    """Channel b in a quarter of the rows, c in one row of the 24."""
    sensor = replace(SENSOR, full_scale=5.0)
    values = np.random.default_rng(0).uniform(1.0, 2.0, (24, 4)).astype(np.float32)
    values[::4, 1] = values[3, 2] = 5.0
    path = tmp_path / "t.mcap"
    with Recorder(path, Manifest.started_now(sensor, now_s=0.0)) as recorder:
        recorder.write(Samples.from_values(values, np.arange(24) / 100.0, 5.0))
    own = contract()
    own = replace(own, window=replace(own.window, tare=tare))

    lines = [line for line in measure_level(path, own).warnings if "limit" in line]

    assert len(lines) == 1
    assert lines[0].startswith("b stood at the converter's limit in 25%")
