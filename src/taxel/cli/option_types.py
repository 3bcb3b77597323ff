"""How tyro reads and shows the types of options, where its own way is not plain.

Knows nothing about verbs.
"""

from __future__ import annotations

from dataclasses import replace
from types import NoneType
from typing import Any, get_args

from tyro.constructors import (
    ConstructorRegistry,
    PrimitiveConstructorSpec,
    PrimitiveTypeInfo,
    UnsupportedTypeAnnotationError,
)


def plain_types() -> ConstructorRegistry:
    """Return rules for tyro, to be used in a `with` block.

    An option that may be left out (`Path | None`) is shown as `PATH`, not as `{None}|PATH`, and
    the word None is no value: whoever wants none leaves the option out.
    """
    registry = ConstructorRegistry()
    registry.primitive_rule(_without_none)
    return registry


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
