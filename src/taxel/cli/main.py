"""The command `taxel`: finds the verb, runs it, and turns a known error into one plain line.

Each verb is a dataclass in a file of its own, whose fields are its options
(read by tyro) and whose `run` does the work. Only the chosen verb is imported,
so that `taxel --help` is quick and the live path stays small.
"""

from __future__ import annotations

import os
import sys

# One thread for each engine, before any is imported: small networks gain nothing from a
# second, and two waiting OpenMP threads collapse on a busy machine (docs/decisions/0002).
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

from collections.abc import Sequence
from contextlib import redirect_stderr
from importlib import import_module
from io import BytesIO, TextIOWrapper
from keyword import iskeyword
from traceback import format_exception
from types import TracebackType
from typing import Protocol

from taxel import __version__
from taxel.errors import TaxelError
from taxel.plain_text import visible_line, without_controls


class Verb(Protocol):
    """What every verb's dataclass offers."""

    def run(self) -> None:
        """Do the work; raise a `TaxelError` for input that cannot be used."""
        ...


VERBS = {
    "demo": "see the TENG hand work end to end, without hardware",
    "find": "list boards and cameras by serial number",
    "doctor": "say what this machine lacks for live work",
    "flash": "write the firmware to a board",
    "calibrate": "known forces to curves, and what a sensor array is worth",
    "simulate": "write recordings of a simulated sensor",
    "record": "record a source to an MCAP file",
    "recover": "save what is sound in a damaged or unfinished recording",
    "import": "turn tables of values, or a public data set, into recordings",
    "info": "say what a recording or a folder of them holds",
    "view": "look at raw touch, without any model",
    "label": "label intervals of long recordings; correct when a grasp turned unstable",
    "audit": "find leaks in recordings or in a split, before a reviewer does",
    "models": "list models and recipes, with their parameter counts",
    "train": "train a recogniser on recordings",
    "evaluate": "print a published table, or cross-validate on recordings",
    "compare": "test whether one run is better than another",
    "sweep": "how accuracy falls with noise, faults and weather",
    "report": "one page of runs: data, splits, audit, tables, commands",
    "bundle": "turn a trained run into the one file that runs live",
    "adapt": "bring a model to a new session, pad, class or correction",
    "live": "tell what is in the hand, live",
    "bench": "measure taxel's figures beside their goals",
}
"""Verb → one line of help; its dataclass is that of its name in the module of its name."""


def usage() -> str:
    """Return the text of `taxel --help`."""
    width = max(map(len, VERBS))
    lines = [f"  {verb:<{width}}  {text}" for verb, text in VERBS.items()]
    return "\n".join(
        [
            f"taxel {__version__}: raw touch to a decision in real time",
            "",
            "usage: taxel VERB [OPTIONS]     each verb has its own --help",
            "",
            *lines,
            "",
            "No hardware? Start with: taxel demo",
        ]
    )


def load_verb(name: str) -> type[Verb]:
    """Return a verb's dataclass; only its module is imported."""
    module = import_module(f"taxel.cli.{name}_" if iskeyword(name) else f"taxel.cli.{name}")
    verb: type[Verb] = getattr(module, name.capitalize())
    return verb


def main(argv: Sequence[str] | None = None) -> None:
    """Run one verb; exit code 0 when done, 2 on bad input, 130 when interrupted."""
    words = list(sys.argv[1:] if argv is None else argv)
    if not words or words[0] in ("-h", "--help"):
        print(usage())
        sys.exit(0 if words else 2)
    if words[0] == "--version":
        print(__version__)
        return
    if words[0] not in VERBS:
        _fail(f"needed one of the verbs {', '.join(VERBS)}; got {words[0]!r}; run: taxel --help.")
    sys.excepthook = _crash
    try:
        _parsed(words[0], words[1:]).run()
    except TaxelError as error:
        _fail(str(error))
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        _fail(
            f"needed a place that can be read or written; got {error.strerror or error} "
            f"({error.filename or 'no file named'}); check the path and the disk."
        )
    except KeyboardInterrupt:
        print("stopped.", file=sys.stderr)
        sys.exit(130)


def _parsed(verb: str, words: list[str]) -> Verb:
    """Return the verb with its options; what tyro says of wrong ones may quote any word."""
    import tyro

    said = TextIOWrapper(BytesIO(), encoding="utf-8", errors="backslashreplace")
    try:
        with redirect_stderr(said):
            return tyro.cli(load_verb(verb), prog=f"taxel {verb}", args=words)
    finally:
        said.seek(0)
        sys.stderr.write(without_controls(said.read()))


def _crash(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Print a traceback of ours, whose message may quote foreign text."""
    sys.stderr.write(without_controls("".join(format_exception(kind, error, trace))))


def _fail(line: str) -> None:
    print(f"taxel: {visible_line(' '.join(line.split()))}", file=sys.stderr)
    sys.exit(2)


if __name__ == "__main__":
    main()
