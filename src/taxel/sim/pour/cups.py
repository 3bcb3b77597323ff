"""Cups, and the pours that are tried on them: every nuisance drawn from seeds.

A cup's own properties depend on its number and the seed alone, so that a cup is the same
in every set; a run's nuisances are drawn apart from its cup, position and force.
Knows nothing about forces, gels or pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from taxel.sim.pour.scenes import Approach, Scene

Position = Literal["upper", "middle", "lower"]
POSITIONS: tuple[Position, ...] = get_args(Position)
FORCES_N = (15.0, 25.0, 40.0, 50.0)
"""With which each cup is gripped at each position, newtons. Source: paper, section 3.2."""
Kind = Literal[
    "pour", "still", "no-slip pour", "bump", "grip drop", "late slip",
    "lift", "tilt", "carry", "hand-over", "collision",
]  # fmt: skip
"""pour and still (held, nothing poured): the paper's protocol, whose videos are in part stable
throughout; the next four are negatives and hard cases; the last five are `MOVING_KINDS`."""
OTHER_KINDS: tuple[Kind, ...] = ("no-slip pour", "bump", "grip drop", "late slip")
MOVING_KINDS: tuple[Kind, ...] = ("lift", "tilt", "carry", "hand-over", "collision")
"""The gripper moves, or somebody else bears the cup: what else the paper's abstract names. Their
scenes are drawn by `taxel.sim.pour.scene_draws`."""

_HELD_KG_MM = 11.9
"""Mass times lever that a grip of 15 N holds where friction is 1: 2 · 15 N · 0.62 · 6.28 mm over
gravity. Source: limit surface of a handle's patch, docs/explanation/physics-gel."""
AMOUNT_G = (90.0, 420.0)
"""Least and most that a pour is drawn to have, grams, evenly. Source: our choice, decision 13."""
_CUP, _RUN = 11, 12
"""Streams of the random generator, so that cups and runs never share numbers."""
_POSITION = {"upper": 0.5, "middle": 0.0, "lower": -0.5}
"""Where on the handle's bend the gripper closes: −1 the lower end, 1 the upper one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cup:
    """What is held out whole: a cup with its handle. Ranges: our choice, decision 13."""

    index: int
    mass_kg: float
    """Empty."""
    lever_mm: float
    """From the middle of the handle to the vertical through the centre of mass."""
    gyration_mm: float
    """Radius of gyration about the centre of mass."""
    radius_across_mm: float
    """Of the handle's cross-section."""
    bend_mm: float
    """Radius of the handle's bend."""
    width_mm: float
    """Of the handle."""
    texture_um: float
    """Root mean square."""
    texture_mm: float
    """Typical wavelength."""
    texture_along: float
    """0…1: ridges along the handle's axis."""
    friction: float
    """Static, μs."""
    friction_kinetic: float
    """Kinetic over static, μk/μs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PourRun:
    """One run: a cup held at one place with one force while something happens to it."""

    cup: Cup
    position: Position
    force_n: float
    """Commanded grip force, newtons."""
    kind: Kind
    number: int
    """Which repetition of this cup, position and force."""
    seed: int
    """Of noise within the run."""
    start_s: float
    """When the pour, or whatever the kind is, begins."""
    flow_g_s: float
    """Poured mass a second; 0 without a pour."""
    amount_g: float
    """Poured at most."""
    grip_error: float
    """True grip over commanded grip, minus 1."""
    relaxation: float
    """Share of the grip that is lost over the seconds, 0…1."""
    creep: float
    """Share by which the gel's shear creeps, 0…1."""
    vibration_n: float
    """Root mean square of the hand's and the jet's unrest, newtons."""
    bump_n: float
    """Peak of a push on the cup, newtons; 0 without."""
    bump_s: float
    """When it comes, seconds."""
    grip_drop: float
    """Share by which the grip falls in a third of a second at `start_s`, 0…1."""
    tilt_rad: float
    """Turn of the handle in the fingers at the grasp."""
    side_friction: tuple[float, float]
    """Friction of the left and the right side over the cup's own."""
    scene: Scene | None = None
    """What else happens: where the gripper goes, table, person, obstacle, approach."""

    @property
    def name(self) -> str:
        """Such as "cup-03_middle_25N"; further kinds and repetitions say so."""
        name = f"cup-{self.cup.index:02d}_{self.position}_{self.force_n:g}N"
        if self.kind != "pour":
            name += "_" + self.kind.replace(" ", "-")
        if self.approach is not None:
            name += "_approach"
        return name if self.number == 0 else f"{name}_{self.number}"

    @property
    def approach(self) -> Approach | None:
        """How the grasp is made; None where it is made at time zero."""
        return None if self.scene is None else self.scene.approach

    @property
    def along(self) -> float:
        """Where on the handle's bend the grasp is, −1…1."""
        return _POSITION[self.position]


