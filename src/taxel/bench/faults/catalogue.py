"""The faults that `taxel bench faults` brings about, each with the rows that measure it.

A name may hold `*`. Knows nothing about how rows are measured.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One fault, as a line of the page of faults."""

    what: str
    """What goes wrong."""
    found: tuple[str, ...] = ()
    """Rows that say how soon it is found; none where there is nothing to find."""
    lost: tuple[str, ...] = ()
    """Rows that say what is lost or harmed."""
    shown: str
    """What a person sees."""


_STOP = "STOP, an alarm that latches"

FAULTS: tuple[Fault, ...] = (
    Fault(
        what="monitor killed while armed",
        found=("monitor killed*",),
        shown=_STOP,
    ),
    Fault(what="monitor stopped while armed", found=("monitor stopped*",), shown=_STOP),
    Fault(what="monitor hung while armed", found=("monitor hung*",), shown=_STOP),
    Fault(
        what="model gives NaN",
        found=("model gives NaN: UNKNOWN within",),
        lost=("model gives NaN: ever called STABLE after that",),
        shown="UNKNOWN",
    ),
    Fault(
        what="monitor lives and decides nothing",
        found=("decisions stop while signs of life go on*",),
        shown=_STOP,
    ),
    Fault(
        what="supervisor stopped for 0.2 to 3 s while armed and raising",
        found=("supervisor stopped for*",),
        lost=("supervisor stopped: the largest step*",),
        shown="an alarm on terminal and page; STOP at its first tick",
    ),
    Fault(
        what="a process stopped and the supervisor killed",
        lost=("a process stopped and the supervisor killed*",),
        shown="a line on the terminal; the page has no connection",
    ),
    Fault(
        what="page stopped for 8 s",
        lost=(
            "page process stopped for 8 s: frames lost*",
            "page process stopped: median time to the alarm*",
        ),
        shown="the page stands still; the station runs on",
    ),
    Fault(
        what="subscriber of the live bus stopped for 8 s",
        lost=(
            "bus subscriber stopped for 8 s: frames lost*",
            "bus subscriber stopped: alarms*",
            "bus subscriber stopped: median time to the alarm*",
        ),
        shown="nothing; the subscriber counts what it missed",
    ),
    Fault(
        what="disk full while recording",
        found=("disk full: an alarm that says so",),
        lost=("disk full: recorded time that recover cannot save",),
        shown="an alarm; the grasp is still watched",
    ),
    Fault(
        what="a camera repeats one image",
        found=("camera frozen: frames until*",),
        shown="UNKNOWN: the camera is frozen",
    ),
    Fault(
        what="a camera sends nothing",
        found=("camera gone: time until*",),
        shown="UNKNOWN: the camera is gone",
    ),
    Fault(
        what="a camera is two frames late",
        found=("one camera 2 frames late: reported",),
        shown="a warning: the camera is late",
    ),
    Fault(
        what="board unplugged and plugged in again",
        lost=("board unplugged and replugged: data again after its return",),
        shown="its values are missing, reconnecting",
    ),
    Fault(
        what="1 in 1,000 bytes of a serial line damaged",
        lost=("1 corrupt byte in 1,000: frames of 4 channels kept",),
        shown="counted as damaged; values missing",
    ),
    Fault(
        what="bursts of up to 16 bits, random damage, noise on a serial line",
        lost=(
            "bursts of up to 16 bits in a frame: accepted",
            "random damage (3 to 20 bytes of a frame): accepted",
            "noise under a well-formed check: accepted",
        ),
        shown="counted as damaged",
    ),
    Fault(
        what="clock of a board 40 ppm off, with USB stalls",
        lost=("clock drift of ±40 ppm with USB stalls: fitted time's bias",),
        shown="nothing: the time is fitted",
    ),
    Fault(
        what="frames of a board sent again, byte for byte",
        lost=("frames sent again byte for byte: counted as new scans",),
        shown="counted as replayed",
    ),
    Fault(
        what="a hello of another boot or board among a board's frames",
        lost=("a hello of another boot or board among the frames: scans lost",),
        shown="counted as foreign",
    ),
    Fault(
        what="64 or 500 connections to the page, held without a request",
        lost=("* connections held without a request: the page is open after",),
        shown="nothing: the page opens",
    ),
    Fault(
        what="a bundle, recording, table, run, folder or pipe made to harm is opened",
        found=("hostile files: slowest refusal by*",),
        lost=(
            "hostile bundles: refused*",
            "hostile recordings: refused*",
            "hostile tables: refused*",
            "hostile runs: refused*",
            "hostile other files*: refused*",
            "hostile files: largest memory*",
            "hostile files: what a verb*",
        ),
        shown="one line: what was needed, what came, how to mend it; exit code 2",
    ),
    Fault(
        what="metadata of a run would become C code",
        lost=("hostile runs whose metadata would become C code: refused*",),
        shown="one line; exit code 2; nothing is written",
    ),
    Fault(
        what="images of 20,000 × 20,000 px, some progressive, in a replay",
        found=("images of another size or progressive in a replay: UNKNOWN*",),
        lost=(
            "images of another size or progressive in a replay: later moments decided",
            "images of another size or progressive in a replay: memory*",
        ),
        shown="UNKNOWN: the image is bad, and what is wrong with it",
    ),
    Fault(
        what="labels and names with markup and terminal escapes",
        lost=(
            "labels with markup and escapes: classes that stay distinct",
            "labels with markup and escapes: raw ESC*",
            "labels with markup and escapes: other characters*",
        ),
        shown="each name literally, escapes as text",
    ),
)
