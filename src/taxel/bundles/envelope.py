"""The file that every bundle is: a first line with a checksum, then a zip. Nothing is unpickled.

The first line is `TAXEL BUNDLE 2 <kind> <SHA-256 of the rest>`, and where it is signed a blank and
the signature (signing.py). Bundles of format 1 do not name their kind: their first member does.
Knows nothing about what the members mean.

Background of our choices: docs/decisions/0034 and docs/decisions/0048.
"""

from __future__ import annotations

import hashlib
import io
import re
import shlex
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np
from numpy.typing import NDArray

from taxel.bundles.shipped import shipped_like
from taxel.bundles.signing import Signer, Trust, check_signature
from taxel.errors import BadBundle, BadFile
from taxel.foreign.archives import FREE, array_of, read_members
from taxel.foreign.files import (
    MIB,
    open_file,
    read_bytes,
    refuse_larger,
    sha256_of_rest,
    size_of,
)

FIRST_WORDS = b"TAXEL BUNDLE "
BundleKind = Literal["array", "grasp", "trials"]
_CONTRACTS: dict[BundleKind, str] = {
    "array": "bundle.json", "grasp": "grasp.json", "trials": "trials.json",
}  # fmt: skip
"""The member that says what a bundle is; the first of all."""
_LINE = re.compile(rb"TAXEL BUNDLE (?:1|2 (array|grasp|trials)) ([0-9a-f]{64})")
FIRST_LINE_BYTES = 512
"""Of a first line, at most; one with a signature has 320."""
LARGEST_BYTES = 512 * MIB
"""A bundle larger than this is refused; one with a ResNet-101 has 180 MB. Source: our choice."""
_LARGEST_JSON = 8 * MIB
"""Of a contract; one with the test for the unknown has some 0.2 MB."""
_MOST_PACKED = 24.0
"""How many times as large as its file a bundle may unpack to, beside `archives.FREE`: weights
hardly pack at all, tables of forests of 22 classes six times, of 100 classes 18. Source: our
choice, docs/decisions/0033."""


def pack(members: Mapping[str, bytes]) -> bytes:
    """Return a bundle as it stands on disk; the same members give the same bytes."""
    content = _zipped(members, zipfile.ZIP_DEFLATED)
    if sum(map(len, members.values())) > FREE + _MOST_PACKED * len(content):
        content = _zipped(members, zipfile.ZIP_STORED)  # else it would be refused where it is read
    kind = next(kind for kind, name in _CONTRACTS.items() if name in members)
    digest = hashlib.sha256(content).hexdigest()
    return FIRST_WORDS + f"2 {kind} {digest}\n".encode() + content


def _zipped(members: Mapping[str, bytes], how: int) -> bytes:
    body = io.BytesIO()
    with zipfile.ZipFile(body, "w") as archive:
        for name, data in members.items():
            # A fixed date: the same run gives the same bytes.
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), data, how)
    return body.getvalue()


def kind_of(path: Path) -> BundleKind | None:
    """Return what kind of bundle a file is; None where it is none, or cannot be read."""
    try:
        with open_file(path) as file:
            line, beginning = file.readline(FIRST_LINE_BYTES), file.read(100)
    except (OSError, BadFile):
        return None
    found = _LINE.match(line)
    if found is None:
        return None
    for kind, contract in _CONTRACTS.items():
        if found[1] == kind.encode() or (not found[1] and contract.encode() in beginning):
            return kind
    return None


def checksum_of(path: Path) -> str:
    """Return the checksum in a bundle's first line, unchecked; empty where it cannot be read."""
    try:
        with open_file(path) as file:
            words, _ = _first_words(file.readline(FIRST_LINE_BYTES))
    except (OSError, BadFile):
        return ""
    return words.split()[-1].decode() if words else ""


def is_grasp_bundle(path: Path) -> bool:
    """Return whether a file is a grasp bundle; False where it cannot be read."""
    return kind_of(path) == "grasp"


def is_trial_bundle(path: Path) -> bool:
    """Return whether a file is a bundle of camera trials; False where it cannot be read."""
    return kind_of(path) == "trials"


def signed(bundle: bytes, signer: Signer) -> bytes:
    """Return a whole bundle's bytes with a signature, in the place of an older one if any."""
    line, _, body = bundle.partition(b"\n")
    words, _ = _first_words(line)
    return words + b" " + signer.sign(words) + b"\n" + body


def signed_file(path: Path, signer: Signer) -> bytes:
    """Return what a bundle's file holds, found whole, with a signature.

    Raises:
        BadBundle: As of `unpack`.
    """
    need_bundle(path)
    with _refusing(path):
        content = read_bytes(path, LARGEST_BYTES)
        _checked(path, io.BytesIO(content))
        return signed(content, signer)


def is_signed(path: Path) -> bool:
    """Return whether a bundle carries a signature, whoever made it; it is not checked."""
    with open_file(path) as file:
        return bool(_first_words(file.readline(FIRST_LINE_BYTES))[1])


