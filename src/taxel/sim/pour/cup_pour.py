"""A cup held by its handle between two gels while it is filled: the dynamics.

The cup is a rigid body that moves in the plane of the gels (down, sideways, and a turn about
the handle, as its weight hangs beside it); two brush fields hold it. Pure physics: knows
nothing about pixels, files or clocks.

Sources: protocol, Sensors 2024, 24, 5080, section 3.2; gel, FEATS (neo-Hooke, indentation and
area) and real marker shear, as collected in docs/explanation/physics-gel; ranges,
docs/decisions/0013.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from taxel.sim.pour.brush_contact import BrushField, elliptic_patch
from taxel.sim.pour.cups import (
    FORCES_N,
    MOVING_KINDS,
    POSITIONS,
    Kind,
    Position,
    PourRun,
    draw_cup,
    draw_kinds,
)
from taxel.sim.pour.gel_shear import LayerGels, LayerMoment
from taxel.sim.pour.grip_limits import GRAVITY_M_S2, half_axes, indentation, pour_less
from taxel.sim.pour.run_forces import RunGrip, RunPulls
from taxel.sim.pour.scene_draws import draw_grasp
from taxel.sim.pour.state import GelMotion, HandleShape, PadHold
from taxel.sim.pour.surroundings import Surroundings, inertia_mm2
from taxel.sim.pour.views import (
    GelRow,
    gel_motion,
    handle_shape,
    layer_motion,
    layer_truth,
    with_layers,
)

SIM_VERSION = "1"
"""Of dynamics and nuisances together; recorded with every run."""
Gel = Literal[1, 2]
"""How a gel's face moves: 1 as one rigid piece, 2 as an elastic layer (docs/decisions/0037)."""
GEL_SHEAR_KPA = 145.0
"""E/3 of the gel, E = 435 kPa. Source: FEATS, C10 = 0.0725 MPa."""
GEL_MM = 4.5
"""Thickness. Source: FEATS."""
LAYER_FACTOR = 3.5
"""Shear stiffness over G/thickness: fits real marker shear, docs/explanation/physics-gel."""
_SHEAR_STIFFNESS_N_MM3 = LAYER_FACTOR * GEL_SHEAR_KPA / 1000.0 / GEL_MM
STEP_S = 1.0 / 480.0
"""Of the integration: eight a frame at 60 Hz."""
DAMPING_S = 0.06
"""Relaxation time of the gel's shear: damps the cup's pendulum of 2 to 4 Hz. Our choice."""
DROP_MM, DROP_RAD = 9.0, 0.75
"""A cup that slid or turned so far is lost: it has left the gripper, or spills. Our choice."""
RELEASE_S = 0.03
"""Time constant of a pad that springs back from a lost cup. Our choice: two frames."""
GONE_MM = 40.0
"""A lost cup has fallen out of every image. Our choice: twice the pad's width."""
HANG_S = 0.6
"""How long the empty cup hangs before time zero."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CupPourConfig:
    """Which runs make a set."""

    seed: int = 0
    cups: int = 5
    """Source: paper, section 3.2."""
    first_cup: int = 0
    """Number of the first cup: sets with other numbers share no cup."""
    positions: tuple[Position, ...] = POSITIONS
    forces_n: tuple[float, ...] = FORCES_N
    repetitions: int = 1
    """Runs of each cup, position and force."""
    still: float = 0.3
    """Share of runs in which nothing is poured, 0…1: with it about half of all frames are
    unstable, as in the paper. Source: our choice, docs/decisions/0013."""
    negatives: float = 0.0
    """Runs of the other kinds, as a share of the paper's runs, 0…1."""
    kinds: tuple[Kind, ...] = ()
    """Runs of these kinds for each cup, position and force, in place of the paper's."""
    approach: bool = False
    """Begin with open jaws about a cup that stands on a table."""
    duration_s: float = 6.0
    frame_hz: float = 60.0
    gel: Gel = 1
    """How the gels shear. The cups move alike in both."""

    def __post_init__(self) -> None:
        if self.gel not in (1, 2):
            raise ValueError(f"needed gel 1 or 2; got {self.gel}")
        if self.approach and self.gel == 2:
            raise ValueError(
                "needed gel 1 for an approach: a layer that nothing touches is not modelled"
            )
        if min(self.cups, self.repetitions) < 1 or not self.forces_n or min(self.forces_n) <= 0:
            raise ValueError("needed at least one cup and repetition, and forces above 0 N")
        if not set() < set(self.positions) <= set(POSITIONS) or self.seed < 0:
            raise ValueError("needed positions among upper, middle and lower, and a seed from 0")
        if not (0 <= self.negatives <= 1 and 0 <= self.still <= 1):
            raise ValueError("needed negatives and still within 0 and 1")
        if self.duration_s < 1.0 or self.frame_hz <= 0 or self.first_cup < 0:
            raise ValueError("needed at least 1 s, a rate above 0 Hz and a cup's number from 0")


