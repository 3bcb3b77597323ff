"""What a file of weights says of itself: one text of JSON in its head.

Knows nothing about tensors or where weights lie.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields

from taxel.errors import BadFile
from taxel.foreign.json_text import parse_json

_NAME = "taxel"
"""Of the text among a head's."""
_LONGEST = 500
"""Characters of a value; what is longer is cut. Source: our choice, docs/decisions/0055."""


@dataclass(frozen=True, slots=True, kw_only=True)
class About:
    """The description in a weight file's head: origin, licence, training and checksums."""

    origin: str
    licence: str = ""
    trained: str = ""
    checksum: str = ""
    """Of the archive that they were converted from."""
    tensors: str = ""
    """Sum over them (`tensor_digest`)."""
    side_px: str = ""
    """Height and width of the images that they were trained on, pixels; the backbone's own where
    empty."""

    def head(self) -> dict[str, str]:
        """Return what is stored in a file's head."""
        return {_NAME: json.dumps(asdict(self), sort_keys=True, ensure_ascii=False)}


def parse_about(head: Mapping[str, str]) -> About | None:
    """Return what a file's head says; None where it says nothing, or nothing that can be read."""
    try:
        content = parse_json(head.get(_NAME, "null"))
    except BadFile:
        return None
    if not isinstance(content, dict) or not isinstance(content.get("origin"), str):
        return None
    known = [field.name for field in fields(About)]
    return About(**{name: str(content[name])[:_LONGEST] for name in known if name in content})
