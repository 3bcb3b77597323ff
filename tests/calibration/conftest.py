"""One simulated hand under the gauge, made once: few forces, two rounds, 250 scans a second."""

from collections.abc import Callable
from dataclasses import dataclass

import pytest

from taxel.calibration.characterise import characterise
from taxel.calibration.presses import script_of_marks
from taxel.calibration.results import Characterisation, PressedRecording
from taxel.signals import Mark, Samples
from taxel.sim.teng.force_gauge import ForceGauge, GaugeConfig
from taxel.sim.teng.hand import TengHandConfig

RATE_HZ = 250.0


@dataclass(frozen=True)
class Gauged:
    gauge: ForceGauge
    samples: Samples
    marks: list[Mark]
    found: Characterisation


def put_under_gauge(hand: TengHandConfig, config: GaugeConfig) -> Gauged:
    gauge = ForceGauge(hand, config)
    parts, marks = [], []
    for samples, own in gauge.script():
        parts.append(samples)
        marks += own
    samples = Samples.join(parts)
    taken = PressedRecording(
        samples=samples, script=script_of_marks(marks, gauge.info), rate_hz=hand.rate_hz
    )
    return Gauged(gauge, samples, marks, characterise([taken], gauge.info))


@pytest.fixture
def gauged() -> Callable[[TengHandConfig, GaugeConfig], Gauged]:
    return put_under_gauge


@pytest.fixture(scope="session")
def three_boards() -> Gauged:
    hand = TengHandConfig(seed=0, rate_hz=RATE_HZ, humidity_pct=(50.0, 50.0))
    return put_under_gauge(hand, GaugeConfig(forces_n=(0.5, 0.7, 1.0, 1.4, 2.0, 4.0), rounds=2))


@pytest.fixture(scope="session")
def one_board() -> Gauged:
    hand = TengHandConfig(
        seed=0, rate_hz=RATE_HZ, humidity_pct=(50.0, 50.0), wiring="one-board", reference_v=5.0
    )
    still = GaugeConfig(forces_n=(0.5, 1.0, 2.0), rounds=1, baseline_v=(0.15, 0.2), memory=0.0)
    return put_under_gauge(hand, still)
