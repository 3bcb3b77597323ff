"""Versions of a bundle or a run: what adapting replaced is kept, and can come back.

Beside NAME.taxel (or a run's folder NAME) stand NAME.v1.taxel, NAME.v2.taxel … (NAME.v1 …),
the former versions as they were, and NAME.versions.json, which says of each what was
adapted, when, from which data, and the accuracy before and after. Each version is
known by its digest, so that the history holds wherever a kill or a copy left off: the
history is written first, the former version is kept second, and the new one takes its
place last. Whatever else stands under such a name is left alone: numbers go on above it.
Knows nothing about what is inside.

Background of our choices: docs/decisions/0028.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from datetime import UTC, datetime
from pathlib import Path

from taxel.bundles.envelope import LARGEST_BYTES
from taxel.errors import BadInput, not_written
from taxel.foreign.files import MIB, sha256_of
from taxel.foreign.json_text import Fields, read_json
from taxel.foreign.records import record_of
from taxel.recordings.whole import write_whole

FORMAT = 1
"""Version of the history's layout."""
_CLASS = "class "
_LARGEST_HISTORY = 4 * MIB
_LARGEST_NUMBER = 10**9 - 1
_MOST_FILES = 1000
"""Bounds of a history and of a run's folder, which has ten or so files. Source: our choice."""


OF_ALL, OF_KNOWN = "all", "all known before"
"""Under these names stand the accuracies of all windows, and of those of classes known before."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """What made a version."""

    what: str
    """One line, such as "new class 'prism' from 5 grasps"."""
    data: tuple[str, ...] = ()
    """Recordings, as they were named."""
    data_digest: str = ""
    """SHA-256 over their values, hexadecimal."""
    before: Mapping[str, float] = field(default_factory=dict)
    """What was measured, `OF_ALL`, `OF_KNOWN` or a class by `class_key` → accuracy before, 0…1."""
    after: Mapping[str, float] = field(default_factory=dict)
    """The same after."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Version:
    """One version in a history."""

    number: int
    """1 is what was trained."""
    digest: str
    """SHA-256 of the file, or over the folder's files, hexadecimal."""
    parent: str
    """Digest of the version that it was made from; empty for the first."""
    made: str
    """When, ISO 8601 with zone."""
    change: Change


@dataclass(frozen=True, slots=True)
class History:
    """All versions, oldest first."""

    versions: tuple[Version, ...]
    current: int
    """Number of the version that is in use."""

    def version(self, number: int) -> Version:
        """Return a version by number.

        Raises:
            BadInput: There is none.
        """
        for version in self.versions:
            if version.number == number:
                return version
        known = ", ".join(str(version.number) for version in self.versions)
        raise BadInput(f"one of the versions {known}", str(number), "see them with --history")


def class_key(name: str) -> str:
    """Return under which name a class's accuracy stands: its own, unless a total's is like it."""
    bare = name
    while bare.startswith(_CLASS):
        bare = bare.removeprefix(_CLASS)
    return _CLASS + name if bare in (OF_ALL, OF_KNOWN) else name


def named_path(path: Path) -> Path:
    """Return a path that ends in a name, so that others can stand beside it: "." has none.

    Raises:
        BadInput: It is the root of all folders.
    """
    found = path if path.name not in ("", "..") else Path(os.path.abspath(path))
    if not found.name:
        raise BadInput("a bundle or a run's folder", f"{found}", "name one that exists")
    return found


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file, or over a folder's files and their names, hexadecimal.

    Raises:
        BadInput: It is no plain file, a file is larger than a bundle may be, or there are too
            many of them.
    """
    if not path.is_dir():
        return sha256_of(path, LARGEST_BYTES)
    whole = hashlib.sha256()
    for number, file in enumerate(sorted(path for path in path.rglob("*") if path.is_file())):
        if number >= _MOST_FILES:
            raise BadInput(f"a run of at most {_MOST_FILES} files", f"more in {path}", "look at it")
        whole.update(file.relative_to(path).as_posix().encode(errors="surrogateescape") + b"\0")
        whole.update(bytes.fromhex(sha256_of(file, LARGEST_BYTES)))
    return whole.hexdigest()


def kept_path(path: Path, number: int) -> Path:
    """Return where a former version stands, or would."""
    stem, suffix = _parts(path)
    return path.with_name(f"{stem}.v{number}{suffix}")


def new_path(path: Path) -> Path:
    """Return where to write what shall take the place of `path`; nobody else's name."""
    stem, suffix = _parts(path)
    return path.with_name(f".{stem}.adapting{suffix}")


