"""What a bundle says about itself, and the file's layout.

A bundle is one file: a first line `TAXEL BUNDLE 2 array <sha256 of the rest>`, then a
zip of `bundle.json` (this contract), `model.onnx` and three `check_*.npy` arrays
with a few windows and the probabilities that they must give. Nothing in it is
unpickled. Knows nothing about training frameworks.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields, replace
from hashlib import sha256
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.envelope import reading_contract
from taxel.decisions.joining import MEAN, Joining
from taxel.decisions.still_channels import Motion, motion_from_json, motion_to_json
from taxel.decisions.unknown import Unknown, unknown_from_json, unknown_to_json
from taxel.errors import BadBundle, BadInput
from taxel.foreign.json_text import Fields, parse_json
from taxel.foreign.records import record_of
from taxel.plain_text import number_of
from taxel.signals import SensorInfo
from taxel.windows.config import MOST_RATE_CHANGE, WindowConfig
from taxel.windows.level_follow import KnownLevel, UsualLevel, WatchedLevel, parse_level_follow
from taxel.windows.reference import Reference
from taxel.windows.scaling import Scaling, ScalingKind

FORMAT = 1
"""Version of the layout above."""
RATE_RANGE = (0.8, 1.25)
"""Least and most that a camera's rate may be of the one that a bundle was trained at. Source: our
choice, docs/decisions/0013."""
MOST_JOINED = 16
"""Windows joined at most where no gate parts contacts, so that the answer follows what is held.
Source: our choice, docs/decisions/0010."""
LARGEST_DIFFERENCE = 1e-4
"""A probability may differ by this much between training framework, export and load.
Source: our choice, docs/decisions/0009."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contract:
    """What a bundle needs and gives."""

    target: str
    """The label it predicts, such as "shape"."""
    classes: tuple[str, ...]
    """Its answers, in the order of its probabilities."""
    window: WindowConfig
    scaling: Scaling
    channels: tuple[str, ...]
    """Names of the channels that it was trained on, in order."""
    units: tuple[str, ...]
    """Their units, which a source must share."""
    rate_hz: float
    """Nominal rate of the recordings that it was trained on, hertz."""
    model: str
    parameters: int
    data_digest: str
    """SHA-256 over the training recordings, hexadecimal."""
    accuracy: Mapping[str, float]
    """Split → accuracy 0…1, as measured when it was trained; may be empty."""
    software: str
    """Version of taxel that wrote it."""
    parity: float | None
    """Largest difference of a probability between the training framework and ONNX Runtime;
    None for a run that was not exported yet."""
    reference: Reference | None = None
    """The level of the reference touches that the scaling holds for; None where it was
    trained on values as measured."""
    unknown: Unknown | None = None
    """The novelty test of touch unlike the training data; None where it was not learned."""
    learned: tuple[str, ...] = ()
    """A fingerprint of each recording that gave a training window, see `fingerprint_of`, sorted;
    empty where it is not known, as in older bundles."""

    joining: Joining = MEAN
    """How sure the windows of a contact are together; older bundles take the mean."""
    motion: Motion | None = None
    """How much each channel changed within training windows, so that one that has stopped is
    reported; None where that is not known, as in older bundles: none is reported."""
    usual: UsualLevel | None = None
    """The level that sessions are followed from; None where levels are not followed."""
    trial_windows: int = 0
    """Windows of a usual training trial (their median); 0 where that is not known, as in bundles of
    before."""
    learned_groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Group, such as the object → a fingerprint of each value that gave a training window, see
    `value_fingerprint`; empty where that is not known, as in older bundles and adapted ones."""

    @property
    def most_windows(self) -> int | None:
        """How many windows of a stream are joined at most, the latest; None: all of a contact, as
        a gate parts it from the next.
        """
        if self.window.gate is not None:
            return None
        return min(self.trial_windows or MOST_JOINED, MOST_JOINED)

    @property
    def followed_from(self) -> KnownLevel | None:
        """The level that sessions are followed from, beside which a hung array shows none."""
        if self.usual is None or self.motion is None:
            return self.usual
        return WatchedLevel(usual=self.usual, hung=self.motion.frozen)

    def check_sensor(self, sensor: SensorInfo) -> None:
        """Refuse a sensor that this bundle was not made for.

        Raises:
            BadBundle: The channels are others in number, unit, name or order, or windows of
                the sensor's own scans would last another time.
        """
        named = self.window.channels
        if named is not None and set(named) <= set(sensor.channels):
            sensor = sensor.only(named)
        if len(sensor.channels) != len(self.channels) or sensor.units != self.units:
            if not sensor.channels:
                raise BadBundle(
                    f"recordings of an array of {number_of(len(self.channels), 'channel')}",
                    "recordings of cameras only",
                    "name recordings of such an array, or a bundle of cameras",
                )
            raise BadBundle(
                f"{number_of(len(self.channels), 'channel')} in "
                f"{', '.join(sorted(set(self.units)))}",
                f"{len(sensor.channels)} in {', '.join(sorted(set(sensor.units)))} "
                f"from {sensor.name!r}",
                "train a bundle on recordings of this sensor",
            )
        if sensor.channels != self.channels:
            raise BadBundle(
                f"the channels {', '.join(self.channels)}, in this order",
                f"{', '.join(sensor.channels)} from {sensor.name!r}",
                "name or order them so in the import table or with channels= in serial://, if you "
                "are sure which is which; or train with --window channels=NAMES, taken by name",
            )
        low_hz, high_hz = self.rate_hz / MOST_RATE_CHANGE, self.rate_hz * MOST_RATE_CHANGE
        if self.window.grid_hz is None and not low_hz <= sensor.rate_hz <= high_hz:
            raise BadBundle(
                f"about {self.rate_hz:g} scans/s, whose rows this bundle takes as they come",
                f"{sensor.rate_hz:g} from {sensor.name!r}",
                "train a bundle on recordings of this rate, or on a grid: --window grid=100",
            )


def fingerprint_of(digest: str) -> str:
    """Return what a contract keeps of a recording's SHA-256: two of a million agree by chance
    once in 10⁷ data sets.
    """
    return digest[:16]


def value_fingerprint(value: str) -> str:
    """Return what a contract keeps of a group's value, such as a person's name."""
    return fingerprint_of(sha256(value.encode()).hexdigest())


def learned_too(contract: Contract, recordings: Collection[str], windows: bytes) -> Contract:
    """Return the contract of a recogniser that has learned more since.

    Args:
        contract: What it was.
        recordings: A fingerprint of each recording of what it learned, see `fingerprint_of`.
        windows: The values that it learned.
    """
    # Where it is not known what it was trained on, a part must not be taken for all of it.
    known = {*contract.learned, *recordings} if contract.learned else set()
    digest = sha256(contract.data_digest.encode() + windows)
    return replace(contract, learned=tuple(sorted(known)), data_digest=digest.hexdigest(),
                   learned_groups={})  # fmt: skip


def holding(contract: Contract) -> Contract:
    """Return a contract whose levels stay at the usual one; its accuracy is not known then.

    Raises:
        BadBundle: Its levels are not followed.
    """
    if contract.window.level_follow is None:
        raise BadBundle(
            "a run whose sessions' levels are followed, to hold the level of",
            "one as measured", "leave --hold-level out",
        )  # fmt: skip
    window = replace(contract.window, level_follow=None)
    return replace(contract, window=window, usual=None, accuracy={})


def following(contract: Contract, follow_s: float) -> Contract:
    """Return the contract with a gate that follows each channel's rest and noise.

    Args:
        contract: A recogniser's.
        follow_s: How many of the last seconds they are measured on.

    Raises:
        BadInput: There is no gate above 0 to follow, or the time is not above 0 s.
    """
    window = contract.window
    if not follow_s > 0 or not (window.gate or 0.0) > 0:
        raise BadInput(
            "more than 0 s, and a recogniser with a gate above 0 to follow",
            f"{follow_s:g} s, gate {window.gate}", "train with --window gate=1.55",
        )  # fmt: skip
    return replace(contract, window=replace(window, gate_follow_s=follow_s))


def at_level(contract: Contract, level: NDArray[np.float32]) -> Contract:
    """Return the contract for a session, pad or gel whose reference touches have another level.

    Args:
        contract: One that was trained with reference touches.
        level: That level, shape (channels,), as `taxel.windows.reference.touch_level` gives it;
            a channel that gives nothing keeps the level that it has.

    Raises:
        BadBundle: The bundle was trained without reference touches.
    """
    if contract.reference is None:
        raise BadBundle(
            "a bundle trained with reference touches", "one without",
            "train it with --recipe teng-referenced, or with --window reference=…",
        )  # fmt: skip
    level = np.where(level > 0, level, contract.reference.level).astype(np.float32)
    motion = contract.motion
    return replace(
        contract,
        scaling=contract.scaling.at_level(contract.reference.level, level),
        reference=replace(contract.reference, level=level),
        motion=None if motion is None else motion.at_level(contract.reference.level, level),
    )


def contract_to_json(contract: Contract) -> str:
    """Return the contract as JSON text."""
    data = asdict(replace(contract, unknown=None, motion=None))
    data["format"] = FORMAT
    data["scaling"] = {
        "kind": contract.scaling.kind,
        "offset": [float(value) for value in contract.scaling.offset],
        "factor": [float(value) for value in contract.scaling.factor],
    }
    if contract.reference is not None:
        data["reference"]["level"] = [float(value) for value in contract.reference.level]
    if contract.unknown is not None:
        data["unknown"] = unknown_to_json(contract.unknown)
    if contract.motion is not None:
        data["motion"] = motion_to_json(contract.motion)
    return json.dumps(data, indent=1, sort_keys=True)


def contract_from_json(text: str | bytes) -> Contract:
    """Return the contract that a JSON text holds.

    Raises:
        BadBundle: A field is missing, unknown, or of the wrong kind, length or range.
    """
    with reading_contract(f"a bundle of format {FORMAT}"):
        return _contract(parse_json(text))


def _contract(data: Any) -> Contract:
    if isinstance(data, dict):  # what older bundles lack
        defaults = {entry.name: entry.default for entry in fields(Contract)
                    if entry.default is not MISSING}  # fmt: skip
        data = defaults | {"learned_groups": {}} | data
    entries = Fields(data, "the contract")
    if entries.any("format") != FORMAT:
        raise ValueError("another format")
    entries.only({entry.name for entry in fields(Contract)} | {"format"})
    classes, channels = entries.texts("classes"), entries.texts("channels")
    units, n = entries.texts("units"), len(channels)
    window = record_of(WindowConfig, _window(entries.any("window")))
    groups, each = entries.any("learned_groups"), entries.fields("learned_groups")
    if not classes or len(set(classes)) < len(classes):
        raise ValueError("the classes are none, or one comes twice")
    if not channels or len(set(channels)) < n or len(units) != n:
        raise ValueError(
            f"{number_of(n, 'channel')}, of which one comes twice, with "
            f"{number_of(len(units), 'unit')}"
        )
    return Contract(
        target=entries.text("target"),
        classes=classes,
        window=window,
        scaling=_scaling(entries.fields("scaling"), n),
        channels=channels,
        units=units,
        rate_hz=entries.number("rate_hz", 0.0),
        model=entries.text("model"),
        parameters=entries.count("parameters", 0, 2**53),
        data_digest=entries.text("data_digest"),
        accuracy=entries.numbers("accuracy"),
        software=entries.text("software"),
        parity=entries.number("parity") if "parity" in entries else None,
        reference=_reference(entries.fields("reference"), n) if "reference" in entries else None,
        unknown=_unknown(entries.any("unknown"), n) if "unknown" in entries else None,
        learned=entries.texts("learned") if entries.any("learned") != () else (),
        joining=_joining(entries.any("joining")),
        motion=motion_from_json(entries.fields("motion"), n) if "motion" in entries else None,
        usual=_usual(entries, n, window),
        trial_windows=entries.count("trial_windows", 0, 2**31),
        learned_groups={key: each.texts(key) for key in groups},
    )


def _usual(entries: Fields, channels: int, window: WindowConfig) -> UsualLevel | None:
    """Return the level that levels are followed from; there is one where the window says so."""
    if (window.level_follow is not None) != ("usual" in entries):
        raise ValueError("levels that follow without a usual level, or the reverse")
    if window.level_follow is None:
        return None
    try:
        parse_level_follow(window.level_follow)
    except BadInput as error:
        raise ValueError(f"levels that follow {error.got}") from error
    found = record_of(UsualLevel, entries.any("usual"))
    if len(found.squares) != channels:
        raise ValueError(f"a usual level of {number_of(len(found.squares), 'channel')}")
    return found


def _joining(data: Any) -> Joining:
    return data if isinstance(data, Joining) else record_of(Joining, data)


def _window(data: Any) -> Any:
    """Return a window as it was meant: older bundles filled no gaps."""
    return {"fill": 0.0} | data if isinstance(data, dict) else data


def _scaling(given: Fields, channels: int) -> Scaling:
    kind: ScalingKind = given.choice("kind", get_args(ScalingKind))
    offset, factor = (
        given.array(name, (channels,)).astype(np.float32) for name in ("offset", "factor")
    )
    return Scaling(kind=kind, offset=offset, factor=factor)


def _reference(given: Fields, channels: int) -> Reference:
    level = given.array("level", (channels,)).astype(np.float32)
    return Reference(touches=given.text("touches"), level=level)


def _unknown(data: object, channels: int) -> Unknown:
    found = unknown_from_json(data)
    if len(found.level) != channels:
        raise ValueError(f"the test for the unknown is not of {number_of(channels, 'channel')}")
    return found
