"""Claims about newtons while scans come."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from taxel.calibration.apply import correct
from taxel.calibration.live import LiveNewtons, in_newtons
from taxel.calibration.stored import Calibration, document_of, read_calibration, write_calibration
from taxel.errors import BadInput
from taxel.signals import Samples, Validity
from taxel.sim.teng.hand import TengHandConfig


@pytest.fixture(scope="module")
def calibration(tmp_path_factory: pytest.TempPathFactory, three_boards) -> Calibration:
    path = tmp_path_factory.mktemp("c") / "c.json"
    write_calibration(path, document_of(three_boards.found, [], {}))
    return read_calibration(path)


def in_calls(calibration: Calibration, info, samples: Samples, size: int) -> Samples:
    newtons = LiveNewtons(calibration, info)
    return Samples.join([newtons.push(samples[i : i + size]) for i in range(0, len(samples), size)])


@pytest.mark.slow
def test_presses_read_live_what_they_read_from_the_whole_recording(
    three_boards, calibration: Calibration
):
    """Peaks to 15 % of the force in the median, where the sensor tells that force."""
    samples, info = three_boards.samples, three_boards.gauge.info
    live = in_calls(calibration, info, samples, 500)
    whole = correct(samples, info, calibration, "N", 250.0).samples
    off = []
    for mark in three_boards.marks:
        if "force_n" not in mark.labels:
            continue
        column = info.channels.index(mark.labels["sensor"])
        inside = (samples.fitted_s >= mark.start_s) & (samples.fitted_s <= mark.end_s + 0.05)
        flags = live.validity[inside, column] & np.uint8(Validity.SATURATED)
        if flags.any():
            continue
        a, b = live.values[inside, column].max(), whole.values[inside, column].max()
        off.append(abs(a - b) / float(mark.labels["force_n"]))
    assert len(off) > 50
    assert np.median(off) < 0.15


def test_how_the_stream_is_cut_changes_nothing(three_boards, calibration: Calibration):
    samples, info = three_boards.samples[:9000], three_boards.gauge.info
    whole = in_calls(calibration, info, samples, 9000)
    for size in (1000, 37):
        np.testing.assert_array_equal(
            in_calls(calibration, info, samples, size).values, whole.values
        )
    assert whole.values.dtype == np.float32
    assert set(LiveNewtons(calibration, info).info.units) == {"N"}


def test_a_pad_at_rest_reads_no_force_though_its_baseline_has_drifted(
    three_boards, calibration: Calibration
):
    """0.2 V of drift reads as force at first, and as none once rest was seen."""
    info = three_boards.gauge.info
    rng = np.random.default_rng(0)
    level = np.array([c.baseline for c in calibration.channels]) + 0.2
    values = level + rng.normal(0.0, 0.005, (250 * 40, 12))
    samples = Samples.from_values(values.astype(np.float32), np.arange(len(values)) / 250.0)
    live = in_calls(calibration, info, samples, 250)
    with_curve = np.flatnonzero([c.curve is not None for c in calibration.channels])
    assert np.nanmedian(live.values[1000:2000, with_curve]) > 0.02
    assert np.nanmedian(live.values[-2500:, with_curve]) < 0.01


def test_missing_values_have_no_newtons(three_boards, calibration: Calibration):
    samples, info = three_boards.samples[:200], three_boards.gauge.info
    validity = np.array(samples.validity)
    validity[100, 3] = Validity.MISSING
    from dataclasses import replace

    live = in_calls(calibration, info, replace(samples, validity=validity), 200)
    assert np.isnan(live.values[100, 3])
    assert np.isfinite(live.values[99, 0])


def test_other_sensors_are_refused_before_anything_is_read(
    calibration: Calibration, gauged: Callable
):
    from taxel.sim.teng.hand import sensor_info

    class Other:
        info = sensor_info(TengHandConfig(seed=99))

    with pytest.raises(BadInput, match="the sensors that were calibrated"):
        in_newtons(Other(), calibration)  # type: ignore[arg-type]


def test_reading_a_calibration_live_loads_no_scipy():
    code = "import sys, taxel.calibration.live; assert 'scipy' not in sys.modules"
    src = Path(__file__).parents[2] / "src"
    subprocess.run([sys.executable, "-c", code], check=True, env={"PYTHONPATH": str(src)})
