"""What faults of arrays and of cameras share: how they are named, and which levels mean anything.

Knows nothing about what a fault does.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, TypeVar

from taxel.errors import BadInput


class Fault(Protocol):
    """One way in which a sensor gets worse."""

    @property
    def summary(self) -> str:
        """What it is, in words."""
        ...

    @property
    def unit(self) -> str:
        """Of its levels."""
        ...


_Fault = TypeVar("_Fault", bound=Fault)


def find_fault(faults: Mapping[str, _Fault], name: str) -> _Fault:
    """Return a fault by name.

    Raises:
        BadInput: There is none of this name.
    """
    if name not in faults:
        known = "; ".join(f"{key} ({fault.summary}, {fault.unit})" for key, fault in faults.items())
        raise BadInput(f"faults among {known}", repr(name), "name one of them")
    return faults[name]


def refused_level(what: str, limits: tuple[float, float], unit: str, level: float) -> BadInput:
    """Return the error of a level that means nothing.

    Args:
        what: Levels of which fault, in words.
        limits: The smallest and the largest that it may be.
        unit: Of all three.
        level: What was asked for.
    """
    low, high = limits
    return BadInput(
        f"{what} within {low:g} and {high:g} {unit}", f"{level:g}", "choose others with --levels"
    )
