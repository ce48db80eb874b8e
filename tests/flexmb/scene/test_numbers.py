"""Every numeric key of the schema says its range and unit, and what is outside is refused by the name of the key."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from typing import Annotated, Any, get_args

import msgspec
import pytest
from msgspec import inspect

from flexmb.scene import schema as s
from flexmb.scene.bodies import SceneStruct
from flexmb.scene.check import check_scene
from flexmb.scene.check.numbers import outside
from flexmb.scene.check.walk import numbers
from flexmb.scene.keys import Key, bare, fields, kinds, number_keys, parts
from flexmb.scene.problems import Doubt, SceneError
from flexmb.scene.quantities import LARGEST, Number

HOLDS = {}
"""A struct that can hold one of a kind, and under which key."""
for each in kinds(s.Scene):
    for of in fields(each):
        for part in parts(of.type):
            if isinstance(part.type, inspect.StructType):
                HOLDS.setdefault(part.type.cls, (each, of))
NUMERIC = [kind for kind in kinds(s.Scene) if number_keys(kind)]


def filled(node: inspect.Type, number: float = 1.0) -> Any:
    """A value of a type, with this number as its first one."""
    match bare(node):
        case inspect.FloatType():
            return number
        case inspect.IntType():
            return int(number)
        case inspect.TupleType(item_types=(first, *others)):
            return (filled(first, number), *(filled(item, 0.0) for item in others))
        case inspect.VarTupleType(item_type=item):
            return (filled(item, number),) if any(not _is_struct(part.type) for part in parts(item)) else ()
        case inspect.UnionType(types=(first, *_)):
            return filled(first, number)
        case inspect.LiteralType(values=(first, *_)):
            return first
        case inspect.StructType(cls=cls):
            return example(cls)
    return "a"


def _is_struct(node: inspect.Type) -> bool:
    return isinstance(node, inspect.StructType)


def example(kind: type, **given: Any) -> Any:
    """A struct with these values, and some for the other keys that need one."""
    return kind(**({field.name: filled(field.type) for field in fields(kind) if field.required} | given))


def scene_with(struct: msgspec.Struct) -> s.Scene:
    """A scene, whatever else may be wrong with it, that holds a struct."""
    while not isinstance(struct, s.Scene):
        holder, field = HOLDS[type(struct)]
        several = any(isinstance(part.type, inspect.StructType) and part.depth for part in parts(field.type))
        struct = example(holder, **{field.name: (struct,) if several else struct})
    return struct


def wrong(kind: type, value: Callable[[Key], float | None]) -> tuple[s.Scene, set[str]]:
    """A scene with a struct all of whose numbers are `value` of their key, where it is not None; and their keys."""
    given = {key.name: number for key in number_keys(kind).values() if (number := value(key)) is not None}
    types = {field.name: field.type for field in fields(kind)}
    struct = example(kind, **{name: filled(types[name], number) for name, number in given.items()})
    return scene_with(struct), set(given)


def below(key: Key) -> float | None:
    return key.range.least - 1 if key.range.least > -LARGEST else None


def above(key: Key) -> float | None:
    return key.range.most + 1 if key.range.most < LARGEST else None


def excluded(key: Key) -> float | None:
    return key.range.excluded


def too_long(key: Key) -> float | None:
    return 2.0 if key.unit_length else None


def not_a_number(key: Key) -> float | None:
    return None if key.whole else nan


def infinite(key: Key) -> float | None:
    return None if key.whole else -inf


def huge(key: Key) -> float | None:
    return None if key.whole else 1.01 * LARGEST


@pytest.mark.parametrize("kind", NUMERIC, ids=lambda kind: kind.__name__)
def test_all_numbers_outside_are_refused_at_once_by_key_and_remedy(kind):
    for value in (below, above, excluded, too_long, not_a_number, infinite, huge):
        scene, keys = wrong(kind, value)
        found = list(numbers(scene))
        where = [problem.where.partition(" (")[0].rpartition(".")[2].partition("[")[0] for problem in found]
        assert sorted(where) == sorted(keys), (value, found)
        assert all(problem.what and problem.remedy for problem in found)
        doubts = {key.name for key in number_keys(kind).values() if key.range.waiver} if value is below else set()
        assert {name for name, each in zip(where, found, strict=True) if isinstance(each, Doubt)} == keys & doubts
        if keys - doubts:
            with pytest.raises(SceneError) as refused:
                check_scene(scene)
            assert all(str(problem) in str(refused.value) for problem in found if not isinstance(problem, Doubt))


@pytest.mark.parametrize("kind", NUMERIC, ids=lambda kind: kind.__name__)
def test_what_one_item_has_another_may_leave_out(kind):
    """Items of a kind are looked at together."""
    types = {field.name: field.type for field in fields(kind)}
    without = example(kind)
    for name in number_keys(kind):
        whole = example(kind, **{name: filled(types[name])})
        assert outside([without, whole]) <= {0, 1} and outside([whole, without]) <= {0, 1}


def test_what_is_only_doubtful_has_a_word_that_admits_it():
    words = {key.range.waiver for kind in NUMERIC for key in number_keys(kind).values()} - {""}
    assert words == {"negative_stiffness", "negative_damping"} and words <= set(get_args(s.Waiver))


def test_a_number_without_range_or_unit_is_no_key():
    """The check of a key that its type says nothing of would be silent."""

    class Plain(SceneStruct, frozen=True, kw_only=True):
        length_m: float

    class Mixed(SceneStruct, frozen=True, kw_only=True):
        length_m: Number | tuple[float, ...]

    class Unitless(SceneStruct, frozen=True, kw_only=True):
        share: Annotated[float, msgspec.Meta(extra={})] | Number

    for kind in (Plain, Mixed, Unitless):
        with pytest.raises(TypeError, match="needs a range and a unit"):
            number_keys(kind)
