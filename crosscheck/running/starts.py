"""The one start of all engines: a scene with the initial values that flexmb finds, so that no engine finds its own.

Loops and couplings are closed once, as initial values need to fit only roughly: engines that keep accelerations closed
would keep the gap, and soft ones would pull it together. A scene may also begin in its equilibrium, so that every
engine's linear model is that of small vibrations about it: one that does not rest there moves, and its frequencies
differ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar, assert_never

import msgspec
import numpy as np

from flexmb.closure.closures import ClosureError
from flexmb.linear.equations import equations_of
from flexmb.linear.equilibrium import equilibrium
from flexmb.linear.newton import EquilibriumError, corrected
from flexmb.scene.functions import Constant
from flexmb.scene.hinges import Free, Hinge, Spherical
from flexmb.scene.schema import ModalState, PointMass, Scene, Wheel
from flexmb.scene.tree import coordinates, with_coordinates
from flexmb.system.compile import compile
from flexmb.system.system import System
from flexmb.system.watches import WAIVERS
from flexmb.tables.state import DynamicsError, State
from flexmb.typing import Real

Item = TypeVar("Item", bound=Hinge | PointMass)
ROUNDING = 2.0**-40


def closed(scene: Scene) -> Scene:
    """The scene with initial values that close its closures and couplings; itself if they do, or if there are none.

    Warns (`SceneWarning`) of values that cannot be kept. Where flexmb finds no such values, engines get the scene as it
    is, and say what they make of it.
    """
    if not scene.constraints:
        return scene
    try:
        system = compile(msgspec.structs.replace(scene, allow=(*scene.allow, *WAIVERS)), kernels="general")
        start = system.initial_state
    except (ClosureError, DynamicsError, NotImplementedError):
        return scene
    rough = system.scene_state(0.0)
    if _is_rounding(start.q, rough.q) and _is_rounding(start.u, rough.u):
        return scene
    return beginning(scene, system, start)


def _is_rounding(found: Real, given: Real) -> bool:
    """Whether two rows of coordinates (rad, m) or speeds are the same but for what closing costs in digits."""
    size = max(1.0, float(np.max(np.abs(given), initial=0.0)))
    return bool(np.all(np.abs(found - given) <= ROUNDING * size))


def at_rest(scene: Scene) -> Scene:
    """The scene with the coordinates of an equilibrium as initial values, and without speeds.

    The state is at rest to rounding: derivatives of accelerations change with it by their own slope, and would carry
    what Newton's method leaves, 1e-13 rad, into stored references that are known better. Of a closed loop that stays.
    ValueError where none is found, or where a function of time changes, so that nothing rests.
    """
    _refuse_changes(scene)
    system = compile(scene)
    try:
        state: State = equilibrium(system)
        if not scene.controllers:
            held = equations_of(system).held(state.t)
            state = corrected(held, held.forces(state))
    except EquilibriumError as error:
        raise ValueError(str(error)) from None
    return beginning(scene, system, State(state.q, np.zeros(system.nu), state.t, system.layout))


def beginning(scene: Scene, system: System, state: State) -> Scene:
    """The scene of a system with a state of it as its initial values; prescribed coordinates keep what they are."""
    values = _Values(system, state)
    return msgspec.structs.replace(
        scene,
        hinges=tuple(_hinge(hinge, values) for hinge in scene.hinges),
        point_masses=tuple(_moved(mass, values) for mass in scene.point_masses),
        wheels=tuple(_wheel(wheel, values) for wheel in scene.wheels),
        modal_states=tuple(_modes(scene, values)),
    )


@dataclass(frozen=True)
class _Values:
    """Coordinates and speeds of a state by the names of items."""

    system: System
    state: State

    def __call__(self, name: str) -> tuple[Real, Real]:
        return self.state.q[self.system.coordinate(name)], self.state.u[self.system.speed(name)]


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


def _hinge(hinge: Hinge, values: _Values) -> Hinge:
    if not isinstance(hinge, Spherical | Free):
        return _moved(hinge, values)
    q, u = (value.tolist() for value in values(hinge.name))
    match hinge:
        case Spherical():
            return msgspec.structs.replace(hinge, quaternion=tuple(q), angular_velocity_rad_s=tuple(u))
        case Free():
            turned = msgspec.structs.replace(hinge, quaternion=tuple(q[3:]), angular_velocity_rad_s=tuple(u[:3]))
            return msgspec.structs.replace(turned, position_m=tuple(q[:3]), velocity_m_s=tuple(u[3:]))
        case _:
            assert_never(hinge)


def _moved(item: Item, values: _Values) -> Item:
    """The scalar coordinates of a hinge or a point mass; prescribed ones keep what they are."""
    every = [coordinate for _, coordinate in coordinates(item)]
    if not every:
        return item
    return with_coordinates(
        item,
        [
            coordinate if coordinate.prescribed is not None
            else msgspec.structs.replace(coordinate, **{coordinate.KEYS.value: value, coordinate.KEYS.rate: rate})
            for coordinate, value, rate in zip(every, *(part.tolist() for part in values(item.name)), strict=True)
        ],
    )  # fmt: skip


def _wheel(wheel: Wheel, values: _Values) -> Wheel:
    angle, speed = (float(part[0]) for part in values(wheel.name))
    return msgspec.structs.replace(wheel, angle_rad=angle, speed_rad_s=speed)


def _modes(scene: Scene, values: _Values) -> list[ModalState]:
    """Those of all bodies that bend at the start or have a modal state in the scene."""
    known = {state.body for state in scene.modal_states}
    modes = []
    for body in scene.bodies:
        eta, rate = values(f"{body.name}.modes")
        if body.name in known or np.any(eta) or np.any(rate):
            modes.append(ModalState(body=body.name, coordinates=tuple(eta.tolist()), rates=tuple(rate.tolist())))
    return modes
