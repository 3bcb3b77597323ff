"""Claims about what a rigid movement of the markers in contact leaves over."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.bench.transitions.gel_shear import ShearFound, comparison_rows
from taxel.evaluation.camera_trials.marker_residual import (
    BANDS,
    MarkerResidual,
    _judge,
    marker_residual,
)
from taxel.gel.contact import ContactShape
from taxel.gel.markers import MarkerFlow
from taxel.sim.gelsight.mini import GelCamera, draw_sensor
from taxel.sim.pour.cup_pour import Gel, simulate_pour
from taxel.sim.pour.cups import draw_cup, draw_run
from taxel.sim.pour.views import LayerView

SHAPE = ContactShape(
    area_px=15000.0,
    centre_px=np.array([160, 120], np.float32),
    axes_px=np.array([90, 60], np.float32),
    angle_rad=0.3,
)
PLACES = np.stack(np.meshgrid(np.arange(16, 310, 31), np.arange(16, 230, 31)), -1).reshape(-1, 2)


def judged(moved: np.ndarray) -> MarkerResidual:
    flow = MarkerFlow(
        PLACES.astype(np.float32),
        (PLACES + moved).astype(np.float32),
        np.ones(len(PLACES), np.bool_),
    )
    found = _judge(0, flow, SHAPE)
    assert found is not None
    return found


def test_a_rigid_movement_leaves_nothing_over() -> None:
    at = PLACES - SHAPE.centre_px
    found = judged(np.stack([3.0 - 0.02 * at[:, 1], 1.0 + 0.02 * at[:, 0]], axis=1))
    assert found.non_rigid == pytest.approx(0.0, abs=1e-5)
    np.testing.assert_allclose(found.carried, 1.0, atol=1e-5)
    assert 0.0 < found.turning < 0.5


def test_a_stretch_is_affine_but_not_rigid() -> None:
    at = PLACES - SHAPE.centre_px
    found = judged(0.05 * at * [1.0, -1.0])
    assert found.non_rigid > 0.8
    assert found.non_affine == pytest.approx(0.0, abs=1e-5)


def test_a_rim_that_lags_behind_shows_by_distance() -> None:
    away = np.hypot(*(PLACES - SHAPE.centre_px).T)
    lag = np.exp(-((away / 80.0) ** 2))
    found = judged(np.array([6.0, 0.0]) * lag[:, None])
    assert 0.1 < found.non_affine < found.non_rigid < 0.6
    seen = [share for share in found.carried if np.isfinite(share)]
    assert len(seen) == len(BANDS)
    assert seen == sorted(seen, reverse=True)


def test_too_little_movement_is_not_judged() -> None:
    flow = MarkerFlow(
        PLACES.astype(np.float32), (PLACES + 0.5).astype(np.float32), np.ones(len(PLACES), bool)
    )
    assert _judge(0, flow, SHAPE) is None


def test_gels_of_version_2_leave_more_over_than_rigid_ones() -> None:
    run = draw_run(0, draw_cup(0, 0), "middle", 15.0)
    left: dict[Gel, float] = {}
    for gel in (1, 2):
        track = simulate_pour(run, 10.0, 6.0, gel)
        sensor = replace(draw_sensor(4, 0), transient=0.0)
        camera = GelCamera(track.shapes[0], sensor, 4)
        view = LayerView(track.layer, 10.0, 0) if gel == 2 else None
        images = [
            camera.frame(track.motions[0], i, i / 10.0, view.at(i / 10.0) if view else None)
            for i in range(40)
        ]
        found = marker_residual(images[:2], images[2:])
        assert found is not None
        assert found.turning > 0.8
        left[gel] = found.non_rigid
    assert left[2] > 1.3 * left[1]


def test_a_gel_that_is_nearer_to_the_real_ones_has_a_ratio_below_one() -> None:
    def found(middle: float) -> dict[bool, ShearFound]:
        spread = [
            MarkerResidual(0, 20, 5.0, 0.5, middle + x, 0.1, (1.0, middle, 0.3, 0.1))
            for x in (-0.1, 0.0, 0.1)
        ]
        return {False: ShearFound(3, spread), True: ShearFound(3, [])}

    rows = comparison_rows({"real": found(0.4), "gel 1": found(0.2), "gel 2": found(0.5)})
    assert [row.value for row in rows] == pytest.approx([0.5, 0.5])  # nothing slipped or turned
    assert all(row.ok for row in rows)
