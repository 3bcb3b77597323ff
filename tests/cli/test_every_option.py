"""No option is accepted and ignored: the contract of every verb, generated from its options.

For each command (a verb, or a verb and its kind) stand some command lines below, one for each way
in which it works. To each, every option that it lacks is added. Then one of two things must be:

- the verb does something else than without the option. What it does is everything it asks of the
  packages below `taxel.cli`, with all arguments, and what it prints (`fake_world`);
- or it refuses, with one line that names the option.

And each option must do the former on at least one of the lines. This proves that no option is
lost on the way through the command line, in any way of working; that functions below use what
they are given is for their own tests.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import pytest
import tyro
from fake_world import observe
from option_lines import LINES

from taxel.cli.main import KINDS, VERBS, commands, load_verb
from taxel.cli.old_spellings import OLD, Old

MOST_OPTIONS = 20

PLACES = ("folder", "d", "run", "r", "s", "g")
"""Folders that the lines name."""
FILES = (
    "b.taxel",
    "trial.taxel",
    "a.mcap",
    "k",
    "fw/teng_daq/teng_daq.ino",
    "run/weights-0.safetensors",
)
"""Files that they name."""
VALUES = {
    "split": "group:object",
    "folds": "f.csv",
    "window": "steps=24",
    "target": "material",
    "recipe": "teng-glove",
    "model": "lstm",
    "label": "shape=sphere",
    "group": "session=2",
    "live page": "127.0.0.1:8080",
    "record page": "127.0.0.1:8080",
    "fleet page": "127.0.0.1:8080",
    "rules": "a.csv",
    "steps": "3",
    "fatigue": "0.2",
    "calibration": "c.json",
    "levels": "30",
    "faults": "noise",
    "html": "given.html",
    "plot": "given.png",
    "png": "given.png",
    "rule": "slip",
    "output": "given.json",
    "seconds": "3",
    "reject-novel": "0.1",
    "gripper": "sim",
    "tell": "udp://127.0.0.1:5005",
    "publish": "zenoh://127.0.0.1:7447/bench",
    "beside": "sim://teng",
    "at": "2",
    "frame": "2",
    "onset": "2",
    "only": "given",
    "expect": "1.2.3",
    "board-number": "3",
    "board-id": "thumb",
    "define": "A=1",
    "backbones": "edge",
    "features": "edge",
    "page": "given.md",
    "least-confidence": "0.7",
    "precision": "bf16",
    "moving": "0.4",
    "reference-v": "5",
    "force-n": "16 40",
    "unseen": "object",
    "fold-count": "4",
    "negatives": "0.5",
    "learning-rate": "0.01",
    "kinds": "lift",
    "crop": "60",
    "flash firmware": "fw",
    "doctor output": "folder",
    "missing": "keep",
    "repeated-times": "drop",
    "garbled-times": "drop",
    "bundle data": "s",
    "report data": "s",
    "wait-s": "3",
    "sketch": "teng_daq",
    "session-s": "200",
    "run-on": "dask",
    "settings": "batch",
    "models": "lstm cnn1d",
    "train-slip cups": "24",
    "storage": "sqlite:///given.db",
    "tune split": "group:object",
}
"""Option → a value that is not its default and that makes sense."""


@dataclasses.dataclass(frozen=True)
class Option:
    """One option of a command."""

    name: str
    """As it is typed, without dashes."""
    words: tuple[str, ...]
    """How it is given, another value than its default."""


def options(kind: Any, command: str) -> Iterator[Option]:
    """Yield all options of a verb, those of its groups too; positional words are none."""
    hints = get_type_hints(kind, include_extras=True)
    for field in dataclasses.fields(kind):
        group = field.default_factory
        if dataclasses.is_dataclass(group):
            yield from options(group, command)
            continue
        hint, marks = hints[field.name], getattr(hints[field.name], "__metadata__", ())
        if any("Positional" in repr(mark) or "positional" in repr(mark) for mark in marks):
            continue
        named = [mark.name for mark in marks if getattr(mark, "name", None)]
        name = (named[0] if named else field.name).replace("_", "-")
        if field.default is True:
            yield Option(name, (f"--no-{name}",))
        elif field.default is False:
            yield Option(name, (f"--{name}",))
        else:
            yield Option(name, (f"--{name}", *_value(name, hint, field.default, command)))


def _value(name: str, hint: Any, default: Any, command: str) -> list[str]:
    if name in VALUES or f"{command} {name}" in VALUES:
        return VALUES.get(f"{command} {name}", VALUES.get(name, "")).split()
    choices = [word for part in (hint, *get_args(hint)) if get_origin(part) is Literal
               for word in get_args(part)]  # fmt: skip
    if choices:
        return [str(next(word for word in choices if word != default))]
    text = str(hint)
    if "tuple[float, float]" in text:
        return ["0.2", "0.25"] if name in ("dust", "moisture") else ["21", "34"]
    if "float" in text:
        return ["1.5", "2.5", "3.5"] if "tuple" in text else ["2.5"]
    if "Path" in text:
        return ["given"]
    return [str(default + 1 if isinstance(default, int) else 3)] if "int" in text else ["given"]


def _with(words: list[str], option: Option) -> list[str]:
    """Return a line with an option added, or with another value where it has the option."""
    typed, *value = option.words
    if typed not in words:
        return [*words, typed, *value]
    at = words.index(typed) + 1
    if option.words[0] == "--output":
        value = [f"other{Path(words[at]).suffix}"]
    return [*words[:at], *value, *words[at + len(value) :]]


@pytest.fixture
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """A folder with all that the lines name."""
    monkeypatch.chdir(tmp_path)
    for place in PLACES:
        (tmp_path / place).mkdir()
    (tmp_path / "run" / "run.json").touch()
    for file in FILES:
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).touch()
    return monkeypatch


def _sweep(before: set[Path]) -> None:
    """Remove what a line has made."""
    for path in sorted(set(Path().rglob("*")) - before, reverse=True):
        path.rmdir() if path.is_dir() else path.unlink()


def test_every_door_has_its_lines() -> None:
    assert set(LINES) == set(commands())


@pytest.mark.slow
@pytest.mark.parametrize("command", commands())
def test_each_option_changes_what_is_done_or_is_refused(
    command: str, world: pytest.MonkeyPatch
) -> None:
    before = set(Path().rglob("*"))
    first: list[str] = []
    lost, never = [], {option.name for option in options(load_verb(command), command)}
    for line in LINES[command]:
        plain, refused = observe(line.split(), world)
        _sweep(before)
        assert not refused, f"{line}: {refused}"
        again, _ = observe(line.split(), world)
        _sweep(before)
        first = first or plain
        if plain != first:
            never -= {word.removeprefix("--") for word in line.split()}
        assert plain == again, f"{line} does not do the same twice"
        for option in options(load_verb(command), command):
            words = _with(line.split(), option)
            if words == line.split():
                continue
            log, refused = observe(words, world)
            _sweep(before)
            if refused and (option.name in refused or option.words[-1] in refused):
                continue
            if log == plain:
                lost.append(f"{' '.join(words)}{refused and ': ' + refused}")
            else:
                never.discard(option.name)

    assert not lost, "\n".join(lost)
    assert never == set(), "refused everywhere"


@pytest.mark.parametrize("command", commands())
def test_no_verb_has_more_options_than_a_reader_takes_in(command: str) -> None:
    assert len(every_name(load_verb(command))) <= MOST_OPTIONS


def every_name(kind: Any) -> list[str]:
    """Return the names of a verb's options and positional words, those of its groups too."""
    names: list[str] = []
    for field in dataclasses.fields(kind):
        group = field.default_factory
        names += every_name(group) if dataclasses.is_dataclass(group) else [field.name]
    return names


