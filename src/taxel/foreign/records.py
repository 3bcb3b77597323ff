"""Make a small dataclass from JSON that somebody else wrote: each field of its annotated type.

Knows numbers, texts, flags, choices, pairs and tuples of them; nothing about what they mean.
"""

from __future__ import annotations

import math
import types
from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import (
    TYPE_CHECKING,
    Any,
    Literal,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np

from taxel.foreign.json_text import fields_differ

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

_Record = TypeVar("_Record", bound="DataclassInstance")
_LARGEST_INTEGER = 2**53
"""Above it a number of 64 bits is no longer exact."""


def record_of(kind: type[_Record], value: object, *, finite: bool = True) -> _Record:
    """Return a dataclass from an object of its fields; those that it lacks have their defaults.

    Args:
        kind: The dataclass.
        value: What should be the object.
        finite: Refuse NaN and infinity.

    Raises:
        ValueError: A field is unknown, missing or of another type; or from the dataclass itself.
    """
    if not isinstance(value, Mapping):
        raise ValueError(f"{kind.__name__} is no object")
    known = {field.name: field for field in fields(kind)}
    unknown = [name for name in value if name not in known]
    lacking = [
        name for name, field in known.items()
        if name not in value and field.default is MISSING and field.default_factory is MISSING
    ]  # fmt: skip
    if unknown or lacking:
        raise ValueError(fields_differ(unknown, lacking))
    types_of = get_type_hints(kind)
    given = {name: _checked(types_of[name], own, name, finite) for name, own in value.items()}
    return kind(**given)


def own_numbers(record: DataclassInstance) -> None:
    """Replace a frozen dataclass's numbers of NumPy's by Python's, as JSON and PyTorch need them.

    Args:
        record: Call it in `__post_init__`.
    """
    for field in fields(record):
        value = getattr(record, field.name)
        if isinstance(value, np.generic):
            object.__setattr__(record, field.name, value.item())


def _checked(wanted: Any, value: Any, name: str, finite: bool) -> Any:
    """Return a value of the wanted type; lists become tuples."""
    origin, parts = get_origin(wanted), get_args(wanted)
    if origin in (Union, types.UnionType):
        if value is None and type(None) in parts:
            return None
        (wanted,) = [part for part in parts if part is not type(None)]
        return _checked(wanted, value, name, finite)
    if origin is Literal and value in parts and isinstance(value, str):
        return value
    if origin is tuple and isinstance(value, list | tuple):
        each = [parts[0]] * len(value) if parts[-1] is Ellipsis else list(parts)
        if len(each) == len(value):
            return tuple(_checked(t, v, name, finite) for t, v in zip(each, value, strict=True))
    if origin in (dict, Mapping) and isinstance(value, Mapping):
        return {key: _checked(parts[1], own, name, finite) for key, own in value.items()}
    if wanted in (bool, str) and type(value) is wanted:
        return value
    if wanted is int and type(value) is int and abs(value) <= _LARGEST_INTEGER:
        return value
    if wanted is float and type(value) in (int, float) and (not finite or math.isfinite(value)):
        return float(value) if math.isfinite(value) and abs(value) > _LARGEST_INTEGER else value
    raise ValueError(f"{name} is not {_in_words(wanted, parts)}")


def _in_words(wanted: Any, parts: tuple[Any, ...]) -> str:
    if get_origin(wanted) is Literal:
        return f"one of {', '.join(parts)}"
    words = {bool: "true or false", str: "text", int: "a whole number", float: "a finite number"}
    return words.get(wanted, f"of the form {wanted}")
