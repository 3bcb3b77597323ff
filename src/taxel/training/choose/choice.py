"""What was chosen, and why: the file expert.json, by which a training can be repeated.

Knows nothing about how it was found.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from taxel.decisions.joining import Joining
from taxel.errors import BadFile, BadInput
from taxel.foreign.json_text import Fields, read_json
from taxel.foreign.records import record_of
from taxel.models.kernel_features import KERNELS
from taxel.models.touch_blocks import is_block
from taxel.recordings.whole import write_whole
from taxel.training.choose.candidates import FAMILIES, Candidate
from taxel.windows.config import WindowConfig

FORMAT = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """One model of the blend."""

    candidate: Candidate
    blocks: tuple[str, ...]
    """Its features; none for a network."""
    weight: float
    sharpness: float
    """What its logits are multiplied by: one over its temperature."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """One line of the leaderboard."""

    name: str
    windows: str
    """How the recordings were cut."""
    loss: float
    """Mean cross-entropy on windows of inner folds, calibrated, nats."""
    accuracy: float
    """On the same, 0…1."""
    seconds: float
    """To fit and score it on all inner folds."""
    weight: float = 0.0
    """In the blend that was chosen; 0 where it is not in it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A recogniser that was chosen: its window and members, and the scores it was chosen by."""

    target: str
    window: WindowConfig
    members: tuple[Member, ...]
    last: float
    """One over the blend's own temperature."""
    joining: Joining
    held: str
    """What the inner folds held out, such as "object"."""
    folds: int
    """Inner folds."""
    why: str
    loss: float
    """The blend's on inner folds, nats."""
    accuracy: float
    leaderboard: tuple[Standing, ...]
    left_out: tuple[str, ...] = ()
    """What was not tried, for the time was up."""
    behind: tuple[str, ...] = ()
    """Ways to cut that were far behind on the first inner fold, and not compared further."""
    slow: tuple[str, ...] = ()
    """Blocks of features that take longer than a window may, and so were not tried."""


def choice_to_json(choice: Choice) -> str:
    """Return a choice as JSON text."""
    return json.dumps({"format": FORMAT, **asdict(choice)}, indent=1, sort_keys=True) + "\n"


def write_choice(path: Path, choice: Choice) -> None:
    """Write expert.json, whole or not at all.

    Raises:
        RecordingFailed: The disk refused.
    """
    write_whole(path, choice_to_json(choice).encode())


def read_choice(path: Path) -> Choice:
    """Read expert.json.

    Raises:
        BadInput: There is none, or it is damaged or names what there is not.
    """
    try:
        given = Fields(read_json(path), "the choice")
        if given.any("format") != FORMAT:
            raise ValueError("another format")
        return _choice(given)
    except (OSError, BadFile, ValueError) as error:
        got = getattr(error, "strerror", None) or getattr(error, "got", error)
        raise BadInput(
            f"a file expert.json as taxel train writes it, at {path}", str(got),
            "train without --like",
        ) from error  # fmt: skip


def _choice(given: Fields) -> Choice:
    members = tuple(_member(Fields(member, "a member")) for member in given.items("members"))
    if not members:
        raise ValueError("no member")
    return Choice(
        target=given.text("target"),
        window=record_of(WindowConfig, given.any("window")),
        members=members,
        last=given.number("last", 0.0),
        joining=record_of(Joining, given.any("joining")),
        held=given.text("held"),
        folds=given.count("folds", 0, 1000),
        why=given.text("why"),
        loss=given.number("loss"),
        accuracy=given.number("accuracy", 0.0, 1.0),
        leaderboard=tuple(record_of(Standing, standing) for standing in given.items("leaderboard")),
        left_out=given.texts("left_out"),
        behind=given.texts("behind") if "behind" in given else (),
        slow=given.texts("slow") if "slow" in given else (),
    )


def _member(given: Fields) -> Member:
    from taxel.training.choose.fitting import FITS

    raw = given.fields("candidate")
    family = raw.choice("family", FAMILIES)
    model, blocks = raw.text("model"), given.texts("blocks")
    known = (model in FITS and bool(blocks)) or family == "network"
    named = blocks == (KERNELS,) or all(map(is_block, blocks))
    if not known or not named:
        raise ValueError(f"{model} on {', '.join(blocks)}")
    candidate = Candidate(family, model, raw.text("features"), raw.number("strength", 0.0))
    return Member(candidate=candidate, blocks=blocks, weight=given.number("weight", 0.0, 1.0),
                  sharpness=given.number("sharpness", 0.0))  # fmt: skip


def as_record(choice: Choice) -> Mapping[str, Any]:
    """Return a choice as plain values, for --json."""
    found: dict[str, Any] = json.loads(choice_to_json(choice))
    return found
