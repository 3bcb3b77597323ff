"""How options are shown and read: an option that may be left out shows its value's type alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pytest

from taxel.cli.main import commands, load_verb
from taxel.cli.parsing import BadOption, parse


@dataclass(frozen=True, kw_only=True)
class Some:
    """Options of each kind that may be left out."""

    file: Path | None = None
    count: int | None = None
    kind: Literal["a", "b"] | None = None
    limits: tuple[float, float] | None = None
    words: tuple[str, ...] | None = None


@dataclass(frozen=True, kw_only=True)
class Valued:
    """Options with a default, one that must be given, and an empty one."""

    needed: int
    count: int = 0
    word: str = " "
    on: bool = False
    empty: str = ""


@pytest.mark.parametrize("command", commands())
def test_no_help_shows_none_as_something_to_type_or_as_a_default(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor an empty default: what happens without an option is said in words, or nothing does."""
    monkeypatch.setenv("COLUMNS", "200")
    with pytest.raises(SystemExit):
        parse(load_verb(command), command, ["--help"])
    text = " ".join(capsys.readouterr().out.replace("│", " ").split())
    for shown in ("None}", "default: None", "(default: )", "(default: '')"):
        assert shown not in text


def test_the_help_names_the_type_of_each_value(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parse(Some, "some", ["--help"])
    text = capsys.readouterr().out
    for shown in ("--file PATH", "--count INT", "--kind {a,b}", "--limits FLOAT FLOAT"):
        assert shown in text


def test_a_default_that_is_a_value_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    """A number, a word and a switch; and what must be given still says so."""
    with pytest.raises(SystemExit):
        parse(Valued, "valued", ["--help"])
    text = " ".join(capsys.readouterr().out.replace("│", " ").split())
    for shown in ("(default: 0)", "(default: ' ')", "(default: False)", "(required)"):
        assert shown in text
    assert text.count("(default:") == 3


@pytest.mark.parametrize(
    ("line", "read"),
    [
        ("", Some()),
        ("--file a.mcap --count 3", Some(file=Path("a.mcap"), count=3)),
        ("--kind b --limits 1 2.5", Some(kind="b", limits=(1.0, 2.5))),
        ("--words", Some(words=())),
        ("--words a b", Some(words=("a", "b"))),
        ("--file None", Some(file=Path("None"))),
    ],
)
def test_values_are_read_as_their_type(line: str, read: Some) -> None:
    assert parse(Some, "some", line.split()) == read


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("--count many", "needed a whole number, in the range that its help gives, for --count; "
         "got many;"),
        ("--count None", "needed a whole number, in the range that its help gives, for --count; "
         "got None;"),
        ("--limits 1 x", "needed numbers, in the range that its help gives, for --limits; "
         "got 1, x;"),
        ("--kind c", "needed one of a, b for --kind; got c;"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_refused_by_its_type(line: str, message: str) -> None:
    with pytest.raises(BadOption) as refused:
        parse(Some, "some", line.split())
    assert message in str(refused.value)