def list_runs(config: CupPourConfig) -> list[PourRun]:
    """Return the runs of a set, cup by cup; a run is the same in every set that holds it."""
    runs = []
    for index in range(config.first_cup, config.first_cup + config.cups):
        cup = draw_cup(config.seed, index)
        random = np.random.default_rng([13, config.seed, index])
        for number in range(config.repetitions):
            for position in config.positions:
                for force_n in config.forces_n:
                    kinds = config.kinds or draw_kinds(config.still, config.negatives, random)
                    runs += [
                        pour_less(
                            draw_grasp(
                                config.seed, cup, position, force_n, kind, number, config.approach
                            )
                        )
                        for kind in kinds
                    ]
    return runs


@dataclass(frozen=True, slots=True, kw_only=True)
class PourTrack:
    """A run, simulated."""

    time_s: NDArray[np.float64]
    """Shape (n,)."""
    motions: tuple[GelMotion, GelMotion]
    """Left and right gel."""
    shapes: tuple[HandleShape, HandleShape]
    truth: NDArray[np.float64]
    """Shape (n, 8 …), columns as `truth_columns` says."""
    pour_start_s: float
    """Infinity without a pour."""
    pour_end_s: float
    layer: tuple[LayerMoment, ...] = ()
    """Gels of version 2 at the video's moments, of which `motions` may have more."""


