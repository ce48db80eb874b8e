"""Generator of the schema's documentation: ``python -m flexmb.scene.reference [FOLDER]``.

Writes `scene.schema.json` (for editors and validators) and `scene-reference.md` (a table for each struct) to FOLDER, by
default `docs`.
"""

from __future__ import annotations

import json
import sys
from inspect import cleandoc
from pathlib import Path

import msgspec
from msgspec import inspect

from flexmb.output.files import write_whole
from flexmb.scene.files import inline
from flexmb.scene.keys import Key, kinds, number_keys
from flexmb.scene.schema import Scene

SCALARS: dict[type[inspect.Type], str] = {
    inspect.StrType: "string", inspect.FloatType: "number", inspect.IntType: "integer", inspect.BoolType: "boolean",
}  # fmt: skip

INTRODUCTION = """\
# Scene reference

Generated from the schema by `python -m flexmb.scene.reference`; do not edit. A scene is a TOML file; the same structs
are built in Python with `SceneBuilder`, whose argument names are these keys without their unit.

SI throughout; the unit of a key is its suffix, and 1 that of pure numbers. All numbers are finite; those with a range
are inside, or the scene is refused. Quaternions are scalar-first, unit, and map outboard components to
inboard ones. References are by name. A key without default is required.
"""


def json_schema() -> str:
    """The JSON Schema of a scene."""
    schema = msgspec.json.schema(Scene)
    for struct in schema["$defs"].values():
        if "description" in struct:  # a docstring, whose indentation is removed by Python 3.13 only
            struct["description"] = cleandoc(struct["description"])
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def reference() -> str:
    """The reference in Markdown: every struct of a scene, in the order of its first appearance."""
    sections = [INTRODUCTION]
    for struct in map(inspect.type_info, kinds(Scene)):
        assert isinstance(struct, inspect.StructType)
        kind = f' (`{struct.tag_field} = "{struct.tag}"`)' if struct.tag is not None else ""
        sections.append(f"## {struct.cls.__name__}{kind}\n\n{cleandoc(struct.cls.__doc__ or '')}\n")
        if struct.fields:
            keys = number_keys(struct.cls)
            said = [(f, _said(keys.get(f.name))) for f in struct.fields]
            rows = [f"| `{f.name}` | {_type(f.type)} | {numbers} | {_default(f)} |" for f, numbers in said]
            sections.append("\n".join(["| key | type | unit | range | default |", "|---|---|---|---|---|", *rows, ""]))
    return "\n".join(sections)


def write(folder: Path) -> None:
    """Write both documents to `folder`."""
    write_whole(folder / "scene.schema.json", json_schema())
    write_whole(folder / "scene-reference.md", reference())


def _type(node: inspect.Type) -> str:
    match node:
        case inspect.Metadata(type=inner):
            return _type(inner)
        case inspect.StructType(cls=cls):
            return f"[{cls.__name__}](#{_anchor(node)})"
        case inspect.VarTupleType(item_type=item):
            return f"array of {_type(item)}"
        case inspect.TupleType(item_types=(first, *_) as items):
            return f"{len(items)} × {_type(first)}"
        case inspect.LiteralType(values=values):
            return ", ".join(f'`"{value}"`' for value in values)
        case inspect.UnionType(types=types):
            return " or ".join(_type(kind) for kind in types if not isinstance(kind, inspect.NoneType))
    return SCALARS[type(node)]


def _anchor(struct: inspect.StructType) -> str:
    """The heading's anchor as Markdown renderers form it: lower case, punctuation dropped, spaces to hyphens."""
    name = struct.cls.__name__.lower()
    return name if struct.tag is None else f"{name}-{struct.tag_field}--{struct.tag}"


def _said(key: Key | None) -> str:
    """Unit and range of a key with numbers; nothing of others."""
    if key is None:
        return " | "
    span = "unit length" if key.unit_length else str(key.range)
    return f"{key.unit} | {span}" + (f', else doubtful ("{key.range.waiver}")' if key.range.waiver else "")


def _default(field: inspect.Field) -> str:
    if field.required:
        return "required"
    return "none" if field.default is None else f"`{inline(field.default)}`"


if __name__ == "__main__":
    write(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs"))