@pytest.mark.parametrize("command", commands())
def test_no_help_speaks_of_another_verb(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither `taxel VERB`, nor the name of a study, nor of a verb of two words."""
    monkeypatch.setenv("COLUMNS", "200")
    with pytest.raises(SystemExit):
        tyro.cli(load_verb(command), prog=f"taxel {command}", args=["--help"])
    text = " ".join(re.sub("[│╭╮╰╯─]", " ", capsys.readouterr().out).split())
    own = set(command.split())
    others = {*KINDS["reproduce"], *(verb for verb in VERBS if "-" in verb)} - own
    named = set(re.findall(r"taxel ([a-z][a-z-]+)", text)) & set(VERBS) - own
    named |= {word for word in others if re.search(rf"(?<![\w-]){word}(?![\w-])", text)}

    assert named == set()


@pytest.mark.parametrize("old", OLD, ids=lambda old: f"{old.verb} {old.option} {old.value}".strip())
def test_former_spellings_are_refused_in_one_line_that_names_the_new(
    old: Old, refused: Callable[[list[str]], str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    value = [] if not old.option else [{r"\d+": "5"}.get(old.value, old.value or "1")]
    option = [f"--{old.option}", *value] if old.option else []

    assert old.new in refused([*old.verb.split(), "data", *option])


def test_a_new_spelling_is_one_that_exists() -> None:
    """Every verb and option that a refusal names can be typed."""
    for old in OLD:
        words = re.findall(r"--[a-z-]+|(?<!\.)taxel [a-z][a-z-]*(?: [a-z0-9][a-z0-9-]*)?", old.new)
        for command in (word for word in words if word.startswith("taxel")):
            _, verb, *kind = command.split()
            assert verb in VERBS
            assert verb not in KINDS or kind[:1] == [] or kind[0] in KINDS[verb]
        command = next(
            (c for c in sorted(commands(), key=len, reverse=True) if f"taxel {c}" in old.new),
            old.verb,
        )
        if command in commands():
            known = {f"--{name.replace('_', '-')}" for name in every_name(load_verb(command))}
            assert {w for w in words if w.startswith("--")} <= known | {"--target"}, old


def test_a_folder_that_is_called_like_a_study_is_evaluated(
    world: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "unknown").mkdir()
    log, refused = observe(["evaluate", "unknown"], world)
    assert not refused
    assert any(line.startswith("check_recipe(unknown, ") for line in log)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            "reproduce table-4-1 --preset fair",
            "needed one of honest, paper, both for --preset; got fair;",
        ),
        ("train", "needed PATH (a folder of recordings); got none; run: taxel train --help."),
        ("live", "needed PATH (a bundle, NAME.taxel) and STR (a source); got none;"),
        ("record sim://teng --seconds 1", "needed --output PATH; got none;"),
        ("train d --output r --epochs many", "for --epochs; got many;"),
        ("train d --output r --epohcs 3", "got --epohcs, 3; perhaps --epochs was meant;"),
        ("simulate rain", "needed taxel simulate with one of teng, cup-pour; got rain;"),
        ("trian d", "needed a verb of taxel; got 'trian'; perhaps train was meant;"),
    ],
)
def test_words_that_do_not_fit_are_named_in_one_line(
    words: str, message: str, refused: Callable[[list[str]], str]
) -> None:
    assert message in refused(words.split())