class PourSim:
    """A run, step by step, so that a gripper may answer to it.

    Args:
        run: What is tried.
    """

    def __init__(self, run: PourRun) -> None:
        if run.kind in MOVING_KINDS and run.scene is None:
            raise ValueError(f"needed a run with its scene, from draw_grasp; got a {run.kind}")
        self.run = run
        self.time_s = 0.0
        self.around = None if run.scene is None else Surroundings(run)
        self.poured_g = 0.0 if run.scene is None else run.scene.contents_g
        self._grip, self._pulls = RunGrip(run), RunPulls(run)
        self._stands = run.scene is not None and run.scene.on_table
        self.dropped = False
        self.pouring = True
        """False once the person has been told to stop."""
        self.patch_mm = half_axes(run, run.force_n)
        self._patch_n = run.force_n
        self._depth_mm: float | NDArray[np.float64] = indentation(run.force_n)[0]
        self._owed_s = 0.0
        self.axis_rad = run.tilt_rad + 0.7 * run.along
        patch = elliptic_patch(*self.patch_mm, self.axis_rad)
        friction = run.cup.friction * np.array(run.side_friction)
        self._field = BrushField(patch, _SHEAR_STIFFNESS_N_MM3, friction, run.cup.friction_kinetic)
        self._place = np.zeros(3)
        """Of the handle: x and y (mm), turn (rad)."""
        if self.around is not None:
            self._place[1] = self.around.sag_mm(run.cup.mass_kg + self.poured_g / 1000.0)
        self._speed = np.zeros(3)
        self._normal_n = run.force_n
        self._sliding = np.zeros(2)
        for _ in range(round(HANG_S / STEP_S)):
            self._advance(0.0 if self._stands else run.force_n, STEP_S, hanging=True)
        if self._stands and run.approach is None:  # gripped as it stands: nothing is sheared yet
            self._normal_n = run.force_n
            self._follow_grip()
        self._field.path[:] = 0.0
        self._origin = self._grasped = self._place.copy()
        self._surface = self._field.surface_motion()
        self.time_s = 0.0

    def pour(self, on: bool) -> None:
        """Let the person pour, or make them stop."""
        self.pouring = on

    def step(self, grip_n: float, dt_s: float) -> None:
        """Go on by some time with a grip force that the gripper is ordered to hold.

        Args:
            grip_n: Commanded force, newtons.
            dt_s: Seconds; what is left of a step of the integration is owed to the next call.
        """
        self._owed_s += dt_s
        steps = int(self._owed_s / STEP_S + 1e-6)
        self._owed_s -= steps * STEP_S
        for _ in range(steps):
            self._advance(grip_n, STEP_S)

    @property
    def state(self) -> NDArray[np.float64]:
        """The truth now, shape (8,) or (16,), as `truth_columns` without those of the layers."""
        share = self._field.patch.share
        slip_um = 1000.0 * float((self._field.path @ share).max())
        moved = self._place - self._grasped
        load_n = (self.run.cup.mass_kg + self.poured_g / 1000.0) * GRAVITY_M_S2
        if self.around is not None:
            load_n = float(np.hypot(*self._field.forces()[:2]))
        load_n *= not self.dropped
        known = np.array([
            slip_um, float(self._sliding.max()), np.degrees(moved[2]), moved[1], load_n,
            self._normal_n, self.poured_g, float(self.dropped),
        ])  # fmt: skip
        if self.around is None:
            return known
        motion = self.around.truth(self.time_s, self._grip.phase(self.time_s))
        return np.concatenate([known, motion])

    def gel(self) -> GelRow:
        """Return the handle's move (3,), each gel's move (2, 2) and twist (2,), and depth (mm),
        of both or, while jaws close, of each (2,).
        """
        moved, turn = self._field.surface_motion()
        return (
            self._place - self._origin,
            moved - self._surface[0],
            turn - self._surface[1],
            self._depth_mm,
        )

    def hold(self) -> PadHold:
        """Return how the handle stands between the gels now, for gels of version 2."""
        return PadHold(
            time_s=self.time_s,
            place=self._place - self._origin,
            normal_n=self._normal_n,
            friction=self._field.friction(),
            patch_mm=self.patch_mm,
            dropped=self.dropped,
            release_s=RELEASE_S,
        )

    def layers(self) -> LayerGels:
        """Return the gels of version 2 as they are now, the empty cup's load upon them."""
        hang = np.zeros(3) if self._stands else self._origin
        return LayerGels(hang, self.hold(), self.axis_rad, self.run.creep, _SHEAR_STIFFNESS_N_MM3)

    def _advance(self, grip_n: float, dt_s: float, *, hanging: bool = False) -> None:
        run = self.run
        self._normal_n = grip_n if hanging else self._grip.normal_n(self.time_s, grip_n)
        if self.dropped:
            self._fall(dt_s)
            return
        self._follow_grip()
        if not hanging and self.pouring and self.time_s >= run.start_s:
            self.poured_g = min(self.poured_g + run.flow_g_s * dt_s, run.amount_g)
        force, moment = self._load(dt_s, hanging)
        held_x, held_y, held_m = self._field.forces()
        mass = run.cup.mass_kg + self.poured_g / 1000.0
        arm2 = inertia_mm2(run)
        line, turn = self._field.stiffness()
        stuck = self._field.sticking() if self._normal_n > 0.0 else 0.0
        # Newton with millimetres: N = kg m/s² is 1000 kg mm/s²; damping is taken implicitly.
        drag_line = DAMPING_S * line * stuck * 1000.0 * dt_s / mass
        drag_turn = DAMPING_S * turn * stuck * 1000.0 * dt_s / (mass * arm2)
        self._speed[0] += 1000.0 * dt_s * (force[0] - held_x) / mass
        self._speed[1] += 1000.0 * dt_s * (force[1] - held_y) / mass
        self._speed[2] += 1000.0 * dt_s * (moment - held_m) / (mass * arm2)
        before = self._speed.copy()
        self._speed[:2] /= 1.0 + drag_line
        self._speed[2] /= 1.0 + drag_turn
        if self.around is not None:
            kept = np.array([held_x, held_y, held_m])
            masses = np.array([mass, mass, mass * arm2]) / (1000.0 * dt_s)
            self._speed = (
                before
                - self._field.most_drag((before - self._speed) * masses, kept, self._normal_n)
                / masses
            )
        step = self._speed * dt_s
        self._field.move(step[0], step[1], step[2], self._normal_n, dt_s)
        if not hanging:  # viscoelastic: the bent gel gives way slowly
            held_s = self._grip.held_s(self.time_s)
            self._field.yield_by(run.creep * dt_s / 3.0 * np.exp(-held_s / 3.0))
        self._place += step
        sliding = (self._field.speed > 0.05) & (self._normal_n > 0.0)
        self._sliding = sliding @ self._field.patch.share
        self.time_s += dt_s
        if hanging:
            return
        if self.time_s - dt_s < self._grip.settled_s:  # slip counts since the grasp
            self._field.path[:] = 0.0
            self._grasped = self._place.copy()
        else:
            moved = np.abs(self._place - self._grasped)
            self.dropped |= bool(np.hypot(moved[0], moved[1]) > DROP_MM or moved[2] > DROP_RAD)

    def _follow_grip(self) -> None:
        """Let depth follow the grip, and the patch once that has changed by a per cent."""
        self._depth_mm = self._grip.depth_mm(self.time_s, self._normal_n)
        if abs(self._normal_n - self._patch_n) > 0.01 * self._patch_n:
            self._patch_n = max(self._normal_n, 0.5)
            self.patch_mm = half_axes(self.run, self._patch_n)
            self._field.resize(elliptic_patch(*self.patch_mm, self.axis_rad))

    def _fall(self, dt_s: float) -> None:
        """Let a lost cup fall out of the images and the pads spring back."""
        if self.around is None:
            self._speed[1] += 1000.0 * GRAVITY_M_S2 * dt_s
        else:
            self._speed[:2] += 1000.0 * self.around.gripper(self.time_s).pull_m_s2 * dt_s
        off = self._place[1:2] if self.around is None else self._place[:2]
        if np.abs(off).max() < GONE_MM:
            self._place += self._speed * dt_s
        kept = float(np.exp(-dt_s / RELEASE_S))
        self._depth_mm = self._depth_mm * kept
        self._normal_n, self._sliding[:] = 0.0, 0.0
        self._field.let_go(kept)
        self.time_s += dt_s

    def _load(self, dt_s: float, hanging: bool) -> tuple[NDArray[np.float64], float]:
        """Return force (x, y), newtons, and clockwise moment, N mm, on the handle."""
        run = self.run
        mass = run.cup.mass_kg + self.poured_g / 1000.0
        weight_n = mass * GRAVITY_M_S2
        turn = self._place[2]
        arm_mm = run.cup.lever_mm * np.cos(turn)
        if hanging:
            if self.around is not None:
                still = self.around.load(0.0, self._place, self._speed, mass, np.zeros(2))
                return still.force_n, still.moment_n_mm
            return np.array([0.0, weight_n]), weight_n * arm_mm
        poured = 0.0 < self.poured_g < run.amount_g and self.pouring
        unrest_n, jet_n, bump_n = self._pulls.step(self.time_s, dt_s, poured)
        down_n = weight_n + jet_n + unrest_n[1] + bump_n
        if self.around is not None:
            poured_n = np.array([unrest_n[0], down_n - weight_n])
            load = self.around.load(self.time_s, self._place, self._speed, mass, poured_n)
            return load.force_n, load.moment_n_mm
        return np.array([unrest_n[0], down_n]), down_n * arm_mm


