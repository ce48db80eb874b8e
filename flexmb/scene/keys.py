"""What the types of a schema say of its keys: which have numbers, in which range and unit, and which have structs.

"stiffness_Nm_rad" has the stem "stiffness" and the unit N m/rad.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from itertools import chain
from typing import Any, NamedTuple

import msgspec
from msgspec import inspect

from flexmb.scene.quantities import Range

UNITS = {
    "s": "s", "m": "m", "kg": "kg", "rad": "rad", "N": "N", "Nm": "N m", "Nm2": "N m²",
    "m_s": "m/s", "m_s2": "m/s²", "rad_s": "rad/s", "kg_m": "kg/m", "kg_m2": "kg m²",
    "N_m": "N/m", "Ns_m": "N s/m", "Nm_rad": "N m/rad", "Nms_rad": "N m s/rad", "s_m": "s/m", "s_rad": "s/rad",
    "m_rad": "m/rad", "1_m": "1/m",
}  # fmt: skip

# In these keys the suffix means kg m, not kg/m: moments of inertia per length have the unit kg m²/m.
ROTARY = ("rotary_y_kg_m", "rotary_z_kg_m")


def split_unit(key: str) -> tuple[str, str]:
    """Stem and unit of a schema key, by the longest suffix that is a unit; the unit is "" if there is none."""
    parts = key.split("_")
    for start in range(1, len(parts)):
        suffix = "_".join(parts[start:])
        if suffix in UNITS:
            return "_".join(parts[:start]), "kg m" if key in ROTARY else UNITS[suffix]
    return key, ""


NOTHING: Mapping[str, Any] = {}


class TypePart(NamedTuple):
    """A type of which the type of a key is made up, what is said of it, and in how many tuples it is."""

    type: inspect.Type
    said: Mapping[str, Any]
    depth: int


class Key(NamedTuple):
    """A key with numbers: their unit and range, and whether they are the components of vectors of unit length.

    `single`: it has one number, or is None. Otherwise it has nested tuples of numbers, or other things in their place.
    """

    name: str
    unit: str
    range: Range
    unit_length: bool
    whole: bool
    single: bool

    @property
    def noun(self) -> str:
        """What messages call the number."""
        return self.range.noun or split_unit(self.name)[0].replace("_", " ")


def bare(node: inspect.Type) -> inspect.Type:
    """A type without what is said of it."""
    return node.type if isinstance(node, inspect.Metadata) else node


def parts(node: inspect.Type, said: Mapping[str, Any] = NOTHING, depth: int = 0) -> Iterator[TypePart]:
    """The types that a type is made up of: alternatives, and the items of its tuples."""
    match node:
        case inspect.Metadata(type=inner, extra=more):
            yield from parts(inner, {**said, **(more or {})}, depth)
        case inspect.UnionType(types=alternatives):
            for each in alternatives:
                yield from parts(each, said, depth)
        case inspect.TupleType(item_types=items):
            for each in items:
                yield from parts(each, said, depth + 1)
        case inspect.VarTupleType(item_type=each):
            yield from parts(each, said, depth + 1)
        case _:
            yield TypePart(node, said, depth)


@cache
def fields(kind: type[msgspec.Struct]) -> tuple[inspect.Field, ...]:
    """The keys of a struct as msgspec describes them."""
    described = inspect.type_info(kind)
    assert isinstance(described, inspect.StructType)
    return described.fields


def kinds(root: type[msgspec.Struct]) -> list[type[msgspec.Struct]]:
    """A kind of struct and all kinds inside it, in the order of their first appearance."""
    kinds: dict[type[msgspec.Struct], None] = {}

    def look(kind: type[msgspec.Struct]) -> None:
        if kind not in kinds:
            kinds[kind] = None
            for part in chain.from_iterable(parts(field.type) for field in fields(kind)):
                if isinstance(part.type, inspect.StructType):
                    look(part.type.cls)

    look(root)
    return list(kinds)


@cache
def struct_keys(kind: type[msgspec.Struct]) -> tuple[str, ...]:
    """Keys whose values can contain structs."""
    return tuple(
        field.name
        for field in fields(kind)
        if any(isinstance(part.type, inspect.StructType) for part in parts(field.type))
    )


@cache
def number_keys(kind: type[msgspec.Struct]) -> Mapping[str, Key]:
    """Keys whose values can contain numbers other than those of inner structs.

    TypeError where a type does not say which numbers it takes, or neither key nor type says in which unit.
    """
    return {field.name: key for field in fields(kind) if (key := _key(kind, field)) is not None}


def _key(kind: type[msgspec.Struct], field: inspect.Field) -> Key | None:
    of_key = list(parts(field.type))
    numbers = [part for part in of_key if isinstance(part.type, inspect.FloatType | inspect.IntType)]
    if not numbers:
        return None
    ranges: set[Range | None] = {part.said.get("range") for part in numbers}
    units = {part.said.get("unit") or split_unit(field.name)[1] for part in numbers}
    (span, *others), unit = ranges, units.pop()
    if span is None or others or not unit or units:
        raise TypeError(f"{kind.__name__}.{field.name} needs a range and a unit: see flexmb.scene.quantities")
    mixed = any(not isinstance(part.type, inspect.NoneType) for part in of_key if part not in numbers)
    single = not mixed and all(part.depth == 0 for part in numbers)
    unit_length = any("unit_length" in part.said for part in numbers)
    whole = all(isinstance(part.type, inspect.IntType) for part in numbers)
    return Key(field.name, unit, span, unit_length, whole, single)
