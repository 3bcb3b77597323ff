"""The command `taxel`: finds the verb, runs it, and turns a known error into one plain line.

Each verb is a dataclass in a file of its own, whose fields are its options
(read by tyro) and whose `run` does the work. Only the chosen verb is imported,
so that `taxel --help` is quick and the live path stays small.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from typing import Protocol

from taxel import __version__
from taxel.errors import TaxelError


class Verb(Protocol):
    """What every verb's dataclass offers."""

    def run(self) -> None:
        """Do the work; raise a `TaxelError` for input that cannot be used."""
        ...


def _simulate() -> type[Verb]:
    from taxel.cli.simulate import Simulate

    return Simulate


VERBS: dict[str, tuple[str, Callable[[], type[Verb]]]] = {
    "simulate": ("write recordings of a simulated sensor", _simulate),
}
"""Verb → (one line of help, how to get its dataclass)."""


def usage() -> str:
    """Return the text of `taxel --help`."""
    width = max(map(len, VERBS))
    lines = [f"  {verb:<{width}}  {text}" for verb, (text, _) in VERBS.items()]
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
    import tyro

    _, load = VERBS[words[0]]
    try:
        command = tyro.cli(load(), prog=f"taxel {words[0]}", args=words[1:])
        command.run()
    except TaxelError as error:
        _fail(str(error))
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except KeyboardInterrupt:
        print("stopped.", file=sys.stderr)
        sys.exit(130)


def _fail(line: str) -> None:
    print(f"taxel: {' '.join(line.split())}", file=sys.stderr)
    sys.exit(2)
