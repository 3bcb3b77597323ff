"""The simulator's constants are frozen under a version (docs/decisions/0005)."""

import hashlib

from taxel.sim import teng_constants

FROZEN = {"1": "330117d270cc456ea4e85808d8364a0a906864160aa0e23a21dba2daea600dfe"}
"""Version → SHA-256 of all constants."""


def test_a_changed_constant_needs_a_new_version() -> None:
    names = sorted(name for name in vars(teng_constants) if name.isupper())
    text = "\n".join(f"{name}={getattr(teng_constants, name)!r}" for name in names)
    found = hashlib.sha256(text.encode()).hexdigest()

    assert FROZEN.get(teng_constants.SIM_VERSION) == found, f"the constants hash to {found}"
