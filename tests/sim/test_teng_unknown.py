"""Claims about the objects that no default data set holds: an elongated prism and rubber."""

import hashlib

import numpy as np
import pytest

from taxel.sim.teng.contact import draw_grasp, pad_pressure
from taxel.sim.teng.electrics import draw_session, full_voltage
from taxel.sim.teng.hand import GraspStream, TengHandConfig, simulate_sessions

FORCE_N = (0.5, 5.0)


def test_the_default_sets_are_what_they_were_before_there_were_unknown_objects():
    """Bit for bit: the hash was taken from the version before."""
    digest = hashlib.sha256()
    for preset in ("honest", "paper"):
        config = TengHandConfig(preset=preset, rate_hz=100.0, scans_per_class=4000)  # type: ignore[arg-type]
        for session in simulate_sessions(config):
            digest.update(session.samples.values.tobytes())
    assert digest.hexdigest() == "ca66ccad11fdf0edc74f80dd0a4a1fc6766cdb7ed552f1dd65b35a6f91e1cac1"


def test_a_prism_leans_on_the_middle_pads_more_than_a_cylinder():
    prism, cylinder, rectangle = (
        pad_pressure(shape, 34.0).reshape(4, 3) for shape in ("prism", "cylinder", "rectangle")
    )
    np.testing.assert_allclose(prism, prism[:1].repeat(4, axis=0))
    assert np.all(prism[:, 1] > cylinder[:, 1])
    assert np.all(rectangle[:, 1] < cylinder[:, 1])
    assert np.all(prism[:, [0, 2]] < cylinder[:, [0, 2]])


@pytest.mark.parametrize("size_mm", [28.0, 34.0, 40.0])
def test_a_prisms_pressure_is_shared_out_too(size_mm: float):
    pressure = pad_pressure("prism", size_mm, across_mm=2.0, turned_rad=0.05)
    assert pressure.mean() == pytest.approx(1.0)
    assert pressure.min() > 0


def test_rubber_charges_less_and_touches_more_slowly_than_plastic():
    session = draw_session(
        np.random.default_rng(0), (23.0, 23.0), (45.0, 45.0), (0.0, 0.0), (0.0, 0.0)
    )
    rubber, plastic = (full_voltage(session, m, 2.0) for m in ("rubber", "plastic"))
    assert 0 < rubber < plastic
    slow, fast = (
        draw_grasp(np.random.default_rng(7), "sphere", m, FORCE_N, 0.0).rise_s
        for m in ("rubber", "plastic")
    )
    assert slow == pytest.approx(fast * 2.0 / 1.5)


def test_a_set_with_unknown_objects_holds_all_sixteen_combinations_in_each_session():
    config = TengHandConfig(rate_hz=100.0, scans_per_class=12_000, sessions=2, unknown=True)
    sessions = list(simulate_sessions(config))
    assert sum(len(session.samples) for session in sessions) == 4 * 12_000
    for session in sessions:
        held = {(mark.labels["shape"], mark.labels["material"]) for mark in session.marks}
        assert len(held) == 16
    order = [mark.labels["shape"] == "prism" for mark in sessions[0].marks[:16]]
    assert 2 <= sum(order) <= 5
    assert not all(order[-sum(order) :])


def test_the_weather_of_a_session_does_not_depend_on_what_is_grasped_in_it():
    with_them, without = (
        [session.details for session in simulate_sessions(
            TengHandConfig(rate_hz=100.0, scans_per_class=2000, unknown=unknown))]
        for unknown in (True, False)
    )  # fmt: skip
    assert with_them == without


def test_the_paper_preset_gives_the_unknown_objects_sessions_of_their_own():
    config = TengHandConfig(preset="paper", rate_hz=100.0, scans_per_class=1000, unknown=True)
    names = [session.name for session in simulate_sessions(config)]
    assert len(names) == 8
    assert {"shape-prism", "material-rubber"} <= set(names)


def test_a_stream_grasps_an_unknown_object_where_it_is_asked_to():
    stream = GraspStream(TengHandConfig(rate_hz=100.0), shape="prism", material="rubber")
    _, (mark,) = stream.next_block()
    assert mark.labels == {"shape": "prism", "material": "rubber"}
    with pytest.raises(ValueError, match="prism"):
        GraspStream(TengHandConfig(), shape="cone")
