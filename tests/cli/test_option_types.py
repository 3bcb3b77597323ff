"""How options are shown and read: an option that may be left out shows its value's type alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pytest

from taxel.cli.main import doors, load_verb
from taxel.cli.parsing import BadOption, parse


@dataclass(frozen=True, kw_only=True)
class Some:
    """Options of each kind that may be left out."""

    file: Path | None = None
    count: int | None = None
    kind: Literal["a", "b"] | None = None
    limits: tuple[float, float] | None = None
    words: tuple[str, ...] | None = None


@pytest.mark.parametrize("door", doors())
def test_no_help_shows_none_as_something_to_type(
    door: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    with pytest.raises(SystemExit):
        parse(load_verb(door), door, ["--help"])
    assert "None}" not in capsys.readouterr().out


def test_the_help_names_the_type_of_each_value(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parse(Some, "some", ["--help"])
    text = capsys.readouterr().out
    for shown in ("--file PATH", "--count INT", "--kind {a,b}", "--limits FLOAT FLOAT"):
        assert shown in text


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
