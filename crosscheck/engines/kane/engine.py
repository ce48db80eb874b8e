"""The engine: what it supports, and how hard it may try."""

from __future__ import annotations

from collections.abc import Iterator
from typing import assert_never

import numpy as np

from crosscheck.engines.contract import Model
from crosscheck.engines.peer import PeerEngine
from crosscheck.engines.scipy_loop import METHODS, RTOL_LADDER, ScipyModel
from flexmb.scene.bodies import BeamBody, Body, ModalBody, RigidBody, SidBody
from flexmb.scene.hinges import (
    Cylindrical,
    Free,
    Gimbal,
    Planar,
    Prismatic,
    Revolute,
    Screw,
    Spherical,
    Universal,
    Weld,
)
from flexmb.scene.modal_data import modal_arrays
from flexmb.scene.schema import Scene
from flexmb.typing import Real

VERSION = "1"
"""Of the equations: it changes with their answers."""


_LEAST = 1e-9  # of the largest moment: below it accelerations of a free body lose the digits that verdicts need
_SLIM = (
    "undeformed it has no inertia about some axis, about which a free body would turn at any rate; the equations of "
    "kane have free bodies: give it some inertia, or take another code"
)


class KaneEngine(PeerEngine):
    """Trees with bodies of level "full", exact, by equations that flexmb has no part in."""

    name = "kane"
    takes = ("t_start",)
    summary = "flexible trees of level full in redundant coordinates, by Kane's equations with multipliers"
    algorithm = "dense, free bodies and multipliers"
    settings = (
        "NumPy, called by SciPy's DOP853: a witness, not a rival. It shares no mechanics with flexmb, and is written "
        "to be read, not to be fast. Outputs are computed after the timed solve."
    )
    ladder, methods = RTOL_LADDER, METHODS

    def version(self) -> str:
        return VERSION

    def refusals(self, scene: Scene) -> Iterator[str]:
        return _obstacles(scene)

    def model(self, scene: Scene) -> Model:
        return compiled(scene)


def compiled(scene: Scene) -> Model:
    """The equations of a scene whose parts are not refused, whether or not anything deforms."""
    from crosscheck.engines.kane.dynamics import KaneDynamics
    from crosscheck.engines.kane.observer import KaneObserver

    dynamics = KaneDynamics(scene)
    return ScipyModel(scene, dynamics, KaneObserver(dynamics))


def _obstacles(scene: Scene) -> Iterator[str]:
    """Why the engine refuses a scene, one thing after the other."""
    for body in scene.bodies:
        yield from _body_obstacles(body, scene)
    for item in (*scene.closures, *scene.couplings, *scene.connectors, *scene.controllers, *scene.events):
        yield f'"{item.name}": the equations of kane have trees without connectors, controllers and events alone'
    for point in scene.point_masses:
        yield f'point mass "{point.name}": make it part of its body'
    for load in scene.loads:
        yield f'load "{load.name}": the equations of kane have none at nodes'
    for hinge in scene.hinges:
        match hinge:
            case Weld() | Free():
                pass
            case Revolute():
                if hinge.rotation.armature:
                    yield f'coordinate "{hinge.name}.rotation" has an armature: the equations of kane have none'
            case Prismatic() | Cylindrical() | Universal() | Gimbal() | Spherical() | Planar() | Screw():
                yield f'hinge "{hinge.name}": the equations of kane have welds, revolute and free hinges alone'
            case _:
                assert_never(hinge)
    if all(body.level == "rigid" for body in scene.bodies):
        yield "no body of the scene deforms: take a code of rigid bodies, which are independent too, and much faster"


def _body_obstacles(body: Body, scene: Scene) -> Iterator[str]:
    what = f'body "{body.name}"'
    match body:
        case RigidBody():
            if not body.mass_kg > 0.0 or _is_slim(np.array(body.inertia_kg_m2)):
                yield f"{what}: {_SLIM}"
        case SidBody():
            yield f"{what}: its SID file is read by flexmb alone: convert it by flexmb import"
        case ModalBody() | BeamBody() if body.level not in ("rigid", "full"):
            remedy = ": use exudyn-beam" if body.level == "exact" else ""
            yield f'{what}: the equations of kane are of level "full", not "{body.level}"{remedy}'
        case ModalBody():
            arrays = modal_arrays(body)
            if arrays.inertia.any() or arrays.com_offset.any():
                yield f'{what}: its points have inertia of their own: use massy section points (points = "section")'
            elif not arrays.mass.sum() > 0.0 or _is_slim(_inertia(arrays.mass, arrays.position)):
                yield f"{what}: {_SLIM}"
        case BeamBody():
            yield from _beam_obstacles(body, scene)
        case _:
            assert_never(body)


def _inertia(mass: Real, position: Real) -> Real:
    """(3,3) kg m^2 of point masses (n,) at `position` (n,3) about their mass centre."""
    arm = position - mass @ position / mass.sum()
    second = arm.T @ (mass[:, None] * arm)
    return np.asarray(np.trace(second) * np.eye(3) - second)


def _is_slim(inertia: Real) -> bool:
    """Whether an inertia (3,3) about the mass centre has next to none about an axis."""
    moments = np.linalg.eigvalsh(inertia)
    return not moments[0] > _LEAST * moments[-1]


def _beam_obstacles(body: BeamBody, scene: Scene) -> Iterator[str]:
    remedy = 'give it as raw points and modes (transform = "modal_points")'
    others = {
        "families other than bending": set(body.modes.families or ("all",)) - {"bending_y", "bending_z"},
        "no clamp": body.modes.boundary != "clamped-free",
        "shear": body.theory != "euler-bernoulli",
        "lumped mass": body.mass != "consistent",
        f'points = "{body.points}"': body.points != "section",
        "tip masses": body.tip_masses,
        "damping": body.modes.damping_ratio or body.modes.viscosity_s,
        "sections as matrices": any(station.stiffness or station.inertia for station in body.stations),
        "sections beside the axis": any(any(station.reference_point_m) for station in body.stations),
        "initial modal coordinates": [state for state in scene.modal_states if state.body == body.name],
    }
    for name, found in others.items():
        if found:
            yield f'beam "{body.name}" has {name}, which kane\'s own elements do not: {remedy}'
