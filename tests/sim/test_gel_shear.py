"""Claims about gels of version 2: what sticks, what slips, what they share with version 1."""

import hashlib
from dataclasses import replace

import numpy as np
import pytest

from taxel.gel.shading import Shading
from taxel.sim.gelsight.mini import GelCamera, draw_sensor
from taxel.sim.pour import gel_shear_constants
from taxel.sim.pour.cup_pour import (
    _SHEAR_STIFFNESS_N_MM3,
    CupPourConfig,
    PourTrack,
    list_runs,
    simulate_pour,
)
from taxel.sim.pour.cups import PourRun, draw_cup, draw_run
from taxel.sim.pour.gel_shear import LayerGels, LayerMoment, contact_of
from taxel.sim.pour.state import PadHold
from taxel.sim.pour.views import LayerView, face_shear

FROZEN = {"2": "3962310a508daa26bff019659272f7de3cf383ba4e6fa7cfdb67df69ad7215b8"}
"""Version → SHA-256 of all constants."""
VERSION_1 = "9008df3a488fa905659f390c0cea14818dbc5866b640feb6fad56b102b2745fd"
"""SHA-256 of the images that the code before version 2 made of two pours."""
RUN = draw_run(0, draw_cup(0, 1), "lower", 15.0)
"""A pour that ends in gross slip."""
STILL = draw_run(0, draw_cup(0, 2), "middle", 40.0, "still")


def hold(x: float = 0.0, y: float = 0.0, turn: float = 0.0, **changed: object) -> PadHold:
    base = PadHold(
        time_s=0.0,
        place=np.array([x, y, turn]),
        normal_n=20.0,
        friction=np.array([0.8, 0.8]),
        patch_mm=(4.5, 8.0),
        dropped=False,
        release_s=0.03,
    )
    return replace(base, **changed)  # type: ignore[arg-type]


def gels(axis_rad: float = 0.2, creep: float = 0.0, **changed: object) -> LayerGels:
    return LayerGels(np.zeros(3), hold(**changed), axis_rad, creep, _SHEAR_STIFFNESS_N_MM3)  # type: ignore[arg-type]


def follow(layers: LayerGels, holds: list[PadHold]) -> list[LayerMoment]:
    """Return the gels at each of the moments, in order."""
    return [layers.step(hold) for hold in holds]