def history_path(path: Path) -> Path:
    """Return where the history stands."""
    return path.with_name(f"{_parts(path)[0]}.versions.json")


def read_history(path: Path) -> History:
    """Return a bundle's or run's history; one that was never adapted has one version.

    A folder that a kill caught between two names is put back first.

    Raises:
        BadInput: There is no such file or folder, or its history is damaged.
    """
    path = named_path(path)
    settle(path)
    if not path.exists():
        raise BadInput("a bundle or a run's folder", f"no {path}", "name one that exists")
    digest = digest_of(path)
    versions = _read(history_path(path))
    current = [version.number for version in versions if version.digest == digest]
    if not current:
        number = _free_number(path, versions)
        changed = "changed by other means" if versions else "trained"
        if not versions and number > 1:
            changed = "found without a history"
        first = Version(
            number=number, digest=digest, parent="", made="", change=Change(what=changed)
        )
        return History((*versions, first), number)
    return History(versions, current[0])


def replace_with(path: Path, new: Path, change: Change) -> Version:
    """Put a new version in the place of the one in use, which is kept; return the new one.

    What equals the version in use, byte for byte, makes no version: that one is returned, and
    `new` is removed. What equals a former one is that version again.

    Args:
        path: The bundle or run in use.
        new: A finished file or folder at `new_path(path)`.
        change: What made it.

    Raises:
        RecordingFailed: The disk refused.
    """
    path = named_path(path)
    history, digest = read_history(path), digest_of(new)
    if digest == history.version(history.current).digest:
        _clear(new)
        return history.version(history.current)
    history = _with_room(path, history)
    parent = history.version(history.current)
    again = [version for version in history.versions if version.digest == digest]
    version = again[-1] if again else Version(
        number=_free_number(path, history.versions),
        digest=digest,
        parent=parent.digest,
        made=datetime.now(UTC).isoformat(timespec="seconds"),
        change=change,
    )  # fmt: skip
    _swap(path, new, parent.number, history.versions + (() if again else (version,)))
    return version


def begin_history(path: Path, parent: Path, change: Change) -> Version:
    """Say of a version under another name what it was made from; return it.

    Args:
        path: The new bundle or run, finished.
        parent: What it was adapted from.
        change: What made it.

    Raises:
        RecordingFailed: The disk refused.
    """
    path, parent = named_path(path), named_path(parent)
    version = Version(
        number=_free_number(path, ()),
        digest=digest_of(path),
        parent=digest_of(parent),
        made=datetime.now(UTC).isoformat(timespec="seconds"),
        change=change,
    )
    _write(history_path(path), (version,))
    return version


def roll_back(path: Path, number: int | None = None) -> Version:
    """Bring a former version back into use; the one in use is kept. Return the former.

    Args:
        path: The bundle or run.
        number: Which version; the one that the version in use was made from unless given.

    Raises:
        BadInput: There is no such version, or its file is gone.
        RecordingFailed: The disk refused.
    """
    path = named_path(path)
    history = read_history(path)
    now = history.version(history.current)
    if number is None:
        former = [version for version in history.versions
                  if version.digest == now.parent and version.number < now.number]  # fmt: skip
        if not former:
            raise BadInput("a former version to go back to", f"none of {path}", "nothing is done")
        number = former[-1].number
    target = history.version(number)
    if number == history.current:
        return target
    kept_file = kept_path(path, number)
    if not kept_file.exists() or digest_of(kept_file) != target.digest:
        state = "another one" if kept_file.exists() else "none"
        raise BadInput(
            f"version {number} as it was in {kept_file}", state, "choose another version"
        )
    new = new_path(path)
    _clear(new)
    try:
        shutil.copytree(kept_file, new) if kept_file.is_dir() else shutil.copyfile(kept_file, new)
    except OSError as error:
        raise not_written(new, error) from error
    history = _with_room(path, history)
    _swap(path, new, history.current, history.versions)
    return target


