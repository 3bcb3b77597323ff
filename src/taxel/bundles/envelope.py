"""The file that every bundle is: a first line with a checksum, then a zip. Nothing is unpickled.

The first line is `TAXEL BUNDLE 1 <SHA-256 of the rest>`. Knows nothing about what the
members mean.
"""

from __future__ import annotations

import hashlib
import io
import shlex
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadBundle

FIRST_WORDS = b"TAXEL BUNDLE 1 "
_LARGEST_BYTES = 1024 * 2**20
"""A bundle larger than this is refused. Source: our choice."""


def pack(members: Mapping[str, bytes]) -> bytes:
    """Return a bundle as it stands on disk; the same members give the same bytes."""
    body = io.BytesIO()
    with zipfile.ZipFile(body, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            # A fixed date: the same run gives the same bytes.
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), data)
    content = body.getvalue()
    return FIRST_WORDS + hashlib.sha256(content).hexdigest().encode() + b"\n" + content


def unpack(path: Path, needed: Sequence[str]) -> dict[str, bytes]:
    """Return the members of a bundle, once their checksum was found right.

    Args:
        path: The bundle's file.
        needed: Members that it must hold.

    Raises:
        BadBundle: It is missing, no bundle, too large or damaged, or lacks a member.
    """
    need_bundle(path)
    try:
        if path.stat().st_size > _LARGEST_BYTES:
            raise damaged(path, "larger than 1 GiB")
        line, _, body = path.read_bytes().partition(b"\n")
    except OSError as error:
        raise BadBundle(
            "a bundle that can be read", f"{error.strerror or error} ({path})", "see who owns it"
        ) from error
    if not line.startswith(FIRST_WORDS):
        raise damaged(path, "another kind of file, or a damaged first line")
    if hashlib.sha256(body).hexdigest().encode() != line.removeprefix(FIRST_WORDS):
        raise damaged(path, "a checksum that does not fit the contents")
    try:
        with zipfile.ZipFile(io.BytesIO(body)) as archive:
            found = {name: archive.read(name) for name in archive.namelist()}
    except zipfile.BadZipFile as error:
        raise damaged(path, "contents that are no zip") from error
    lacking = [name for name in needed if name not in found]
    if lacking:
        raise damaged(path, f"another kind of bundle: it lacks {', '.join(lacking)}")
    return found


def need_bundle(path: Path) -> None:
    """Refuse what is no file where a bundle is needed.

    Raises:
        BadBundle: It is a run's folder, another folder, or not there.
    """
    if path.is_file():
        return
    got, mend = f"{path}, which is not there", "taxel bundle RUN --output FILE"
    if path.is_dir():
        is_run = (path / "run.json").exists()
        got = f"{path}, {'a run' if is_run else 'a folder'}"
        mend = f"taxel bundle {shlex.quote(str(path)) if is_run else 'RUN'} --output FILE"
    raise BadBundle("a bundle's file", got, f"write one with: {mend}")


def damaged(path: Path, what: str) -> BadBundle:
    """Return the error of a bundle that is not whole."""
    return BadBundle(
        f"a whole taxel bundle in {path.name}", what, "copy it again, or write it again"
    )


def to_npy(array: NDArray[Any]) -> bytes:
    """Return an array as a member's bytes."""
    raw = io.BytesIO()
    np.save(raw, array, allow_pickle=False)
    return raw.getvalue()


def from_npy(member: bytes) -> NDArray[Any]:
    """Return a member's array."""
    found: NDArray[Any] = np.load(io.BytesIO(member), allow_pickle=False)
    return found
