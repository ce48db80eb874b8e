"""The contents of a scene in words: what an engine would have to represent for a clause to be tried."""

from __future__ import annotations

import re
from collections.abc import Iterator

from crosscheck.engines.checked import LATER
from crosscheck.engines.contract import Engine
from flexmb.scene.hinges import AngularCoordinate, LinearCoordinate
from flexmb.scene.schema import RigidBody, Scene


def to_offer(engine: Engine, scene: Scene) -> str:
    """What the engine would have to offer for a scene that it refuses."""
    known = getattr(engine, "takes", ())
    later = [f'"{collection}"' for collection in LATER if getattr(scene, collection) and collection not in known]
    named = f" and name {', '.join(later)} in `takes`" if later else ""
    return f"represent {', '.join(dict.fromkeys(_parts(scene)))}{named}"


def _parts(scene: Scene) -> Iterator[str]:
    """The kinds of the scene's items in the order of their declaration, without rigid bodies."""
    if not all(isinstance(body, RigidBody) for body in scene.bodies):
        yield "flexible bodies"
    for hinge in scene.hinges:
        yield f"{_words(hinge)} hinges"
        for part in _coordinates(hinge):
            yield from _abilities(part)
    for wheel in scene.wheels:
        yield "wheels"
        yield from (f"{what} of wheels" for what in _abilities(wheel))
    if scene.point_masses:
        yield "point masses"
    for load in scene.loads:
        yield f"{load.type}s in {load.frame} axes"
    for connector in scene.connectors:
        yield f"connectors: {_words(connector)}"
    if scene.couplings:
        yield "couplings"


def _coordinates(hinge: object) -> Iterator[AngularCoordinate | LinearCoordinate]:
    for name in getattr(hinge, "__struct_fields__", ()):
        coordinates = getattr(hinge, name)
        if isinstance(coordinates, AngularCoordinate | LinearCoordinate):
            yield coordinates


def _abilities(part: object) -> Iterator[str]:
    """The drives, springs and dampers of a coordinate or a wheel."""
    told = {
        "prescribed": "prescribed motion", "torque": "motors", "force": "motors", "stiffness": "springs",
        "damping": "dampers", "friction": "friction",
    }  # fmt: skip
    for name in getattr(part, "__struct_fields__", ()):
        what = told.get(name.partition("_")[0])
        if what is not None and getattr(part, name):
            yield what


def _words(item: object) -> str:
    """The name of a class in small letters: "spring damper" of SpringDamper."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(item).__name__).lower()