def unpack(
    path: Path, needed: Sequence[str], trust: Trust | None = None, optional: Sequence[str] = ()
) -> dict[str, bytes]:
    """Return some members of a bundle, once its checksum was found right; no other is unpacked.

    Args:
        path: The bundle's file.
        needed: Members that it must hold.
        trust: Keys of which one must have signed it, these very bytes; any bundle unless given.
        optional: Members that it may hold.

    Raises:
        BadBundle: It is missing, no bundle, too large or damaged, lacks a member, unpacks to
            more than a bundle's parts can have, or is not signed by a trusted key.
    """
    need_bundle(path)
    wanted = {name: _most(name) for name in (*needed, *optional)}
    with _refusing(path), _opened(path, once=trust is not None) as file:
        refuse_larger(path, size_of(file), LARGEST_BYTES)
        words, signature = _checked(path, file)
        if trust is not None:
            check_signature(path, words, signature, trust)
        members = read_members(file, wanted, _MOST_PACKED)
    lacking = [name for name in needed if name not in members]
    if lacking:
        raise damaged(path, f"another kind of bundle: it lacks {', '.join(lacking)}")
    return members


def _opened(path: Path, *, once: bool) -> BinaryIO:
    """Open a bundle; what a key signed is read once, so that nobody changes it after the check."""
    return io.BytesIO(read_bytes(path, LARGEST_BYTES)) if once else open_file(path)


@contextmanager
def _refusing(path: Path) -> Iterator[None]:
    """Turn what a file's readers raise into the words for bundles."""
    try:
        yield
    except BadFile as error:
        raise damaged(path, error.got) from error
    except OSError as error:
        raise BadBundle(
            "a bundle that can be read", f"{error.strerror or error} ({path})", "see who owns it"
        ) from error


def _checked(path: Path, file: BinaryIO) -> tuple[bytes, bytes]:
    """Return a bundle's first words and its signature, once the sum of the rest was compared."""
    line = file.readline(FIRST_LINE_BYTES)
    words, signature = _first_words(line)
    if not words or not line.endswith(b"\n"):
        what = "another kind of file, or a damaged first line"
        raise damaged(path, what if line else "an empty file")
    if words.split()[-1] != sha256_of_rest(file).encode():
        raise damaged(path, "a checksum that does not fit the contents")
    return words, signature


def _most(name: str) -> int:
    return _LARGEST_JSON if name.endswith(".json") else LARGEST_BYTES


def _first_words(line: bytes) -> tuple[bytes, bytes]:
    """Return a first line's words up to the checksum, and the signature, which may be empty.

    Both are empty where the line is no bundle's.
    """
    found = _LINE.match(line)
    words = found[0] if found else b""
    rest = line.removesuffix(b"\n")[len(words) :]
    if not rest:
        return words, b""
    return (words, rest[1:]) if rest[:1] == b" " and rest[1:] else (b"", b"")


def need_bundle(path: Path) -> None:
    """Refuse what is no file where a bundle is needed.

    Raises:
        BadBundle: It is a run's folder, another folder, or not there.
    """
    if path.is_file():
        return
    got, mend = f"{path}, which is not there", "taxel bundle RUN --output FILE"
    if (inside := path / "recogniser.taxel").is_file():
        raise BadBundle("a bundle's file", f"{path}, a run", f"name {inside}")
    if path.is_dir():
        is_run = (path / "run.json").exists()
        got = f"{path}, {'a run' if is_run else 'a folder'}"
        mend = f"taxel bundle {shlex.quote(str(path)) if is_run else 'RUN'} --output FILE"
    elif name := shipped_like(path):
        raise BadBundle("a bundle's file", got, f"for the one that comes with taxel, write {name}")
    raise BadBundle("a bundle's file", got, f"write one with: {mend}")


def damaged(path: Path, what: str) -> BadBundle:
    """Return the error of a bundle that is not whole."""
    return BadBundle(
        f"a whole taxel bundle in {path.name}", what, "copy it again, or write it again"
    )


@contextmanager
def reading_contract(wanted: str) -> Iterator[None]:
    """Turn what a contract's reader raises into the words for bundles.

    Args:
        wanted: The kind of bundle and its format, in words.

    Raises:
        BadBundle: The reader raised a ValueError, of which a BadFile is one.
    """
    try:
        yield
    except ValueError as error:
        raise BadBundle(
            wanted, f"another ({error.got if isinstance(error, BadFile) else error})",
            "write it again with taxel bundle, or update taxel if a newer version wrote it",
        ) from error  # fmt: skip


def to_npy(array: NDArray[Any]) -> bytes:
    """Return an array of any shape as a member's bytes, a .npy file."""
    raw = io.BytesIO()
    np.save(raw, array, allow_pickle=False)
    return raw.getvalue()


def from_npy(member: bytes) -> NDArray[Any]:
    """Return a member's array; its shape is as stored, and not checked here.

    Raises:
        BadBundle: It is none, or its size is not what it says.
    """
    try:
        return array_of(member)
    except BadFile as error:
        raise BadBundle("check windows as arrays", error.got, "write the bundle again") from error
