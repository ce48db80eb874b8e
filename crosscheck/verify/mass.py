"""The mass of all that a scene consists of."""

from __future__ import annotations

from typing import assert_never

import numpy as np

from flexmb.scene.bodies import BeamBody, Body, ModalBody, RigidBody, SidBody
from flexmb.scene.schema import Scene
from flexmb.scene.sections import mass_per_length


def total_mass(scene: Scene) -> float | None:
    """In kg; None if a body has its mass in a file."""
    bodies = [_mass(body) for body in scene.bodies]
    carried = sum(wheel.mass_kg for wheel in scene.wheels) + sum(point.mass_kg for point in scene.point_masses)
    return None if None in bodies else carried + sum(mass for mass in bodies if mass is not None)


def _mass(body: Body) -> float | None:
    match body:
        case RigidBody():
            return body.mass_kg
        case BeamBody():
            stations = sorted(body.stations, key=lambda station: station.x_m)
            places = [0.0, *(each.x_m for each in stations), body.length_m]
            densities = [mass_per_length(each) for each in (stations[0], *stations, stations[-1])]
            return float(np.trapezoid(densities, places)) + sum(tip.mass_kg for tip in body.tip_masses)
        case ModalBody() if body.points:
            return sum(point.mass_kg for point in body.points)
        case ModalBody() | SidBody():
            return None
        case _:
            assert_never(body)
