"""Names of channels as field names of a message, so that other programs show them.

ROS allows small letters, digits and single underscores. The exact names and units stand in the
manifest. Knows nothing about messages or files.

Background of our choices: docs/decisions/0051.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from keyword import iskeyword

_SPELT = {"µ": "u", "μ": "u", "°": "deg", "Ω": "ohm", "%": "percent", "/": "_per_", "ß": "ss"}
"""What no decomposition turns into letters."""
_LONGEST = 60
"""Characters of a field's name. Source: our choice."""


def field_names(channels: Sequence[str], units: Sequence[str]) -> tuple[str, ...]:
    """Return a field name for each channel, each different: "Thumb-1" in V is thumb_1_v."""
    taken: set[str] = set()
    found = []
    for number, (channel, unit) in enumerate(zip(channels, units, strict=True)):
        name = base = _field_name(channel, unit) or f"channel_{number}"
        again = 2
        while name in taken:
            name, again = f"{base}_n{again}", again + 1
        taken.add(name)
        found.append(name)
    return tuple(found)


def _field_name(channel: str, unit: str) -> str:
    letters = _letters(channel)[:_LONGEST].strip("_")
    if not letters:
        return ""
    end = _letters(unit)[:_LONGEST].strip("_")
    name = f"{letters}_{end}" if end else letters
    if not name[0].isalpha():
        name = f"channel_{name}"
    return f"{name}_value" if iskeyword(name) else name


def _letters(text: str) -> str:
    spelt = "".join(_SPELT.get(letter, letter) for letter in text)
    plain = unicodedata.normalize("NFKD", spelt).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9]+", "_", plain).strip("_")
