"""Structs that are made in Python say by name which key is wrong, as files do."""

import msgspec
import pytest

import flexmb as fm
from flexmb.scene import schema

STRUCTS = [each for name in schema.__all__ if issubclass(type(each := getattr(schema, name)), msgspec.StructMeta)]


@pytest.mark.parametrize("struct", STRUCTS, ids=lambda each: each.__name__)
def test_a_misspelt_key_of_any_struct_is_named_with_the_nearest(struct) -> None:
    name = msgspec.structs.fields(struct)[-1].name if msgspec.structs.fields(struct) else ""
    with pytest.raises(TypeError, match=f'^{struct.__name__} has no key "{name}x"') as refused:
        struct(**{f"{name}x": 1.0})
    assert not name or f'"{name}"' in str(refused.value)
    with pytest.raises(TypeError, match=f"^{struct.__name__} "):
        struct(1.0)


def test_what_is_missing_is_named() -> None:
    with pytest.raises(TypeError, match='^RigidBody has no key "mas": did you mean "mass_kg"'):
        fm.RigidBody(mas=1.0)
    with pytest.raises(TypeError, match='^Constant needs the key "value"'):
        fm.Constant()
