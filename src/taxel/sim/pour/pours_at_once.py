"""Many pours simulated side by side: `simulate_pour`'s equations over arrays, ten times as fast.

The dynamics of `taxel.sim.pour.cup_pour` step by step are bound by the cost of small arrays; here
all runs take each step together. What it gives equals `simulate_pour` up to rounding (a test holds
it there). Knows nothing about pixels, files or clocks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.sim.pour.brush_contact import STRIBECK_MM_S, elliptic_patch
from taxel.sim.pour.cup_pour import (
    DAMPING_S,
    DROP_MM,
    DROP_RAD,
    GEL_MM,
    GEL_SHEAR_KPA,
    GONE_MM,
    HANG_S,
    LAYER_FACTOR,
    RELEASE_S,
    STEP_S,
    PourTrack,
)
from taxel.sim.pour.cups import PourRun
from taxel.sim.pour.grip_limits import GRAVITY_M_S2, half_axes, indentation
from taxel.sim.pour.run_forces import GRIP_SETTLE_S
from taxel.sim.pour.state import TRUTH_CHANNELS
from taxel.sim.pour.views import gel_motion, handle_shape

Values = NDArray[np.float64]


def simulate_pours(
    runs: Sequence[PourRun], frame_hz: float = 60.0, duration_s: float = 6.0
) -> list[PourTrack]:
    """Simulate runs with their grips held as commanded.

    Args:
        runs: What is tried.
        frame_hz: Moments a second that are returned; 480 Hz must be a multiple of it.
        duration_s: Seconds.

    Raises:
        ValueError: The rate does not divide that of the integration, or a run has a scene.
    """
    steps = round(1.0 / (STEP_S * frame_hz))
    if abs(steps * STEP_S * frame_hz - 1.0) > 1e-9:
        raise ValueError(f"needed a rate that divides {1 / STEP_S:g} Hz; got {frame_hz:g}")
    if any(run.scene is not None for run in runs):
        raise ValueError("needed runs without a scene; simulate moving ones one by one")
    if not runs:
        return []
    count = round(duration_s * frame_hz)
    sim = _Pours(runs, count * steps)
    truth = np.zeros((len(runs), count, 8))
    place = np.zeros((len(runs), count, 3))
    moved = np.zeros((len(runs), count, 2, 2))
    turn = np.zeros((len(runs), count, 2))
    depth = np.zeros((len(runs), count))
    patches = np.zeros((len(runs), count, 2))
    for index in range(count):
        truth[:, index] = sim.state()
        place[:, index] = sim.place - sim.origin
        surface, twist = sim.surface()
        moved[:, index], turn[:, index] = surface - sim.moved0, twist - sim.turn0
        depth[:, index] = sim.depth_mm
        patches[:, index] = sim.patch_mm
        for _ in range(steps):
            sim.advance()
    tracks = []
    for number, run in enumerate(runs):
        rows = [
            (place[number, i], moved[number, i], turn[number, i], float(depth[number, i]))
            for i in range(count)
        ]
        pours = run.flow_g_s > 0
        tracks.append(
            PourTrack(
                time_s=np.arange(count) / frame_hz,
                motions=(
                    gel_motion(rows, 0, patches[number]),
                    gel_motion(rows, 1, patches[number]),
                ),
                shapes=(handle_shape(run, 0), handle_shape(run, 1)),
                truth=truth[number],
                pour_start_s=run.start_s if pours else float("inf"),
                pour_end_s=run.start_s + run.amount_g / run.flow_g_s if pours else float("inf"),
            )
        )
    return tracks


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstSlips:
    """When runs first slip further than some distance, or are dropped."""

    moment: NDArray[np.intp]
    """Shape (runs,): number of the moment; -1: never."""
    poured_g: Values
    """Shape (runs,): what had been poured then, grams; at the end where there was none."""


def first_slips(
    runs: Sequence[PourRun], above_um: float, frame_hz: float, duration_s: float
) -> FirstSlips:
    """Return when runs first slip further, with their grips held as commanded.

    Args:
        runs: What is tried, none with a scene.
        above_um: Slip, micrometres.
        frame_hz: Moments a second that are looked at; 480 Hz must be a multiple of it.
        duration_s: Seconds.
    """
    steps, count = round(1.0 / (STEP_S * frame_hz)), round(duration_s * frame_hz)
    moment, poured_g = np.full(len(runs), -1), np.zeros(len(runs))
    if not runs:
        return FirstSlips(moment=moment, poured_g=poured_g)
    sim = _Pours(runs, count * steps)
    slip, dropped, poured = (TRUTH_CHANNELS.index(n) for n in ("slip", "dropped", "poured"))
    for index in range(count):
        truth = sim.state()
        waiting = moment < 0
        poured_g[waiting] = truth[waiting, poured]
        moment[waiting & ((truth[:, slip] > above_um) | (truth[:, dropped] > 0))] = index
        for _ in range(steps):
            sim.advance()
    return FirstSlips(moment=moment, poured_g=poured_g)


class _Pours:
    """The state of all runs; first axis runs, then sides, then cells."""

    def __init__(self, runs: Sequence[PourRun], steps: int) -> None:
        self.runs = runs

        def column(values: Sequence[float]) -> Values:
            return np.array(values, np.float64)

        cups = [run.cup for run in runs]
        self.mass_kg, self.lever_mm = (
            column([c.mass_kg for c in cups]),
            column([c.lever_mm for c in cups]),
        )
        self.arm2 = self.lever_mm**2 + column([c.gyration_mm for c in cups]) ** 2
        self.force_n = column([run.force_n for run in runs])
        self.start_s = column([run.start_s for run in runs])
        self.flow, self.amount = (column([getattr(r, n) for r in runs])
                                  for n in ("flow_g_s", "amount_g"))  # fmt: skip
        self.error, self.relaxation, self.drop, self.creep = (
            column([getattr(r, n) for r in runs])
            for n in ("grip_error", "relaxation", "grip_drop", "creep")
        )
        self.vibration, self.bump_n, self.bump_s = (
            column([getattr(r, n) for r in runs]) for n in ("vibration_n", "bump_n", "bump_s")
        )
        static = np.array([[c.friction * s for s in r.side_friction]
                           for c, r in zip(cups, runs, strict=True)])  # fmt: skip
        kinetic = column([c.friction_kinetic for c in cups])
        self.static = static[:, :, None]
        self.kinetic = self.static * kinetic[:, None, None]
        self.kicks = np.stack(
            [np.random.default_rng([14, run.seed]).normal(size=(steps, 2)) for run in runs]
        )
        self.axis = column([run.tilt_rad + 0.7 * run.along for run in runs])
        patches = [elliptic_patch(*half_axes(r, r.force_n), float(a))
                   for r, a in zip(runs, self.axis, strict=True)]  # fmt: skip
        self.patch_mm = np.array([half_axes(run, run.force_n) for run in runs])
        self.x = np.stack([patch.x_mm for patch in patches])
        self.y = np.stack([patch.y_mm for patch in patches])
        self.share = patches[0].share
        self.area = column([patch.area_mm2 for patch in patches])
        self.stiffness = LAYER_FACTOR * GEL_SHEAR_KPA / 1000.0 / GEL_MM * self.area
        shape = (len(runs), 2, len(self.share))
        self.shear_x, self.shear_y = np.zeros(shape), np.zeros(shape)
        self.set_x, self.set_y = np.zeros(shape), np.zeros(shape)
        self.path, self.speed = np.zeros(shape), np.zeros(shape)
        self.friction = np.broadcast_to(
            self.kinetic + (self.static - self.kinetic), shape
        ).copy()  # of a brush that does not slide; others follow in `_move`
        self.slides: tuple[NDArray[np.intp], ...] = (np.zeros(0, np.intp),) * 3
        self.patch_n = self.force_n.copy()
        self.normal_n = self.force_n.copy()
        self.depth_mm = column([indentation(run.force_n)[0] for run in runs])
        self.place, self.velocity = np.zeros((len(runs), 3)), np.zeros((len(runs), 3))
        self.unrest = np.zeros((len(runs), 2))
        self.sliding = np.zeros((len(runs), 2))
        self.poured_g = np.zeros(len(runs))
        self.dropped = np.zeros(len(runs), np.bool_)
        self.time_s, self.drawn = 0.0, 0
        for _ in range(round(HANG_S / STEP_S)):
            self.advance(hanging=True)
        self.path[:] = 0.0
        self.origin = self.place.copy()
        self.moved0, self.turn0 = self.surface()
        self.time_s = 0.0

    def state(self) -> Values:
        """Return the truth now, shape (runs, 8), as `TRUTH_CHANNELS`."""
        moved = self.place - self.origin
        load_n = (self.mass_kg + self.poured_g / 1000.0) * GRAVITY_M_S2 * ~self.dropped
        return np.stack(
            [
                1000.0 * (self.path @ self.share).max(axis=1), self.sliding.max(axis=1),
                np.degrees(moved[:, 2]), moved[:, 1], load_n, self.normal_n, self.poured_g,
                self.dropped.astype(np.float64),
            ],
            axis=1,
        )  # fmt: skip

    def surface(self) -> tuple[Values, Values]:
        """Return each pad's mean movement (runs, sides, 2), mm, and twist (runs, sides), rad."""
        x, y = self.shear_x + self.set_x, self.shear_y + self.set_y
        moved = np.stack([x @ self.share, y @ self.share], axis=2)
        turn = (y * self.x[:, None] - x * self.y[:, None]) @ self.share
        return moved, turn / ((self.x**2 + self.y**2) @ self.share)[:, None]

    def advance(self, *, hanging: bool = False) -> None:
        """Go on by one step of the integration."""
        held = ~self.dropped
        grip_n = self.force_n if hanging else self._grip()
        self.normal_n = np.where(held, grip_n, 0.0)
        fallen = np.flatnonzero(self.dropped)
        if len(fallen):
            self._fall(fallen)
        self._follow_grip(held)
        if not hanging:
            more = np.where(held & (self.time_s >= self.start_s), self.flow * STEP_S, 0.0)
            self.poured_g = np.minimum(self.poured_g + more, np.maximum(self.amount, self.poured_g))
        force, moment = self._load(hanging)
        x, y = self.shear_x.sum(axis=1), self.shear_y.sum(axis=1)
        pull_x, pull_y = self.stiffness * x.sum(axis=1), self.stiffness * y.sum(axis=1)
        twist = self.stiffness * ((self.x * y).sum(axis=1) - (self.y * x).sum(axis=1))
        mass = self.mass_kg + self.poured_g / 1000.0
        inertia = mass * self.arm2
        cells = len(self.share)
        line = 2 * cells * self.stiffness
        turn = 2 * self.stiffness * (self.x**2 + self.y**2).sum(axis=1)
        stuck = (self.speed <= 0.0).mean(axis=(1, 2))
        velocity = self.velocity.copy()
        velocity[:, 0] += 1000.0 * STEP_S * (force[:, 0] - pull_x) / mass
        velocity[:, 1] += 1000.0 * STEP_S * (force[:, 1] - pull_y) / mass
        velocity[:, :2] /= (1.0 + DAMPING_S * line * stuck * 1000.0 * STEP_S / mass)[:, None]
        velocity[:, 2] += 1000.0 * STEP_S * (moment - twist) / inertia
        velocity[:, 2] /= 1.0 + DAMPING_S * turn * stuck * 1000.0 * STEP_S / inertia
        self.velocity = np.where(held[:, None], velocity, self.velocity)
        step = np.where(held[:, None], self.velocity * STEP_S, 0.0)
        self._move(step, held)
        if not hanging:
            self._yield(np.where(held, self.creep * STEP_S / 3.0 * np.exp(-self.time_s / 3.0), 0.0))
        self.place += step
        self.sliding = np.where(held[:, None], (self.speed > 0.05) @ self.share, 0.0)
        self.time_s += STEP_S
        if not hanging:
            moved = np.abs(self.place - self.origin)
            far = np.hypot(moved[:, 0], moved[:, 1]) > DROP_MM
            self.dropped = self.dropped | far | (moved[:, 2] > DROP_RAD)

    def _move(self, step: Values, held: NDArray[np.bool_]) -> None:
        self.shear_x += (step[:, 0, None] - step[:, 2, None] * self.y)[:, None]
        self.shear_y += (step[:, 1, None] + step[:, 2, None] * self.x)[:, None]
        bent = np.sqrt(self.shear_x**2 + self.shear_y**2)
        press = np.maximum(self.normal_n, 0.0) / self.stiffness
        limit = self.friction * (self.share * press[:, None])[:, None]
        loose = (bent > limit) & held[:, None, None]
        at = np.nonzero(loose)
        was_sliding, self.slides = self.slides, at
        self.speed[was_sliding] = 0.0
        self.friction[was_sliding] = (self.kinetic + (self.static - self.kinetic))[was_sliding[:2]][
            :, 0
        ]
        if not len(at[0]):
            return
        kept = limit[at] / np.maximum(bent[at], 1e-12)
        slid = bent[at] * (1.0 - kept)
        self.shear_x[at] *= kept
        self.shear_y[at] *= kept
        self.path[at] += slid
        self.speed[at] = slid / STEP_S
        kinetic, static = (side[at[:2]][:, 0] for side in (self.kinetic, self.static))
        self.friction[at] = kinetic + (static - kinetic) * np.exp(
            self.speed[at] * (-1.0 / STRIBECK_MM_S)
        )

    def _yield(self, share: Values) -> None:
        part = share[:, None, None]
        self.set_x += part * self.shear_x
        self.set_y += part * self.shear_y
        self.shear_x *= 1.0 - part
        self.shear_y *= 1.0 - part

    def _follow_grip(self, held: NDArray[np.bool_]) -> None:
        off = held & (np.abs(self.normal_n - self.patch_n) > 0.01 * self.patch_n)
        self.depth_mm = np.where(
            held, 1.4 * (np.maximum(self.normal_n, 0.5) / 15.0) ** 0.448, self.depth_mm
        )
        for i in np.flatnonzero(off):
            run = self.runs[i]
            self.patch_n[i] = max(self.normal_n[i], 0.5)
            self.patch_mm[i] = half_axes(run, float(self.patch_n[i]))
            across, along = self.patch_mm[i]
            patch = elliptic_patch(float(across), float(along), float(self.axis[i]))
            if patch.area_mm2 > self.area[i]:
                share = np.zeros(len(self.runs))
                share[i] = 1.0 - self.area[i] / patch.area_mm2
                self._yield(share)
            self.stiffness[i] *= patch.area_mm2 / self.area[i]
            self.x[i], self.y[i], self.area[i] = patch.x_mm, patch.y_mm, patch.area_mm2

    def _fall(self, fallen: NDArray[np.intp]) -> None:
        """Let lost cups fall out of the images and their pads spring back."""
        kept = float(np.exp(-STEP_S / RELEASE_S))
        self.velocity[fallen, 1] += 1000.0 * GRAVITY_M_S2 * STEP_S
        falling = fallen[np.abs(self.place[fallen, 1]) < GONE_MM]
        self.place[falling] += self.velocity[falling] * STEP_S
        self.depth_mm[fallen] *= kept
        for part in (self.shear_x, self.shear_y, self.set_x, self.set_y):
            part[fallen] *= kept

    def _grip(self) -> Values:
        lost = self.relaxation * (1.0 - np.exp(-self.time_s / GRIP_SETTLE_S))
        drop = self.drop * np.clip((self.time_s - self.start_s) / 0.33, 0.0, 1.0)
        kept = (1.0 - lost) * (1.0 - drop)
        return np.asarray(self.force_n * (1.0 + self.error) * kept)

    def _load(self, hanging: bool) -> tuple[Values, Values]:
        mass = self.mass_kg + self.poured_g / 1000.0
        weight_n = mass * GRAVITY_M_S2
        arm_mm = self.lever_mm * np.cos(self.place[:, 2])
        if hanging:
            return np.stack([np.zeros_like(weight_n), weight_n], axis=1), weight_n * arm_mm
        fade = np.exp(-STEP_S * 50.0)
        self.unrest = self.unrest * fade + self.kicks[:, self.drawn] * np.sqrt(1.0 - fade**2)
        self.drawn += 1
        poured = (self.poured_g > 0.0) & (self.poured_g < self.amount)
        unrest_n = (self.vibration * np.where(poured, 2.0, 1.0))[:, None] * self.unrest
        jet_n = np.where(poured, 1.4 * self.flow / 1000.0, 0.0)
        since = (self.time_s - self.bump_s) / 0.08
        bump_n = np.where((since > 0.0) & (since < 1.0), self.bump_n * np.sin(np.pi * since), 0.0)
        down_n = weight_n + jet_n + unrest_n[:, 1] + bump_n
        return np.stack([unrest_n[:, 0], down_n], axis=1), down_n * arm_mm
