"""Scenes drawn from seeds: lifts, tilts, carries, hand-overs, collisions, and how a grasp begins.

A scene has random numbers of its own, so that runs of the other kinds are what they ever were.
Knows nothing about forces, gels or pixels.

Sources: ranges are our choice, docs/decisions/0045; a mass m that meets a spring k at speed v is
pushed with at most v √(k m), for π √(m / k).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from taxel.sim.pour.cups import MOVING_KINDS, Cup, Kind, Position, PourRun, draw_run, place_of
from taxel.sim.pour.grip_limits import indentation, load_ratio
from taxel.sim.pour.gripper_path import PEAK_ACCELERATION, ArmStop, GripperPath, Move
from taxel.sim.pour.scenes import Approach, Hit, Person, Scene

_SCENE, _APPROACH = 18, 19
"""Streams of the random generator."""
_MOST_G = 420.0
"""Most that a cup holds: as much as is ever poured. Our choice, decision 13."""
_ROOM = {
    "lift": (0.3, 1.15), "hand-over": (0.3, 1.15), "tilt": (0.4, 0.95), "carry": (0.3, 0.9),
    "collision": (0.3, 0.9),
}  # fmt: skip
"""Resting load over the limit surface, which what is in the cup is chosen for: a cup that is only
lifted or handed over may be too heavy, one that hangs in the gripper from the start may not. Our
choice, decision 45."""
_BRAKE_M_S2 = (5.0, 15.0)
"""Of an arm that feels a collision. Our choice, decision 45."""
_REACTION_S = (0.01, 0.04)
"""From the collision to the brake. Our choice, decision 45."""
_OBSTACLE_N_MM = (0.5, 10.0)
"""Stiffness of what is hit, log-uniform. Our choice, decision 45."""


@dataclass(frozen=True, slots=True)
class _Drawn:
    """What a scene is drawn from."""

    run: PourRun
    random: np.random.Generator
    mass_kg: float
    """Of the cup and what is in it."""

    def between(self, low: float, high: float) -> float:
        return float(self.random.uniform(low, high))

    def side(self) -> float:
        return float(self.random.choice([-1.0, 1.0]))


def draw_grasp(
    seed: int,
    cup: Cup,
    position: Position,
    force_n: float,
    kind: Kind = "pour",
    number: int = 0,
    approach: bool = False,
) -> PourRun:
    """Return a run of any kind, with its scene where it has one.

    Args:
        seed: Of everything random.
        cup: Which.
        position: On its handle.
        force_n: Commanded grip force.
        kind: What happens.
        number: Which repetition.
        approach: Begin with open jaws about a cup that stands on a table.
    """
    run = draw_run(seed, cup, position, force_n, kind, number)
    place = [seed, cup.index, *place_of(position, force_n, number, kind)]
    if kind in MOVING_KINDS:
        run = _with_scene(run, np.random.default_rng([_SCENE, *place]))
    return _approached(run, np.random.default_rng([_APPROACH, *place])) if approach else run


def _with_scene(run: PourRun, random: np.random.Generator) -> PourRun:
    room = float(random.uniform(*_ROOM[run.kind]))
    empty = load_ratio(run, 0.0)
    contents_g = float(np.clip(1000.0 * run.cup.mass_kg * (room / empty - 1.0), 0.0, _MOST_G))
    drawn = _Drawn(run, random, run.cup.mass_kg + contents_g / 1000.0)
    scene = _SCENES[run.kind](drawn)
    # The handle is about as high as the cup's middle; along its bend a grasp is higher or lower.
    below_mm = drawn.between(0.0, 8.0) + run.cup.bend_mm * float(np.sin(0.7 * run.along))
    scene = replace(scene, contents_g=contents_g, below_mm=below_mm)
    return replace(run, amount_g=contents_g, scene=scene)


def _lift(drawn: _Drawn) -> Scene:
    up_mm, peak = drawn.between(60.0, 250.0), drawn.between(0.3, 4.0)
    move = Move(start_s=drawn.run.start_s, duration_s=_duration(up_mm, peak), up_mm=up_mm)
    return Scene(path=GripperPath(moves=(move,)), on_table=True)


def _tilt(drawn: _Drawn) -> Scene:
    tilt = drawn.side() * drawn.between(0.35, 1.75)
    move = Move(start_s=drawn.run.start_s, duration_s=drawn.between(0.6, 2.0), tilt_rad=tilt)
    return Scene(path=GripperPath(moves=(move,)))


def _carried(drawn: _Drawn, peak: float) -> GripperPath:
    """Return a way to the side over an arc, with this largest acceleration, m/s²."""
    way_mm, arc_mm, start_s = (
        drawn.between(150.0, 500.0),
        drawn.between(20.0, 80.0),
        drawn.run.start_s,
    )
    long_s = _duration(way_mm, peak)
    return GripperPath(
        moves=(
            Move(start_s=start_s, duration_s=long_s, x_mm=drawn.side() * way_mm),
            Move(start_s=start_s, duration_s=long_s / 2.0, up_mm=arc_mm),
            Move(start_s=start_s + long_s / 2.0, duration_s=long_s / 2.0, up_mm=-arc_mm),
        )
    )  # fmt: skip


def _carry(drawn: _Drawn) -> Scene:
    return Scene(path=_carried(drawn, drawn.between(0.5, 6.0)))


def _collision(drawn: _Drawn) -> Scene:
    """A carry that ends at an obstacle: the cup hits it where it leads, else the arm does."""
    path = _carried(drawn, drawn.between(0.5, 3.0))
    along = path.moves[0]
    at_s = along.start_s + drawn.between(0.3, 0.7) * along.duration_s
    stop = ArmStop(at_s=at_s + drawn.between(*_REACTION_S), brake_m_s2=drawn.between(*_BRAKE_M_S2))
    low, high = np.log(_OBSTACLE_N_MM)
    stiffness_n_m = 1000.0 * float(np.exp(drawn.between(low, high)))
    below_mm = drawn.between(-30.0, 30.0)
    hit = None
    if along.x_mm > 0:
        speed_m_s = float(path.world(at_s)[0, 1]) / 1000.0
        hit = Hit(
            at_s=at_s,
            force_n=-speed_m_s * float(np.sqrt(stiffness_n_m * drawn.mass_kg)),
            duration_s=float(np.pi * np.sqrt(drawn.mass_kg / stiffness_n_m)),
            below_mm=below_mm,
        )
    return Scene(path=replace(path, stop=stop), hit=hit)


def _hand_over(drawn: _Drawn) -> Scene:
    """Somebody lets go of the cup, or takes it and pulls before the gripper opens."""
    start_s, takes_s = drawn.run.start_s, drawn.between(0.25, 1.0)
    gives, bears = drawn.random.random() < 0.5, drawn.between(0.7, 1.0)
    pull_n, angle = drawn.between(1.0, 8.0), drawn.between(-0.8, 0.8)
    pull_s = start_s + takes_s + drawn.between(0.1, 0.6)
    rise_s = drawn.between(0.2, 0.6)
    if gives:
        return Scene(
            person=Person(start_s=start_s, duration_s=takes_s, bears_from=1.0, bears_to=0.0)
        )
    return Scene(
        person=Person(
            start_s=start_s,
            duration_s=takes_s,
            bears_from=0.0,
            bears_to=bears,
            pull_n=(pull_n * float(np.cos(angle)), -pull_n * float(np.sin(angle))),
            pull_s=pull_s,
            pull_rise_s=rise_s,
        )
    )


_SCENES: dict[str, Callable[[_Drawn], Scene]] = {
    "lift": _lift, "tilt": _tilt, "carry": _carry, "hand-over": _hand_over,
    "collision": _collision,
}  # fmt: skip


def _duration(way_mm: float, peak_m_s2: float) -> float:
    """Return how long a move takes whose largest acceleration is this, seconds."""
    return float(np.sqrt(PEAK_ACCELERATION * way_mm / 1000.0 / peak_m_s2))


def _approached(run: PourRun, random: np.random.Generator) -> PourRun:
    """Return a run that begins with open jaws; what happens in it comes as much later.

    A cup that is not lifted anyway is lifted off the table a little, once it is held.
    """
    contact_s, lag_s = float(random.uniform(0.8, 2.5)), float(random.uniform(0.0, 0.15))
    speed = float(random.uniform(5.0, 25.0))
    depth_mm, _ = indentation(run.force_n * (1.0 + run.grip_error))
    settled_s = contact_s + lag_s + depth_mm / speed
    approach = Approach(
        contact_s=contact_s,
        lag_s=lag_s,
        first=0 if random.random() < 0.5 else 1,
        push_n=float(random.uniform(0.3, 1.0)),
        close_mm_s=speed,
        settled_s=settled_s,
    )
    rest_s = settled_s + float(random.uniform(0.8, 1.5))
    up_mm, long_s = float(random.uniform(40.0, 100.0)), float(random.uniform(0.5, 0.9))
    scene = Scene() if run.scene is None else run.scene
    if scene.person is not None and scene.person.bears_from > 0.0:
        # Hands that hold a cup out while it is grasped stand still and then sink: a table does so.
        scene = replace(scene, person=None)
    first: tuple[Move, ...] = ()
    later_s = rest_s
    if not scene.on_table:
        first = (Move(start_s=rest_s, duration_s=long_s, up_mm=up_mm),)
        later_s = rest_s + long_s
    scene = _later(scene, later_s)
    scene = replace(
        scene,
        approach=approach,
        on_table=True,
        path=replace(scene.path, moves=(*first, *scene.path.moves)),
    )
    return replace(run, start_s=run.start_s + later_s, bump_s=run.bump_s + later_s, scene=scene)


def _later(scene: Scene, by_s: float) -> Scene:
    """Return a scene in which everything comes later."""
    moves = tuple(replace(move, start_s=move.start_s + by_s) for move in scene.path.moves)
    stop, person, hit = scene.path.stop, scene.person, scene.hit
    return replace(
        scene,
        path=GripperPath(
            moves=moves, stop=None if stop is None else replace(stop, at_s=stop.at_s + by_s)
        ),
        person=None
        if person is None
        else replace(person, start_s=person.start_s + by_s, pull_s=person.pull_s + by_s),
        hit=None if hit is None else replace(hit, at_s=hit.at_s + by_s),
    )
