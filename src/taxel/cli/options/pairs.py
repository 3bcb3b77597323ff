"""Options of the form --label shape=sphere material=glass, once or several times.

Knows nothing about what the pairs mean.
"""

from __future__ import annotations

from typing import Annotated

import tyro

from taxel.errors import BadInput

Pairs = Annotated[tuple[tuple[str, ...], ...], tyro.conf.UseAppendAction]
"""What tyro reads: a group of words for each time the option was given."""


def parse_pairs(pairs: tuple[tuple[str, ...], ...], option: str) -> dict[str, str]:
    """Return the pairs by name.

    Args:
        pairs: What tyro read.
        option: The option's name, for the message.

    Raises:
        BadInput: A word is not NAME=VALUE, or a name comes twice.
    """
    found: dict[str, str] = {}
    for word in (word for group in pairs for word in group):
        name, equals, value = word.partition("=")
        if not (name and equals and value):
            raise BadInput(f"{option} NAME=VALUE", repr(word), "write it as in shape=sphere")
        if not _is_text(word):
            raise BadInput(f"text in UTF-8 with {option}", repr(word), "type it again")
        if name in found:
            raise BadInput(f"each {option} once", f"{name!r} twice", "leave one of them out")
        found[name] = value
    return found


def _is_text(word: str) -> bool:
    """Return whether a word is text; bytes of a shell that are none come as half surrogates."""
    try:
        word.encode()
    except UnicodeEncodeError:
        return False
    return True
