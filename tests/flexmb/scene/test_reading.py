"""Texts that readers must not take long over, and structs made in Python that say by name which key is wrong, as files
do."""

from __future__ import annotations

import time

import msgspec
import pytest

import flexmb as fm
from flexmb.scene import schema
from flexmb.scene.reading import DEEPEST, MOST_DOTS, Unreadable, parse_toml


@pytest.mark.parametrize("long", ["1" * 4_000_000, "a " * 2_000_000, "a" + " " * 4_000_000, "a.b " * 1_000_000])
def test_long_text_is_read_in_one_go(long: str) -> None:
    """A search for dotted keys that took the square of a word's length hung for minutes."""
    assert parse_toml(f'x = "{long}"') == {"x": long}


@pytest.mark.parametrize("dot", [".", " . "])
def test_endless_keys_are_refused(dot: str) -> None:
    assert parse_toml(dot.join("a" * DEEPEST) + " = 1")
    with pytest.raises(Unreadable, match="a key has more than 64 parts"):
        parse_toml(dot.join("a" * (DEEPEST + 1)) + " = 1")


@pytest.mark.parametrize("line", [
    "[t{i}]\n" + "a." * 60 + "a = 1\n", "[t{i}]\na.b.c.d.e.f.g = 1\n", "[a{i}.b.c.d.e.f.g]\n", "t{i}.1.2.3.4.5.6 = 1\n",
    't{i} . "a"."b" = 1\n',
])  # fmt: skip
def test_twenty_thousand_tables_in_tables_are_refused_at_once(line: str) -> None:
    """tomllib took 24 s for the first of them, and a gigabyte."""
    count = 20_000 if "60" in line else 60_000
    text = "".join(line.replace("{i}", str(i)) for i in range(count))
    start = time.process_time()
    with pytest.raises(Unreadable, match="in keys"):
        parse_toml(text)
    assert time.process_time() - start < 2.0


def test_dots_in_numbers_texts_and_times_are_no_dots_in_keys() -> None:
    row = "[[b]]\nx = [1.5, -0.25e3, 1979-05-27T07:32:00.999]\n"
    assert len(parse_toml(row * 10_000)["b"]) == 10_000
    prose = """# 'a.b\nx = "a.b \\\" a.b"\ny = 'a.b "a.b'\n"""
    prose += """z = \"\"\"a.b \"a.b\n# a.b\n\\\\\"\"\"\nw = \'\'\'a.b\n\'a.b\'\'\'\n"""
    assert len(parse_toml(f"[[b]]\n{prose}" * 20_000)["b"]) == 20_000
    assert len(parse_toml("x = [" + "1.5," * (MOST_DOTS + 1) + "]")["x"]) == MOST_DOTS + 1


def test_a_robot_is_told_from_a_scene_with_a_slip() -> None:
    with pytest.raises(Unreadable, match="^XML, and a scene is TOML: ") as error:
        parse_toml('\n<robot name="r"/>')
    assert "flexmb import" in error.value.remedy


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
