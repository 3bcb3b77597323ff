"""The one place where text and numbers of a bundle become C: nothing else of it gets there.

A name becomes a string of known characters; a number is a whole number in its range; a digest is
hexadecimal. What cannot be such is refused. Knows nothing about networks.

Background of our choices: docs/decisions/0021.
"""

from __future__ import annotations

import operator
import re
import string
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadBundle

_KNOWN = frozenset(string.ascii_letters + string.digits + " _+-.,:;=()[]{}/#@&!~'<>|^$*")
"""Characters of a C string that mean themselves. Without " and \\, which end or change it, ?, of
which two begin a trigraph, and %, which a sketch that prints may read as a format."""
_LONGEST = 64
"""Characters of a name; flash is small. Source: our choice."""
_SOFTWARE = re.compile(r"taxel [0-9A-Za-z.+-]{1,40}")
_DIGEST = re.compile(r"[0-9a-f]{64}")
_NO_NUMBERS = "whole numbers in the C of a network"


def c_strings(names: Sequence[str], what: str) -> str:
    """Return names as C strings, comma after comma.

    Printable characters that C does not take as themselves become "_".

    Args:
        names: At least one.
        what: What they are, for messages.

    Raises:
        BadBundle: A name is empty, too long, holds characters that cannot be printed, or two
            are no longer different.
    """
    for name in names:
        if not name or len(name) > _LONGEST or not name.isprintable():
            raise BadBundle(
                f"{what} of 1 to {_LONGEST} printable characters", repr(name)[:80],
                "rename it, and train again",
            )  # fmt: skip
    plain = ["".join(sign if sign in _KNOWN else "_" for sign in name) for name in names]
    if len(set(plain)) < len(plain):
        twice = next(name for name, own in zip(names, plain, strict=True) if plain.count(own) > 1)
        raise BadBundle(
            f"{what} that stay apart in plain ASCII", f"{twice!r} and another like it",
            "rename one of them, and train again",
        )  # fmt: skip
    return ", ".join(f'"{name}"' for name in plain)


def c_origin(digest: str, software: str) -> str:
    """Return a C comment's text on the data and the software a network was trained with.

    Args:
        digest: SHA-256 of its data, hexadecimal.
        software: Such as "taxel 0.1.0".

    Raises:
        BadBundle: They are of another form.
    """
    if not _DIGEST.fullmatch(digest):
        raise BadBundle("a digest of 64 hexadecimal digits", repr(digest)[:80], "train it again")
    if not _SOFTWARE.fullmatch(software):
        raise BadBundle("a version as taxel writes it", repr(software)[:80], "train it again")
    return f"data {digest[:12]} with {software}"


def c_number(value: Any, low: int, high: int, suffix: str = "") -> str:
    """Return a whole number as C; one below zero stands in brackets.

    Args:
        value: An int, or NumPy's.
        low: The least that it may be.
        high: The most.
        suffix: C's letters behind it, such as "UL".

    Raises:
        BadBundle: It is no whole number, or out of its range.
    """
    try:
        number = operator.index(value)
    except TypeError as error:
        raise BadBundle(_NO_NUMBERS, repr(value)[:80], "write the bundle again") from error
    if isinstance(value, bool) or not low <= number <= high:
        raise BadBundle(f"a whole number from {low} to {high}", repr(value)[:80], "train it again")
    return f"({number})" if number < 0 else f"{number}{suffix}"


def c_numbers(values: NDArray[Any]) -> list[str]:
    """Return whole numbers of an array of any shape as C, row by row.

    Raises:
        BadBundle: They are no whole numbers.
    """
    flat = np.asarray(values).ravel()
    if flat.dtype.kind not in "iu":
        raise BadBundle(_NO_NUMBERS, f"{flat.dtype}", "write the bundle again")
    return [str(int(value)) for value in flat.tolist()]
