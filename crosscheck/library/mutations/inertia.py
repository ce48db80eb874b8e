"""Mutations of masses, mass centres and moments of inertia."""

from __future__ import annotations

from collections.abc import Callable
from typing import assert_never

import numpy as np
from msgspec.structs import replace

from crosscheck.library.case import CaseError
from crosscheck.library.mutations.edits import (
    bodies,
    heavier,
    more,
    multiplied,
    of_body,
    of_point_mass,
    opposite,
    point_masses,
    scaled,
    scaled_stations,
)
from crosscheck.library.mutations.mutation import FACTOR, Mutation, SceneChange
from crosscheck.library.mutations.resting import rests
from crosscheck.library.mutations.turning import EPS, only_axis
from flexmb.scene.bodies import BeamBody, Body, Matrix3, ModalBody, RigidBody, SidBody
from flexmb.scene.rigid_equivalent import steiner
from flexmb.scene.schema import Scene

MILLI = 1e-3


@of_body
def _mass(body: Body) -> Body:
    """+1 % mass, inertia untouched (a beam: mass per length)."""
    match body:
        case RigidBody():
            return replace(body, mass_kg=FACTOR * body.mass_kg)
        case BeamBody():
            return scaled_stations(body, ("mass_per_length_kg_m",), heavier(FACTOR, 1.0))
        case ModalBody() if body.points:
            return replace(body, points=tuple(multiplied(point, ("mass_kg",), FACTOR) for point in body.points))
        case ModalBody() | SidBody():
            raise CaseError(f'body "{body.name}" keeps its mass in a file: control "mass" needs it inline')
        case _:
            assert_never(body)


@of_body
def _inertia(body: Body) -> Body:
    """+1 % inertia about the mass centre."""
    match body:
        case RigidBody():
            return _more_inertia(body)
        case BeamBody():
            return scaled_stations(body, ("rotary_y_kg_m", "rotary_z_kg_m"), heavier(1.0, FACTOR))
        case ModalBody() | SidBody():
            raise CaseError(f'control "inertia" changes rigid bodies and beams, not "{body.name}"')
        case _:
            assert_never(body)


def _of_rigid(name: str, change: Callable[[RigidBody], RigidBody]) -> SceneChange:
    """A change of one rigid body; CaseError for any other."""

    def changed(body: Body) -> Body:
        if isinstance(body, RigidBody):
            return change(body)
        raise CaseError(f'control "{name}" changes rigid bodies, not "{body.name}"')

    return of_body(changed)


def _more_inertia(body: RigidBody) -> RigidBody:
    return replace(body, inertia_kg_m2=scaled(body.inertia_kg_m2))


def _com(body: RigidBody) -> RigidBody:
    return replace(body, com_m=scaled(body.com_m))


def _com_sign(body: RigidBody) -> RigidBody:
    return replace(body, com_m=opposite(body.com_m))


def _com_unit(body: RigidBody) -> RigidBody:
    return replace(body, com_m=scaled(body.com_m, MILLI))


def _with(body: RigidBody, J: np.ndarray) -> RigidBody:
    return replace(body, inertia_kg_m2=_matrix(J))


def _swapped(body: RigidBody) -> RigidBody:
    """x and z of the body's axes exchanged, so that J_xx and J_zz change places."""
    return _with(body, np.asarray(body.inertia_kg_m2)[::-1, ::-1])


def _products(body: RigidBody) -> RigidBody:
    J = np.asarray(body.inertia_kg_m2)
    return _with(body, 2.0 * np.diag(np.diag(J)) - J)


def _about_origin(body: RigidBody) -> RigidBody:
    """The parallel axes' part m (c.c 1 - c c) added once more."""
    return _with(body, np.asarray(body.inertia_kg_m2) + steiner(body.mass_kg, np.asarray(body.com_m)))


def _spherical(body: RigidBody) -> RigidBody:
    """A third of the trace about every axis: w x J w vanishes."""
    return _with(body, np.trace(np.asarray(body.inertia_kg_m2)) / 3.0 * np.eye(3))


def _matrix(J: np.ndarray) -> Matrix3:
    a, b, c = (tuple(float(value) + 0.0 for value in row) for row in J)  # + 0.0: no negative zeros
    return (a, b, c)  # type: ignore[return-value]  # rows of three


def _same_about_its_axis(change: Callable[[RigidBody], RigidBody]) -> Callable[[Scene, str], str]:
    """Of a body that turns about one axis e only, the inertia enters as J e."""

    def idle(scene: Scene, target: str) -> str:
        body = next(body for body in scene.bodies if body.name == target)
        axis = only_axis(scene, target)
        if axis is None or not isinstance(body, RigidBody):
            return ""
        J, other = np.asarray(body.inertia_kg_m2), np.asarray(change(body).inertia_kg_m2)
        same = np.max(np.abs((other - J) @ axis)) <= EPS * np.max(np.abs(J))
        if same and not np.any(axis):
            return "the body does not turn"
        return "the body turns about one axis only, and the inertia about that is the same" if same else ""

    return idle


MUTATIONS = (
    Mutation(
        "mass",
        "+1 % mass of a body, its inertia as it was",
        "a wrong figure, or a lump forgotten",
        bodies,
        _mass,
        rests,
    ),
    Mutation(
        "inertia",
        "+1 % inertia about the mass centre",
        "a wrong figure",
        bodies,
        _inertia,
        _same_about_its_axis(_more_inertia),
    ),
    Mutation(
        "inertia_swapped",
        "x and z exchanged in the inertia of a rigid body",
        "another order of the axes",
        bodies,
        _of_rigid("inertia_swapped", _swapped),
        _same_about_its_axis(_swapped),
    ),
    Mutation(
        "inertia_products",
        "opposite sign of the products of inertia",
        "J_xy taken for its negative, as half of all textbooks define it",
        bodies,
        _of_rigid("inertia_products", _products),
        _same_about_its_axis(_products),
    ),
    Mutation(
        "inertia_about_origin",
        "parallel-axis part added to an inertia about the mass centre",
        "inertia about the mass centre taken for that about the body origin, or the part counted twice",
        bodies,
        _of_rigid("inertia_about_origin", _about_origin),
        _same_about_its_axis(_about_origin),
    ),
    Mutation(
        "gyroscopic",
        "inertia made spherical, a third of its trace about every axis",
        "the gyroscopic moment w x J w left out",
        bodies,
        _of_rigid("gyroscopic", _spherical),
        _same_about_its_axis(_spherical),
    ),
    Mutation("com", "+1 % offset of the mass centre", "a wrong figure", bodies, _of_rigid("com", _com)),
    Mutation(
        "com_sign",
        "opposite offset of the mass centre",
        "from the mass centre to the origin instead of the other way",
        bodies,
        _of_rigid("com_sign", _com_sign),
    ),
    Mutation(
        "com_unit",
        "offset of the mass centre a thousandth",
        "millimetres taken for metres, or the offset left out",
        bodies,
        _of_rigid("com_unit", _com_unit),
    ),
    Mutation("point_mass", "+1 % of a point mass", "a wrong figure", point_masses, more(of_point_mass, "mass_kg")),
)
