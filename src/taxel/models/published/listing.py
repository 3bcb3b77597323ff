"""What weights there are: for each backbone what is here, and each place that hands some out.

Knows nothing about printing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from taxel.models.backbones.catalogue import BACKBONES, find_backbone
from taxel.models.published.origins import STARTS, network_of, origins_of
from taxel.models.weights import Weights, fetched_weights, find_weights


@dataclass(frozen=True, slots=True, kw_only=True)
class Offer:
    """One place that hands out a backbone's weights."""

    origin: str
    megabytes: float
    """Of what is transferred, millions of bytes."""
    checksum: str
    """SHA-256 of what is transferred, or the MD5 that the publisher states."""
    licence: str
    trained: str
    """On what, and by whom."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ListedWeights:
    """A backbone's weights."""

    backbone: str
    here: str
    """What a run would start from: label and origin; RANDOM where nothing is here."""
    path: str
    """The file; empty where nothing is here."""
    sha256: str
    """Of that file."""
    megabytes: float
    """Of that file, millions of bytes."""
    places: tuple[Offer, ...]
    """Best first; none where nothing was published."""


_NOTHING = Weights(backbone="", label="nothing", digest="", path=None)
"""What is here of a start that was not fetched."""


def list_weights(backbones: Sequence[str] = (), folder: Path | None = None) -> list[ListedWeights]:
    """Return what weights there are.

    Args:
        backbones: Names, of starts too; all unless given.
        folder: Of fetched weights; the user's cache unless given.

    Raises:
        BadInput: There is no such backbone.
    """
    for name in backbones:
        find_backbone(network_of(name))
    return [_listed(name, folder) for name in backbones or (*BACKBONES, *STARTS)]


def _listed(backbone: str, folder: Path | None) -> ListedWeights:
    if backbone in STARTS:
        found = fetched_weights(backbone, folder) or _NOTHING
    else:
        found = find_weights(backbone, cache=folder)
    places = tuple(
        Offer(
            origin=origin.words, megabytes=origin.megabytes,
            checksum=origin.sha256 or origin.md5, licence=origin.licence, trained=origin.trained,
        )
        for origin in origins_of(backbone)
    )  # fmt: skip
    return ListedWeights(
        backbone=backbone,
        here=found.words,
        path=str(found.path or ""),
        sha256=found.digest if found.path else "",
        megabytes=found.path.stat().st_size / 1e6 if found.path else 0.0,
        places=places,
    )
