"""Spellings of verbs and options that taxel had before: refused in one line that names the new.

Knows nothing about what a verb does. One table; a line is taken out when nobody can remember.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from taxel.cli.options.rules import typed_options
from taxel.cli.trial_verbs import takes_option, verb_for_data
from taxel.errors import BadInput


@dataclass(frozen=True, slots=True)
class Old:
    """A spelling that is refused."""

    verb: str
    """The verb that it was typed with; "evaluate teng-table" is a verb and its first word."""
    option: str
    """The option; empty where the verb and word themselves are old."""
    new: str
    """How it is written now."""
    value: str = ""
    """Only with a value that matches this pattern."""


_WINDOW = {
    "steps": "steps=50", "stride": "stride=25", "grid": "grid=own", "gate": "gate=none",
    "layout": "layout=A", "channels": "channels=thumb,index", "pad": "pad=yes",
    "no-pad": "pad=no", "tare": "tare=yes", "no-tare": "tare=no", "wavelet": "wavelet=db2",
    "segment": "segment=none", "reference": "reference=none",
}  # fmt: skip
_CUPS = (
    "cups", "first-cup", "repetitions", "negatives", "forces-n", "duration-s", "camera-hz", "gel",
)  # fmt: skip
_HAND = (
    "preset", "scans-per-class", "sessions", "rate-hz", "wiring", "force-n", "temperature-c",
    "humidity-pct", "dust", "moisture", "moving", "unknown", "reference-v",
)  # fmt: skip
_CAMERA = (
    "rule", "head", "frames", "ahead", "weights", "cache", "engine", "precision",
    "threads", "paper-settings",
)  # fmt: skip
_MONITOR = "taxel train-monitor DATA --features gel --output NAME.taxel"
_TRIALS = "taxel evaluate-trials DATA --target outcome --split group:object"
_STUDIES = {
    "teng-table": "table-4-1", "teng-models": "teng-models", "teng-cleaning": "teng-cleaning",
    "unknown": "unknown-objects", "transition-tables": "transition-tables",
    "grasp-warnings": "grasp-warnings", "precisions": "precisions",
}  # fmt: skip

OLD: tuple[Old, ...] = (
    *(Old(f"evaluate {old}", "", f"taxel reproduce {new}") for old, new in _STUDIES.items()),
    Old("evaluate slip-trials", "", _TRIALS),
    Old("reproduce slip-trials", "", _TRIALS),
    Old("train", "grasp", "taxel train-slip POSES --output NAME.taxel", "slip"),
    Old("train", "grasp", _MONITOR),
    Old("train", "false-alarms", "taxel train-slip POSES --output NAME.taxel --false-alarms 0.3"),
    Old("train", "fine-tune", "taxel train-backbone DATA --backbone edge --epochs 3"),
    Old("train", "unknown", "taxel train DATA --reject-novel 0.05"),
    Old("train", "resume", "--fresh, to start again; without it an interrupted run continues"),
    Old("train", "members", "--recipe teng-glove, which averages three"),
    Old("train", "folds", "taxel train DATA --fold-count 5", r"\d+"),
    Old("evaluate", "folds", "taxel evaluate DATA --fold-count 5", r"\d+"),
    *(Old("train", option, _MONITOR) for option in (*_CAMERA, "backbones", "single-split")),
    *(Old("evaluate", option, f"taxel reproduce grasp-warnings --{option}") for option in _CAMERA),
    Old("evaluate", "backbones", "taxel reproduce transition-tables --backbones"),
    Old("evaluate", "single-split", "taxel reproduce transition-tables --single-split"),
    Old("evaluate", "plot", "taxel reproduce grasp-warnings --plot FILE.png"),
    Old("evaluate", "crop", f"{_TRIALS} --crop"),
    *(Old(verb, "moving-part", "--part moving") for verb in ("evaluate-trials", "train-trials")),
    Old("evaluate", "moving-part", f"{_TRIALS} --part moving"),
    Old("train", "moving-part", "taxel train-trials --part moving"),
    Old("evaluate", "data", "taxel evaluate DATA, or taxel reproduce STUDY --data DATA"),
    Old("evaluate", "never", "taxel reproduce unknown-objects --never"),
    Old("evaluate", "rejected", "taxel reproduce unknown-objects --reject-novel 0.05"),
    Old("evaluate", "preset", "taxel reproduce table-4-1 --preset"),
    Old("evaluate", "scans-per-class", "taxel reproduce table-4-1 --scans-per-class"),
    *(
        Old(verb, option, f"--window {new}")
        for verb in ("train", "evaluate")
        for option, new in _WINDOW.items()
    ),
    Old("reproduce grasp-warnings", "backbones", "--features gel"),
    Old("reproduce unknown-objects", "folds", "--fold-count 5", r"\d+"),
    *(Old("simulate teng", option, f"taxel simulate cup-pour --{option}") for option in _CUPS),
    *(Old("simulate cup-pour", option, f"taxel simulate teng --{option}") for option in _HAND),
    Old("audit", "parts", "--fold-count 5"),
    Old("bundle", "target", "--board mega", "avr"),
    Old("bundle", "target", "without --target: a bundle is for live work", "live"),
    *(
        Old("live", option, "--page 127.0.0.1:8080")
        for option in ("page-host", "page-port", "page-address")
    ),
    Old("live", "rerun", "--publish rerun"),
    Old("live", "quiet", "--json"),
    Old("live", "least-n", "--force-n 15 50"),
    Old("live", "most-n", "--force-n 15 50"),
)  # fmt: skip
"""In the order in which they are looked for."""


def refuse_old(words: Sequence[str]) -> None:
    """Refuse a command that is written as it was before.

    Args:
        words: What was typed after `taxel`.

    Raises:
        BadInput: It holds an old spelling; the message names the new one.
    """
    typed = typed_options(words)
    for old in OLD:
        verb, _, word = old.verb.partition(" ")
        if words[0] != verb or (word and words[1:2] != [word]):
            continue
        if not old.option and not Path(word).exists():
            raise _refusal(old, f"taxel {old.verb}")
        if old.option in typed and takes_option(verb_for_data(verb, words[1:]), old.option):
            continue  # camera trials: the verb that takes them has the option
        if old.option in typed and re.fullmatch(old.value or ".*", _value(words, old.option)):
            raise _refusal(old, f"--{old.option}")


def _refusal(old: Old, typed: str) -> BadInput:
    new = old.new if old.new.startswith("taxel") else f"taxel {old.verb} … {old.new}"
    return BadInput(new, f"the former spelling {typed}", "write it so")


def _value(words: Sequence[str], option: str) -> str:
    """Return the word behind an option, or after its "="; empty where there is none."""
    for at, word in enumerate(words):
        name, equals, value = word.replace("_", "-").partition("=")
        if name == f"--{option}":
            return value if equals else next(iter(words[at + 1 : at + 2]), "")
    return ""
