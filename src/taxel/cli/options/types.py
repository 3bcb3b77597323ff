"""How tyro reads and shows the types of options, where its own way is not plain.

Knows nothing about verbs.
"""

from __future__ import annotations

from dataclasses import is_dataclass, replace
from types import NoneType
from typing import Annotated, Any, get_args

import tyro
from tyro.constructors import (
    ConstructorRegistry,
    PrimitiveConstructorSpec,
    PrimitiveTypeInfo,
    StructConstructorSpec,
    StructFieldSpec,
    StructTypeInfo,
    UnsupportedTypeAnnotationError,
)


def plain_types() -> ConstructorRegistry:
    """Return rules for tyro, to be used in a `with` block.

    An option that may be left out (`Path | None`) is shown as `PATH`, not as `{None}|PATH`, and
    the word None is no value: whoever wants none leaves the option out. Where leaving it out gives
    no value, help shows no default: not `(default: None)`.
    """
    registry = ConstructorRegistry()
    registry.primitive_rule(_without_none)
    registry.struct_rule(_NoEmptyDefaults())
    return registry


class _NoEmptyDefaults:
    """A rule for dataclasses: tyro's own, but that an empty default is not shown."""

    def __init__(self) -> None:
        self._asking = False

    def __call__(self, info: StructTypeInfo) -> StructConstructorSpec | None:
        """Return the fields of a dataclass; None of anything else, and while tyro is asked."""
        if self._asking or not is_dataclass(info.type):
            return None
        self._asking = True
        try:
            spec = ConstructorRegistry.get_struct_spec(info)
        finally:
            self._asking = False
        if not isinstance(spec, StructConstructorSpec):
            return None
        return replace(spec, fields=tuple(map(_without_empty_default, spec.fields)))


def _without_empty_default(field: StructFieldSpec) -> StructFieldSpec:
    """Return a field whose help ends without a default, where that is None or empty.

    Words without number that must be given, `tuple[Path, ...]`, have an empty one in tyro's help.
    """
    without = field.default in (None, tyro.MISSING, tyro.MISSING_NONPROP)
    if not (without or field.default in ("", ())):
        return field
    shown: Any = Annotated[field.type, tyro.conf.arg(help_behavior_hint="")]
    return replace(field, type=shown)


def _without_none(
    info: PrimitiveTypeInfo,
) -> PrimitiveConstructorSpec[Any] | UnsupportedTypeAnnotationError | None:
    """Read `X | None` as X; None where it is another type."""
    parts = get_args(info.type)
    if len(parts) != 2 or NoneType not in parts:
        return None
    (other,) = (part for part in parts if part is not NoneType)
    spec = ConstructorRegistry.get_primitive_spec(PrimitiveTypeInfo.make(other, info.markers))
    if not isinstance(spec, PrimitiveConstructorSpec):
        return spec
    return replace(
        spec,
        is_instance=lambda value: value is None or spec.is_instance(value),
        str_from_instance=lambda value: (
            ["None"] if value is None else spec.str_from_instance(value)
        ),
    )
