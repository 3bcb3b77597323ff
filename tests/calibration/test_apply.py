"""Later recordings corrected: what was added is taken away, newtons are those of the gauge."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taxel.calibration.apply import correct, rate_of, write_corrected
from taxel.calibration.stored import Calibration, document_of, read_calibration, write_calibration
from taxel.errors import BadInput
from taxel.recordings.manifest import Manifest
from taxel.recordings.reader import read_recording
from taxel.recordings.writer import Recorder
from taxel.signals import Samples, Validity
from taxel.sim.teng.force_gauge import ForceGauge, GaugeConfig
from taxel.sim.teng.hand import GraspStream, TengHandConfig


@pytest.fixture(scope="module")
def calibration(three_boards: Any, tmp_path_factory: pytest.TempPathFactory) -> Calibration:
    path = tmp_path_factory.mktemp("c") / "c.json"
    write_calibration(path, document_of(three_boards.found, [], {}))
    return read_calibration(path)


@pytest.fixture(scope="module")
def later() -> tuple[Samples, list[tuple[int, float, float, float]], ForceGauge]:
    """The same sensors another day: other baselines that drift ten times as fast, new presses."""
    hand = TengHandConfig(seed=0, rate_hz=250.0, humidity_pct=(50.0, 50.0))
    day = GaugeConfig(baseline_v=(0.1, 0.15), drift_v_per_hour=(0.5, 1.5), memory=0.0)
    gauge = ForceGauge(hand, day)
    parts, presses = [gauge.rest(5.0)], []
    for number in range(24):
        sensor, force_n = number % 12, (0.6, 1.2)[number // 12]
        samples, mark = gauge.press(sensor, force_n)
        parts += [samples, gauge.rest(3.0)]
        presses.append((sensor, float(mark.labels["force_n"]), mark.start_s, mark.end_s))
    return Samples.join(parts), presses, gauge


def test_baseline_and_drift_of_another_day_are_taken_away(
    calibration: Calibration, later: Any
) -> None:
    samples, _, gauge = later
    done = correct(samples, gauge.info, calibration, "V", 250.0)

    rest = done.samples.values[:1000].mean(axis=0)  # 4 s before the first press
    end = done.samples.values[-500:].mean(axis=0)  # and 2 s after the last
    assert samples.values[:1000].mean(axis=0).min() > 0.09
    assert np.abs(rest).max() < 0.006
    assert np.abs(end[:-1]).max() < 0.006  # the last press's own channel still recovers
    assert done.borrowed == ()
    drift = [line.per_hour for line in done.baselines]
    assert drift == pytest.approx(gauge.truth.drift_v_per_hour, abs=0.12)


@pytest.mark.slow
def test_volts_change_by_the_baseline_and_by_nothing_else(
    calibration: Calibration, later: Any
) -> None:
    samples, _, gauge = later
    done = correct(samples, gauge.info, calibration, "V", 250.0)

    for column, line in enumerate(done.baselines):
        back = done.samples.values[:, column] + line.at(samples.fitted_s)
        assert back == pytest.approx(samples.values[:, column], abs=1e-5)
    assert (done.samples.validity == samples.validity).all()


def test_newtons_at_a_press_s_peak_are_those_of_the_gauge(
    calibration: Calibration, later: Any
) -> None:
    samples, presses, gauge = later
    done = correct(samples, gauge.info, calibration, "N", 250.0)

    errors = []
    for sensor, force_n, start_s, end_s in presses:
        inside = (samples.fitted_s >= start_s) & (samples.fitted_s <= end_s)
        errors.append(abs(float(done.samples.values[inside, sensor].max()) - force_n))
    assert done.info.units == ("N",) * 12
    assert np.mean(errors[:12]) < 0.04  # at 0.6 N
    assert np.mean(errors[12:]) < 0.2  # at 1.2 N, where the pads begin to saturate
    untouched = done.samples.values[:1000].max(axis=0)
    assert np.delete(untouched, 1).max() < 0.02
    assert untouched[1] < 0.2  # the nearly silent sensor: its noise is worth more force


@pytest.mark.parametrize(
    ("material", "low", "high"),
    [("plastic", 0.55, 0.9), ("glass", 1.4, 2.6), ("aluminium", 1.6, 3)],
)
def test_newtons_hold_for_the_material_and_the_speed_that_were_calibrated_and_no_other(
    calibration: Calibration, material: str, low: float, high: float
) -> None:
    """Grasps told with a plastic tip's curve: what docs/how-to/calibrate.md warns of, measured."""
    hand = TengHandConfig(
        seed=0, rate_hz=250.0, humidity_pct=(50.0, 50.0), force_n=(0.5, 1.5), moving=0.0
    )
    stream = GraspStream(hand, shape="cylinder", material=material)
    parts, marks = [], []
    for _ in range(25):
        samples, own = stream.next_block()
        parts.append(samples)
        marks += own
    done = correct(Samples.join(parts), stream.info, calibration, "N", 250.0).samples
    ratios = []
    for mark in marks:
        first = (done.fitted_s >= mark.start_s) & (done.fitted_s <= mark.start_s + 0.35)
        measured = np.median(np.delete(done.values[first].max(axis=0), 1))
        ratios.append(float(measured) / float(mark.groups["force_n"]))

    assert low < np.median(ratios) < high, np.median(ratios)


