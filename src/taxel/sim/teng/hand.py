"""The simulated TENG hand: sessions of grasps, as data sets and as an endless stream.

Pure physics: knows nothing about files, sources or models.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from taxel.signals import Mark, Samples, SensorInfo, flag_values
from taxel.sim.teng import constants
from taxel.sim.teng.constants import MATERIALS, SENSORS, SHAPES, SIM_VERSION
from taxel.sim.teng.contact import HALF_WIDTH_MM, Grasp, contact_over_time, draw_grasp
from taxel.sim.teng.electrics import Sensors, Session, draw_session, full_voltage, quantise
from taxel.sim.teng.pickup import PICKUP_SEED, Pickup
from taxel.sim.teng.unknown_objects import UNKNOWN_MATERIALS, UNKNOWN_SHAPES
from taxel.sim.teng.wear import Wear

Preset = Literal["honest", "paper"]
Wiring = Literal["three-boards", "one-board"]
Range = tuple[float, float]

_FULL_SCALE_V = 3.3
"""Source: TENG thesis, section 3.6.1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TengHandConfig:
    """What is simulated."""

    preset: Preset = "honest"
    """honest: sessions shared by all classes; paper: one session a class, our reading of the
    thesis's "each shape's dataset" (docs/decisions/0042); its nuisances are then a fingerprint
    of the class (leaky)."""
    seed: int = 0
    wiring: Wiring = "three-boards"
    """one-board: all 12 channels on one converter, with hum and ghosts."""
    rate_hz: float = 1000.0
    """Scans a second."""
    scans_per_class: int = 160_000
    """Scans of each shape, and of each material. Source: TENG thesis, section 3.5.1."""
    sessions: int = 6
    """Sessions of the honest preset."""
    force_n: Range = (0.5, 5.0)
    """Grip force, newtons. Source: thesis, section 3.4."""
    temperature_c: Range = (20.0, 35.0)
    """Source: thesis, section 4.4."""
    humidity_pct: Range = (30.0, 65.0)
    """Relative humidity, percent."""
    dust: Range = (0.0, 0.3)
    """Share of the pads covered, 0…1."""
    moisture: Range = (0.0, 0.1)
    """Share of the pads wet, 0…1."""
    moving: float = 0.1
    """Share of grasps whose object moves, 0…1."""
    reference_v: float = 3.3
    """The converter's reference, volts: 3.3 or 5."""
    size_mm: Range = HALF_WIDTH_MM
    """Half of the object's width, millimetres."""
    contact_angle_deg: float = 0.0
    """How much further objects are turned in the hand than grasps scatter, degrees."""
    fatigue: float = 0.0
    """Share of its output that a pad loses in 10,000 full presses, 0…1; 0 does not wear."""
    worn_presses: float = 0.0
    """Full presses that every pad has behind it when a session begins."""
    pickup_v: float = 0.0
    """Interference that all leads pick up alike, volts of standard deviation; 0 is none."""
    unknown: bool = False
    """True: grasps of an elongated prism and of a rubber composite come among the others."""

    @property
    def shapes(self) -> tuple[str, ...]:
        """The shapes that are grasped."""
        return SHAPES + UNKNOWN_SHAPES if self.unknown else SHAPES

    @property
    def materials(self) -> tuple[str, ...]:
        """The materials that are grasped."""
        return MATERIALS + UNKNOWN_MATERIALS if self.unknown else MATERIALS

    def __post_init__(self) -> None:
        ranges = (self.force_n, self.temperature_c, self.humidity_pct, self.dust, self.moisture)
        if any(low > high for low, high in ranges):
            raise ValueError("needed ranges as (low, high); got one whose low is above its high")
        if self.rate_hz <= 0 or self.scans_per_class < 1 or self.sessions < 1:
            raise ValueError("needed a rate, scans a class and sessions above 0")
        if self.force_n[0] <= 0 or self.size_mm[0] <= 0:
            raise ValueError(
                f"needed a force above 0 N and an object wider than 0 mm; got {self.force_n[0]} N "
                f"and {self.size_mm[0]} mm"
            )


@dataclass(frozen=True, slots=True)
class SimulatedSession:
    """One session, finished."""

    name: str
    samples: Samples
    marks: list[Mark]
    """One a grasp, from first touch until the voltage has died away."""
    details: dict[str, str]
    """The session's nuisances, for the manifest."""


