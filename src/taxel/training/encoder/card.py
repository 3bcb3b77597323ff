"""The card of a pretrained touch encoder: all that it saw, under which licence, and how.

Lies beside the weights as JSON. Knows nothing about networks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from taxel.plain_text import json_text
from taxel.recordings.whole import write_whole
from taxel.training.encoder.fit import EncoderConfig
from taxel.training.encoder.videos import TouchVideo, data_digest

_SINGLE = ("trial", "run", "recording")
"""Groups that name each trial."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """What an encoder saw of one folder."""

    folder: str
    trials: int
    videos: int
    """A camera each."""
    images: int
    groups: Mapping[str, Sequence[str]]
    """Such as object → all its values."""
    sha256: str
    """Over the trials' images."""
    simulated: bool
    """A simulator's truth of slip stands beside the images."""


def seen_of(videos: Sequence[TouchVideo]) -> list[Seen]:
    """Return what was seen, a folder each."""
    return [
        _seen(folder, [video for video in videos if video.folder == folder])
        for folder in sorted({video.folder for video in videos})
    ]


def write_card(
    path: Path,
    videos: Sequence[TouchVideo],
    config: EncoderConfig,
    losses: Sequence[float],
    begun: Mapping[str, object] | None,
) -> dict[str, object]:
    """Write a card, whole or not at all; return it.

    Args:
        path: A file, .json.
        videos: All that was seen.
        config: How it was trained.
        losses: Of each epoch.
        begun: The card of the encoder that it began from; what that one saw was seen too.

    Raises:
        RecordingFailed: The disk refused.
    """
    card: dict[str, object] = {
        "seen": [asdict(seen) for seen in seen_of(videos)],
        "config": asdict(config),
        "losses": [round(loss, 4) for loss in losses],
        "labels": "none; in simulation how far the object slipped",
        "began_from": dict(begun) if begun else None,
    }
    write_whole(path, json_text(card, 1) + "\n")
    return card


def _seen(folder: str, videos: Sequence[TouchVideo]) -> Seen:
    keys = sorted(key for key in {key for video in videos for key in video.groups}
                  if key not in _SINGLE and not key.endswith("_s"))  # fmt: skip
    return Seen(
        folder=folder,
        trials=len({video.trial for video in videos}),
        videos=len(videos),
        images=sum(video.images.shape[0] * video.images.shape[1] for video in videos),
        groups={
            key: sorted({video.groups[key] for video in videos if key in video.groups})
            for key in keys
        },
        sha256=data_digest(videos),
        simulated=any(bool((video.slip_um == video.slip_um).any()) for video in videos),
    )
