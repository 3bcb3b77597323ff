"""Open a source by its address.

    sim://teng?preset=honest&shape=sphere&speed=max
    sim://cup-pour?force_n=25&runs=3
    serial:///dev/serial/by-id/board-a,/dev/serial/by-id/board-b
    camera:///dev/v4l/by-id/left,/dev/v4l/by-id/right?width=640&height=480&rate_hz=30
    realsense://any?width=640&height=480&rate_hz=30
    replay://runs/session-1.mcap?speed=2
    runs/session-1.mcap                       (the same as replay://)
    runs, replay://runs?speed=max             (a folder: `recordings_of` gives an address for each)

Knows nothing about what is done with the samples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from taxel.clock import Clock, SystemClock
from taxel.errors import BadInput, BadSource, MissingExtra
from taxel.foreign.addresses import read_options, write_options
from taxel.name_order import counting_order
from taxel.recordings.reader import list_recordings
from taxel.sources.contract import Source


def _open_sim(name: str, options: dict[str, str], clock: Clock) -> Source:
    if name not in ("teng", "cup-pour"):
        raise BadSource(
            "a simulator that exists: sim://teng or sim://cup-pour",
            f"sim://{name}",
            "mend the address",
        )
    try:
        if name == "cup-pour":
            from taxel.sources.simulated.pour import SimPour

            return SimPour(options, clock)
        from taxel.sources.simulated.teng import SimTeng
    except ModuleNotFoundError as error:
        raise MissingExtra(error.name or "scipy", "sim", "the simulators") from error

    return SimTeng(options, clock)


def _open_replay(name: str, options: dict[str, str], clock: Clock) -> Source:
    from taxel.sources.replay import Replay

    return Replay(Path(name), options, clock)


def _open_serial(name: str, options: dict[str, str], clock: Clock) -> Source:
    try:
        from taxel.sources.boards.source import SerialBoards
    except ModuleNotFoundError as error:
        raise MissingExtra(error.name or "pyserial", "serial", "boards on a serial port") from error

    return SerialBoards(name, options, clock)


def _open_camera(name: str, options: dict[str, str], _clock: Clock) -> Source:
    try:
        from taxel.sources.cameras.source import Cameras
    except ModuleNotFoundError as error:
        raise MissingExtra(error.name or "cv2", "camera", "tactile cameras") from error

    return Cameras(name, options)


def _open_realsense(name: str, options: dict[str, str], _clock: Clock) -> Source:
    try:
        from taxel.sources.cameras.realsense import RealSense
    except MissingExtra as error:  # its extra brings what any camera needs, too
        raise MissingExtra(error.package, "realsense", "RealSense cameras") from error

    return RealSense(name, options)


SCHEMES: dict[str, Callable[[str, dict[str, str], Clock], Source]] = {
    "sim": _open_sim,
    "replay": _open_replay,
    "serial": _open_serial,
    "camera": _open_camera,
    "realsense": _open_realsense,
}
"""Scheme → how to open it: (what follows ://, options, clock) → source."""

_HURRIED = ("sim", "replay")
"""Schemes that can run faster than the world does."""


def open_source(url: str | Path, clock: Clock | None = None) -> Source:
    """Open a source; use it in a `with` block.

    Args:
        url: An address as above, or the file of a recording. What follows :// is taken as it
            stands, up to the first question mark; a recording's name may hold question marks.
        clock: The host's clock unless given.

    Raises:
        BadSource: The address is wrong, or an option of it.
        BadRecording: A recording to replay cannot be read.
        MissingExtra: The source needs a package that is not installed.
    """
    scheme, name, options = _split(str(url))
    return SCHEMES[scheme](name, options, clock or SystemClock())


def recordings_of(url: str) -> list[str]:
    """Return the address of each recording where a folder is to be replayed, as people count their
    names; else the address as it is.

    Raises:
        BadSource: The address is wrong.
        BadRecording: The folder holds no recording, or an unfinished one.
    """
    scheme, name, options = _split(url)
    if scheme != "replay" or not Path(name).is_dir():
        return [url]
    query = write_options(options)
    return [f"replay://{path}?{query}" if query else str(path) for path in _in_order(Path(name))]


def is_replay(url: str) -> bool:
    """Return whether an address replays recordings, whose reading always begins at their start.

    Raises:
        BadSource: The address is wrong.
    """
    return _split(url)[0] == "replay"


def replayed_files(url: str) -> list[Path]:
    """Return the recordings that an address replays, as `recordings_of`; none for another source.

    Raises:
        BadSource: The address is wrong.
        BadRecording: The folder holds no recording, or an unfinished one.
    """
    scheme, name, _ = _split(url)
    return _in_order(Path(name)) if scheme == "replay" else []


def _in_order(path: Path) -> list[Path]:
    """Return a data set's recordings as they are replayed: as `order_in_time` does trials."""
    return sorted(list_recordings(path), key=lambda file: counting_order(file.name))


def refuse_replayed(path: Path, urls: Iterable[str]) -> None:
    """Refuse to record over a recording that is replayed: what it holds beyond would be lost.

    Args:
        path: Where is to be recorded.
        urls: The sources of what is to be recorded.

    Raises:
        BadInput: One of them is that very file.
        BadSource: An address is wrong.
    """
    for url in urls:
        scheme, name, _ = _split(url)
        replayed = scheme == "replay" and path.exists() and Path(name).exists()
        if replayed and path.samefile(name):
            raise BadInput(
                "another file to record to", f"{path}, which is replayed", "name a new file"
            )


def at_full_speed(url: str) -> str:
    """Return the address with speed=max, where it names no speed and is no real device's.

    Raises:
        BadSource: The address is wrong.
    """
    scheme, name, options = _split(url)
    if scheme not in _HURRIED or "speed" in options:
        return url
    return f"{scheme}://{name}?{write_options({**options, 'speed': 'max'})}"


def options_of(url: str) -> dict[str, str]:
    """Return an address's options.

    Raises:
        BadSource: It is no address.
    """
    return _split(url)[2]


def _split(url: str) -> tuple[str, str, dict[str, str]]:
    """Return scheme, what follows it, and the options.

    Raises:
        BadSource: It is no address.
    """
    scheme, found, rest = url.partition("://")
    if not found:
        if url and Path(url).exists():
            return "replay", url, {}
        scheme, rest = "replay", url
    name, _, query = rest.partition("?")
    if scheme == "replay" and "?" in rest:  # a name may hold question marks
        name, query = _split_name(rest)
    folder = scheme == "replay" and Path(name).is_dir()
    if scheme not in SCHEMES or not name or not (found or name.endswith(".mcap") or folder):
        known = ", ".join(f"{scheme}://" for scheme in SCHEMES)
        absent = not found and not Path(name).exists()
        raise BadSource(
            f"an address that starts with one of {known}, or a recording's file",
            f"{url!r}, and there is no such file or folder" if absent else repr(url),
            "check the path, or try sim://teng" if absent else "try sim://teng",
        )
    return scheme, name, read_options(query, BadSource)


def _split_name(rest: str) -> tuple[str, str]:
    """Return a recording's name, the longest that exists, and the options behind it."""
    cuts = [at for at, sign in enumerate(rest) if sign == "?"]
    for at in (len(rest), *reversed(cuts)):
        if Path(rest[:at]).exists():
            return rest[:at], rest[at + 1 :]
    return rest[: cuts[0]], rest[cuts[0] + 1 :]
