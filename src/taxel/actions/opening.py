"""Open an actuator by its address.

    pge:///dev/serial/by-id/adapter?max_force_n=50&id=1
    hand:///dev/serial/by-id/hand?board=1&raise_ma=100&most_ma=1200
    jaka://192.168.1.10?port=10001&lower_mm=20&speed_mm_s=50
    udp://127.0.0.1:5005
    sim://gripper?width_mm=10&max_force_n=50
    sim://arm?lower_mm=20
    sim://hand?stroke_s=1.5

Nothing moves by opening. Knows nothing about decisions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

from taxel.actions.actuators import (
    Actuator,
    ArmActuator,
    GripperActuator,
    HandActuator,
    OutputActuator,
)
from taxel.actions.arm import Arm, ArmLimits, SimArm
from taxel.actions.gripper import ForceRange
from taxel.actions.hand_raise import CurrentRaise
from taxel.actions.plain_output import open_udp
from taxel.actions.sim_gripper import FingersConfig, SimGripper
from taxel.clock import Clock, SystemClock
from taxel.errors import BadInput, MissingExtra
from taxel.foreign.addresses import read_options

_Options = dict[str, Any]
_YES_NO = {"0": False, "no": False, "false": False, "1": True, "yes": True, "true": True}
_PGE: dict[str, type] = {
    "id": int,
    "max_force_n": float,
    "force_table": str,
    "initialise": bool,
    "speed_pct": int,
    "timeout_s": float,
}
_RAISE: dict[str, type] = {"raise_ma": int, "most_ma": int, "contact_ma": int}
_HAND: dict[str, type] = {"board": int, "baud": int, **_RAISE}
_SIM_HAND: dict[str, type] = {"stroke_s": float, "speed": str, **_RAISE}
_FORCE: dict[str, type] = {"max_force_n": float, "force_table": str}
_UDP: dict[str, type] = {"allow_other_hosts": bool, **_FORCE}
_ARM: dict[str, type] = {
    "lower_mm": float, "lowest_mm": float, "speed_mm_s": float, "accel_mm_s2": float,
}  # fmt: skip
_JAKA: dict[str, type] = {"port": int, "timeout_s": float, **_ARM}
_SIM_GRIPPER: dict[str, type] = {
    "max_force_n": float,
    **{field.name: float for field in fields(FingersConfig) if field.name != "max_n"},
}
"""Options of each kind of address → their types."""


def open_actuator(url: str, clock: Clock | None = None) -> Actuator:
    """Return an actuator, not connected yet.

    Args:
        url: An address as above. What follows :// is taken as it stands, up to the first
            question mark.
        clock: The host's clock unless given.

    Raises:
        BadInput: The address is wrong, or an option of it.
        MissingExtra: The actuator needs a package that is not installed.
    """
    scheme, found, rest = url.partition("://")
    name, _, query = rest.partition("?")
    if not found or scheme not in SCHEMES or not name:
        known = ", ".join(f"{scheme}://" for scheme in SCHEMES)
        raise BadInput(
            f"an actuator's address that starts with one of {known}",
            repr(url),
            "try sim://gripper",
        )
    return SCHEMES[scheme](name, read_options(query), clock or SystemClock())


def _open_pge(name: str, texts: dict[str, str], clock: Clock) -> Actuator:
    options = _parsed("pge://", texts, _PGE)
    if "max_force_n" not in options:
        raise BadInput(
            "the gripper's force at 100 %, max_force_n, in the address",
            "none",
            "see its data sheet: 50 for a PGE-50-26",
        )
    force = _force(options)
    try:
        from taxel.actions.pge_gripper import PgeConfig, PgeGripper
    except ModuleNotFoundError as error:
        raise MissingExtra(error.name or "pymodbus", "gripper", "a gripper over Modbus") from error

    if "id" in options:
        options["device_id"] = options.pop("id")
    gripper = PgeGripper(PgeConfig(port=name, **options), clock)
    return GripperActuator(f"PGE gripper on {name}", gripper, force)


def _open_hand(name: str, texts: dict[str, str], clock: Clock) -> Actuator:
    options = _parsed("hand://", texts, _HAND)
    try:
        from taxel.actions.hand import HandController
        from taxel.actions.hand_link import HandConfig
    except ModuleNotFoundError as error:
        raise MissingExtra(error.name or "pyserial", "serial", "the hand's motors") from error

    raises = _raise(options)
    hand = HandController(HandConfig(port=name, **options), clock)
    return HandActuator(f"TENG hand on {name}", hand, raises)


def _open_jaka(name: str, texts: dict[str, str], clock: Clock) -> Actuator:
    from taxel.actions.jaka_arm import JakaArm, JakaConfig

    options = _parsed("jaka://", texts, _JAKA)
    lower_mm, limits = _lowering(options)
    arm: Arm = JakaArm(JakaConfig(host=name, limits=limits, **options), clock)
    return ArmActuator(f"JAKA arm at {name}", arm, lower_mm)


def _open_udp(name: str, texts: dict[str, str], clock: Clock) -> Actuator:
    options = _parsed("udp://", texts, _UDP)
    if "force_table" in options and "max_force_n" not in options:
        raise BadInput(
            "max_force_n, the force at 100 %, beside force_table", "none", "add it to the address"
        )
    force = _force(options) if "max_force_n" in options else None
    output = open_udp(name, options.pop("allow_other_hosts", False), clock)
    return OutputActuator(f"UDP to {name}", output, force)


def _open_sim(name: str, texts: dict[str, str], clock: Clock) -> Actuator:
    if name == "gripper":
        options = _parsed("sim://gripper", texts, _SIM_GRIPPER)
        if "max_force_n" in options:
            options["max_n"] = options.pop("max_force_n")
        config = FingersConfig(**options)
        force = ForceRange(max_n=config.max_n, min_pct=config.min_pct)
        return GripperActuator("simulated gripper", SimGripper(config, clock), force)
    if name == "arm":
        lower_mm, limits = _lowering(_parsed("sim://arm", texts, _ARM))
        return ArmActuator("simulated arm", SimArm(limits, clock), lower_mm)
    if name == "hand":
        return _sim_hand(_parsed("sim://hand", texts, _SIM_HAND), clock)
    raise BadInput(
        "a simulated actuator that exists: sim://gripper or sim://arm or sim://hand",
        f"sim://{name}",
        "mend the address",
    )


def _sim_hand(options: _Options, clock: Clock) -> Actuator:
    from taxel.actions.sim_hand import SimHand
    from taxel.sim.teng.grasped_hand import GraspedHand, Motors

    stroke_s = options.get("stroke_s", Motors().stroke_s)
    if not 0.1 <= stroke_s <= 60:
        raise BadInput("stroke_s of sim://hand within 0.1 and 60", f"{stroke_s:g}", "mend it")
    if options.get("speed", "1") not in ("1", "max"):
        raise BadInput("speed of sim://hand as 1 or max", repr(options["speed"]), "mend it")
    raises = _raise(options)
    hand = SimHand(GraspedHand(motors=Motors(stroke_s=stroke_s)), clock)
    return HandActuator("simulated hand", hand, raises)


def _raise(options: _Options) -> CurrentRaise | None:
    """Take out of the options how the contact current is raised; None where it is not."""
    named = {key: options.pop(key) for key in _RAISE if key in options}
    if not named:
        return None
    if not {"raise_ma", "most_ma"} <= set(named):
        raise BadInput(
            "raise_ma with most_ma: steps of the contact current and their bound",
            f"{', '.join(named)} alone", "name both, or none",
        )  # fmt: skip
    named["step_ma"] = named.pop("raise_ma")
    return CurrentRaise(**named)


SCHEMES: dict[str, Callable[[str, dict[str, str], Clock], Actuator]] = {
    "pge": _open_pge,
    "hand": _open_hand,
    "jaka": _open_jaka,
    "udp": _open_udp,
    "sim": _open_sim,
}
"""Scheme → how to open it: (what follows ://, options, clock) → actuator."""


def _force(options: _Options) -> ForceRange:
    """Take the range of force out of the options.

    Raises:
        BadInput: The table of force cannot be read or does not rise.
    """
    text = options.pop("force_table", "")
    try:
        pairs = [pair.split(":") for pair in text.split(",")] if text else []
        table = tuple((float(pct), float(force_n)) for pct, force_n in pairs)
    except ValueError as error:
        raise BadInput(
            "force_table as percent:newtons pairs, such as 20:9.1,50:24.3,100:49.5",
            repr(text),
            "mend the address",
        ) from error
    return ForceRange(max_n=options.pop("max_force_n"), table=table)


def _lowering(options: _Options) -> tuple[float, ArmLimits]:
    """Take the way down and an arm's limits out of the options."""
    lower_mm = options.pop("lower_mm", 0.0)
    named = {key: options.pop(key) for key in _ARM if key in options}
    limits = ArmLimits(**named)
    if not 0 <= lower_mm <= limits.lowest_mm:
        raise BadInput(
            f"lower_mm of 0 to lowest_mm, {limits.lowest_mm:g}", f"{lower_mm:g}", "choose another"
        )
    if named and not lower_mm:
        raise BadInput(
            f"lower_mm, the way down, beside {next(iter(named))}",
            "none: the arm would never be moved", "add lower_mm, or leave it out",
        )  # fmt: skip
    return lower_mm, limits


def _parsed(address: str, texts: dict[str, str], kinds: dict[str, type]) -> _Options:
    """Return options by their types.

    Raises:
        BadInput: One is unknown or of the wrong kind.
    """
    return {key: _value(address, key, text, kinds) for key, text in texts.items()}


def _value(address: str, key: str, text: str, kinds: dict[str, type]) -> Any:
    if key not in kinds:
        raise BadInput(
            f"options of {address} among {', '.join(kinds)}", repr(key), "mend the address"
        )
    kind = kinds[key]
    try:
        return _YES_NO[text.lower()] if kind is bool else kind(text)
    except (KeyError, ValueError) as error:
        forms = {bool: "yes or no", int: "a whole number", float: "a number", str: "text"}
        raise BadInput(
            f"{key} of {address} as {forms[kind]}", repr(text), "mend the address"
        ) from error
