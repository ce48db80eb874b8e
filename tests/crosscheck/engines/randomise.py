"""Random states of a scene, in which engines must agree on accelerations, loads, energies and momenta to round-off."""

from typing import assert_never

import numpy as np
from msgspec.structs import replace
from numpy.random import Generator

from flexmb.scene import schema as s
from flexmb.scene.modal_data import modal_arrays
from flexmb.scene.strains import families
from flexmb.scene.tree import Coordinate, coordinates, with_coordinates

_ANGLE = 0.8  # rad: away from the singularity of three-axis gimbals at pi/2
_SHIFT = 0.2  # m
_RATE = 1.0  # rad/s, m/s
_WHEEL_SPEED = 20.0  # rad/s
_DEFLECTION = 0.03  # of a beam's length


def randomise(scene: s.Scene, rng: Generator) -> s.Scene:
    """The scene with random hinge coordinates and speeds, modal states and wheel speeds, except prescribed ones."""
    flexible = [body for body in scene.bodies if isinstance(body, s.BeamBody | s.ModalBody) and body.level != "rigid"]
    states = tuple(_modal_state(body, rng) for body in flexible)
    return replace(
        scene, hinges=tuple(_hinge(hinge, rng) for hinge in scene.hinges),
        wheels=tuple(_wheel(wheel, rng) for wheel in scene.wheels),
        point_masses=tuple(_point_mass(point, rng) for point in scene.point_masses), modal_states=states,
    )  # fmt: skip


def _hinge(hinge: s.Hinge, rng: Generator) -> s.Hinge:
    if isinstance(hinge, s.Free):
        hinge = replace(hinge, position_m=_vector(rng, _SHIFT))
    if isinstance(hinge, s.Free | s.Spherical):
        hinge = replace(hinge, quaternion=_quaternion(rng), angular_velocity_rad_s=_vector(rng, _RATE))
    if isinstance(hinge, s.Free):
        hinge = replace(hinge, velocity_m_s=_vector(rng, _RATE))
    return with_coordinates(hinge, [_coordinate(each, rng) for _, each in coordinates(hinge)])


def _coordinate(coordinate: Coordinate, rng: Generator) -> Coordinate:
    value, rate = rng.uniform(-1.0, 1.0), rng.uniform(-_RATE, _RATE)
    if coordinate.prescribed is not None:
        return coordinate
    keys, size = coordinate.KEYS, _ANGLE if coordinate.ANGULAR else _SHIFT
    return replace(coordinate, **{keys.value: size * value, keys.rate: rate})


def _point_mass(point: s.PointMass, rng: Generator) -> s.PointMass:
    return with_coordinates(point, [_coordinate(each, rng) for _, each in coordinates(point)])


def _wheel(wheel: s.Wheel, rng: Generator) -> s.Wheel:
    if wheel.prescribed_rad is not None:
        return wheel
    return replace(wheel, angle_rad=rng.uniform(-np.pi, np.pi), speed_rad_s=rng.uniform(-_WHEEL_SPEED, _WHEEL_SPEED))


def _modal_state(body: s.BeamBody | s.ModalBody, rng: Generator) -> s.ModalState:
    """Modal coordinates whose largest displacement is a few per cent of the body's size, rates alike per second."""
    match body:
        case s.BeamBody():
            count, scale = _beam_modes(body)
        case s.ModalBody():
            arrays = modal_arrays(body)
            modes = arrays.translation_modes
            count = modes.shape[2]
            size = np.ptp(arrays.position, axis=0).max()
            scale = _DEFLECTION * size / np.maximum(np.abs(modes).max(axis=(0, 1)), np.finfo(float).tiny)
        case _:
            assert_never(body)
    coordinates, rates = scale * rng.uniform(-1.0, 1.0, (2, count))
    return s.ModalState(body=body.name, coordinates=tuple(map(float, coordinates)), rates=tuple(map(float, rates)))


def _beam_modes(body: s.BeamBody) -> tuple[int, float]:
    """Number of modes, and a coordinate that moves the tip by a few per cent: beam modes have unit modal mass.

    Attachment modes add, for each wanted family, one (axial, torsion) or two (bending: force and moment). Torsional
    modes are normalised by the polar inertia, which keeps the scale small enough for them.
    """
    mean = {
        key: float(np.mean([getattr(station, key) for station in body.stations])) * body.length_m
        for key in ("mass_per_length_kg_m", "rotary_y_kg_m", "rotary_z_kg_m")
    }
    scale = _DEFLECTION * body.length_m * np.sqrt(mean["mass_per_length_kg_m"]) / 2.0
    polar = mean["rotary_y_kg_m"] + mean["rotary_z_kg_m"]
    if "torsion" in families(body) and polar > 0.0:
        scale = min(scale, 0.2 * np.sqrt(polar))
    attachments = {"axial": 1, "torsion": 1, "bending_y": 2, "bending_z": 2}
    extra = sum(attachments[family] for family in families(body)) if body.modes.static else 0
    return body.modes.count + extra, float(scale)


def _quaternion(rng: Generator) -> s.Quaternion:
    q = rng.normal(size=4)
    w, x, y, z = (float(part) for part in q / np.linalg.norm(q))
    return (w, x, y, z)


def _vector(rng: Generator, size: float) -> s.Vector:
    x, y, z = (float(part) for part in rng.uniform(-size, size, 3))
    return (x, y, z)
