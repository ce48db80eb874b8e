"""Motion of points of carriers in an Exudyn run, rigid or bending, and from it the loads of connectors.

Points have World position, rotation, velocity and acceleration; connectors depend on the recorded motion of their ends
and joints.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from crosscheck.engines.connections import Along, Exerted, Moving, along_hinges, exerts
from crosscheck.engines.contract import MarkerPath, MarkerSnapshot
from crosscheck.engines.conventions import frame
from crosscheck.engines.exudyn.assembly import Assembly
from crosscheck.engines.exudyn.balance import coordinate, coordinate_rate
from crosscheck.engines.exudyn.modal import NodeShape
from crosscheck.engines.exudyn.rotations import exponential, left_jacobian, left_jacobian_rate, quaternions
from crosscheck.engines.exudyn.state import CarrierPath, States
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.tree import GROUND, EndFrame, ends
from flexmb.typing import Real


def marker_path(path: CarrierPath, shape: NodeShape, offset: Real) -> MarkerPath:
    """The frame at a node (in Exudyn axes) plus `offset` (3,) in node axes, over all samples."""
    position, rotation, velocity, _ = _motion(path, shape, offset)
    return MarkerPath(position, quaternions(rotation), velocity)


def marker_snapshot(path: CarrierPath, shape: NodeShape, offset: Real) -> MarkerSnapshot:
    """The same at the first sample, with accelerations."""
    position, rotation, velocity, acceleration = _motion(path, shape, offset)
    return MarkerSnapshot(position[0], quaternions(rotation)[0], velocity[0], acceleration[0])


def _motion(path: CarrierPath, shape: NodeShape, offset: Real) -> tuple[Real, Real, Real, Real | None]:
    A, w = path.rotation, path.omega
    theta, theta_rate = path.eta @ shape.rotation_modes.T, path.eta_rate @ shape.rotation_modes.T
    E, J = exponential(theta), left_jacobian(theta)
    arm = E @ (shape.rotation @ offset)  # node to marker, body axes
    s = _times(J, theta_rate)  # angular velocity of the node in the body, body axes
    x = shape.position + path.eta @ shape.translation.T + arm
    x_rate = path.eta_rate @ shape.translation.T + np.cross(s, arm)
    x_World, x_rate_World, s_World = (_times(A, vector) for vector in (x, x_rate, s))
    position = path.position + x_World
    linear = path.velocity + np.cross(w, x_World) + x_rate_World
    velocity = np.concatenate([w + s_World, linear], axis=1)
    if path.acceleration is None:
        return position, A @ E @ shape.rotation, velocity, None
    s_rate = _times(J, path.eta_acceleration @ shape.rotation_modes.T) + _times(
        left_jacobian_rate(theta, theta_rate), theta_rate
    )
    x_second = path.eta_acceleration @ shape.translation.T + np.cross(s_rate, arm) + np.cross(s, np.cross(s, arm))
    angular = path.alpha + np.cross(w, s_World) + _times(A, s_rate)
    classical = (
        path.acceleration
        + np.cross(path.alpha, x_World)
        + np.cross(w, np.cross(w, x_World))
        + 2.0 * np.cross(w, x_rate_World)
        + _times(A, x_second)
    )
    return position, A @ E @ shape.rotation, velocity, np.concatenate([angular, classical], axis=1)


def _times(A: Real, b: Real) -> Real:
    """(T,3,3) times (T,3)."""
    return np.einsum("tij,tj->ti", A, b)


Paths = dict[int, CarrierPath]


class Connected(NamedTuple):
    """By name, at T samples: wrenches (T,6) of connectors between nodes on B about B, loads (T,1) of those along
    hinges; energy (T,) stored in all."""

    between: dict[str, Real]
    along: dict[str, Real]
    energy: Real


def connected(assembly: Assembly, states: States, paths: Paths) -> Connected:
    between, along = _between(assembly, states, paths), _along(assembly, states.times.tolist(), paths)
    energy = np.zeros(len(states.times))
    for each in between.values():
        energy += [at.energy for at in each]
    for held in along.values():
        energy += [at.energy for at in held]
    return Connected(
        {name: np.array([at.on_b for at in motions]) for name, motions in between.items()},
        {name: np.array([[at.load] for at in held]) for name, held in along.items()},
        energy,
    )


def _between(assembly: Assembly, states: States, paths: Paths) -> dict[str, list[Exerted]]:
    exerted = {}
    for connector in assembly.scene.connectors:
        if isinstance(connector, BetweenNodes):
            a, b = (_moving(assembly, end, paths, len(states.times)) for end in ends(connector))
            law = exerts(connector)
            exerted[connector.name] = [law(t, *ends) for t, *ends in zip(states.times.tolist(), a, b, strict=True)]
    return exerted


def _along(assembly: Assembly, times: list[float], paths: Paths) -> dict[str, list[Along]]:
    loads = {}
    for name, item, number, load in along_hinges(assembly.scene):
        stage = assembly.links[item].stages[number]
        motion = zip(times, coordinate(stage, paths).tolist(), coordinate_rate(stage, paths).tolist(), strict=True)
        loads[name] = [load(*moving) for moving in motion]
    return loads


def _moving(assembly: Assembly, end: EndFrame, paths: Paths, count: int) -> list[Moving]:
    own = frame(end.position_m, end.quaternion)
    if end.body == GROUND:
        return [Moving(own.position, own.rotation, np.zeros(3), np.zeros(3))] * count
    placed = assembly.bodies[end.body].at(end.node)
    path = marker_path(paths[placed.carrier.key], placed.shape(end.node), own.position)
    turns: Real = Rotation.from_quat(path.quaternion, scalar_first=True).as_matrix() @ own.rotation
    motion = zip(path.position, turns, path.velocity[:, :3], path.velocity[:, 3:], strict=True)
    return [Moving(*state) for state in motion]
