"""Finish a bill of materials (CycloneDX): `make sbom`.

`cyclonedx-py` lists the environment; here development's own parts are left out, what was taken
into taxel's files is added, and each part says which extras bring it.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from packaging.utils import canonicalize_name
from supply.distributions import DEVELOPMENT, ROOT, extras, required, vendored


def finish(bill: dict[str, Any]) -> dict[str, Any]:
    """Return a bill of materials of what users get.

    Args:
        bill: As `cyclonedx-py environment` writes it.
    """
    brought: dict[str, list[str]] = {}
    for extra in ["", *(extra for extra in extras() if extra not in DEVELOPMENT)]:
        for name in required(extra):
            brought.setdefault(name, []).append(extra or "always")
    kept = []
    for part in bill["components"]:
        name = str(canonicalize_name(part["name"]))
        if name in brought:
            own = part.setdefault("properties", [])
            own += [{"name": "taxel:brought-by", "value": extra} for extra in brought[name]]
            kept.append(part)
    taken = [_taken(package) for package in vendored()]
    refs = {part["bom-ref"] for part in [*kept, *taken]}
    root = bill["metadata"].get("component", {}).get("bom-ref", ROOT)
    links = [link for link in bill.get("dependencies", []) if link["ref"] in refs | {root}]
    for link in links:
        inside = [ref for ref in link.get("dependsOn", []) if ref in refs]
        link["dependsOn"] = inside + (
            [part["bom-ref"] for part in taken] if link["ref"] == root else []
        )
    return bill | {"components": [*kept, *taken], "dependencies": links}


def _taken(package: dict[str, Any]) -> dict[str, Any]:
    return {
        "type": "library",
        "bom-ref": package["purl"],
        "name": package["name"],
        "version": package["version"],
        "purl": package["purl"],
        "licenses": [{"license": {"id": package["license"]}}],
        "hashes": [{"alg": "SHA-256", "content": package["tarball_sha256"]}],
        "properties": [{"name": "taxel:brought-by", "value": "in taxel's own files"}],
    }


def main() -> None:
    """Finish the file that is named."""
    path = Path(sys.argv[1])
    bill = finish(json.loads(path.read_text()))
    path.write_text(json.dumps(bill, indent=1) + "\n")
    print(f"{path}: {len(bill['components'])} components, CycloneDX {bill['specVersion']}")


if __name__ == "__main__":
    main()
