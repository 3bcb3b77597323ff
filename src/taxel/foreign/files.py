"""Open and read a file that somebody else wrote: plain files only, and never more than is allowed.

A pipe in a file's place would wait for ever, a device would never end, and a sparse file says
nothing of its size on the disk. Every reader of foreign files begins here. Knows nothing about
what the files mean.

Background of our choices: docs/decisions/0033.
"""

from __future__ import annotations

import hashlib
import os
import stat
from pathlib import Path
from typing import BinaryIO

from taxel.errors import BadFile
from taxel.plain_text import number_of

MIB = 2**20
GIB = 2**30
_BLOCK = MIB
_LARGEST_TENSORS, _LARGEST_TENSOR_HEAD = 1024 * MIB, 16 * MIB
"""Of a .safetensors file. Source: our choice."""
_FLAGS = (
    os.O_RDONLY
    | getattr(os, "O_NONBLOCK", 0)  # a pipe is opened without a writer, to be refused
    | getattr(os, "O_CLOEXEC", 0)
    | getattr(os, "O_NOCTTY", 0)
    | getattr(os, "O_BINARY", 0)
)


def open_file(path: Path) -> BinaryIO:
    """Open a plain file to read; nothing else is even waited for.

    Raises:
        BadFile: It is a folder, a pipe, a device or a socket, or its name cannot be one.
        OSError: It is not there, or may not be read.
    """
    try:
        _refuse_others(os.stat(path), path)
        number = os.open(path, _FLAGS)
    except BadFile:
        raise
    except ValueError as error:
        raise BadFile("a file's name", repr(str(path)), "correct it") from error
    try:
        _refuse_others(os.fstat(number), path)
        return os.fdopen(number, "rb")
    except BaseException:
        os.close(number)
        raise


def size_of(file: BinaryIO) -> int:
    """Return an open file's size, bytes; its place stays as it is."""
    place = file.tell()
    size = file.seek(0, os.SEEK_END)
    file.seek(place)
    return size


def read_bytes(path: Path, most: int) -> bytes:
    """Return a file's content.

    Args:
        path: The file.
        most: Bytes that it may have.

    Raises:
        BadFile: It is no plain file, or larger.
        OSError: It is not there, or may not be read.
    """
    with open_file(path) as file:
        size = size_of(file)
        refuse_larger(path, size, most)
        content = file.read(size + 1)  # one more: it may grow meanwhile, and /proc says 0
        while len(content) > size and len(content) <= most and (more := file.read(_BLOCK)):
            content += more
    refuse_larger(path, len(content), most)
    return content


def read_text(path: Path, most: int) -> str:
    """Return the content of a file of UTF-8.

    Args:
        path: The file.
        most: Bytes that it may have.

    Raises:
        BadFile: It is no plain file, larger, or in another encoding.
        OSError: It is not there, or may not be read.
    """
    content = read_bytes(path, most)
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise BadFile(
            "text in UTF-8", f"the byte 0x{content[error.start]:02x} at {error.start} in {path}",
            "save it as UTF-8",
        ) from error  # fmt: skip


def check_tensors(path: Path) -> None:
    """Refuse a file of tensors (.safetensors) that its library had better not open.

    Raises:
        BadFile: It is no plain file, larger than 1 GiB, or with a head of more than 16 MiB.
        OSError: It is not there, or may not be read.
    """
    with open_file(path) as file:
        refuse_larger(path, size_of(file), _LARGEST_TENSORS)
        head = int.from_bytes(file.read(8), "little")
    if head > _LARGEST_TENSOR_HEAD:
        raise BadFile(
            "a file of tensors", f"{path} with a head of {in_words(head)}", "make it anew"
        )


def sha256_of(path: Path, most: int) -> str:
    """Return the SHA-256 of a file, hexadecimal, read block by block.

    Args:
        path: The file.
        most: Bytes that it may have.

    Raises:
        BadFile: It is no plain file, or larger.
        OSError: It is not there, or may not be read.
    """
    with open_file(path) as file:
        refuse_larger(path, size_of(file), most)
        return sha256_of_rest(file)


def sha256_of_rest(file: BinaryIO) -> str:
    """Return the SHA-256 of what follows in an open file, hexadecimal, read block by block."""
    whole = hashlib.sha256()
    while block := file.read(_BLOCK):
        whole.update(block)
    return whole.hexdigest()


def refuse_larger(path: Path, size: int, most: int) -> None:
    """Refuse a size above what is allowed, both in bytes.

    Raises:
        BadFile: It is larger.
    """
    if size > most:
        raise BadFile(
            f"a file of at most {in_words(most)}", f"{path} of {in_words(size)}",
            "check that it is the file that you mean",
        )  # fmt: skip


def in_words(size: int) -> str:
    """Return bytes as a person reads them."""
    return f"{size / MIB:,.1f} MiB" if size >= MIB else number_of(size, "byte", ",")


def _refuse_others(found: os.stat_result, path: Path) -> None:
    if stat.S_ISREG(found.st_mode):
        return
    kinds = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}
    kind = kinds.get(stat.S_IFMT(found.st_mode), "a device")
    raise BadFile("a plain file", f"{kind} at {path}", "name a file")
