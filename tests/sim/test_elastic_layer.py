"""Claims about the elastic layer: closed forms, equilibrium, symmetry."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import j1

from taxel.sim.pour.elastic_layer import LayerPatch, cell_kernel, layer_patch, shear_response


def by_boundary_conditions(k: float, h: float, nu: float) -> tuple[float, float]:
    """Solve Navier's equations for one wave: movement along k and inwards, times G.

    u = i f(z) and w = g(z) times exp(ikx), with f, g from exp(±kz) and kz exp(±kz), a traction
    along x on z = 0, none across it, and nothing moving at z = h.
    """
    kappa, lame = 3.0 - 4.0 * nu, 2.0 * nu / (1.0 - 2.0 * nu)

    def basis(z: float) -> tuple[np.ndarray, ...]:
        down, up = np.exp(-z), np.exp(z - k * h)
        f = np.array([down, z * down, up, z * up])
        df = np.array([-down, (1 - z) * down, up, (1 + z) * up]) * k
        g = np.array([-down, -(kappa + z) * down, up, (z - kappa) * up])
        dg = np.array([down, (kappa + z - 1) * down, up, (z - kappa + 1) * up]) * k
        return f, df, g, dg

    f, df, g, dg = basis(0.0)
    fixed = basis(k * h)
    rows = np.array([df + k * g, lame * (dg - k * f) + 2 * dg, fixed[0], fixed[2]])
    parts = np.linalg.solve(rows, [-1.0, 0.0, 0.0, 0.0])
    return float(f @ parts), float(g @ parts)


@pytest.mark.parametrize("k", [0.01, 0.1, 0.5, 1.0, 3.0])
@pytest.mark.parametrize("nu", [0.2, 0.49])
def test_the_response_solves_the_layers_equations(k: float, nu: float) -> None:
    along, across, inwards = (float(x) for x in shear_response(np.array(k), 4.5, nu))
    f, g = by_boundary_conditions(k, 4.5, nu)
    assert along == pytest.approx(f, rel=1e-9)
    assert inwards == pytest.approx(g, rel=1e-6, abs=1e-9)
    assert across == pytest.approx(np.tanh(4.5 * k) / k)


def test_a_thick_layer_is_cerrutis_half_space() -> None:
    k = np.array([0.5, 1.0, 4.0])
    along, across, inwards = shear_response(k, 100.0, 0.3)
    np.testing.assert_allclose(along, 0.7 / k, rtol=1e-10)
    np.testing.assert_allclose(across, 1.0 / k, rtol=1e-10)
    np.testing.assert_allclose(inwards, 0.2 / k, rtol=1e-9)


def disc_centre(radius: float, thickness: float, nu: float) -> float:
    """Return the movement of the middle of a uniformly sheared disc, per traction over G."""

    def wave(k: float) -> float:
        along, across, _ = shear_response(np.array(k), thickness, nu)
        return float((along + across) / 2.0 * radius * j1(k * radius))

    edges = np.linspace(0.0, 80.0 / radius, 161)
    return sum(quad(wave, a, b)[0] for a, b in pairwise(edges))


def test_a_uniformly_sheared_disc_on_a_half_space() -> None:
    """Its middle moves by q a (2 − ν) / 2G (Cerruti's kernel integrated over the disc)."""
    assert disc_centre(2.0, 4000.0, 0.4) == pytest.approx(2.0 * 1.6 / 2.0, rel=0.01)


@pytest.mark.parametrize("radius", [3.0, 6.0])
def test_the_cells_move_as_the_continuous_layer(radius: float) -> None:
    """The middle of a disc of cells moves as Hankel's integral says, within 1.5 %."""
    patch = layer_patch(radius, radius, cells=31)
    count = len(patch.x_mm)
    even = np.append(np.full(count, patch.cell_mm2), np.zeros(count))
    middle = np.argmin(np.hypot(patch.x_mm, patch.y_mm))
    moved = patch.compliance[middle] @ even
    area = count * patch.cell_mm2 / (np.pi * radius**2)
    assert moved == pytest.approx(disc_centre(radius, 4.5, 0.49) * area, rel=0.015)


def test_the_window_bears_what_the_face_is_given() -> None:
    """A bonded layer is in equilibrium: all its movement, over h / G, is the force on it."""
    kernel = cell_kernel((0.7, 1.1), (54, 64))
    for part, whole in ((kernel.xx, 4.5), (kernel.yy, 4.5), (kernel.xy, 0.0)):
        assert part.sum() * 0.7 * 1.1 == pytest.approx(whole, abs=1e-9)


def test_work_is_positive_and_reciprocal() -> None:
    compliance = layer_patch(4.5, 8.8).compliance
    np.testing.assert_array_equal(compliance, compliance.T)
    assert np.linalg.eigvalsh(compliance).min() > 0


def push(patch: LayerPatch, x: float, y: float) -> np.ndarray:
    even = np.tile(np.array([x, y], np.float32), (len(patch.x_mm), 1))
    return patch.field(even * np.float32(patch.cell_mm2))


def test_no_traction_moves_nothing() -> None:
    assert np.abs(push(layer_patch(4.5, 8.8), 0.0, 0.0)).max() == 0.0


def test_the_field_equals_the_compliance_under_the_contact() -> None:
    patch = layer_patch(4.5, 8.8)
    field = push(patch, 0.3, 0.1)
    count = len(patch.x_mm)
    force = np.append(np.full(count, 0.3), np.full(count, 0.1)) * patch.cell_mm2
    moved = (patch.compliance @ force).reshape(2, count)
    rows, columns = field.shape[:2]
    column = np.rint(patch.x_mm / patch.step_mm[0]).astype(int) + columns // 2
    row = np.rint(patch.y_mm / patch.step_mm[1]).astype(int) + rows // 2
    np.testing.assert_allclose(field[row, column, 0], moved[0], rtol=2e-4)
    np.testing.assert_allclose(field[row, column, 1], moved[1], rtol=2e-3, atol=1e-4)


def test_gel_piles_up_ahead_of_a_push_and_fades_far_away() -> None:
    """Pushed to the right it rises at the right: the inward slope falls through the middle."""
    patch = layer_patch(5.0, 5.0)
    field = push(patch, 0.2, 0.0)
    middle = field.shape[0] // 2
    inwards = np.cumsum(field[middle, :, 2]) * patch.step_mm[0]
    assert inwards[:middle].max() > 0.01  # sinks behind
    right = np.rint(6.0 / patch.step_mm[0]).astype(int) + field.shape[1] // 2
    assert inwards[right] < -0.01
    assert np.abs(field[:, [0, -1], :2]).max() < 0.08 * field[..., 0].max()
