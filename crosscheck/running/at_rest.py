"""A scene that begins in its equilibrium, so that every engine's linear model is that of small vibrations about it.

flexmb finds the equilibrium from the scene's own initial state. It is the start of all engines: one that does not rest
there moves, and its frequencies differ.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import msgspec

from flexmb.linear.equilibrium import equilibrium
from flexmb.linear.newton import EquilibriumError
from flexmb.scene.functions import Constant
from flexmb.scene.hinges import Free, Hinge, Spherical
from flexmb.scene.schema import ModalState, PointMass, Scene, Wheel
from flexmb.scene.tree import coordinates, with_coordinates
from flexmb.system.compile import compile

Item = TypeVar("Item", bound=Hinge | PointMass)
STILL = (0.0, 0.0, 0.0)


def at_rest(scene: Scene) -> Scene:
    """The scene with the coordinates of an equilibrium as initial values, and without speeds.

    ValueError where none is found, or where a function of time changes, so that nothing rests.
    """
    _refuse_changes(scene)
    system = compile(scene)
    try:
        state = equilibrium(system)
    except EquilibriumError as error:
        raise ValueError(str(error)) from None
    found = {name: float(value) for (name, _), value in zip(system.state_names[0], state.q, strict=True)}
    modal = [name.rpartition(".mode[")[0] for name in found if ".mode[" in name]
    return msgspec.structs.replace(
        scene,
        hinges=tuple(_hinge(each, found) for each in scene.hinges),
        point_masses=tuple(_moved(each, found) for each in scene.point_masses),
        wheels=tuple(_wheel(each, found) for each in scene.wheels),
        modal_states=tuple(_modes(body, found) for body in dict.fromkeys(modal)),
    )


def _refuse_changes(scene: Scene) -> None:
    """Prescribed coordinates, motors and loads must be constant."""
    named = [
        (f"{item.name}.{name}", function)
        for item in (*scene.hinges, *scene.point_masses)
        for name, coordinate in coordinates(item)
        for function in (coordinate.prescribed, coordinate.effort)
    ]
    named += [(load.name, load.function) for load in scene.loads]
    named += [(wheel.name, function) for wheel in scene.wheels for function in (wheel.prescribed_rad, wheel.torque_Nm)]
    for name, function in named:
        if function is not None and not isinstance(function, Constant):
            raise ValueError(f'"{name}" changes with time: a scene that begins in its equilibrium has constants there')


def _hinge(hinge: Hinge, found: Mapping[str, float]) -> Hinge:
    if not isinstance(hinge, Spherical | Free):
        return _moved(hinge, found)
    w, x, y, z = (found[f"{hinge.name}.quaternion.{part}"] for part in "wxyz")
    turned = msgspec.structs.replace(hinge, quaternion=(w, x, y, z), angular_velocity_rad_s=STILL)
    if isinstance(turned, Spherical):
        return turned
    px, py, pz = (found[f"{hinge.name}.position.{part}"] for part in "xyz")
    return msgspec.structs.replace(turned, position_m=(px, py, pz), velocity_m_s=STILL)


def _moved(item: Item, found: Mapping[str, float]) -> Item:
    """The scalar coordinates of a hinge or a point mass; prescribed ones keep what they are."""
    every = coordinates(item)
    if not every:
        return item
    return with_coordinates(
        item,
        [
            each if each.prescribed is not None
            else msgspec.structs.replace(each, **{each.KEYS.value: found[f"{item.name}.{name}"], each.KEYS.rate: 0.0})
            for name, each in every
        ],
    )  # fmt: skip


def _wheel(wheel: Wheel, found: Mapping[str, float]) -> Wheel:
    return msgspec.structs.replace(wheel, angle_rad=found[f"{wheel.name}.angle"], speed_rad_s=0.0)


def _modes(body: str, found: Mapping[str, float]) -> ModalState:
    count = sum(name.startswith(f"{body}.mode[") for name in found)
    return ModalState(body=body, coordinates=tuple(found[f"{body}.mode[{n}]"] for n in range(count)))
