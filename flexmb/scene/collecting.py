"""Common base of the builders: makes structs of a scene from values named without units, and collects them by kind.

Keyword arguments of several methods, or rarely needed ones, are typed dictionaries: type checkers and editors know
their names, calls refuse other names, and omitted ones have the defaults of the schema.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, wraps
from inspect import Parameter, isfunction, signature
from typing import Any, Literal, ParamSpec, Self, TypedDict, TypeVar, get_args, get_type_hints

import msgspec
from numpy.typing import ArrayLike

from flexmb.scene import schema as s
from flexmb.scene.bodies import ZERO
from flexmb.scene.convert import ROOT, label, plain, to_struct
from flexmb.scene.keys import split_unit
from flexmb.scene.problems import closest


def refuse_others(what: str, names: Iterable[str], known: type) -> None:
    """TypeError for a name that a typed dictionary does not declare, with the nearest name that it declares."""
    for name in names:
        if name not in known.__annotations__:
            raise TypeError(f'{what} has no "{name}": {closest(name, known.__annotations__)}')


class Placement(TypedDict, total=False):
    """Hinge frames: nodes of parent and child, and fixed offsets from them (node axes, m)."""

    parent_node: str
    child_node: str
    parent_position: ArrayLike
    parent_quaternion: ArrayLike
    child_position: ArrayLike
    child_quaternion: ArrayLike


class BeamOptions(TypedDict, total=False):
    """Model of a beam, see `flexmb.scene.schema.BeamBody`: `theory`, `mass` matrix, inertia `points`; and rigid lumps
    fixed to it, `tip_masses`."""

    theory: Literal["euler-bernoulli", "timoshenko"]
    mass: Literal["consistent", "lumped"]
    points: Literal["line", "rotary", "section"]
    tip_masses: Sequence[s.TipMass]


class Sampling(TypedDict, total=False):
    """Sampling of a controller: every `period` (s) from `offset` (s) on, with outputs that change `delay` (s) later;
    without a period the controller is continuous."""

    period: float | None
    offset: float
    delay: float


class SectionShape(TypedDict, total=False):
    """A beam section's torsion constant `J` (m⁴), `shear_factor`, and station `x` (m)."""

    J: float | None
    shear_factor: float
    x: float


P = ParamSpec("P")
R = TypeVar("R")
ALONE: dict[type[msgspec.Struct], tuple[str, type[msgspec.Struct]]] = {
    s.Revolute: ("rotation", s.AngularCoordinate), s.Screw: ("rotation", s.AngularCoordinate),
    s.Prismatic: ("translation", s.LinearCoordinate),
}  # fmt: skip
"""Hinges with one coordinate, whose keys stand for those of the coordinate."""


@cache
def stems(kind: type[msgspec.Struct]) -> dict[str, str]:
    """The keys of a struct by their names without unit."""
    return {split_unit(key)[0]: key for key in kind.__struct_fields__}


def make(kind: type[msgspec.Struct], place: Any = ROOT, **values: Any) -> Any:
    """A schema struct from values named without units; None is what is not given.

    TypeError for an unknown name; SceneError, which names the place, for a value of a wrong type.
    """
    keys = stems(kind)
    if kind in ALONE:
        within, coordinate = ALONE[kind]
        inner = {name: values.pop(name) for name in stems(coordinate) if name in values}
        values[within] = make(coordinate, **inner)
    for name in values:
        if name not in keys:
            raise TypeError(f'a {kind.__name__} has no "{name}": {closest(name, keys)}')
    given = {keys[name]: value for name, value in values.items() if value is not None}
    return to_struct(plain(given), kind, place=place)


def _collections() -> dict[type, str]:
    """The collection of a scene for each kind of struct, from the schema."""
    table = {}
    for key, hint in get_type_hints(s.Scene).items():
        for item in get_args(hint):
            for kind in get_args(item) or (item,):
                if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
                    table[kind] = key
    return table


COLLECTIONS = _collections()


def known_keywords(method: Callable[P, R]) -> Callable[P, R]:
    """The function, which refuses a keyword that it does not have by the nearest one that it has.

    One that takes keywords of any name, which `make` examines, is itself.
    """
    known = signature(method).parameters
    if any(each.kind is Parameter.VAR_KEYWORD for each in known.values()):
        return method

    @wraps(method)
    def examined(*given: P.args, **named: P.kwargs) -> R:
        for name in named:
            if name not in known:
                words = [each for each in known if each != "self"]
                raise TypeError(f'{method.__name__}() has no argument "{name}": {closest(name, words)}')
        return method(*given, **named)

    return examined


class Collector:
    """Collects the structs of a scene; `flexmb.scene.build.SceneBuilder` has a method for each kind."""

    def __init_subclass__(cls) -> None:
        """Methods refuse a keyword that they do not have by the nearest one that they have."""
        for name, method in list(vars(cls).items()):
            if isfunction(method) and not name.startswith("_"):
                setattr(cls, name, known_keywords(method))

    def __init__(
        self, name: str, *, gravity: ArrayLike = ZERO, description: str = "", allow: Sequence[s.Waiver] = ()
    ) -> None:
        """`gravity`: uniform acceleration (m/s²) in World axes. `allow`: doubts that are intended, see `Scene`."""
        self._head: dict[str, Any] = {
            "name": name, "description": description, "allow": list(allow), "gravity_m_s2": plain(gravity)
        }  # fmt: skip
        self._lists: dict[str, list[msgspec.Struct]] = {key: [] for key in COLLECTIONS.values()}

    def add(self, *structs: msgspec.Struct) -> Self:
        """Append schema structs of any kind: bodies, hinges, wheels, loads, markers ..."""
        for struct in structs:
            if type(struct) not in COLLECTIONS:
                names = ", ".join(sorted(kind.__name__ for kind in COLLECTIONS))
                raise TypeError(f"a {type(struct).__name__} is not a part of a scene by itself; these are: {names}")
            self._lists[COLLECTIONS[type(struct)]].append(struct)
        return self

    def _made(self, kind: type[msgspec.Struct], given: Mapping[str, Any]) -> Self:
        """Append a struct whose values are the arguments of a method, its local names; one input stands for a list."""
        values = {name: value for name, value in given.items() if name != "self"}
        if isinstance(values.get("inputs"), str):
            values["inputs"] = (values["inputs"],)
        return self._append(kind, **values)

    def _append(self, kind: type[msgspec.Struct], **values: Any) -> Self:
        key = COLLECTIONS[kind]
        place = ROOT.key(key, len(self._lists[key])).named(label(key, values))
        return self.add(make(kind, place, **values))
