"""Two gels that shear as elastic layers under one handle: stick in the middle, slip at the rim.

The dynamics say how the handle moves, how hard the gels are pressed and how large friction is;
each gel answers as a layer: what sticks moves with the handle, what slips bears friction times
its pressure, and the face between and around follows elastically. One step a video frame, in
order, since friction remembers. Knows nothing about pixels or files.

Sources: Mindlin, J. Appl. Mech. 16 (1949) 259, for the annulus; docs/explanation/gel-shear.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from taxel.sim.pour.elastic_layer import LayerPatch, layer_patch
from taxel.sim.pour.gel_shear_constants import HANG_STEPS, MOST_ITERATIONS, SIZE_STEP, TOLERANCE_MM
from taxel.sim.pour.layer_friction import FrictionSolver
from taxel.sim.pour.state import PadHold

Array = NDArray[np.float64]

_AT_LIMIT = 1.0 - 1e-3
"""Share of friction's limit from which a cell counts as slipping."""
_LEAST_MM = 0.5
"""Half axes below which a contact is no ellipse any more."""


@dataclass(frozen=True, slots=True)
class Contact:
    """A contact of one size: its layer, its friction solver and the layer's shear modulus."""

    patch: LayerPatch
    solver: FrictionSolver
    modulus_mpa: float


@lru_cache(maxsize=24)
def contact_of(across_mm: float, along_mm: float, stiffness_n_mm3: float) -> Contact:
    """Return a contact whose torsional stiffness, while all sticks, is that of brushes.

    Which stiffness the two share sets the layer's shear modulus. Source: our choice; a cup beside
    its handle loads the gels by a moment above all, and the brushes' stiffness was fitted to the
    shear of real markers (`cup_pour.LAYER_FACTOR`).

    Args:
        across_mm: Half axis across the handle.
        along_mm: Half axis along it.
        stiffness_n_mm3: Of the brushes, a millimetre and square millimetre.
    """
    patch = layer_patch(across_mm, along_mm)
    turn = np.concatenate([-patch.y_mm, patch.x_mm])
    layer = float(turn @ np.linalg.solve(patch.compliance, turn))
    brushes = stiffness_n_mm3 * patch.cell_mm2 * float(turn @ turn)
    modulus_mpa = brushes / layer
    return Contact(patch, FrictionSolver(patch.compliance / modulus_mpa), modulus_mpa)


@dataclass(frozen=True, slots=True)
class LayerMoment:
    """Both gels at one moment, in the handle's coordinates (left gel's)."""

    patch: LayerPatch
    source_mm2: NDArray[np.float32]
    """Shape (2 gels, cells, 2): force over shear modulus of each cell (across, along) that gives
    the face's present movement; what has crept is among it."""
    middle_mm: Array
    """Shape (2 gels, 2): where on the unmoved face the contact's middle is (x, y)."""
    angle_rad: Array
    """Shape (2 gels,): direction of the contact's long axis on the unmoved face."""
    moved_mm: Array
    """Shape (2 gels, 2): load-weighted movement of the face under the contact (x, y)."""
    turn_rad: Array
    """Shape (2 gels,): its load-weighted turn, clockwise."""
    slip_um: Array
    """Shape (2 gels,): load-weighted path of the handle over the face since the grasp."""
    limited: NDArray[np.bool_]
    """Shape (2 gels, cells): where friction's limit is reached: the annulus that slips."""

    @property
    def at_limit(self) -> Array:
        """Shape (2 gels,): share of the contact's area at friction's limit, 0…1."""
        return np.asarray(self.limited.mean(axis=1), np.float64)


