"""What the simulator put in comes out: curves, drift, uniformity, ghosts, hysteresis."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from taxel.calibration.characterise import characterise
from taxel.calibration.presses import Script, script_of_marks
from taxel.calibration.results import PressedRecording
from taxel.errors import BadDataset
from taxel.sim.teng import constants
from taxel.sim.teng.electrics import full_voltage
from taxel.sim.teng.force_gauge import GaugeConfig
from taxel.sim.teng.hand import GraspStream, TengHandConfig


def test_the_gauge_presses_the_sensors_of_sim_teng(three_boards: Any) -> None:
    """The same seed gives the same sensors, so that a calibration fits later recordings."""
    hand = TengHandConfig(seed=0, rate_hz=250.0, humidity_pct=(50.0, 50.0))
    stream = GraspStream(hand)

    assert stream.info.serial == three_boards.gauge.info.serial
    session = stream._maker.session
    assert session.gain.tolist() == three_boards.gauge.truth.session.gain.tolist()


def test_the_curve_has_the_simulator_s_form_and_its_force_scale(three_boards: Any) -> None:
    assert three_boards.found.form == "saturating"
    for sensor in three_boards.found.sensors:
        assert sensor.curve is not None
        if sensor.channel == "index-middle":  # nearly silent: its curve is blurred by noise
            continue
        _, scale_n, exponent = sensor.curve.parameters
        # The rise's leak bends the curve a little: α is found within a tenth.
        assert scale_n == pytest.approx(constants.FORCE_SCALE_N, rel=0.1)
        assert exponent == pytest.approx(1.0, abs=0.2)


def test_heights_are_proportional_to_the_sensors_gains(three_boards: Any) -> None:
    truth = three_boards.gauge.truth.session
    volts = np.array(three_boards.found.at_one_force.volts)
    ratio = volts / truth.gain

    assert ratio == pytest.approx(np.median(ratio), rel=0.05)
    full = full_voltage(truth, "plastic", 2.0)
    assert 0.7 * full < np.median(ratio) < full  # the rest leaks away while it rises


def test_drift_and_baseline_are_found(three_boards: Any) -> None:
    truth = three_boards.gauge.truth
    step_v = 3.3 / 1024
    for sensor, drift, level in zip(
        three_boards.found.sensors, truth.drift_v_per_hour, truth.baseline_v, strict=True
    ):
        assert sensor.rest is not None
        assert sensor.rest.per_hour == pytest.approx(drift, abs=0.02)
        # A converter rounds down: half a step too low; the floor at 0 V lifts noise a little.
        assert sensor.rest.at(0.0) == pytest.approx(level, abs=step_v)


def test_the_silent_sensor_is_named_and_boards_differ_by_their_references(
    three_boards: Any,
) -> None:
    assert three_boards.found.at_one_force.outliers == ("index-middle",)
    half, full = three_boards.found.references
    # Half a step: the converter rounds down. 0.002: three standard errors of 125 scans.
    error = (np.array(half.volts) + 3.3 / 1024 / 2) / 1.65 - 1.0
    assert error == pytest.approx(three_boards.gauge.truth.reference_error, abs=0.002)
    # 3.3 V with a reference of 3.3 V says "at least": no spread is made up from it.
    assert all(full.at_least)
    assert math.isnan(full.spread_pct)


def test_ghosts_of_one_board_lie_beside_the_pressed_sensor(one_board: Any) -> None:
    truth = one_board.gauge.truth.session
    hold = constants.HOLD_CAPACITANCE_PF
    share = hold / (hold + truth.capacitance_pf)
    found = np.array(one_board.found.ghosts.share)
    beside = [found[i, (i + 1) % 12] for i in range(12)]

    assert np.median(beside) == pytest.approx(share / (1 - share), rel=0.15)
    found[np.arange(12), (np.arange(12) + 1) % 12] = 0.0
    np.fill_diagonal(found, 0.0)
    assert np.abs(np.delete(found, 1, axis=0)).max() < 0.01  # not of the nearly silent sensor
    assert len(one_board.found.ghosts.named) >= 11


def test_three_boards_with_grounded_pins_have_no_ghosts(three_boards: Any) -> None:
    assert three_boards.found.ghosts.named == ()


def test_hysteresis_is_found_where_there_is_some_and_not_where_there_is_none(
    three_boards: Any, one_board: Any
) -> None:
    some = [sensor.hysteresis.mean_pct for sensor in three_boards.found.sensors]
    none = [sensor.hysteresis.mean_pct for sensor in one_board.found.sensors]

    # memory 0.04 for 5 N: 2.8 % of the height at 0.5 N … 0 at 4 N, 1.7 % of the span on average.
    assert np.mean(some) == pytest.approx(1.7, abs=0.5)
    assert abs(np.mean(none)) < 0.5


def test_forces_in_the_sensors_range_are_measured_better_than_by_a_straight_line(
    three_boards: Any,
) -> None:
    errors = three_boards.found.errors[-1]

    assert errors.split == "whole rounds, forces in its range"
    assert errors.curve_n[2] < errors.line_n[1]  # the intervals do not meet
    assert errors.curve_n[0] < 0.12
    for sensor in three_boards.found.sensors:
        # The pads saturate near 1.7 N: more is not claimed.
        assert 1.0 < sensor.largest_n < 2.5
        assert sensor.smallest_n < (0.2 if sensor.channel == "index-middle" else 0.06)


def test_a_press_with_a_missing_value_is_left_out_and_counted(three_boards: Any) -> None:
    samples = three_boards.samples
    script = script_of_marks(three_boards.marks, three_boards.gauge.info)
    press = script.presses[3]
    first = int(np.searchsorted(samples.fitted_s, press.start_s)) + 20
    validity = samples.validity.copy()
    validity[first, press.channel] = 1
    holed = type(samples)(
        values=samples.values, counter=samples.counter, device_s=samples.device_s,
        arrival_s=samples.arrival_s, fitted_s=samples.fitted_s, validity=validity,
    )  # fmt: skip

    found = characterise(
        [PressedRecording(samples=holed, script=script, rate_hz=250.0)], three_boards.gauge.info
    )

    assert [sensor.unusable for sensor in found.sensors] == [1] + [0] * 11
    assert len(found.sensors[0].volts) == len(three_boards.found.sensors[0].volts) - 1


def test_a_converter_at_its_end_is_left_out_and_counted(gauged: Callable[..., Any]) -> None:
    loud = TengHandConfig(seed=0, rate_hz=100.0, humidity_pct=(30.0, 30.0))
    config = GaugeConfig(forces_n=(0.2, 0.3, 0.5, 5.0), rounds=1, material="aluminium")
    found = gauged(loud, config).found

    assert sum(sensor.saturated for sensor in found.sensors) >= 11
    assert all(sensor.volts.max() < 3.3 for sensor in found.sensors if len(sensor.volts))


def test_no_presses_and_presses_of_one_force_are_refused(three_boards: Any) -> None:
    info = three_boards.gauge.info
    nothing = PressedRecording(
        samples=three_boards.samples, script=Script(presses=()), rate_hz=250.0
    )
    with pytest.raises(BadDataset, match="presses of known force"):
        characterise([nothing], info)
    script = script_of_marks(three_boards.marks, info)
    alike = tuple(press for press in script.presses if 0.4 < press.force_n < 0.6)
    with pytest.raises(BadDataset, match="3 forces"):
        characterise(
            [
                PressedRecording(
                    samples=three_boards.samples, script=Script(presses=alike), rate_hz=250.0
                )
            ],
            info,
        )


def test_a_press_outside_the_recording_is_refused(three_boards: Any) -> None:
    script = script_of_marks(three_boards.marks, three_boards.gauge.info)
    with pytest.raises(BadDataset, match="inside the recording"):
        characterise(
            [PressedRecording(samples=three_boards.samples[:2000], script=script, rate_hz=250.0)],
            three_boards.gauge.info,
        )