def seen(moment: LayerMoment, side: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return places (n, 2) of the unmoved face and its movement there (n, 2), millimetres."""
    shear = face_shear(moment, side)
    field = shear.patch.field(shear.source_mm2)
    rows, columns = field.shape[:2]
    x, y = np.meshgrid(np.arange(columns) - columns // 2, np.arange(rows) - rows // 2)
    own = np.stack([x * shear.patch.step_mm[0], y * shear.patch.step_mm[1]], -1).reshape(-1, 2)
    cos, sin = np.cos(shear.angle_rad), np.sin(shear.angle_rad)
    turn = np.array([[cos, -sin], [sin, cos]])
    return own @ turn.T + shear.middle_mm, field[..., :2].reshape(-1, 2) @ turn.T


@pytest.fixture(scope="module")
def track() -> PourTrack:
    return simulate_pour(RUN, duration_s=6.0, gel=2)


def test_a_changed_constant_needs_a_new_version() -> None:
    names = sorted(name for name in vars(gel_shear_constants) if name.isupper())
    text = "\n".join(f"{name}={getattr(gel_shear_constants, name)!r}" for name in names)
    found = hashlib.sha256(text.encode()).hexdigest()
    assert FROZEN.get(gel_shear_constants.GEL_VERSION) == found, f"the constants hash to {found}"


def test_version_1_is_the_same_to_the_last_bit() -> None:
    from taxel.sources.simulated.pour_sets import simulate_videos

    digest = hashlib.sha256()
    runs = list_runs(CupPourConfig(cups=1, negatives=1.0))
    for run in (runs[0], runs[3]):
        for video in simulate_videos(run, 10.0, 60.0, 3.0)[1]:
            for image in video.images:
                digest.update(image.tobytes())
    assert digest.hexdigest() == VERSION_1


def test_a_handle_that_has_not_moved_shears_nothing() -> None:
    moment = gels().step(hold(time_s=1.0))
    assert np.abs(moment.source_mm2).max() == 0.0
    assert np.abs(seen(moment)[1]).max() == 0.0
    assert moment.slip_um.max() == 0.0


def test_an_unsheared_face_looks_as_in_version_1() -> None:
    track = simulate_pour(replace(STILL, cup=replace(STILL.cup, texture_um=8.0)), 60.0, 1.0)
    camera = GelCamera(track.shapes[0], draw_sensor(3, 0), 3)
    motion = replace(
        track.motions[0],
        object_mm=np.zeros((60, 2)), object_rad=np.zeros(60),
        gel_mm=np.zeros((60, 2)), gel_rad=np.zeros(60),
    )  # fmt: skip
    shear = face_shear(gels().step(hold(time_s=1.0)), 0)
    one, two = camera.frame(motion, 0, 0.0), camera.frame(motion, 0, 0.0, shear)
    np.testing.assert_array_equal(one, two)


def test_what_sticks_moves_rigidly_with_the_handle() -> None:
    """With friction without end all under the contact moves as the handle, turned or shifted."""
    sticky = {"friction": np.array([50.0, 50.0])}
    layers = gels(**sticky)
    steps = [hold(0.02 * i, 0.03 * i, 0.006 * i, time_s=i / 60, **sticky) for i in range(1, 11)]
    moment = follow(layers, steps)[-1]
    places, moved = seen(moment)
    cos, sin = np.cos(0.06), np.sin(0.06)
    expected = places @ (np.array([[cos, -sin], [sin, cos]]) - np.eye(2)).T + [0.2, 0.3]
    near = np.hypot(*places.T) < 3.0
    assert near.sum() > 20
    np.testing.assert_allclose(moved[near], expected[near], atol=2e-3)
    np.testing.assert_allclose(moment.middle_mm, 0.0, atol=1e-3)
    np.testing.assert_allclose(moment.turn_rad, 0.06, atol=1e-3)
    assert moment.at_limit.max() == 0.0


def test_in_full_slip_the_gel_stays_while_the_handle_goes_on() -> None:
    """The face keeps its movement, and the handle slides over it by all that it moves."""
    layers = gels(axis_rad=0.0)
    steps = [hold(0.0, 0.06 * i, time_s=i / 60) for i in range(1, 101)]
    moments = follow(layers, steps)
    late, end = moments[79], moments[99]
    assert end.at_limit.min() == 1.0
    np.testing.assert_allclose(end.moved_mm, late.moved_mm, atol=2e-3)
    slid_um = end.slip_um - late.slip_um
    np.testing.assert_allclose(slid_um, 1200.0, rtol=0.005)  # 20 steps of 60 µm
    np.testing.assert_allclose(end.middle_mm[:, 1] - late.middle_mm[:, 1], 1.2, atol=5e-3)


def test_the_rim_slips_first_and_the_annulus_grows() -> None:
    layers = gels()
    steps = [hold(0.0, 0.0, 0.0015 * i, time_s=i / 60) for i in range(1, 200)]
    limits = np.array([moment.at_limit[0] for moment in follow(layers, steps)])
    assert limits[0] == 0.0
    assert (np.diff(limits) >= -1e-9).all()
    assert len(np.unique(limits)) > 5  # it grows cell by cell
    assert 0.5 < limits[-1] < 1.0  # a turn leaves the very middle stuck, however far it goes


def test_in_full_spin_the_gel_keeps_its_twist() -> None:
    """Clockwise slip of the handle past a face that stays twisted clockwise."""
    end = follow(gels(), [hold(0.0, 0.0, 0.006 * i, time_s=i / 60) for i in range(1, 121)])
    twist = np.array([moment.turn_rad[0] for moment in end])
    assert end[-1].at_limit[0] > 0.85
    assert 0.05 < twist[-1] < 0.4
    assert abs(twist[-1] - twist[-30]) < 0.03  # while the handle turns by 0.18
    np.testing.assert_allclose(end[-1].angle_rad, 0.2 + 0.72 - twist[-1], atol=1e-6)


def test_the_two_sides_differ_where_their_friction_does() -> None:
    friction = np.array([0.4, 0.9])
    layers = gels(friction=friction)
    end = follow(layers, [hold(0.0, 0.02 * i, time_s=i / 60, friction=friction)
                          for i in range(1, 16)])[-1]  # fmt: skip
    assert end.slip_um[0] > 2.0 * end.slip_um[1]
    assert end.at_limit[0] > end.at_limit[1]


def test_the_right_camera_sees_the_mirror_image() -> None:
    moment = follow(gels(), [hold(0.1, 0.2, 0.03, time_s=0.1)])[-1]
    places, moved = seen(moment, 0)
    mirrored, others = seen(moment, 1)
    order, other = (np.lexsort(np.round(p, 6).T) for p in (places * [-1, 1], mirrored))
    np.testing.assert_allclose((places * [-1, 1])[order], mirrored[other], atol=1e-6)
    np.testing.assert_allclose((moved * [-1, 1])[order], others[other], atol=1e-5)


def test_a_contact_that_grows_or_creeps_keeps_its_face() -> None:
    layers = gels(creep=0.2)
    before = layers.step(hold(0.05, 0.1, 0.01, time_s=0.01))
    after = layers.step(hold(0.05, 0.1, 0.01, time_s=0.012, patch_mm=(4.9, 8.7)))
    assert after.patch.half_mm != before.patch.half_mm
    np.testing.assert_allclose(after.moved_mm, before.moved_mm, atol=3e-3)
    np.testing.assert_allclose(after.turn_rad, before.turn_rad, atol=1e-3)
    late = layers.step(hold(0.05, 0.1, 0.01, time_s=4.0, patch_mm=(4.9, 8.7)))
    np.testing.assert_allclose(late.moved_mm, after.moved_mm, atol=3e-3)


def test_creep_takes_force_from_what_sticks() -> None:
    """The share that crept bears nothing: released, the face does not come back all the way."""
    sticky = {"friction": np.array([50.0, 50.0])}
    layers = gels(creep=0.2, **sticky)
    layers.step(hold(0.0, 0.1, time_s=0.0, **sticky))
    layers.step(hold(0.0, 0.1, time_s=30.0, **sticky))
    free = layers.step(hold(0.0, 0.1, time_s=30.0, normal_n=0.0, **sticky))
    np.testing.assert_allclose(free.moved_mm[:, 1], 0.1 * -np.expm1(-0.2), rtol=0.02)


def test_a_lost_cup_lets_the_faces_spring_back() -> None:
    layers = gels()
    layers.step(hold(0.0, 0.2, 0.02, time_s=0.1))
    gone = layers.step(hold(0.0, 9.0, 0.02, time_s=0.4, dropped=True))
    assert np.abs(gone.moved_mm).max() < 1e-4


def test_a_stuck_contact_turns_as_hard_as_the_brushes() -> None:
    contact = contact_of(4.5, 8.0, _SHEAR_STIFFNESS_N_MM3)
    patch = contact.patch
    turn = np.concatenate([-patch.y_mm, patch.x_mm])
    layer = turn @ np.linalg.solve(patch.compliance / contact.modulus_mpa, turn)
    brushes = _SHEAR_STIFFNESS_N_MM3 * patch.cell_mm2 * (turn @ turn)
    assert layer == pytest.approx(brushes)
    assert 0.1 < contact.modulus_mpa < 0.3  # about the gel's own 0.145 MPa


def test_the_cups_move_alike_in_both_versions(track: PourTrack) -> None:
    first = simulate_pour(RUN, duration_s=6.0)
    np.testing.assert_array_equal(track.truth[:, :8], first.truth)
    np.testing.assert_array_equal(track.motions[1].object_mm, first.motions[1].object_mm)


def test_the_layers_own_slip_agrees_with_the_dynamics(track: PourTrack) -> None:
    """Of 300 µm by brushes the layers slip 55 to 115 %; in the end they differ by the bend."""
    slip = track.truth[:, 0]
    at = int(np.argmax(slip > 300))
    assert slip[at] > 300
    assert 165 < track.truth[at, 8:10].max() < 345
    assert track.truth[-1, 8:10].max() == pytest.approx(slip[-1], rel=0.15)
    assert track.truth[at, 10:12].min() > 0.3  # the annulus came first


def test_coarser_following_gives_nearly_the_same(track: PourTrack) -> None:
    """Every second of 120 moments a second is every one of 60."""
    fine = simulate_pour(RUN, 120.0, 6.0, 2, layer_every=2)
    np.testing.assert_array_equal(fine.truth[::2], track.truth)
    np.testing.assert_array_equal(fine.layer[100].source_mm2, track.layer[100].source_mm2)
    between = fine.motions[0].gel_rad
    np.testing.assert_allclose(between[1:-1:2], (between[:-2:2] + between[2::2]) / 2, atol=1e-12)


def test_a_camera_sees_between_two_moments_what_lies_between(track: PourTrack) -> None:
    view = LayerView(track.layer, 60.0, 0)
    at = int(np.argmax(track.truth[:, 0] > 100))
    here, then = (view.at(index / 60.0) for index in (at, at + 1))
    middle = view.at((at + 0.5) / 60.0)
    np.testing.assert_allclose(
        middle.source_mm2, (here.source_mm2 + then.source_mm2) / 2, rtol=1e-3, atol=1e-5
    )
    assert view.at(-1.0).angle_rad == view.at(0.0).angle_rad
    assert view.at(99.0).angle_rad == view.at(359 / 60.0).angle_rad


def dots(image: np.ndarray) -> np.ndarray:
    from taxel.gel.markers import find_markers

    return find_markers(image).astype(np.float64)


def test_markers_under_a_stuck_contact_move_with_the_handle() -> None:
    """By fractions of a pixel, within 0.1 px; those far away move less."""
    sensor = replace(
        draw_sensor(7, 0), noise=0.0, scratches=0, dust=0, transient=0.0, drift=0.0, flicker=0.0
    )
    track = simulate_pour(STILL, 60.0, 1.0)
    camera = GelCamera(track.shapes[0], sensor, 5, Shading(np.zeros((20, 3)), 0.7))
    sticky = {"friction": np.array([50.0, 50.0]), "patch_mm": (7.5, 7.5)}
    shift_px = np.array([2.3, -3.6])
    place = shift_px * sensor.mm_per_px
    moment = gels(**sticky).step(hold(*place, time_s=0.1, **sticky))
    motion = replace(track.motions[0], object_mm=np.tile(place, (60, 1)))
    unmoved = face_shear(gels(**sticky).step(hold(time_s=0.1, **sticky)), 0)
    still = replace(motion, object_mm=np.zeros((60, 2)))
    before = dots(camera.frame(still, 0, 0.0, unmoved))
    after = dots(camera.frame(motion, 0, 0.0, face_shear(moment, 0)))
    away = np.hypot(*(before - (159.5, 119.5)).T)
    steps = np.array([after[np.argmin(np.hypot(*(after - dot).T))] - dot for dot in before])
    assert (away < 60).sum() >= 4
    # The indentation's push is centred on the handle, which has moved as well.
    np.testing.assert_allclose(steps[away < 60].mean(axis=0), shift_px, atol=0.15)
    assert np.hypot(*steps[away > 150].T).max() < 2.0


def test_the_same_run_gives_the_same_layers(track: PourTrack) -> None:
    again = simulate_pour(RUN, duration_s=2.0, gel=2)
    np.testing.assert_array_equal(again.truth, track.truth[:120])
    np.testing.assert_array_equal(again.layer[100].source_mm2, track.layer[100].source_mm2)


def test_an_unknown_gel_is_refused() -> None:
    with pytest.raises(ValueError, match="gel 1 or 2"):
        CupPourConfig(gel=3)  # type: ignore[arg-type]


def test_a_run_without_slip_shows_none() -> None:
    run: PourRun = replace(STILL, vibration_n=0.0, creep=0.0)
    truth = simulate_pour(run, duration_s=2.0, gel=2).truth
    assert truth[-1, 8:10].max() < 5.0
