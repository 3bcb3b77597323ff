"""Parts of an address: its host, and options `?key=value&key=value`.

Knows nothing about what they mean.
"""

from __future__ import annotations

from collections.abc import Mapping
from urllib.parse import parse_qsl, quote

from taxel.errors import BadInput

_PLAIN = "/:,+@[] "
"""What stands in an option as it is, beside letters and digits."""


def bracketed(host: str) -> str:
    """Return a host as an address with a port has it: IPv6 in brackets, [::1]."""
    return f"[{host}]" if ":" in host else host


def read_options(query: str, wrong: type[BadInput] = BadInput) -> dict[str, str]:
    """Return an address's options, each once.

    Args:
        query: What follows the question mark; may be empty. A plus sign is itself: paths have it.
        wrong: What is raised.

    Raises:
        BadInput: It is no list of options, or names one twice.
    """
    try:
        plain = query.replace("+", "%2B")  # which a form of the web would make a blank
        pairs = parse_qsl(plain, keep_blank_values=True, strict_parsing=bool(query))
    except ValueError as error:
        raise wrong("options as key=value&key=value", repr(query), "mend the address") from error
    options = dict(pairs)
    if len(options) < len(pairs):
        raise wrong("each option once", repr(query), "mend the address")
    return options


def write_options(options: Mapping[str, str]) -> str:
    """Return options as what follows the question mark, so that `read_options` gives them again."""
    parts = [f"{quote(key)}={quote(value, safe=_PLAIN)}" for key, value in options.items()]
    return "&".join(parts)
