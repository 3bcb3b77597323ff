"""What taxel brings along: every distribution that it or one of its extras requires.

Reads the installed metadata only. Knows nothing about licences or bills of materials.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = "taxel"
DEVELOPMENT = ("dev", "docs")
"""The extras that are not shipped to users."""
VENDORED = Path(__file__).parents[1] / "src/taxel/views/page/static/vendor/vendored.json"


def extras() -> list[str]:
    """Return the names of taxel's extras."""
    return sorted(distribution(ROOT).metadata.get_all("Provides-Extra") or [])


def required(extra: str = "") -> dict[str, Distribution]:
    """Return all distributions that taxel with an extra brings, itself left out, by name.

    What is not installed, or is meant for another platform, is left out.
    """
    found: dict[str, Distribution] = {}
    seen: set[tuple[str, str]] = set()
    waiting = [(ROOT, extra) for extra in {"", extra}]
    while waiting:
        name, own = waiting.pop()
        if (name, own) in seen:
            continue
        seen.add((name, own))
        try:
            package = distribution(name)
        except PackageNotFoundError:
            continue
        if name != ROOT:
            found[name] = package
        for need in _needs(package, own):
            key = str(canonicalize_name(need.name))
            waiting += [(key, extra) for extra in {"", *need.extras}]
    return found


def absent(extra: str) -> list[str]:
    """Return what an extra requires by name and is not installed here."""
    missing = []
    for need in _needs(distribution(ROOT), extra):
        try:
            distribution(need.name)
        except PackageNotFoundError:
            missing.append(need.name)
    return missing


def vendored() -> list[dict[str, Any]]:
    """Return what was taken into taxel's own files."""
    found: list[dict[str, Any]] = json.loads(VENDORED.read_text())
    return found


def _needs(package: Distribution, extra: str) -> Iterator[Requirement]:
    for line in package.requires or []:
        need = Requirement(line)
        if need.marker is None:
            if not extra:
                yield need
        elif need.marker.evaluate({"extra": extra}) and (
            not extra or not need.marker.evaluate({"extra": ""})
        ):
            yield need
