"""The command `taxel`: finds the verb, runs it, and turns a known error into one plain line.

Each verb is a dataclass in a file of its own, whose fields are its options
(read by tyro) and whose `run` does the work. Three verbs, those of `KINDS`, do a job
whose options differ by kind: `taxel simulate cup-pour`; there each kind is such
a dataclass. Only the chosen verb is imported, so that `taxel --help` is quick
and the live path stays small (docs/decisions/0038).
"""

from __future__ import annotations

import os
import sys

# One thread for each engine, before any is imported: small networks gain nothing from a
# second, and two waiting OpenMP threads collapse on a busy machine (docs/decisions/0002).
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
# What OpenCV warns of, such as a damaged image, is said in our own line.
os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")

from collections.abc import Sequence
from difflib import get_close_matches
from importlib import import_module
from keyword import iskeyword
from traceback import format_exception
from types import TracebackType
from typing import Protocol

from taxel import __version__
from taxel.cli.extras import missing_extra
from taxel.cli.old_spellings import refuse_old
from taxel.cli.options.rules import check_rules
from taxel.cli.parsing import parse
from taxel.cli.trial_verbs import refuse_options_of_arrays, verb_for_data
from taxel.errors import BadInput, MissingExtra, TaxelError
from taxel.plain_text import visible_line, without_controls


class Verb(Protocol):
    """What every verb's dataclass offers."""

    def run(self) -> None:
        """Do the work; raise a `TaxelError` for input that cannot be used."""
        ...


SECTIONS: dict[str, dict[str, str]] = {
    "start here": {
        "demo": "run the TENG hand end to end, without hardware",
    },
    "devices": {
        "find": "list boards and cameras by serial number",
        "doctor": "check what this machine lacks for live work",
        "flash": "write the firmware to a board",
        "calibrate": "fit volts to newtons from known forces; measure errors and wear",
        "power": "estimate the energy that TENG pads could harvest",
    },
    "recordings": {
        "simulate": "write recordings of a simulated sensor",
        "record": "record a source to an MCAP file",
        "hand": "move the TENG hand's fingers and print its motor currents",
        "collect": "let the hand grasp, label and record a list of objects",
        "recover": "save the intact part of a damaged or unfinished recording",
        "import": "turn tables of values, files of arrays, or a public data set, into recordings",
        "export": "write recordings for LeRobot, ROS 2, tables or video players",
        "info": "print what a recording, a folder of recordings or a bundle holds",
        "view": "look at raw touch, without any model",
        "label": "label intervals of long recordings; correct when a grasp turned unstable",
        "audit": "find data leaks in recordings or in a split",
        "split": "print what a split holds out, without training; write it as a table",
    },
    "training": {
        "models": "list models and recipes, with their parameter counts",
        "weights": "list image networks' weights, or fetch published ones",
        "train": "train a recogniser on recordings of an array",
        "tune": "search for a recipe's best settings by nested cross-validation",
        "train-monitor": "train a grasp monitor on recordings of tactile cameras",
        "train-trials": "train a recogniser on camera trials, videos with one label each",
        "train-slip": "train a slip warning on simulated cups",
        "train-backbone": "train an image network end to end on tactile cameras",
        "distil": "train an image network to imitate a trained one, without labels",
        "train-encoder": "pretrain the touch encoder on videos of touch, without labels",
    },
    "evaluation": {
        "evaluate": "cross-validate a recipe, or score a bundle, on recordings",
        "learning-curve": "measure accuracy against the amount of training data",
        "evaluate-trials": "cross-validate a recogniser of camera trials, or score its bundle",
        "reproduce": "print a published table or study, with our figures beside it",
        "compare": "test whether one run is better than another",
        "sweep": "measure how accuracy falls with noise, faults and other conditions",
        "report": "write one page about runs: data, splits, audit, tables, commands",
    },
    "live": {
        "bundle": "turn a trained run into the one file that runs live",
        "adapt": "adapt a model to a new session, pad or class, or to corrections",
        "live": "predict live what is in the hand, or whether it slips",
        "fleet": "show the live stations that report to an MQTT broker",
    },
    "taxel itself": {
        "bench": "measure taxel's own performance beside its goals",
    },
}
"""Heading → its verbs, each with a line of help. The heading names the folder of their modules, and
a verb's dataclass is that of its name in the module of its name."""
_AT_THE_ROOT = ("start here", "taxel itself")
"""Sections whose modules have no folder."""

_TRAINS = {
    "demo", "bench", "audit", "split", "adapt", "bundle",
    *SECTIONS["training"], *SECTIONS["evaluation"],
}  # fmt: skip
"""Verbs that need the extra `train`; of `bundle`, keys and signatures do without it."""

VERBS = {verb: text for own in SECTIONS.values() for verb, text in own.items()}
"""Verb → its line of help."""

