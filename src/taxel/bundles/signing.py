"""Signatures of bundles: who wrote a file, where its checksum says only that it is whole.

A key is an Ed25519 key in OpenSSH's own files, as `ssh-keygen -t ed25519` writes them; a signature
is OpenSSH's too (SSHSIG, in the namespace `taxel-bundle`), over the words with which a bundle
begins, `TAXEL BUNDLE 2 <kind> <SHA-256 of the rest>`. So `ssh-keygen -Y verify` checks it without
taxel. The cryptography is pyca's, an extra; without it bundles are read as before, and no signature
is checked. Knows nothing about bundles beyond those words.

Source: OpenSSH's PROTOCOL.sshsig; docs/decisions/0034.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import os
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taxel.errors import BadBundle, BadFile, BadInput, MissingExtra, not_written
from taxel.foreign.files import read_bytes

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

_NAMESPACE = b"taxel-bundle"
"""What such a signature is good for: one for a letter or a commit is none for a bundle."""
_KIND = b"ssh-ed25519"
_KEY_BYTES = 32
_SIGNATURE_BYTES = 64
_LARGEST_FILE = 64 * 1024
"""Bytes of a key's file; a thousand public keys fit. Source: our choice."""


@dataclass(frozen=True, slots=True)
class Trust:
    """The public keys whose bundles are accepted."""

    keys: tuple[bytes, ...]
    """Ed25519 public keys of 32 bytes."""
    source: str
    """Where they came from, for messages."""


class Signer:
    """A private key that signs bundles.

    Args:
        key: pyca's Ed25519 key.
    """

    def __init__(self, key: Ed25519PrivateKey) -> None:
        self._key = key
        self.public = key.public_key().public_bytes_raw()
        """32 bytes."""

    def sign(self, words: bytes) -> bytes:
        """Return the signature of a bundle's first words, as it stands behind them: base64."""
        value = _string(_KIND) + _string(self._key.sign(_signed(words)))
        return base64.b64encode(_blob(self.public) + _string(value))


def new_key(path: Path) -> Path:
    """Write a new private key, for its owner alone, and its public key beside it; return that.

    Args:
        path: File of the private key; the public one is called the same with `.pub`.

    Raises:
        BadInput: One of the files exists: a key is never replaced.
        RecordingFailed: The disk refused.
        MissingExtra: pyca/cryptography is not installed.
    """
    serialization, ed25519 = _pyca()
    public = path.with_name(f"{path.name}.pub")
    for file in (path, public):
        if os.path.lexists(file):
            raise BadInput("a free name for a new key", f"{file}, which exists",
                           "name another: a key is never replaced")  # fmt: skip
    key = ed25519.Ed25519PrivateKey.generate()
    secret = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.OpenSSH,
        serialization.NoEncryption(),
    )  # fmt: skip
    line = key.public_key().public_bytes(
        serialization.Encoding.OpenSSH, serialization.PublicFormat.OpenSSH
    )
    _write_new(path, secret, 0o600)
    try:
        _write_new(public, line + b" taxel\n", 0o644)
    except BaseException:
        path.unlink(missing_ok=True)
        raise
    return public


def read_key(path: Path, ask: Callable[[str], str] | None = None) -> Signer:
    """Return the private key of a file that `new_key` or ssh-keygen wrote.

    Args:
        path: The file.
        ask: Asks a person for the key's passphrase; None refuses keys that have one.

    Raises:
        BadInput: It cannot be read, is no Ed25519 key, others may read it too, or its passphrase
            is wrong.
        MissingExtra: pyca/cryptography is not installed.
    """
    serialization, ed25519 = _pyca()
    data = _read(path, "a private key's file")
    if os.name == "posix" and path.stat().st_mode & 0o077:
        raise BadInput("a private key that only its owner may read",
                       f"{path} of mode {path.stat().st_mode & 0o777:o}",
                       "run: chmod 600 on it, if nobody else had it")  # fmt: skip

    def opened(passphrase: bytes | None) -> object:
        return serialization.load_ssh_private_key(data, passphrase)

    try:
        try:
            key = opened(None)
        except TypeError:  # pyca's way to say that it has a passphrase
            if ask is None:
                raise BadInput("a key without a passphrase here", f"{path}, which has one",
                               "sign on a terminal") from None  # fmt: skip
            key = opened(ask(f"passphrase of {path}: ").encode())
    except BadInput:
        raise
    except Exception as error:  # pyca raises several kinds, also for a wrong passphrase
        raise _no_key(path, "a private Ed25519 key of OpenSSH's form") from error
    if not isinstance(key, ed25519.Ed25519PrivateKey):
        raise _no_key(path, "a private Ed25519 key of OpenSSH's form")
    return Signer(key)


def read_trust(path: Path) -> Trust:
    """Return the public keys of a file: a line each, `ssh-ed25519 … name`; # begins a remark.

    Raises:
        BadInput: It cannot be read, or a line is no Ed25519 public key.
        MissingExtra: pyca/cryptography is not installed, so nothing could be checked.
    """
    _pyca()
    lines = _read(path, "a public key's file").decode("utf-8", "replace").splitlines()
    keys = [_public(line, path) for line in lines if line.strip() and line.strip()[0] != "#"]
    if not keys:
        raise _no_key(path, "a public key, ssh-ed25519 … , in each line")
    return Trust(tuple(keys), str(path))


