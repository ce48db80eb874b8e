"""Conversion of plain data to typed structs, with errors that name the place and the remedy."""

from __future__ import annotations

import re
from numbers import Real
from typing import Any, TypeVar

import msgspec
from msgspec import inspect

from flexmb.scene.keys import bare, split_unit
from flexmb.scene.problems import Defect, Place, SceneError, closest

Struct = TypeVar("Struct")

ROOT = Place()
KINDS = {
    "bodies": "body", "hinges": "hinge", "closures": "closure", "couplings": "coupling", "connectors": "connector",
    "wheels": "wheel",
    "point_masses": "point mass", "loads": "load", "markers": "marker", "total_loads": "total load",
    "modal_states": "modal state of body",
    "nodes": "node", "sensors": "sensor", "controllers": "controller", "events": "event",
}  # fmt: skip


class NamedKeys(msgspec.StructMeta):
    """What makes the structs of scenes: a call with other keys than theirs is a TypeError that names struct and key."""

    def __call__(cls, *given: Any, **keys: Any) -> Any:
        """Make a struct."""
        try:
            return _make(cls, *given, **keys)
        except TypeError as error:
            known = msgspec.structs.fields(cls)  # type: ignore[arg-type]  # its classes are structs
            names = [each.name for each in known]
            if given:
                raise TypeError(f"{cls.__name__} takes values by key only: {', '.join(names) or 'none'}") from error
            if strange := [key for key in keys if key not in names]:
                raise TypeError(f'{cls.__name__} has no key "{strange[0]}": {closest(strange[0], names)}') from error
            if missing := [each.name for each in known if each.required and each.name not in keys]:
                raise TypeError(f'{cls.__name__} needs the key "{missing[0]}", which is not given') from error
            raise


_make = msgspec.StructMeta.__call__


def plain(value: Any) -> Any:
    """Structs, arrays and numpy scalars as dicts, lists and numbers."""
    return msgspec.to_builtins(value, enc_hook=_array_to_list)


def to_struct(data: Any, kind: type[Struct], scene: str = "", place: Place = ROOT) -> Struct:
    """Plain `data` as a `kind`, with all types, keys and lengths checked; `place` is its place in the scene.

    Raises SceneError with the path, the names on it, and the remedy: for an unknown key the nearest one, or the
    expected unit if only the unit is wrong.
    """
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        raise SceneError(scene or _name_of(data), [_explain(str(error), data, kind, place)]) from None


def refuse_wrong_types(struct: msgspec.Struct) -> None:
    """SceneError, like that of `to_struct`, if a struct contains values that its kind does not allow."""
    kind = type(struct)
    try:  # encoding and decoding in binary form takes a fraction of the time
        _DECODERS.setdefault(kind, msgspec.msgpack.Decoder(kind)).decode(_ENCODER.encode(struct))
    except (msgspec.MsgspecError, TypeError, ValueError, OverflowError):
        to_struct(plain(struct), kind)


def label(collection: str, item: Any) -> str:
    """The name of an item in messages, such as `hinge "pivot"`; "" for items without a name."""
    field = "body" if collection == "modal_states" else "name"
    name = item.get(field) if isinstance(item, dict) else getattr(item, field, None)
    return f'{KINDS[collection]} "{name}"' if collection in KINDS and isinstance(name, str) else ""


def _array_to_list(value: Any) -> Any:
    if hasattr(value, "tolist"):
        values = value.tolist()
        if type(values) is not type(value):
            return values
        if isinstance(value, Real):  # numpy has no plain number for one of extended precision
            return float(value)
    raise TypeError(f"a scene cannot hold a {type(value).__name__}")


_ENCODER = msgspec.msgpack.Encoder(enc_hook=_array_to_list)
_DECODERS: dict[type, msgspec.msgpack.Decoder[Any]] = {}


def _name_of(data: Any) -> str:
    return str(data.get("name", "")) if isinstance(data, dict) else ""


def _explain(message: str, data: Any, kind: Any, place: Place) -> Defect:
    """One msgspec message ("what - at `$.path`") as a Defect."""
    what, _, path = message.partition(" - at ")
    steps: list[str | int] = [
        int(index) if index else key for key, index in re.findall(r"\.(\w+)|\[(\d+)\]", path.strip("`"))
    ]
    value = data
    node: inspect.Type = inspect.type_info(kind)
    for i, step in enumerate(steps):
        value = value[step] if not isinstance(value, dict) or step in value else None
        place, node = place.key(step), _below(node, step, value)
        collection = steps[i - 1] if i else None
        if isinstance(step, int) and isinstance(collection, str) and (name := label(collection, value)):
            place = place.named(name)
    return Defect(str(place), what, _remedy(what, place, value, node))


def _below(node: inspect.Type, step: str | int, value: Any) -> inspect.Type:
    """The type one step below `node`; in a union, the alternative that the `kind` of `value` selects."""
    below = node = bare(node)
    if isinstance(node, inspect.StructType):
        below = next((field.type for field in node.fields if field.encode_name == step), node)
    elif isinstance(node, inspect.VarTupleType):
        below = node.item_type
    elif isinstance(node, inspect.TupleType) and isinstance(step, int):
        below = node.item_types[min(step, len(node.item_types) - 1)]
    below = bare(below)
    if isinstance(below, inspect.UnionType):
        structs = [kind for kind in below.types if isinstance(kind, inspect.StructType)]
        tag = value.get("kind") if isinstance(value, dict) else None
        chosen = [struct for struct in structs if struct.tag == tag or len(structs) == 1]
        return chosen[0] if chosen else below
    return below


def _remedy(what: str, place: Place, value: Any, node: inspect.Type) -> str:
    quoted = re.search(r"`(\w+)`|'([^']*)'", what)
    word = (quoted[1] or quoted[2] or "") if quoted else ""
    if "unknown field" in what and isinstance(node, inspect.StructType):
        return _unknown_key(word, node)
    if "missing required field" in what:
        if word == "kind":
            return f"say which kind it is: {_tags(node)}"
        unit = split_unit(word)[1]
        return f'add "{word}"' + (f" (in {unit})" if unit else "")
    if place.path.endswith(".kind"):
        return closest(word, _tags(node).split(", "))
    if isinstance(node, inspect.LiteralType):
        return closest(word, map(str, node.values))
    key = place.path.rpartition(".")[2].partition("[")[0]
    unit = split_unit(key)[1]
    return f"give {key} {'in ' + unit + ' ' if unit else ''}as the reference of its file says"


def _tags(node: inspect.Type) -> str:
    types = node.types if isinstance(node, inspect.UnionType) else (node,)
    return ", ".join(str(kind.tag) for kind in types if isinstance(kind, inspect.StructType) and kind.tag)


def _unknown_key(word: str, node: inspect.StructType) -> str:
    """The remedy for an unknown key: a wrong unit, a key that belongs one table deeper, or a misspelling."""
    keys = [field.encode_name for field in node.fields]
    stems = {split_unit(key)[0]: key for key in keys if split_unit(key)[1]}
    same = [stem for stem in stems if word == stem or word.startswith(stem + "_")]
    if same:
        key = stems[max(same, key=len)]
        return f'the unit expected is {split_unit(key)[1]}: write "{key}"'
    for field in node.fields:
        if isinstance(field.type, inspect.StructType) and word in (each.encode_name for each in field.type.fields):
            return f'"{word}" belongs one level deeper: {field.encode_name} = {{ {word} = ... }}'
    return closest(word, keys)
