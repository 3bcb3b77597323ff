"""Claims about what the simulated hand can show besides: size, angle, fatigue, interference."""

import hashlib
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from taxel.sim.teng.contact import pad_pressure
from taxel.sim.teng.hand import GraspStream, TengHandConfig, simulate_sessions
from taxel.sim.teng.pickup import TIME_CONSTANT_S, Pickup
from taxel.sim.teng.wear import PRESSES, Wear

SMALL = TengHandConfig(rate_hz=100.0, scans_per_class=6000, sessions=2)
BEFORE = {
    "honest": "a9bfddf0807461b245000b6d140aa3b175ca3c49b42b04ea7713c477077f1a82",
    "paper": "e4a03f5cb239a715f999bf42c5210b5d22b69737f69cddad71b17f846b4ff392",
    "one board": "ed6ab3bbe485617638224f9074d95d01ea72e96cf36948130b74ce113665e15d",
}
"""Preset → SHA-256 of values, times and marks as they were before these effects existed."""


@pytest.mark.parametrize(
    ("name", "config"),
    [
        ("honest", SMALL),
        ("paper", replace(SMALL, seed=7, preset="paper")),
        ("one board", replace(SMALL, seed=3, wiring="one-board", unknown=True)),
    ],
)
def test_without_them_data_sets_are_bit_for_bit_as_before(name: str, config: TengHandConfig):
    digest = hashlib.sha256()
    for session in simulate_sessions(config):
        digest.update(session.samples.values.tobytes())
        digest.update(session.samples.arrival_s.tobytes())
        digest.update(repr(session.marks).encode())
    assert digest.hexdigest() == BEFORE[name]


def peaks(config: TengHandConfig, grasps: int) -> np.ndarray:
    """Return each grasp's largest value a pad, shape (grasps, 12), volts."""
    stream = GraspStream(config, shape="cylinder", material="plastic")
    blocks = [stream.next_block()[0] for _ in range(grasps)]
    return np.stack([block.values.max(axis=0) for block in blocks])


def test_a_hand_with_presses_behind_it_gives_the_share_that_its_fatigue_says():
    """Full presses alone: 10,000 of them cost what is stated, pressed grasp by grasp or before."""
    wear = Wear(0.2, 0.0, 1)
    for _ in range(10):
        wear.add(np.array([PRESSES / 10]))
    assert wear.left[0] == pytest.approx(0.8)
    assert Wear(0.2, 2 * PRESSES, 3).left == pytest.approx([0.64] * 3)


def test_worn_pads_read_lower_by_the_share_that_is_left():
    config = replace(SMALL, force_n=(1.0, 1.0), moving=0.0, fatigue=0.3)
    new, worn = peaks(config, 3), peaks(replace(config, worn_presses=20_000.0), 3)
    loud = new.mean(axis=0) > 0.5
    assert (worn / new)[:, loud].mean() == pytest.approx(0.49, abs=0.03)


def test_a_pad_wears_while_it_is_pressed():
    config = replace(SMALL, force_n=(1.0, 1.0), moving=0.0, fatigue=0.99)
    grasps = peaks(config, 40)
    assert grasps[-3:].mean() < 0.97 * grasps[:3].mean()


def test_pickup_is_the_same_on_all_channels_and_as_large_as_asked():
    rng = np.random.default_rng(0)
    pickup = Pickup(0.2, 100.0, rng)
    whole = np.concatenate([pickup.next(n) for n in (1, 99, 60_000)])
    assert whole.std() == pytest.approx(0.2, rel=0.1)
    lag = round(100.0 * TIME_CONSTANT_S)
    found = np.corrcoef(whole[:-lag], whole[lag:])[0, 1]
    assert found == pytest.approx(np.exp(-1.0), abs=0.06)
    config = replace(SMALL, pickup_v=0.3, force_n=(0.001, 0.001))
    values = next(islice(simulate_sessions(config), 1)).samples.values
    assert np.corrcoef(values[:, 3], values[:, 8])[0, 1] > 0.95


def test_objects_are_as_wide_and_as_turned_as_asked():
    config = replace(SMALL, size_mm=(20.0, 22.0), contact_angle_deg=30.0)
    marks = [mark for session in simulate_sessions(config) for mark in session.marks]
    sizes = [float(mark.groups["size_mm"]) for mark in marks]
    assert 20.0 <= min(sizes) <= max(sizes) <= 22.0


def test_a_turned_cylinder_loads_the_outer_fingers_less():
    straight, turned = (pad_pressure("cylinder", 34.0, 0.0, np.deg2rad(a)) for a in (0.0, 30.0))
    outer, inner = [0, 1, 2, 9, 10, 11], [3, 4, 5, 6, 7, 8]
    assert straight[outer].mean() == pytest.approx(straight[inner].mean())
    assert turned[outer].mean() < turned[inner].mean()


@pytest.mark.parametrize("shape", ["sphere", "cylinder", "rectangle", "prism"])
def test_no_angle_within_the_limits_gives_a_pressure_that_is_no_number(shape: str):
    for angle_rad in np.deg2rad([-55.0, 0.0, 55.0]):
        assert np.isfinite(pad_pressure(shape, 34.0, 0.0, angle_rad)).all()
