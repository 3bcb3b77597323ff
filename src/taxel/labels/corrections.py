"""What a person says of a video's labels, kept beside the recording as NAME.labels.json.

A rule's labels are computed; a correction replaces them for one rule and one recording.
Knows nothing about how rules work, images or models.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile, BadInput, RecordingFailed
from taxel.foreign.files import MIB
from taxel.foreign.json_text import read_json
from taxel.labels.rules import rule_named
from taxel.recordings.whole import write_whole

FORMAT_VERSION = "1"
"""Raised when a reader of the old format would misread the new one."""
_LARGEST_BYTES = MIB
_MEND = "correct the file, or delete it and label again"


@dataclass(frozen=True, slots=True, kw_only=True)
class Correction:
    """One person's word on one rule's labels of one recording."""

    rule: str
    """Name of the rule that is corrected."""
    onset_s: float | None
    """First unstable moment, seconds after the recording's first frame; None: stable
    throughout."""
    author: str = ""
    """Who says so."""
    note: str = ""
    """Why."""

    @staticmethod
    def at_frame(
        rule: str, frame: int, time_s: NDArray[np.float64], author: str = "", note: str = ""
    ) -> Correction:
        """Return a correction whose onset is a frame, counted from 0.

        Args:
            rule: Name of the rule that is corrected.
            frame: First unstable frame.
            time_s: Shape (n,): time of each frame, seconds.
            author: Who says so.
            note: Why.

        Raises:
            BadInput: The video has no such frame.
        """
        if not 0 <= frame < len(time_s):
            raise BadInput(
                f"a frame from 0 to {len(time_s) - 1}", f"{frame}", "choose one of the video"
            )
        onset = float(time_s[frame] - time_s[0])
        return Correction(rule=rule, onset_s=onset, author=author, note=note)


def corrections_path(recording: Path) -> Path:
    """Return where a recording's corrections stand: beside it, as NAME.labels.json."""
    return recording.with_name(f"{recording.stem}.labels.json")


def read_corrections(recording: Path, duration_s: float) -> dict[str, Correction]:
    """Return a recording's corrections by rule; none where there is no file.

    Args:
        recording: The recording's file.
        duration_s: Time from its first frame to its last, seconds.

    Raises:
        BadInput: The file is not what this module writes, names an unknown rule, or
            an onset lies outside the video.
    """
    path = corrections_path(recording)
    try:
        stored = read_json(path, _LARGEST_BYTES)
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise BadInput(f"a readable {path}", type(error).__name__, _MEND) from error
    except BadFile as error:
        raise BadInput(f"JSON in {path}", error.got, _MEND) from error
    if not isinstance(stored, dict) or stored.get("format") != FORMAT_VERSION:
        raise BadInput(f"labels of format {FORMAT_VERSION} in {path}", "another", _MEND)
    entries = stored.get("corrections")
    if not isinstance(entries, list):
        raise BadInput(f"a list of corrections in {path}", type(entries).__name__, _MEND)
    by_rule: dict[str, Correction] = {}
    for entry in entries:
        correction = _from_json(entry, path)
        check_inside(correction, duration_s)
        by_rule[correction.rule] = correction
    return by_rule


def write_correction(recording: Path, correction: Correction, duration_s: float) -> Path:
    """Add a correction, or replace the rule's earlier one; return the file's path.

    Args:
        recording: The recording's file.
        correction: What is said.
        duration_s: Time from its first frame to its last, seconds.

    Raises:
        BadInput: The rule is unknown, the onset lies outside the video, or the file
            that is there cannot be read. Nothing is written then.
        RecordingFailed: The disk refused.
    """
    rule_named(correction.rule)
    check_inside(correction, duration_s)
    merged = {**read_corrections(recording, duration_s), correction.rule: correction}
    return _store(recording, merged)


def remove_correction(recording: Path, rule: str, duration_s: float) -> bool:
    """Take a rule's correction back; return whether there was one.

    The file goes with its last correction.

    Args:
        recording: The recording's file.
        rule: Whose correction.
        duration_s: Time from its first frame to its last, seconds.

    Raises:
        BadInput: There is no such rule, or the file that is there cannot be read.
        RecordingFailed: The disk refused.
    """
    rule_named(rule)
    kept = read_corrections(recording, duration_s)
    if kept.pop(rule, None) is None:
        return False
    _store(recording, kept)
    return True


def _store(recording: Path, corrections: Mapping[str, Correction]) -> Path:
    """Write the file as a whole, or remove it where nothing is left to say."""
    path = corrections_path(recording)
    stored = {
        "format": FORMAT_VERSION,
        "recording": recording.name,
        "corrections": [asdict(correction) for correction in corrections.values()],
    }
    if corrections:
        text = json.dumps(stored, indent=2, ensure_ascii=False, allow_nan=False)
        write_whole(path, text + "\n")
        return path
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise RecordingFailed(
            f"needed to remove {path}; got {error.strerror or error}; "
            "choose a folder that may be written."
        ) from error
    return path


def apply_correction(
    labels: NDArray[np.int8], time_s: NDArray[np.float64], correction: Correction | None
) -> NDArray[np.int8]:
    """Return the labels as the correction has them: 0 before its onset, 1 from there on.

    Args:
        labels: Shape (n,): the rule's own labels, returned as they are without a correction.
        time_s: Shape (n,): time of each frame, seconds, on any clock.
        correction: What is said, or None.

    Raises:
        BadInput: The onset lies outside the video.
    """
    if correction is None:
        return labels
    if correction.onset_s is None:
        return np.zeros(len(labels), np.int8)
    check_inside(correction, float(time_s[-1] - time_s[0]))
    return np.asarray(time_s - time_s[0] >= correction.onset_s - 1e-9, np.int8)


def check_inside(correction: Correction, duration_s: float) -> None:
    """Check that an onset lies in the video.

    Raises:
        BadInput: It does not.
    """
    onset = correction.onset_s
    if onset is not None and not (math.isfinite(onset) and 0 <= onset <= duration_s + 1e-9):
        raise BadInput(
            f"an onset of {correction.rule!r} from 0 to {duration_s:g} s, inside the video",
            f"{onset:g} s",
            "give a time after the first frame",
        )


def _from_json(entry: object, path: Path) -> Correction:
    if not isinstance(entry, Mapping) or not {"rule", "onset_s"} <= set(entry):
        raise BadInput(f"corrections with rule and onset_s in {path}", repr(entry), _MEND)
    unknown = set(entry) - {"rule", "onset_s", "author", "note"}
    if unknown:
        raise BadInput(f"only known fields in {path}", ", ".join(sorted(unknown)), _MEND)
    rule, onset = entry["rule"], entry["onset_s"]
    author, note = entry.get("author", ""), entry.get("note", "")
    if not (isinstance(rule, str) and isinstance(author, str) and isinstance(note, str)):
        raise BadInput(f"texts for rule, author and note in {path}", repr(entry), _MEND)
    if onset is not None and (isinstance(onset, bool) or not isinstance(onset, int | float)):
        raise BadInput(f"seconds or null for onset_s in {path}", repr(onset), _MEND)
    rule_named(rule)
    return Correction(
        rule=rule, onset_s=None if onset is None else float(onset), author=author, note=note
    )