class LayerGels:
    """The two gels of one grasp.

    Args:
        hang: Shape (3,): how far the empty cup's weight has moved the handle before time zero,
            x and y (mm) and turn (rad).
        first: What holds the handle at time zero.
        axis_rad: Direction of the contact's long axis at time zero.
        creep: Share of the gels' bend that stops to bear force over time, 0…1.
        stiffness_n_mm3: Of the dynamics' brushes.
    """

    def __init__(
        self, hang: Array, first: PadHold, axis_rad: float, creep: float, stiffness_n_mm3: float
    ) -> None:
        self._stiffness, self._axis_rad, self._creep = stiffness_n_mm3, axis_rad, creep
        self._contact = self._sized(first)
        cells = len(self._contact.patch.x_mm)
        self._source = np.zeros((2 * cells, 4), np.float32)
        """In the contact's frame, newtons: forces held (left, right gel), and those that crept
        away but whose movement stays (left, right)."""
        self._moved = np.zeros_like(self._source)
        """Movement of the face that these give, millimetres."""
        self._slip_mm = np.zeros((2 * cells, 2), np.float32)
        """In the last step."""
        self._path_mm = np.zeros((cells, 2))
        self._place = first.place - hang
        self._time_s = 0.0
        self._face, self._turn = np.zeros((2, 2)), np.zeros(2)
        for step in range(1, HANG_STEPS + 1):
            self._move(first, first.place - hang * (1.0 - step / HANG_STEPS))
        self._path_mm[:] = 0.0

    def step(self, hold: PadHold) -> LayerMoment:
        """Follow the handle to its next place; return the gels there.

        Args:
            hold: What holds the handle, later than at the last call.
        """
        if hold.dropped:
            fade = np.exp(-(hold.time_s - self._time_s) / hold.release_s)
            self._source *= np.float32(fade)
            self._moved *= np.float32(fade)
            self._place = hold.place.copy()
            self._face, self._turn = self._middle()
        else:
            self._resize(self._sized(hold))
            self._yield(hold.time_s)
            self._move(hold, hold.place)
        self._time_s = hold.time_s
        return self._moment(hold)

    def _sized(self, hold: PadHold) -> Contact:
        step = np.log1p(SIZE_STEP)
        across, along = (
            float(np.exp(np.round(np.log(max(half, _LEAST_MM)) / step) * step))
            for half in hold.patch_mm
        )
        return contact_of(across, along, self._stiffness)

    def _resize(self, contact: Contact) -> None:
        """Take a contact of another size: forces stay, and so does the face under it."""
        if contact is self._contact:
            return
        self._contact = contact
        face = self._moved[:, :2] + self._moved[:, 2:]
        self._moved[:, :2] = contact.solver.compliance @ self._source[:, :2]
        self._moved[:, 2:] = face - self._moved[:, :2]
        self._source[:, 2:] = np.linalg.solve(contact.solver.compliance, self._moved[:, 2:])

    def _yield(self, time_s: float) -> None:
        """Let the bent gel creep: part of the force goes, the face stays."""
        faded = np.exp(-self._time_s / 3.0) - np.exp(-time_s / 3.0)
        lost = np.float32(-np.expm1(-self._creep * faded))
        for part in (self._source, self._moved):
            part[:, 2:] += lost * part[:, :2]
            part[:, :2] *= 1 - lost

    def _move(self, hold: PadHold, place: Array) -> None:
        """Move the handle; let stick and slip settle."""
        patch, solver = self._contact.patch, self._contact.solver
        before = self._axis_rad + self._place[2]
        after = self._axis_rad + place[2]
        turned = _turn(after) - _turn(before)
        x = place[0] - self._place[0] + turned[0, 0] * patch.x_mm + turned[0, 1] * patch.y_mm
        y = place[1] - self._place[1] + turned[1, 0] * patch.x_mm + turned[1, 1] * patch.y_mm
        # The contact's frame lies on the face: while all sticks it stays as it was.
        cos, sin = np.cos(before - self._turn), np.sin(before - self._turn)
        step = np.concatenate(
            [x[:, None] * cos + y[:, None] * sin, y[:, None] * cos - x[:, None] * sin]
        )
        settled = solver.settle(
            self._moved[:, :2] + step.astype(np.float32),
            _most(patch, hold),
            self._source[:, :2],
            self._slip_mm,
            TOLERANCE_MM,
            MOST_ITERATIONS,
        )
        self._source[:, :2], self._slip_mm = settled.force, settled.slip_mm
        self._moved[:, :2] = solver.compliance @ settled.force
        cells = len(patch.share)
        self._path_mm += np.hypot(settled.slip_mm[:cells], settled.slip_mm[cells:])
        self._place = place.copy()
        self._face, self._turn = self._middle()

    def _middle(self) -> tuple[Array, Array]:
        """Return the face's movement (2, gels) in the contact's frame, and its turn (gels,)."""
        patch = self._contact.patch
        moved = patch.weights @ self._moved
        across, along, turn = moved[:, :2] + moved[:, 2:]
        return np.stack([across, along]), turn

    def _moment(self, hold: PadHold) -> LayerMoment:
        patch = self._contact.patch
        cells = len(patch.share)
        (across, along), turn = self._face, self._turn
        angle = self._axis_rad + self._place[2] - turn
        cos, sin = np.cos(angle), np.sin(angle)
        face = np.stack([across * cos - along * sin, across * sin + along * cos], axis=1)
        source = (self._source[:, :2] + self._source[:, 2:]).reshape(2, cells, 2)
        size2 = (self._source[:, :2] ** 2).reshape(2, cells, 2).sum(axis=0)
        return LayerMoment(
            patch=patch,
            source_mm2=source.transpose(2, 1, 0) / np.float32(self._contact.modulus_mpa),
            middle_mm=self._place[:2] - face,
            angle_rad=angle,
            moved_mm=face,
            turn_rad=turn,
            slip_um=1000.0 * (patch.share @ self._path_mm),
            limited=(size2 >= (_AT_LIMIT * _most(patch, hold)) ** 2).T,
        )


def _most(patch: LayerPatch, hold: PadHold) -> NDArray[np.float32]:
    """Return the largest force that friction gives each cell of each gel, newtons."""
    limit = hold.friction * max(hold.normal_n, 0.0)
    return (patch.share[:, None] * limit).astype(np.float32)


def _turn(angle_rad: float) -> Array:
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[cos, -sin], [sin, cos]])