KINDS = {
    "simulate": {
        "teng": "the TENG hand: one recording per session",
        "cup-pour": "two tactile cameras hold a cup that is filled: one recording per pour",
    },
    "export": {
        "lerobot": "a LeRobot data set, version 3.0: touch and JPEG images, labels as tasks",
        "ros2": "ROS 2 bags, and the package of the touch message",
        "parquet": "tables of scans, frames and marks, nothing resampled",
        "video": "one video per camera: its own JPEG, or H.264 for browsers",
        "foxglove": "a layout for Foxglove and Lichtblick: named plots, images, map, states",
    },
    "reproduce": {
        "table-4-1": "Table 4.1 of the TENG thesis: 2D and 1D CNN, simulated hand",
        "teng-models": "every model under random windows and with groups held out",
        "teng-cleaning": "the effect of denoising, segmentation and augmentation",
        "unknown-objects": "how well objects that were never trained on are rejected",
        "transition-tables": "Tables 1 to 3 of the grasp-transition paper",
        "grasp-warnings": "lead times and false alarms on unseen cups",
        "precisions": "time and accuracy of a backbone by engine and number format",
    },
}
"""Verb → its kinds, each with a line of help; the dataclass is in the verb's package."""


def usage() -> str:
    """Return the text of `taxel --help`."""
    width = max(map(len, VERBS))
    lines = []
    for heading, verbs in SECTIONS.items():
        lines += ["", f"{heading}:"]
        lines += [f"  {verb:<{width}}  {text}" for verb, text in verbs.items()]
    return "\n".join(
        [
            f"taxel {__version__}: robotic touch, from the sensor to a decision in real time",
            "",
            "usage: taxel VERB [OPTIONS]     each verb has its own --help",
            *lines,
            "",
            "No hardware? Start with: taxel demo",
        ]
    )


def kinds_usage(verb: str) -> str:
    """Return the help of a verb that has kinds."""
    width = max(map(len, KINDS[verb]))
    lines = [f"  {kind:<{width}}  {text}" for kind, text in KINDS[verb].items()]
    usage = f"usage: taxel {verb} KIND [OPTIONS]     each kind has its own --help"
    return "\n".join([f"taxel {verb}: {VERBS[verb]}", "", usage, "", *lines])


def commands() -> list[str]:
    """Return all that can be run: each verb, or where a verb has kinds each "verb kind"."""
    return [
        command
        for verb in VERBS
        for command in [f"{verb} {kind}" for kind in KINDS.get(verb, ())] or [verb]
    ]


def load_verb(command: str) -> type[Verb]:
    """Return the dataclass of a verb, or of a "verb kind"; only its module is imported."""
    verb, _, kind = command.partition(" ")
    name = (kind or verb).replace("-", "_")
    section = next(heading for heading, verbs in SECTIONS.items() if verb in verbs)
    folder = "" if section in _AT_THE_ROOT else section
    package = ".".join(filter(None, ("taxel.cli", folder, kind and verb)))
    module = import_module(f"{package}.{name}_" if iskeyword(name) else f"{package}.{name}")
    found: type[Verb] = getattr(module, "".join(part.capitalize() for part in name.split("_")))
    return found


def split_command(words: Sequence[str]) -> tuple[str, list[str]]:
    """Return which command the words name, as `commands` spells it, and the words behind it.

    Raises:
        BadInput: They name none.
    """
    verb, *rest = words
    if verb not in VERBS:
        near = get_close_matches(verb, VERBS, 1)
        meant = f"perhaps {near[0]} was meant; " if near else ""
        raise BadInput("a verb of taxel", repr(verb), f"{meant}run: taxel --help")
    if verb not in KINDS:
        return verb_for_data(verb, rest), rest
    kind = rest[0] if rest else "nothing"
    if kind not in KINDS[verb]:
        raise BadInput(
            f"taxel {verb} with one of {', '.join(KINDS[verb])}", visible_line(kind),
            f"run: taxel {verb} --help",
        )  # fmt: skip
    return f"{verb} {kind}", rest[1:]


def main(argv: Sequence[str] | None = None) -> None:
    """Run one verb; exit code 0 when done, 2 on bad input, 130 when interrupted."""
    words = list(sys.argv[1:] if argv is None else argv)
    if not words or words[0] in ("-h", "--help"):
        print(usage())
        sys.exit(0 if words else 2)
    if words[0] == "--version":
        print(__version__)
        return
    if words[0] in KINDS and words[1:2] in (["-h"], ["--help"]):
        print(kinds_usage(words[0]))
        return
    sys.excepthook = _crash
    try:
        refuse_old(words)
        command, rest = split_command(words)
        refuse_options_of_arrays(words[0], command, rest)
        verb = parse(load_verb(command), command, rest)
        check_rules(verb, rest)
        verb.run()
    except (MissingExtra, ModuleNotFoundError) as error:
        missing = missing_extra(error, f"taxel {words[0]}", words[0] in _TRAINS)
        if missing is None:
            raise
        _fail(str(missing))
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


def _crash(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Print a traceback of ours, whose message may quote foreign text."""
    sys.stderr.write(without_controls("".join(format_exception(kind, error, trace))))


def _fail(line: str) -> None:
    print(f"taxel: {visible_line(' '.join(line.split()))}", file=sys.stderr)
    sys.exit(2)


if __name__ == "__main__":
    main()
