"""Replacement of an outermost flexible body by a rigid body on a spring hinge, by Frisch's equivalence relations."""

from __future__ import annotations

from typing import Any

import numpy as np
from msgspec.structs import replace
from scipy.spatial.transform import Rotation

from flexmb.frisch.equivalence.appendage import appendage_of
from flexmb.frisch.equivalence.relations import HingeFit, best_hinge
from flexmb.modal import flexible_model
from flexmb.scene.bodies import BeamBody, ModalBody, Node, RigidBody
from flexmb.scene.schema import AngularCoordinate, Hinge, Revolute, Scene, Universal
from flexmb.surrogate.lumping import rigid_equivalent, vector
from flexmb.typing import Real

_ACROSS = 1e-6  # axes count as orthogonal if the cosine of their angle is below this
_CLAMP = ("origin", "root")


def spring_hinged(scene: Scene, name: str) -> Scene:
    """The scene with the flexible body `name` rigid, on a spring hinge.

    Its inboard hinge carries a clamp without mass, `<name>.clamp`, to which the hinge `<name>.spring` joins the body.
    It has one axis, or two if low modes bend in two planes, at the point with the least mismatch of (149)-(151).
    Springs and dampers give each axis the frequency and the damping of its mode with the base fixed. Loads and markers
    at the clamp remain there. Raises ValueError if the body is not clamped, carries other bodies, or starts deformed,
    or if its modes do not turn it.
    """
    body = next((body for body in scene.bodies if body.name == name), None)
    if not isinstance(body, BeamBody | ModalBody):
        raise ValueError(f'the scene has no flexible body "{name}"')
    if any(state.body == name for state in scene.modal_states):
        raise ValueError(f'body "{name}" starts deformed: a spring hinge has no modal state')
    spring = _spring(body, fitted_hinge(scene, name))
    clamp = RigidBody(name=spring.parent, mass_kg=0.0, inertia_kg_m2=((0.0,) * 3,) * 3, nodes=(Node(name="root"),))
    bodies = [part for each in scene.bodies for part in ((clamp, rigid_equivalent(each)) if each is body else (each,))]
    hinges: list[Hinge] = []
    for hinge in scene.hinges:
        hinges += [replace(hinge, child=clamp.name), spring] if hinge.child == name else [hinge]

    def placed(item: Any) -> Any:
        return replace(item, body=clamp.name) if item.body == name and item.node in _CLAMP else item

    loads, markers = tuple(map(placed, scene.loads)), tuple(map(placed, scene.markers))
    return replace(scene, bodies=tuple(bodies), hinges=tuple(hinges), loads=loads, markers=markers)


def fitted_hinge(scene: Scene, name: str) -> HingeFit:
    """The best hinge for the lowest mode, or for the lowest two that turn the body about orthogonal axes."""
    body = appendage_of(scene, name)
    one = best_hinge(body)
    for mode in range(1, min(body.mode_count, 4)):
        try:
            other = best_hinge(body, modes=(mode,))
        except ValueError:  # a mode that does not turn the body
            continue
        if abs(one.hinge.axes[0] @ other.hinge.axes[0]) < _ACROSS:
            return best_hinge(body, np.vstack([one.hinge.axes, other.hinge.axes]), (0, mode))
    return one


def _spring(body: BeamBody | ModalBody, fit: HingeFit) -> Hinge:
    """The hinge between clamp and body, with its frames at the fitted point, x (and y) along its axes at rest."""
    first = fit.hinge.axes[0]
    second = fit.hinge.axes[1] if len(fit.hinge.axes) == 2 else _across(first)
    frame = Rotation.from_matrix(np.column_stack([first, second, np.cross(first, second)]))
    w, x, y, z = (float(value) for value in frame.as_quat(scalar_first=True))
    lag = _damping_rate(body)
    turns = [AngularCoordinate(stiffness_Nm_rad=float(k), damping_Nms_rad=lag * float(k)) for k in fit.hinge.stiffness]
    point = vector(fit.hinge.point)
    placed: dict[str, Any] = {
        "name": f"{body.name}.spring", "parent": f"{body.name}.clamp", "child": body.name,
        "parent_position_m": point, "child_position_m": point,
        "parent_quaternion": (w, x, y, z), "child_quaternion": (w, x, y, z),
    }  # fmt: skip
    if len(turns) == 1:
        return Revolute(**placed, axis=(1.0, 0.0, 0.0), rotation=turns[0])
    return Universal(**placed, first=turns[0], second=turns[1])


def _across(axis: Real) -> Real:
    """A unit vector orthogonal to `axis`."""
    other = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    return np.asarray(other / np.linalg.norm(other))


def _damping_rate(body: BeamBody | ModalBody) -> float:
    """Ratio (s) of damping and stiffness of the lowest mode."""
    model = flexible_model(body)
    if model.mode_count == 0 or not np.any(model.damping):
        return 0.0
    lowest = int(np.argmin(np.diag(model.stiffness)))
    return float(model.damping[lowest, lowest] / model.stiffness[lowest, lowest])
