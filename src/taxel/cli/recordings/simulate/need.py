"""What every simulator needs to be installed."""

from __future__ import annotations

from importlib.util import find_spec

from taxel.errors import MissingExtra


def need_simulators() -> None:
    """Refuse to go on where the simulators' packages are missing.

    Raises:
        MissingExtra: They are.
    """
    if find_spec("scipy") is None:
        raise MissingExtra("scipy", "sim", "the simulators")