def check_signature(path: Path, words: bytes, signature: bytes, trust: Trust) -> None:
    """Refuse a bundle that none of the trusted keys signed.

    Args:
        path: The bundle, for the message.
        words: Its first words, whose checksum was found right for the very bytes that are opened.
        signature: What stands behind them; empty where there is none.
        trust: The keys.

    Raises:
        BadBundle: It is not signed, signed by another key, or was changed since.
        MissingExtra: pyca/cryptography is not installed.
    """
    _, ed25519 = _pyca()
    from cryptography.exceptions import InvalidSignature

    if not signature:
        raise _untrusted(path, trust, "one without a signature")
    public, value = _parsed(path, signature, trust)
    if public not in trust.keys:
        raise _untrusted(path, trust, f"one signed by {fingerprint(public)}")
    try:
        ed25519.Ed25519PublicKey.from_public_bytes(public).verify(value, _signed(words))
    except InvalidSignature as error:
        raise _untrusted(path, trust, "a signature that does not fit its contents") from error


def fingerprint(public: bytes) -> str:
    """Return a public key's fingerprint, as `ssh-keygen -l` prints it."""
    digest = hashlib.sha256(_string(_KIND) + _string(public)).digest()
    return "SHA256:" + base64.b64encode(digest).decode().rstrip("=")


def _string(data: bytes) -> bytes:
    """Return bytes as SSH writes them: a length of 4 bytes, then the bytes."""
    return struct.pack(">I", len(data)) + data


def _signed(words: bytes) -> bytes:
    """Return what is signed for a bundle's first words."""
    digest = hashlib.sha512(words).digest()
    return b"SSHSIG" + b"".join(map(_string, (_NAMESPACE, b"", b"sha512", digest)))


def _blob(public: bytes) -> bytes:
    """Return an SSHSIG up to its signature."""
    key = _string(_KIND) + _string(public)
    parts = b"".join(map(_string, (key, _NAMESPACE, b"", b"sha512")))
    return b"SSHSIG" + struct.pack(">I", 1) + parts


def _parsed(path: Path, signature: bytes, trust: Trust) -> tuple[bytes, bytes]:
    """Return a signature's key and value; only the one form that `Signer` writes is taken."""
    try:
        blob = base64.b64decode(signature, validate=True)
    except (binascii.Error, ValueError):
        blob = b""
    at = len(b"SSHSIG") + 4 + 4 + 4 + len(_KIND) + 4
    public, value = blob[at : at + _KEY_BYTES], blob[-_SIGNATURE_BYTES:]
    if blob != _blob(public) + _string(_string(_KIND) + _string(value)):
        raise _untrusted(path, trust, "a signature that cannot be read")
    return public, value


def _public(line: str, path: Path) -> bytes:
    kind, _, rest = line.strip().partition(" ")
    try:
        blob = base64.b64decode(rest.partition(" ")[0], validate=True)
    except (binascii.Error, ValueError):
        blob = b""
    start = _string(_KIND) + struct.pack(">I", _KEY_BYTES)
    if kind != _KIND.decode() or blob[: len(start)] != start or (
        len(blob) != len(start) + _KEY_BYTES
    ):  # fmt: skip
        raise _no_key(path, "a public key, ssh-ed25519 … , in each line")
    return blob[len(start) :]


def _read(path: Path, what: str) -> bytes:
    try:
        return read_bytes(path, _LARGEST_FILE)
    except BadFile as error:
        raise BadInput(what, error.got, "check the path") from error
    except OSError as error:
        raise BadInput(what, f"{error.strerror or error} ({path})", "check the path") from error


def _write_new(path: Path, data: bytes, mode: int) -> None:
    """Write a file that must not exist yet, with its mode from the first moment."""
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    except FileExistsError as error:
        raise BadInput("a free name for a new key", f"{path}, which exists",
                       "name another: a key is never replaced") from error  # fmt: skip
    except OSError as error:
        raise not_written(path, error, "choose another place") from error
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        path.unlink(missing_ok=True)
        raise not_written(path, error, "choose another place") from error


def _no_key(path: Path, needed: str) -> BadInput:
    return BadInput(needed, f"another in {path}", "make one with: taxel bundle --new-key FILE")


def _untrusted(path: Path, trust: Trust, got: str) -> BadBundle:
    return BadBundle(
        f"{path} to be signed by a key of {trust.source}", got,
        "ask whoever sent it, or sign it yourself with taxel bundle --sign if you trust it",
    )  # fmt: skip


def _pyca() -> tuple[Any, Any]:
    try:
        from cryptography.hazmat.primitives import serialization
        from cryptography.hazmat.primitives.asymmetric import ed25519
    except ModuleNotFoundError as error:
        raise MissingExtra("cryptography", "sign", "signatures of bundles") from error
    return serialization, ed25519
