"""Where a page of a verb listens, as it is typed behind `--page`."""

from __future__ import annotations

import re

from taxel.errors import BadInput

PAGE_ADDRESS = "127.0.0.1:0"
"""Where a page listens unless told: this machine alone, at a free port."""


def page_address(given: tuple[str, ...] | None) -> tuple[str, int]:
    """Return host and port of what stands behind --page: HOST:PORT, or nothing.

    Raises:
        BadInput: It is something else.
    """
    if given and len(given) > 1:
        raise BadInput("one HOST:PORT for --page", " ".join(given), "put --page last")
    return parse_address(given[0] if given else PAGE_ADDRESS)


def parse_address(text: str) -> tuple[str, int]:
    """Return host and port of a page's address, HOST:PORT.

    Raises:
        BadInput: It is none.
    """
    host, colon, port = text.rpartition(":")
    if not (host and colon and re.fullmatch(r"[0-9]{1,5}", port) and int(port) < 1 << 16):
        raise BadInput("HOST:PORT for --page", repr(text), "for example 127.0.0.1:8080")
    return host.removeprefix("[").removesuffix("]"), int(port)
