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

from collections.abc import Callable, Sequence
from typing import Protocol

from taxel import __version__
from taxel.errors import TaxelError


class Verb(Protocol):
    """What every verb's dataclass offers."""

    def run(self) -> None:
        """Do the work; raise a `TaxelError` for input that cannot be used."""
        ...


def _demo() -> type[Verb]:
    from taxel.cli.demo import Demo

    return Demo


def _simulate() -> type[Verb]:
    from taxel.cli.simulate import Simulate

    return Simulate


def _record() -> type[Verb]:
    from taxel.cli.record import Record

    return Record


def _recover() -> type[Verb]:
    from taxel.cli.recover import Recover

    return Recover


def _import() -> type[Verb]:
    from taxel.cli.import_ import Import

    return Import


def _info() -> type[Verb]:
    from taxel.cli.info import Info

    return Info


def _view() -> type[Verb]:
    from taxel.cli.view import View

    return View


def _label() -> type[Verb]:
    from taxel.cli.label import Label

    return Label


def _models() -> type[Verb]:
    from taxel.cli.models import Models

    return Models


def _train() -> type[Verb]:
    from taxel.cli.train import Train

    return Train


def _evaluate() -> type[Verb]:
    from taxel.cli.evaluate import Evaluate

    return Evaluate


def _bundle() -> type[Verb]:
    from taxel.cli.bundle import Bundle

    return Bundle


def _live() -> type[Verb]:
    from taxel.cli.live import Live

    return Live


def _find() -> type[Verb]:
    from taxel.cli.find import Find

    return Find


def _calibrate() -> type[Verb]:
    from taxel.cli.calibrate import Calibrate

    return Calibrate


def _flash() -> type[Verb]:
    from taxel.cli.flash import Flash

    return Flash


def _doctor() -> type[Verb]:
    from taxel.cli.doctor import Doctor

    return Doctor


def _bench() -> type[Verb]:
    from taxel.cli.bench import Bench

    return Bench


VERBS: dict[str, tuple[str, Callable[[], type[Verb]]]] = {
    "demo": ("see the TENG hand work end to end, without hardware", _demo),
    "find": ("list boards and cameras by serial number", _find),
    "doctor": ("say what this machine lacks for live work", _doctor),
    "flash": ("write the firmware to a board", _flash),
    "calibrate": ("known forces to curves, and what a sensor array is worth", _calibrate),
    "simulate": ("write recordings of a simulated sensor", _simulate),
    "record": ("record a source to an MCAP file", _record),
    "recover": ("save what is sound in a damaged or unfinished recording", _recover),
    "import": ("turn tables of values, or a public data set, into recordings", _import),
    "info": ("say what a recording or a folder of them holds", _info),
    "view": ("look at raw touch, without any model", _view),
    "label": ("show and correct when a grasp turned unstable", _label),
    "models": ("list models and recipes, with their parameter counts", _models),
    "train": ("train a recogniser on recordings", _train),
    "evaluate": ("print a published table, or cross-validate on recordings", _evaluate),
    "bundle": ("turn a trained run into the one file that runs live", _bundle),
    "live": ("tell what is in the hand, live", _live),
    "bench": ("measure taxel's figures beside their goals", _bench),
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
    except OSError as error:
        _fail(
            f"needed a place that can be read or written; got {error.strerror or error} "
            f"({error.filename or 'no file named'}); check the path and the disk."
        )
    except KeyboardInterrupt:
        print("stopped.", file=sys.stderr)
        sys.exit(130)


def _fail(line: str) -> None:
    print(f"taxel: {' '.join(line.split())}", file=sys.stderr)
    sys.exit(2)


if __name__ == "__main__":
    main()