def draw_cup(seed: int, index: int) -> Cup:
    """Return a cup; the same for a seed and index in every set."""
    random = np.random.default_rng([_CUP, seed, index])
    # Only cups that 15 N holds while empty: the paper starts from a stable grasp.
    share, friction = random.uniform(0.3, 0.6), random.uniform(0.45, 1.3)
    lever_mm = random.uniform(42.0, 70.0)
    return Cup(
        index=index,
        mass_kg=float(np.clip(share * friction * _HELD_KG_MM / lever_mm, 0.05, 0.40)),
        lever_mm=lever_mm,
        gyration_mm=random.uniform(30.0, 42.0),
        radius_across_mm=random.uniform(4.0, 9.0),
        bend_mm=random.uniform(22.0, 60.0),
        width_mm=random.uniform(8.0, 15.0),
        texture_um=float(np.exp(random.uniform(np.log(4.0), np.log(30.0)))),
        texture_mm=random.uniform(0.35, 1.6),
        texture_along=float(random.choice([0.0, 0.5, 0.9])),
        friction=friction,
        friction_kinetic=random.uniform(0.70, 0.95),
    )


def draw_run(
    seed: int, cup: Cup, position: Position, force_n: float, kind: Kind = "pour", number: int = 0
) -> PourRun:
    """Return a run without its scene; it depends on the seed and its place in the set alone."""
    place = place_of(position, force_n, number, kind)
    random = np.random.default_rng([_RUN, seed, cup.index, *place])
    amount_g = random.uniform(*AMOUNT_G)
    start_s = random.uniform(0.4, 2.2)
    flow_g_s = random.uniform(50.0, 160.0)
    pours = kind in ("pour", "no-slip pour", "late slip")
    if kind == "no-slip pour":
        amount_g *= 0.3
    if kind == "late slip":
        start_s, flow_g_s, amount_g = random.uniform(0.4, 0.8), 160.0, amount_g * 0.6
    late_s = start_s + amount_g / flow_g_s + random.uniform(0.6, 1.2)
    return PourRun(
        cup=cup,
        position=position,
        force_n=force_n,
        kind=kind,
        number=number,
        seed=int(random.integers(2**31)),
        start_s=start_s,
        flow_g_s=flow_g_s if pours else 0.0,
        amount_g=amount_g if pours else 0.0,
        grip_error=random.uniform(-0.03, 0.03),
        relaxation=random.uniform(0.0, 0.06),
        creep=random.uniform(0.05, 0.20),
        vibration_n=random.uniform(0.02, 0.15),
        bump_n=random.uniform(4.0, 14.0) if kind in ("bump", "late slip") else 0.0,
        bump_s=late_s if kind == "late slip" else start_s,
        grip_drop=random.uniform(0.25, 0.6) if kind == "grip drop" else 0.0,
        tilt_rad=random.uniform(-0.12, 0.12),
        side_friction=_side_friction(random),
    )


def _side_friction(random: np.random.Generator) -> tuple[float, float]:
    random.uniform(size=2)  # not used: without these two draws every stored run would be another
    return random.uniform(0.9, 1.1), random.uniform(0.9, 1.1)


def draw_kinds(still: float, negatives: float, random: np.random.Generator) -> tuple[Kind, ...]:
    """Draw the kind of one run, "pour" or "still", and at times a second run of another kind.

    Args:
        still: Share of runs in which nothing is poured, 0…1.
        negatives: Runs of the other kinds, as a share of these, 0…1.
        random: Of the cup.
    """
    first: Kind = "still" if random.random() < still else "pour"
    if random.random() >= negatives:
        return (first,)
    return first, OTHER_KINDS[int(random.integers(len(OTHER_KINDS)))]


def place_of(position: Position, force_n: float, number: int, kind: Kind) -> list[int]:
    """Return a run's place in its set, for its random numbers."""
    return [int(_POSITION[position] * 2 + 3), round(force_n * 10), number, hash_of(kind)]


def kind_named(name: str) -> Kind:
    """Return the kind of this name, words joined by hyphens.

    Raises:
        KeyError: There is none.
    """
    kinds: tuple[Kind, ...] = get_args(Kind)
    return {kind.replace(" ", "-"): kind for kind in kinds}[name]


def hash_of(kind: Kind) -> int:
    """Return a number for a kind, the same on every machine."""
    return ("pour", *OTHER_KINDS, "still", *MOVING_KINDS).index(kind)
