"""The coordinates by which all engines give derivatives: names and order, from the scene alone.

They are the free coordinates of a tree: those of the hinges in the order of the scene, then those of point masses,
wheels and modes. Prescribed ones are left out. The displacements xi along them are those of `flexmb.linear.variations`,
the motion that constant speeds would make in a unit of time: the change of a scalar coordinate; for a ball joint a
rotation vector in outboard axes; for free flight the same, then the displacement of the outboard origin in outboard
axes. The speeds are their rates: in free flight the relative angular velocity and velocity, both in outboard axes.
Forces are the loads along them: torques and forces in the same axes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from flexmb.scene.check.beams import mode_count
from flexmb.scene.freedoms import Ball, Floating, Freedom, ScalarFreedom
from flexmb.scene.modal_data import modal_arrays
from flexmb.scene.schema import BeamBody, Body, Hinge, ModalBody, PointMass, RigidBody, Scene, SidBody, Wheel

ROTATION = tuple(f"rotation.{axis}" for axis in "xyz")
POSITION = tuple(f"position.{axis}" for axis in "xyz")


def obstacle(scene: Scene) -> str:
    """Why the scene has no coordinates that all engines share, or accelerations that do not follow from them; "" if it
    has."""
    for collection, what in (
        ("closures", "displacements of a closed chain depend on each other"),
        ("couplings", "displacements of coupled coordinates depend on each other"),
        ("controllers", "accelerations depend on the states of controllers too"),
        ("events", "events change the scene"),
    ):
        items = getattr(scene, collection)
        if items:
            return f'"{items[0].name}": {what}'
    return ""


def is_counted(scene: Scene) -> bool:
    """Whether the number of coordinates follows from the scene alone: that of a SID body's modes is in its file."""
    return not any(isinstance(body, SidBody) for body in scene.bodies)


def coordinate_names(scene: Scene) -> tuple[str, ...]:
    """Names of the displacements, such as "elbow.rotation", "flight.position.x" and "boom.mode[0]"."""
    found = [name for item in _items(scene) for names in freedom_names(item) for name in names]
    return (*found, *(f"{body.name}.mode[{n}]" for body in scene.bodies for n in range(modes_of(body))))


def freedom_names(item: Hinge | PointMass | Wheel) -> tuple[tuple[str, ...], ...]:
    """For each freedom of an item the names of its displacements; none for a prescribed one."""
    return tuple(tuple(f"{item.name}.{name}" for name in _components(freedom)) for freedom in item.freedoms)


def places(names: Sequence[str], own: Iterable[str]) -> NDArray[np.intp]:
    """For each of `names` its place among an engine's `own` names."""
    where = {name: place for place, name in enumerate(own)}
    return np.array([where[name] for name in names], dtype=np.intp)


def modes_of(body: Body) -> int:
    """The number of modal coordinates of a body."""
    match body:
        case RigidBody():
            return 0
        case BeamBody() | ModalBody() if body.level == "rigid":
            return 0
        case BeamBody():
            return mode_count(body)
        case ModalBody():
            return int(modal_arrays(body).translation_modes.shape[2])
        case SidBody():
            raise ValueError(f'body "{body.name}": the number of its modes is in its SID file')
        case _:
            assert_never(body)


def _items(scene: Scene) -> tuple[Hinge | PointMass | Wheel, ...]:
    return (*scene.hinges, *scene.point_masses, *scene.wheels)


def _components(freedom: Freedom) -> tuple[str, ...]:
    match freedom:
        case ScalarFreedom(name=name, coordinate=coordinate):
            return () if coordinate.prescribed is not None else (name,)
        case Ball():
            return ROTATION
        case Floating():
            return ROTATION + POSITION
        case _:
            assert_never(freedom)