def simulate_pour(
    run: PourRun,
    frame_hz: float = 60.0,
    duration_s: float = 6.0,
    gel: Gel = 1,
    layer_every: int = 1,
) -> PourTrack:
    """Simulate a run with its grip held as commanded.

    Args:
        run: What is tried.
        frame_hz: Moments a second that are returned.
        duration_s: Seconds.
        gel: How the gels shear; with 2 the track says how the layers' faces move.
        layer_every: Follow the layers at each so many moments, with straight lines between.
    """
    sim = PourSim(run)
    count = round(duration_s * frame_hz)
    rows, patches = [], np.zeros((count, 2))
    truth = np.zeros((count, len(sim.state)))
    layers = sim.layers() if gel == 2 else None
    layer: list[LayerMoment] = []
    for index in range(count):
        truth[index] = sim.state
        rows.append(sim.gel())
        patches[index] = sim.patch_mm
        if layers is not None and index % layer_every == 0:
            layer.append(layers.step(sim.hold()))
        sim.step(run.force_n, 1.0 / frame_hz)
    motions = (gel_motion(rows, 0, patches), gel_motion(rows, 1, patches))
    if layer:
        motions = (layer_motion(motions[0], layer, 0), layer_motion(motions[1], layer, 1))
        truth = with_layers(truth, layer_truth(layer, count))
    pours = run.flow_g_s > 0
    return PourTrack(
        time_s=np.arange(count) / frame_hz,
        motions=motions,
        shapes=(handle_shape(run, 0), handle_shape(run, 1)),
        truth=truth,
        pour_start_s=run.start_s if pours else float("inf"),
        pour_end_s=run.start_s + run.amount_g / run.flow_g_s if pours else float("inf"),
        layer=tuple(layer),
    )