def _swap(path: Path, new: Path, number: int, versions: tuple[Version, ...]) -> None:
    """Write the history, keep the version in use under its number, let the new one in."""
    kept = kept_path(path, number)
    try:
        _write(history_path(path), versions)
        if path.is_dir():
            _clear(kept)
            os.rename(path, kept)
            os.rename(new, path)
            return
        link = kept.with_name(kept.name + ".part")
        link.unlink(missing_ok=True)
        shutil.copyfile(path, link)
        os.replace(link, kept)
        os.replace(new, path)
    except OSError as error:
        raise not_written(path, error) from error


def settle(path: Path) -> None:
    """Finish what a kill between the two renames of a folder left: its new version goes in.

    Raises:
        BadInput: There is something to finish, and the history is damaged.
    """
    path = named_path(path)
    new = new_path(path)
    if path.exists() or not new.is_dir():
        return
    digest = digest_of(new)
    if any(version.digest == digest for version in _read(history_path(path))):
        os.rename(new, path)


def _free_number(path: Path, versions: tuple[Version, ...]) -> int:
    """Return the number above all in a history and above every NAME.vN beside it."""
    stem, suffix = _parts(path)
    form = re.compile(re.escape(stem) + r"\.v(\d{1,9})" + re.escape(suffix))
    found = [form.fullmatch(path.name) for path in path.parent.iterdir()]
    taken = [int(match[1]) for match in found if match] + [version.number for version in versions]
    return 1 + max(taken, default=0)


def _with_room(path: Path, history: History) -> History:
    """Return a history whose version in use can be kept under its number.

    Where something else stands there, that version takes the next free number.
    """
    now = history.version(history.current)
    kept = kept_path(path, now.number)
    if not os.path.lexists(kept) or digest_of(kept) == now.digest:
        return history
    number = _free_number(path, history.versions)
    versions = tuple(version for version in history.versions if version is not now)
    return History((*versions, replace(now, number=number)), number)


def _parts(path: Path) -> tuple[str, str]:
    """Return the name and what follows it; a folder's whole name is its name."""
    return (path.stem, ".taxel") if path.suffix == ".taxel" else (path.name, "")


def _read(path: Path) -> tuple[Version, ...]:
    if not path.exists():
        return ()
    try:
        stored = Fields(read_json(path, _LARGEST_HISTORY), "the history")
        if stored.any("format") != FORMAT:
            raise ValueError("another format")
        versions = tuple(map(_version, stored.items("versions")))
        if len({version.number for version in versions}) < len(versions):
            raise ValueError("a number comes twice")
    except (OSError, ValueError) as error:  # BadFile is a ValueError
        raise BadInput(
            f"a history that can be read in {path}",
            f"a damaged one, or one of another version ({getattr(error, 'got', error)})",
            "move it away; the former versions beside it stay",
        ) from error
    return versions


def _version(stored: object) -> Version:
    given = Fields(stored, "a version")
    given.only({field.name for field in fields(Version)})
    return Version(
        number=given.count("number", 1, _LARGEST_NUMBER),
        digest=given.text("digest"),
        parent=given.text("parent"),
        made=given.text("made"),
        change=record_of(Change, given.any("change"), finite=False),
    )


def _write(path: Path, versions: tuple[Version, ...]) -> None:
    text = json.dumps(
        {"format": FORMAT, "versions": [asdict(version) for version in versions]}, indent=1
    )
    write_whole(path, text + "\n")


def _clear(path: Path) -> None:
    """Remove what an attempt before left."""
    shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