def sensor_info(config: TengHandConfig) -> SensorInfo:
    """Return what the simulated array is."""
    return SensorInfo(
        name="teng",
        channels=SENSORS,
        units=("V",) * len(SENSORS),
        rate_hz=config.rate_hz,
        # The largest reading: one count below the reference, or 3.3 V as a 5 V reference has it.
        full_scale=float(quantise(np.array([_FULL_SCALE_V]), config.reference_v)[0]),
        serial=f"sim-teng-{SIM_VERSION}",
        details={
            "wiring": config.wiring,
            "reference_v": str(config.reference_v),
            "seed": str(config.seed),
            "simulator": f"taxel sim teng {SIM_VERSION}",
        },
    )


def simulate_sessions(config: TengHandConfig) -> Iterator[SimulatedSession]:
    """Yield the data set, session after session.

    honest: every session holds all nine combinations in a shuffled order; a third
    of the scans belongs to each shape and to each material. With `unknown` there are four
    of each, so 16 combinations, and as many scans more. paper: three
    sessions of one shape each (glass) and three of one material each (cylinders),
    marked with the group "task".
    """
    if config.preset == "paper":
        plan = [("shape", shape, "glass") for shape in config.shapes]
        plan += [("material", "cylinder", material) for material in config.materials]
        # One laboratory in one season: the middle fifth of each range.
        places = [
            (0.4 + 0.2 * a, 0.4 + 0.2 * b, 0.4 + 0.2 * c)
            for a, b, c in _spread_evenly(len(plan), config.seed)
        ]
        for index, (task, shape, material) in enumerate(plan):
            name = f"{task}-{shape if task == 'shape' else material}"
            groups = {"session": name, "task": task}
            yield _session(
                config,
                index,
                name,
                [(shape, material)],
                config.scans_per_class,
                groups,
                places[index],
            )
        return
    every = [(shape, material) for shape in config.shapes for material in config.materials]
    scans = len(config.shapes) * config.scans_per_class
    edges = np.linspace(0, scans, config.sessions + 1).round().astype(int)
    places = _spread_evenly(config.sessions, config.seed)
    for index in range(config.sessions):
        name = f"session-{index + 1}"
        count = int(edges[index + 1] - edges[index])
        yield _session(config, index, name, every, count, {"session": name}, places[index])


def _spread_evenly(sessions: int, seed: int) -> list[tuple[float, float, float]]:
    """Return each session's place in three ranges: one in each equal part of each range.

    Six sessions drawn freely can all be humid; a laboratory would spread them.
    """
    rng = np.random.default_rng([seed, sessions])
    parts = np.stack([rng.permutation(sessions) for _ in range(3)], axis=1)
    places = (parts + rng.uniform(0.0, 1.0, parts.shape)) / sessions
    return [(float(a), float(b), float(c)) for a, b, c in places]


class GraspStream:
    """An endless session, grasp by grasp, for live sources.

    Args:
        config: What is simulated.
        shape: Only this shape, which may be an unknown one; all of the configuration's in a
            shuffled order unless given.
        material: Only this material, as above.

    Raises:
        ValueError: There is no such shape or material.
    """

    def __init__(
        self, config: TengHandConfig, *, shape: str | None = None, material: str | None = None
    ) -> None:
        every = ((shape, SHAPES + UNKNOWN_SHAPES), (material, MATERIALS + UNKNOWN_MATERIALS))
        for name, known in every:
            if name is not None and name not in known:
                raise ValueError(f"needed one of {', '.join(known)}; got {name!r}")
        shapes = (shape,) if shape else config.shapes
        materials = (material,) if material else config.materials
        self.info = sensor_info(config)
        self._maker = _Maker(
            config, 0, [(s, m) for s in shapes for m in materials], {"session": "live"}
        )

    def next_block(self) -> tuple[Samples, list[Mark]]:
        """Return the scans and the mark of the next grasp; time goes on from 0."""
        return self._maker.grasp()


