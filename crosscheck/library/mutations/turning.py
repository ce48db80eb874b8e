"""Bodies that turn about one axis only, because all hinges that carry them are parallel, or by symmetry.

Of the inertia of such a body only J e matters, e its axis: moments are J e alpha + e x J e w^2. A torque along e is the
same in World and in body axes.
"""

from __future__ import annotations

import numpy as np

from crosscheck.library.mutations.mirror import mirrors
from flexmb.scene.bodies import Body, RigidBody
from flexmb.scene.freedoms import ScalarFreedom
from flexmb.scene.hinges import Hinge
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.schema import Scene
from flexmb.scene.tree import GROUND, node_frame, ordered
from flexmb.typing import Real

EPS = 1e-12


def only_axis(scene: Scene, name: str) -> Real | None:
    """The axis (3,) in body axes that body `name` can only turn about, zero if it cannot turn; None if there is none.

    The body itself may be flexible, where it is carried at its frame; those that carry it are rigid. Closures, which
    take more freedom, are not looked at but for symmetry: a scene that is its own image in a mirror turns about the
    mirror's normal only, in two mirrors not at all.
    """
    symmetric = mirrors(scene)
    if symmetric:
        return np.eye(3)[symmetric[0]] if len(symmetric) == 1 else np.zeros(3)
    axes: dict[str, Real | None] = {GROUND: np.zeros(3)}
    bodies: dict[str, Body] = {}
    for body, hinge in ordered(scene):
        bodies[body.name] = body
        axes[body.name] = _axis(bodies.get(hinge.parent), axes[hinge.parent], body, hinge)
    return axes[name]


def _axis(parent: Body | None, carried: Real | None, body: Body, hinge: Hinge) -> Real | None:
    """The only axis of a body whose parent turns about `carried` only, in the body's axes."""
    if carried is None or not (parent is None or isinstance(parent, RigidBody)):
        return None
    if not isinstance(body, RigidBody) and np.any(node_frame(body, hinge.child_node).position):
        return None
    own = _own(hinge)
    if own is None:
        return None
    inboard = rotation_matrix(hinge.parent_quaternion)
    if parent is not None:
        inboard = rotation_matrix(node_frame(parent, hinge.parent_node).quaternion) @ inboard
    outboard = rotation_matrix(node_frame(body, hinge.child_node).quaternion) @ rotation_matrix(hinge.child_quaternion)
    brought = inboard.T @ carried  # in hinge axes, which this hinge's own rotation leaves as they are if parallel
    if np.any(own) and np.any(np.abs(np.cross(own, brought)) > EPS):
        return None
    return outboard @ (own if np.any(own) else brought)


def _own(hinge: Hinge) -> Real | None:
    """The axis of a hinge in its own axes, zero where it does not turn, None where it turns otherwise."""
    lines = [freedom for freedom in hinge.freedoms if isinstance(freedom, ScalarFreedom)]
    turning = [np.asarray(line.axis) / np.linalg.norm(line.axis) for line in lines if line.turns]
    if len(lines) < len(hinge.freedoms) or len(turning) > 1:
        return None
    return turning[0] if turning else np.zeros(3)