def test_more_force_than_a_sensor_can_show_is_at_least_what_it_shows(
    calibration: Calibration, later: Any
) -> None:
    _, _, gauge = later
    samples, _ = gauge.press(0, 5.0)
    rest = gauge.rest(3.0)
    done = correct(Samples.join([samples, rest]), gauge.info, calibration, "N", 250.0)

    # 5 N and 2 N give the same volts; the value is the end of what is told, flagged as such.
    first = done.samples.values[:, 0]
    peak = int(first.argmax())
    assert first[peak] == pytest.approx(calibration.channels[0].largest_n, rel=1e-6)
    assert done.samples.validity[peak, 0] & Validity.SATURATED


def test_a_sensor_without_a_curve_has_no_newtons(calibration: Calibration, later: Any) -> None:
    samples, _, gauge = later
    channels = (replace(calibration.channels[0], curve=None), *calibration.channels[1:])
    done = correct(samples, gauge.info, replace(calibration, channels=channels), "N", 250.0)

    assert np.isnan(done.samples.values[:, 0]).all()
    assert (done.samples.validity[:, 0] & Validity.NOT_FINITE).all()
    assert not done.samples.usable[:, 0].any()


def test_a_sensor_that_never_rests_gets_the_calibration_s_baseline_and_is_named(
    calibration: Calibration, later: Any
) -> None:
    samples, _, gauge = later
    noisy = samples.values.copy()
    noisy[:, 5] += np.random.default_rng(0).normal(1.0, 0.5, len(noisy)).astype(np.float32)
    done = correct(replace(samples, values=noisy), gauge.info, calibration, "V", 250.0)

    assert done.borrowed == ("middle-distal",)
    assert done.baselines[5].level == calibration.channels[5].baseline


def test_missing_values_stay_missing(calibration: Calibration, later: Any) -> None:
    samples, _, gauge = later
    validity = samples.validity.copy()
    validity[100:110, 3] = Validity.MISSING
    values = samples.values.copy()
    values[100:110, 3] = np.nan
    holed = replace(samples, values=values, validity=validity)

    for unit in ("V", "N"):
        done = correct(holed, gauge.info, calibration, unit, 250.0)
        assert np.isnan(done.samples.values[100:110, 3]).all()
        assert (done.samples.validity[100:110, 3] == Validity.MISSING).all()
        assert np.isfinite(done.samples.values[:, 4]).all()


def test_a_lost_scan_does_not_lower_the_force_of_those_beside_it(
    calibration: Calibration, later: Any
) -> None:
    """The mean over 20 ms is of the values that came: a missing one is no 0 V."""
    samples, presses, gauge = later
    sensor, _, start_s, end_s = presses[3]
    inside = np.flatnonzero((samples.fitted_s > start_s) & (samples.fitted_s < end_s))
    peak = int(inside[np.argmax(samples.values[inside, sensor])])
    validity, values = samples.validity.copy(), samples.values.copy()
    validity[peak, sensor], values[peak, sensor] = Validity.MISSING, 0.0
    holed = replace(samples, values=values, validity=validity)

    whole, found = (correct(own, gauge.info, calibration, "N", 250.0).samples.values
                    for own in (samples, holed))  # fmt: skip

    beside = [peak - 1, peak + 1]
    np.testing.assert_allclose(found[beside, sensor], whole[beside, sensor], rtol=0.05)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"name": "glove"}, "name"),
        ({"serial": "other"}, "serial number"),
        ({"units": ("count",) * 12}, "units"),
        ({"channels": tuple("abcdefghijkl")}, "channels"),
        ({"details": {"wiring": "one-board"}}, "simulator"),
    ],
)
def test_other_sensors_are_refused_by_what_differs(
    calibration: Calibration, later: Any, change: dict[str, Any], says: str
) -> None:
    samples, _, gauge = later
    with pytest.raises(BadInput, match=f"calibrated, {says}"):
        correct(samples, replace(gauge.info, **change), calibration, "V", 250.0)


def test_a_disk_that_is_refused_leaves_no_half_recording(
    calibration: Calibration, later: Any, tmp_path: Path
) -> None:
    samples, _, gauge = later
    with Recorder(tmp_path / "raw.mcap", Manifest(sensor=gauge.info)) as recorder:
        recorder.write(samples)
    (tmp_path / "there.mcap").write_bytes(b"mine")

    with pytest.raises(BadInput):
        write_corrected(tmp_path / "raw.mcap", tmp_path / "there.mcap", calibration, "V")

    assert (tmp_path / "there.mcap").read_bytes() == b"mine"
    ledger = write_corrected(tmp_path / "raw.mcap", tmp_path / "new.mcap", calibration, "V")
    assert ledger["scans"] == len(samples)
    written = read_recording(tmp_path / "new.mcap")
    assert written.manifest.sensor.details["raw"] == "raw.mcap"
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "new.mcap",
        "raw.mcap",
        "there.mcap",
    ]


def test_the_rate_is_the_measured_one_whatever_the_gaps() -> None:
    time_s = np.arange(1000) / 200.0
    plain = Samples.from_values(np.zeros((1000, 1)), time_s)
    time_s = np.where(np.arange(1000) > 500, time_s + 60.0, time_s)
    gap = Samples.from_values(np.zeros((1000, 1)), time_s)

    assert rate_of(plain, 1.0) == pytest.approx(200.0)
    assert rate_of(gap, 1.0) == pytest.approx(200.0)
