"""Open a source by its address.

    sim://teng?preset=honest&shape=sphere&speed=max
    replay://runs/session-1.mcap?speed=2
    runs/session-1.mcap                       (the same as replay://)

Knows nothing about what is done with the samples.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from urllib.parse import parse_qsl, urlsplit

from taxel.clock import Clock, SystemClock
from taxel.errors import BadSource
from taxel.sources.contract import Source


def _open_sim(name: str, options: dict[str, str], clock: Clock) -> Source:
    from taxel.sources.sim_teng import SimTeng

    if name != "teng":
        raise BadSource("a simulator: sim://teng", f"sim://{name}", "see docs/reference/sources.md")
    return SimTeng(options, clock)


def _open_replay(name: str, options: dict[str, str], clock: Clock) -> Source:
    from taxel.sources.replay import Replay

    return Replay(Path(name), options, clock)


SCHEMES: dict[str, Callable[[str, dict[str, str], Clock], Source]] = {
    "sim": _open_sim,
    "replay": _open_replay,
}
"""Scheme → how to open it: (what follows ://, options, clock) → source."""


def open_source(url: str, clock: Clock | None = None) -> Source:
    """Open a source; use it in a `with` block.

    Args:
        url: An address as above, or the file of a recording.
        clock: The host's clock unless given.

    Raises:
        BadSource: The address is wrong, or an option of it.
        BadRecording: A recording to replay cannot be read.
    """
    clock = clock or SystemClock()
    if "://" not in url:
        if url.endswith(".mcap") or Path(url).exists():
            return _open_replay(url, {}, clock)
        raise _unknown(url)
    parts = urlsplit(url)
    if parts.scheme not in SCHEMES:
        raise _unknown(url)
    try:
        pairs = parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query))
    except ValueError as error:
        raise BadSource(
            "options as key=value&key=value", repr(parts.query), "mend the address"
        ) from error
    return SCHEMES[parts.scheme](parts.netloc + parts.path, dict(pairs), clock)


def read_speed(options: dict[str, str]) -> float:
    """Take "speed" out of the options: a factor of real time, infinity for "max".

    Raises:
        BadSource: It is no number above 0.
    """
    text = options.pop("speed", "1")
    try:
        speed = float("inf") if text == "max" else float(text)
    except ValueError:
        speed = 0.0
    if not speed > 0:
        raise BadSource("speed as a number above 0, or max", repr(text), "for example speed=2")
    return speed


def _unknown(url: str) -> BadSource:
    known = ", ".join(f"{scheme}://" for scheme in SCHEMES)
    return BadSource(
        f"an address that starts with one of {known}, or a recording's file",
        repr(url),
        "for example sim://teng",
    )
