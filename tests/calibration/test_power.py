"""Claims about the estimate of charge, energy and a capacitor's curve."""

import json

import numpy as np
import pytest

from taxel.calibration.power import Circuit, PressPower, capacitor_curve, presses_of
from taxel.cli.main import main
from taxel.signals import Samples
from taxel.sim.teng.electrics import full_voltage
from taxel.sim.teng.force_gauge import ForceGauge, GaugeConfig
from taxel.sim.teng.hand import TengHandConfig

CIRCUIT = Circuit(capacitance_pf=200.0, time_constant_s=0.15, storage_uf=0.01, diode_v=0.0)


def test_charge_and_energy_of_a_decay_are_those_of_the_formula():
    """A sudden 2 V that leaks with τ: Q = C·V and E = C·V²/2, to 5 % of what smoothing takes."""
    time_s = np.arange(6000) / 1000.0
    volts = np.where(time_s > 4.0, 2.0 * np.exp(-(time_s - 4.0) / 0.15), 0.0)[:, None]
    (press,) = presses_of(Samples.from_values(volts.astype(np.float32), time_s), 1000.0, CIRCUIT)
    assert press.charge_nc == pytest.approx(0.4, rel=0.05)
    assert press.energy_nj == pytest.approx(0.4, rel=0.05)


def test_the_simulated_pads_charge_is_found_though_it_leaks_while_it_comes():
    """Within 6 % of what the simulator put onto the pad, at half the speed of a grasp."""
    hand = TengHandConfig(seed=1, rate_hz=1000.0, moisture=(0.0, 0.0))
    gauge = ForceGauge(hand, GaugeConfig(rise_s=0.12, force_spread=0.0, scatter=0.0))
    session = gauge.truth.session
    parts = [gauge.rest(3.0), *(gauge.press(0, 1.0)[0] for _ in range(5))]
    samples = Samples.join(parts)
    circuit = Circuit(time_constant_s=session.time_constant_s)
    opened = [p.open_v for p in presses_of(samples, 1000.0, circuit) if p.channel == 0]
    assert len(opened) == 5
    truth = full_voltage(session, "plastic", 1.0) * session.gain[0]
    assert np.mean(opened) == pytest.approx(truth, rel=0.06)


def press(at_s: float, open_v: float) -> PressPower:
    return PressPower(at_s, 0, open_v, 0.2 * open_v, 1.0, False)


def test_a_capacitor_fills_as_a_geometric_series_to_the_pads_open_voltage():
    """Press and release each take the same share off what is missing, as two capacitors share
    charge: V = V0 (1 − (Cs / (Cs + C))^2n)."""
    curve = capacitor_curve([press(5.0, 4.0)], 2.0, [0.0, 2.0, 20.0, 4000.0], CIRCUIT)
    share = (0.01e-6 / (0.01e-6 + 200e-12)) ** 2
    assert curve == pytest.approx([4.0 * (1 - share**n) for n in (1, 2, 11, 2001)], rel=1e-9)
    assert curve[-1] == pytest.approx(4.0, rel=1e-6)


def test_a_storage_smaller_than_a_pad_is_not_charged_above_the_pads_voltage():
    small = Circuit(capacitance_pf=200.0, storage_uf=1e-5, diode_v=0.5)
    curve = capacitor_curve([press(0.0, 4.0)], 2.0, [0.0, 4000.0], small)
    assert curve == pytest.approx([3.0 * (1 - (10 / 210) ** 2), 3.0], rel=1e-9)


def test_diodes_are_never_charged_through():
    curve = capacitor_curve([press(0.0, 1.0)], 1.0, [100.0], Circuit(diode_v=0.6))
    assert curve[0] == 0.0


def test_the_verb_prints_what_it_assumes(capsys: pytest.CaptureFixture[str]):
    main(["power", "sim://teng?seed=1&rate_hz=250", "--seconds", "20"])
    text = " ".join(capsys.readouterr().out.split())
    for words in ("an estimate", "a grasp, all pads", "assumed: a pad with its cable has 250 pF",
                  "beside it: the TENG thesis"):  # fmt: skip
        assert words in text
    main(["power", "sim://teng?seed=1&rate_hz=250", "--seconds", "20", "--json"])
    found = json.loads(capsys.readouterr().out)
    assert found["grasps"] >= 3
    volts = [row["volts"] for row in found["capacitor"]]
    assert volts == sorted(volts)
    assert 0.1 < found["press"]["charge_nc"] < 5.0


def test_a_time_of_nothing_is_refused():
    from taxel.cli.devices.power import Power
    from taxel.errors import BadInput

    with pytest.raises(BadInput, match="above 0"):
        Power(source="sim://teng", seconds=0.0).run()
