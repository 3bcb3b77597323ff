"""Where a page of a verb listens, as it is typed behind `--page`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Annotated

import tyro

from taxel.errors import BadInput

LOCAL_ADDRESS = "127.0.0.1:0"
"""Where a page listens unless told: this machine alone, at a free port."""
PageAddress = Annotated[str | None, tyro.conf.arg(metavar="[HOST:PORT]")]
"""Type of an option `--page`: an address, or `LOCAL_ADDRESS` where none was typed behind it."""
_MEANT = re.compile(r"(?!.*://)([0-9.]+(:\S*)?|\S*:[^\s./\\]*)")
"""What stands for an address, also for one that is wrong; a bundle or a source does not: a bundle
ends in .taxel, or comes behind a slash."""


def with_addresses(words: Sequence[str]) -> list[str]:
    """Return words as typed, with `LOCAL_ADDRESS` behind each --page that no address follows.

    So that `--page BUNDLE SOURCE` leaves bundle and source their places.
    """
    found = list[str]()
    for word, following in zip(words, [*words[1:], ""], strict=True):
        found.append(word)
        if word == "--page" and not _MEANT.fullmatch(following):
            found.append(LOCAL_ADDRESS)
    return found


def parse_address(text: str) -> tuple[str, int]:
    """Return host and port of a page's address, HOST:PORT.

    Raises:
        BadInput: It is none.
    """
    host, colon, port = text.rpartition(":")
    if not (host and colon and re.fullmatch(r"[0-9]{1,5}", port) and int(port) < 1 << 16):
        raise BadInput("HOST:PORT for --page", repr(text), "for example 127.0.0.1:8080")
    return host.removeprefix("[").removesuffix("]"), int(port)