class _Maker:
    """Make one session's grasps; each has a generator of its own."""

    def __init__(
        self,
        config: TengHandConfig,
        index: int,
        combinations: list[tuple[str, str]],
        groups: dict[str, str],
        place: tuple[float, float, float] | None = None,
    ) -> None:
        own = np.random.SeedSequence([config.seed, index, 0 if config.preset == "honest" else 1])
        first, noise, order, self._grasps = own.spawn(4)
        self.session = draw_session(
            np.random.default_rng(first),
            config.temperature_c,
            config.humidity_pct,
            config.dust,
            config.moisture,
            place,
        )
        self._config = config
        self._groups = groups
        self._combinations = combinations
        self._order_rng = np.random.default_rng(order)
        self._order: list[int] = []
        self._noise = np.random.default_rng(noise)
        # Interference has a generator of its own, so that it changes nothing else.
        pickup = np.random.default_rng([config.seed, index, PICKUP_SEED])
        self._sensors = Sensors(
            self.session, config.rate_hz, config.wiring, config.reference_v, self._noise,
            Pickup(config.pickup_v, config.rate_hz, pickup) if config.pickup_v else None,
        )  # fmt: skip
        self._wear = Wear(config.fatigue, config.worn_presses, len(SENSORS))
        self._scan = 0
        self._last_arrival_s = 0.0
        self._count = 0

    def grasp(self) -> tuple[Samples, list[Mark]]:
        """Return the next grasp's scans and its mark."""
        if not self._order:
            self._order = list(self._order_rng.permutation(len(self._combinations)))
        shape, material = self._combinations[self._order.pop()]
        rng = np.random.default_rng(self._grasps.spawn(1)[0])
        config = self._config
        grasp = draw_grasp(
            rng, shape, material, config.force_n, config.moving, config.size_mm,
            config.contact_angle_deg,
        )  # fmt: skip
        rate_hz = config.rate_hz
        n = round(grasp.duration_s * rate_hz)
        contact = contact_over_time(grasp, np.arange(n) / rate_hz)
        volts = full_voltage(self.session, material, grasp.force_n)
        charge = contact * volts * self.session.gain
        if config.fatigue:
            charge = charge * self._wear.left
        self._wear.add(grasp.presses * grasp.pressure)
        values = self._sensors.read(charge)
        samples = self._samples(values)
        self._count += 1
        return samples, [self._mark(grasp, samples)]

    def _samples(self, values: NDArray[np.float32]) -> Samples:
        n, config = len(values), self._config
        counter = self._scan + np.arange(n)
        true_s = counter / config.rate_hz
        delay_s = self._noise.exponential(constants.USB_DELAY_S, n)
        arrival_s = np.maximum(np.maximum.accumulate(true_s + delay_s), self._last_arrival_s)
        self._last_arrival_s = float(arrival_s[-1])
        self._scan += n
        return Samples(
            values=values,
            counter=counter.astype(np.int64),
            device_s=true_s * (1 + self.session.clock_ppm * 1e-6),
            arrival_s=arrival_s,
            fitted_s=true_s,
            validity=flag_values(values, sensor_info(config).full_scale),
        )

    def _mark(self, grasp: Grasp, samples: Samples) -> Mark:
        start_s = float(samples.fitted_s[0]) + grasp.rest_s + float(grasp.delay_s.min())
        return Mark(
            start_s=start_s,
            end_s=float(samples.fitted_s[-1]),
            labels={"shape": grasp.shape, "material": grasp.material},
            groups={
                **self._groups,
                "grasp": f"{self._groups['session']}/{self._count}",
                "object": f"{grasp.shape}-{grasp.material}",
                "force_n": f"{grasp.force_n:.2f}",
                "size_mm": f"{grasp.size_mm:.1f}",
                "moving": "yes" if grasp.moving_hz else "no",
            },
        )


def _session(
    config: TengHandConfig,
    index: int,
    name: str,
    combinations: list[tuple[str, str]],
    scans: int,
    groups: dict[str, str],
    place: tuple[float, float, float],
) -> SimulatedSession:
    maker = _Maker(config, index, combinations, groups, place)
    parts: list[Samples] = []
    marks: list[Mark] = []
    count = 0
    while count < scans:
        samples, own = maker.grasp()
        parts.append(samples)
        marks += own
        count += len(samples)
    samples = Samples.join(parts)[:scans]
    end_s = float(samples.fitted_s[-1])
    marks = [mark for mark in marks if mark.end_s <= end_s]
    return SimulatedSession(name, samples, marks, _details(maker.session))


def _details(session: Session) -> dict[str, str]:
    return {
        "temperature_c": f"{session.temperature_c:.1f}",
        "humidity_pct": f"{session.humidity_pct:.1f}",
        "dust": f"{session.dust:.3f}",
        "moisture": f"{session.moisture:.3f}",
        "time_constant_s": f"{session.time_constant_s:.3f}",
        "capacitance_pf": f"{session.capacitance_pf:.0f}",
        "hum_v": f"{session.hum_v:.3f}",
        "clock_ppm": f"{session.clock_ppm:.1f}",
    }
