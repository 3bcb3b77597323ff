"""Read JSON that somebody else wrote: bounded in size and depth, each name once, no huge numbers.

`Fields` gives an object's values, each of the kind and range that it must have. Knows nothing
about what they mean.

Background of our choices: docs/decisions/0033.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel.errors import BadFile
from taxel.foreign.files import MIB, read_text

LARGEST = 16 * MIB
"""Bytes of a file of JSON, unless a reader knows better. Source: our choice."""
MOST_VALUES = 1_000_000
"""Commas and openings of a text; what they become takes about 100 bytes each. Our choice."""
_BYTES_A_VALUE = 16
"""A file may have one value in so many of the bytes that are allowed."""
DEEPEST = 32
"""Lists and objects within one another; taxel's own files stay below 10. Source: our choice."""
_LONGEST_INTEGER = 20
"""Characters: what 64 bits hold, and a sign."""
_Word = TypeVar("_Word", bound=str)
_LARGEST_32 = float(np.finfo(np.float32).max)
_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")
_BRACKET_OR_STRING = re.compile(r'[\[\]{}]|"(?:[^"\\]|\\.)*"')


def read_json(path: Path, most: int = LARGEST, *, finite: bool = False) -> Any:
    """Return what a file of JSON holds.

    Args:
        path: The file.
        most: Bytes that it may have.
        finite: Refuse NaN and infinity, which are no JSON but Python's, and 1e999, which Python
            reads as infinity.

    Raises:
        BadFile: It is no plain file, too large, no JSON, or beyond the bounds of this module.
        OSError: It is not there, or may not be read.
    """
    return parse_json(read_text(path, most), most // _BYTES_A_VALUE, finite=finite)


def parse_json(text: str | bytes, most_values: int = MOST_VALUES, *, finite: bool = False) -> Any:
    """Return what a text of JSON holds.

    Args:
        text: UTF-8, where it is bytes.
        most_values: Commas and openings that it may have.
        finite: Refuse NaN and infinity, which are no JSON but Python's, and 1e999, which Python
            reads as infinity.

    Raises:
        BadFile: It is no JSON, or too deep, or has too many values, an integer beyond 64 bits,
            a name twice, or text that is no Unicode.
    """
    try:
        if isinstance(text, bytes):
            text = text.decode("utf-8")
        if text.count(",") + text.count("[") + text.count("{") > most_values:
            _refuse(f"more than {most_values:,} values")
        _refuse_deep(text)
        parsed = json.loads(
            text, object_pairs_hook=_once, parse_int=_integer,
            parse_float=_finite if finite else None,
            parse_constant=_no_constant if finite else float,
        )  # fmt: skip
        if _SURROGATE.search(text):
            json.dumps(parsed, ensure_ascii=False).encode()
    except BadFile:
        raise
    except (ValueError, RecursionError) as error:
        _refuse(f"something else ({error})", error)
    return parsed


def fields_differ(unknown: Sequence[str], lacking: Sequence[str]) -> str:
    """Return in words which fields an object has that are not known, and which it lacks.

    Args:
        unknown: Names, as of a newer version's file.
        lacking: Names, as of an older one's.
    """
    parts = (("unknown to this version: ", unknown), ("lacking: ", lacking))
    return "; ".join(
        f"fields {head}{', '.join(map(repr, names[:6]))}"
        + (f" and {len(names) - 6} more" if len(names) > 6 else "")
        for head, names in parts if names
    )  # fmt: skip


class Fields:
    """The values of a JSON object, by name, each checked as it is taken.

    Args:
        value: What should be the object.
        what: What it is, for messages.

    Raises:
        ValueError: From every method: a value is missing, or of another kind or range.
    """

    def __init__(self, value: object, what: str) -> None:
        if not isinstance(value, Mapping):
            raise ValueError(f"{what} is no object")
        self._value: Mapping[str, Any] = value
        self._what = what

    def only(self, known: Collection[str]) -> None:
        """Refuse fields that are not known, and known ones that are missing.

        Raises:
            ValueError: There is one.
        """
        unknown, lacking = set(self._value) - set(known), set(known) - set(self._value)
        if unknown or lacking:
            raise ValueError(fields_differ(sorted(unknown), sorted(lacking)))

    def __contains__(self, name: str) -> bool:
        return self._value.get(name) is not None

    def any(self, name: str) -> Any:
        """Return a value of any kind.

        Raises:
            ValueError: There is no such field.
        """
        if name not in self._value:
            raise ValueError(f"{self._what} has no {name}")
        return self._value[name]

    def text(self, name: str) -> str:
        """Return a text."""
        value = self.any(name)
        return value if isinstance(value, str) else self._wrong(name, "text")

    def flag(self, name: str) -> bool:
        """Return True or False."""
        value = self.any(name)
        return value if isinstance(value, bool) else self._wrong(name, "true or false")

    def number(self, name: str, low: float = -math.inf, high: float = math.inf) -> float:
        """Return a finite number from `low` to `high`."""
        value = self.any(name)
        if isinstance(value, bool) or not isinstance(value, int | float):
            self._wrong(name, "a number")
        if not (math.isfinite(value) and low <= value <= high):
            self._wrong(name, f"a finite number{_range(low, high)}")
        return float(value)

    def count(self, name: str, low: int, high: int) -> int:
        """Return a whole number from `low` to `high`."""
        value = self.any(name)
        if type(value) is not int or not low <= value <= high:
            self._wrong(name, f"a whole number{_range(low, high)}")
        return int(value)

    def choice(self, name: str, known: Iterable[_Word]) -> _Word:
        """Return one of the known texts, of their type."""
        value, words = self.text(name), tuple(known)
        found = next((word for word in words if word == value), None)
        return self._wrong(name, f"one of {', '.join(words)}") if found is None else found

    def items(self, name: str) -> list[Any]:
        """Return a list of anything."""
        value = self.any(name)
        return value if isinstance(value, list) else self._wrong(name, "a list")

    def texts(self, name: str) -> tuple[str, ...]:
        """Return a list of texts."""
        value = self.items(name)
        if not all(isinstance(item, str) for item in value):
            self._wrong(name, "a list of texts")
        return tuple(value)

    def pairs(self, name: str) -> dict[str, str]:
        """Return an object whose values are texts."""
        value = self.any(name)
        if not isinstance(value, dict) or not all(isinstance(v, str) for v in value.values()):
            self._wrong(name, "an object of texts")
        return dict(value)

    def numbers(self, name: str) -> dict[str, float]:
        """Return an object whose values are numbers."""
        value = self.any(name)
        if not isinstance(value, dict) or not all(
            isinstance(v, int | float) and not isinstance(v, bool) for v in value.values()
        ):
            self._wrong(name, "an object of numbers")
        return dict(value)

    def array(self, name: str, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
        """Return finite numbers, which 32 bits hold, in lists within lists.

        Args:
            name: The field.
            shape: Length of each axis; None for any.
        """
        try:
            found = np.array(self.items(name))
        except ValueError:
            self._wrong(name, "rows of equal length")
        fits = found.ndim == len(shape) and all(
            wanted in (None, length) for wanted, length in zip(shape, found.shape, strict=True)
        )
        if not fits or (found.size and found.dtype.kind not in "iuf"):
            sides = " × ".join("any" if n is None else str(n) for n in shape)
            self._wrong(name, f"{sides} number{'s' * (shape != (1,))}")
        found = found.astype(np.float64)
        fits = (np.abs(found) <= _LARGEST_32).all()  # NaN does not, either
        return found if fits else self._wrong(name, "finite numbers that 32 bits hold")

    def fields(self, name: str) -> Fields:
        """Return an object's own fields."""
        return Fields(self.any(name), name)

    def _wrong(self, name: str, wanted: str) -> NoReturn:
        raise ValueError(f"{name} is not {wanted}")


def _refuse_deep(text: str) -> None:
    if text.count("[") + text.count("{") <= DEEPEST:
        return
    depth = 0
    for match in _BRACKET_OR_STRING.finditer(text):
        sign = text[match.start()]
        if sign in "[{":
            depth += 1
            if depth > DEEPEST:
                _refuse(f"lists and objects more than {DEEPEST} deep")
        elif sign != '"':
            depth -= 1


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        _refuse("a name that comes twice in one object")
    return found


def _no_constant(name: str) -> NoReturn:
    _refuse(f"{name}, which is no number")


def _finite(text: str) -> float:
    number = float(text)
    return number if math.isfinite(number) else _refuse(f"{text}, beyond 64 bits")


def _integer(digits: str) -> int:
    if len(digits) > _LONGEST_INTEGER:
        _refuse(f"an integer of {len(digits):,} digits")
    return int(digits)


def _refuse(got: str, cause: Exception | None = None) -> NoReturn:
    raise BadFile("JSON as taxel writes it", got, "write it again") from cause


def _range(low: float, high: float) -> str:
    bounds = [f"{word} {bound:g}" for word, bound in (("from", low), ("to", high))
              if math.isfinite(bound)]  # fmt: skip
    return f" {' '.join(bounds)}" if bounds else ""
