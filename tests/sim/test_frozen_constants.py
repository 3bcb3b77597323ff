"""The simulator's constants are frozen under a version (docs/decisions/0005)."""

import hashlib

from taxel.sim.teng import constants as teng_constants

FROZEN = {"1": "21f9bcd85c06d77f46588eb01809cc6a667479c217fa00847afde40398625f29"}
"""Version → SHA-256 of all constants."""


def test_a_changed_constant_needs_a_new_version() -> None:
    names = sorted(name for name in vars(teng_constants) if name.isupper())
    text = "\n".join(f"{name}={getattr(teng_constants, name)!r}" for name in names)
    found = hashlib.sha256(text.encode()).hexdigest()

    assert FROZEN.get(teng_constants.SIM_VERSION) == found, f"the constants hash to {found}"
