"""Energy and momentum of recorded states, from Exudyn's states and, where bodies bend, Exudyn's mass matrices."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from crosscheck.engines.exudyn.assembly import Assembly
from crosscheck.engines.exudyn.carriers import Carrier
from crosscheck.engines.exudyn.joints import Stage
from crosscheck.engines.exudyn.rotations import local_rate_map, logarithm
from crosscheck.engines.exudyn.sections import BeamElement
from crosscheck.engines.exudyn.state import CarrierPath, States, set_state
from crosscheck.engines.functions_of_time import initial
from flexmb.typing import Real

Paths = dict[int, CarrierPath]


def energy_and_momentum(assembly: Assembly, states: States, paths: Paths) -> tuple[dict[str, Real], Real]:
    """Energies (T,) of each kind, and momentum (T,6) [angular about the World origin; linear]."""
    T = len(states.times)
    energy = {kind: np.zeros(T) for kind in ("kinetic", "strain", "spring", "gravity")}
    momentum = np.zeros((T, 6))
    g = assembly.shop.gravity
    for carrier in assembly.carriers:
        path = paths[carrier.key]
        parts = _rigid(carrier, path) if carrier.flexible is None else _flexible(assembly, carrier, path, states)
        kinetic, linear, angular, moment = parts
        energy["kinetic"] += kinetic
        energy["gravity"] -= moment @ g
        momentum += np.hstack([angular + np.cross(path.position, linear), linear])
        if carrier.flexible is not None:
            energy["strain"] += 0.5 * np.einsum("ti,ij,tj->t", path.eta, carrier.data.stiffness, path.eta)
    energy["strain"] += strain_energy(assembly.elements, paths)
    for link in assembly.links.values():
        for stage in link.stages:
            if stage.stiffness:
                energy["spring"] += 0.5 * stage.stiffness * (coordinate(stage, paths) - stage.rest) ** 2
        if link.spherical is not None:
            ball, inboard, outboard = link.spherical
            # the hinge frames at coordinate zero have parallel Exudyn axes, so their relative turn is the hinge's
            turn = Rotation.from_matrix(_relative(paths[inboard.key], paths[outboard.key])).magnitude()
            energy["spring"] += 0.5 * ball.stiffness * turn**2
    return energy, momentum


def coordinate(stage: Stage, paths: Paths) -> Real:
    """(T,) value of a scalar joint coordinate; an angle is continued from its value at t = 0."""
    a, b = paths[stage.inboard.key], paths[stage.outboard.key]
    if not stage.angular:
        gap = b.position + b.rotation @ stage.outboard_point - a.position - a.rotation @ stage.inboard_point
        return np.einsum("ti,ti->t", gap, a.rotation @ stage.axis)
    vector = Rotation.from_matrix(_relative(a, b)).as_rotvec() @ stage.axis
    return np.unwrap(np.concatenate([[initial(stage.coordinate)[0]], vector]))[1:]


def coordinate_rate(stage: Stage, paths: Paths) -> Real:
    """(T,) rate of a scalar joint coordinate."""
    a, b = paths[stage.inboard.key], paths[stage.outboard.key]
    axis = a.rotation @ stage.axis
    if stage.angular:
        return np.einsum("ti,ti->t", b.omega - a.omega, axis)
    arm_a, arm_b = a.rotation @ stage.inboard_point, b.rotation @ stage.outboard_point
    gap = b.position + arm_b - a.position - arm_a
    rate = b.velocity + np.cross(b.omega, arm_b) - a.velocity - np.cross(a.omega, arm_a)
    return np.einsum("ti,ti->t", rate - np.cross(a.omega, gap), axis)


def _relative(a: CarrierPath, b: CarrierPath) -> Real:
    return np.einsum("tji,tjk->tik", a.rotation, b.rotation)


def _rigid(carrier: Carrier, path: CarrierPath) -> tuple[Real, Real, Real, Real]:
    """Kinetic energy (T,), linear momentum (T,3), angular momentum about the origin (T,3), mass times centre (T,3)."""
    m, J = carrier.inertia.mass, carrier.inertia.inertia
    arm = path.rotation @ carrier.inertia.com
    velocity = path.velocity + np.cross(path.omega, arm)
    spin = np.einsum("tij,jk,tlk,tl->ti", path.rotation, J, path.rotation, path.omega)
    kinetic = 0.5 * m * np.sum(velocity**2, axis=1) + 0.5 * np.sum(path.omega * spin, axis=1)
    return kinetic, m * velocity, spin + np.cross(arm, m * velocity), m * (path.position + arm)


def _flexible(assembly: Assembly, carrier: Carrier, path: CarrierPath, states: States) -> tuple[Real, ...]:
    """The same for a floating frame, with the conjugate momenta p = M v of Exudyn's mass matrix."""
    mbs, kind = assembly.shop.mbs, assembly.shop.exu.ComputeItemType.MassMatrix
    columns = np.array(mbs.systemData.GetObjectLTGODE2(carrier.flexible))
    conjugate = np.zeros((len(states.times), len(columns)))
    for k in range(len(states.times)):
        set_state(mbs, states, k)
        conjugate[k] = np.asarray(mbs.ComputeItem(carrier.flexible, kind)) @ states.v[k, columns]
    kinetic = 0.5 * np.einsum("ti,ti->t", states.v[:, columns], conjugate)
    angular_local = conjugate[:, 3:6]
    if not assembly.shop.explicit:
        p = np.array(mbs.GetNodeParameter(carrier.node, "referenceCoordinates"))[3:7] + states.q[:, columns[3:7]]
        # p' = G' h for the angular momentum h in body axes, and G G' = 4
        angular_local = np.einsum("tij,tj->ti", local_rate_map(p), conjugate[:, 3:7]) / 4.0
    angular = np.einsum("tij,tj->ti", path.rotation, angular_local)
    first = carrier.data.first + path.eta @ carrier.data.shape.T
    moment = carrier.data.mass * path.position + np.einsum("tij,tj->ti", path.rotation, first)
    return kinetic, conjugate[:, :3], angular, moment


def strain_energy(elements: tuple[BeamElement, ...], paths: dict[int, CarrierPath]) -> Real:
    """(T,) of all elements: half their length times strain' K strain."""
    energy = np.zeros(len(paths[-1].position))
    for element in elements:
        left, right = paths[element.left.key], paths[element.right.key]
        turn = np.swapaxes(left.rotation, 1, 2) @ right.rotation
        apart = np.einsum("tji,tj->ti", left.rotation, right.position - left.position)
        energy += 0.5 / element.length * (logarithm(turn, apart) - element.rest) ** 2 @ element.stiffness
    return energy
