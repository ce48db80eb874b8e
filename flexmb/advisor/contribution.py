"""First-order contribution of each mode of a body to a quantity, in addition to the run of the rigid scene.

The deflection of nodes moves the markers on the body and outboard of it. The loads of inboard hinges change by the
inertia forces of the elastic motion. A free-flying scene recoils, so that its momentum is conserved. Quantities without
a first-order contribution (loads of wheels, work) get zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexmb.advisor.modal_response import ModalResponse, RigidRun, momenta
from flexmb.scene.bodies import RigidBody
from flexmb.scene.schema import Free, Hinge, Marker, Scene
from flexmb.scene.tree import GROUND
from flexmb.typing import Real


@dataclass(frozen=True)
class Moved:
    """The response of one body in World axes: momenta of its modes about its origin (T,3,m), and its pose."""

    response: ModalResponse
    position: Real
    turn: Real
    linear: Real
    angular: Real


def moved(rigid: RigidRun, response: ModalResponse) -> Moved:
    """Momenta of the modes in World axes."""
    position, turn = rigid.frame(response.body.name)
    linear, angular = momenta(response.model)
    return Moved(response, position, turn, turn @ linear, turn @ angular)


def contribution(channel: str, rigid: RigidRun, scene: Scene, part: Moved) -> Real:
    """Contributions of the modes to a channel over time (T,k,m), in its unit; rotation vectors for orientations."""
    kind, _, rest = channel.partition(":")
    r = part.response
    if kind == "marker":
        name, _, what = rest.rpartition(".")
        marker = next(marker for marker in scene.markers if marker.name == name)
        amount = r.eta if what in ("position", "orientation") else r.etad
        turning, moving = _carried(rigid, scene, marker, part)
        recoil = _recoil(rigid, scene, marker, part)
        translation = what in ("position", "velocity")
        return ((moving if translation else turning) + recoil[int(translation)]) * amount[:, None, :]
    if kind in ("load", "drive"):
        hinge, _, what = rest.rpartition(".") if kind == "load" else (rest, "", "")
        return _load(rigid, scene, hinge, what, part)
    if channel in ("energy.strain", "energy.total", "energy.kinetic"):
        strain, kinetic = 0.5 * (r.eta * r.frequencies) ** 2, 0.5 * r.etad**2
        return {"energy.strain": strain, "energy.kinetic": kinetic}.get(channel, strain + kinetic)[:, None, :]
    if kind.startswith("momentum.") and not _floats(scene, r.body.name):
        shapes = part.linear if kind == "momentum.linear" else part.angular
        return shapes * r.etad[:, None, :]
    return np.zeros((len(r.eta), 1, r.eta.shape[1]))


def _carried(rigid: RigidRun, scene: Scene, marker: Marker, part: Moved) -> tuple[Real, Real]:
    """Rotation and translation (T,3,m), World axes, of a marker per unit modal coordinate."""
    body = part.response.body.name
    node, at = marker.node, marker.body
    while at != body:
        hinge = _inboard(scene, at)
        if hinge is None:
            nothing = np.zeros((len(part.position), 3, part.response.model.mode_count))
            return nothing, nothing
        node, at = hinge.parent_node, hinge.parent
    shape = part.response.model.nodes[node]
    turning, moving = part.turn @ shape.rotation_modes, part.turn @ shape.translation
    arm = rigid.run.markers[marker.name].position - part.position - part.turn @ shape.position
    return turning, moving + np.cross(turning, arm[:, :, None], axis=1)


def _recoil(rigid: RigidRun, scene: Scene, marker: Marker, part: Moved) -> tuple[Real, Real]:
    """Rotation and translation (T,3,m) of a free-flying scene, per unit coordinate, that conserve its momentum.

    The rest of the scene is taken for one rigid body, with its initial inertia.
    """
    base = _base(scene, part.response.body.name)
    count = part.response.model.mode_count
    if not isinstance(base, Free):
        return np.zeros((1, 3, count)), np.zeros((1, 3, count))
    place = rigid.system.speed(base.name)
    inertia = rigid.system.mass_matrix(rigid.system.initial_state)[place, place]
    position, turn = rigid.frame(base.child)
    about = np.cross((part.position - position)[:, :, None], part.linear, axis=1) + part.angular
    momentum = np.concatenate([_into(turn, about), _into(turn, part.linear)], axis=1)
    motion = -np.linalg.solve(inertia, momentum.reshape(len(momentum), 6, count))
    turning, moving = turn @ motion[:, :3], turn @ motion[:, 3:]
    arm = rigid.run.markers[marker.name].position - position
    return turning, moving + np.cross(turning, arm[:, :, None], axis=1)


def _load(rigid: RigidRun, scene: Scene, name: str, what: str, part: Moved) -> Real:
    """Change (T,3,m) of the force or torque across a hinge inboard of the body; for a drive that of the torque."""
    r = part.response
    at: str = r.body.name
    while at != GROUND:
        hinge = _inboard(scene, at)
        if hinge is None or hinge.name == name:
            break
        at = hinge.parent
    else:
        hinge = None
    if hinge is None:
        return np.zeros((len(r.eta), 3, r.eta.shape[1]))
    if what == "force":
        return part.linear * r.etadd[:, None, :]
    arm = part.position - rigid.hinge_point(name)
    return (part.angular + np.cross(arm[:, :, None], part.linear, axis=1)) * r.etadd[:, None, :]


def free_share(rigid: RigidRun, scene: Scene, body: str) -> float:
    """Fraction of the body in the inertia that moves with the base; 0 if the base cannot react to the body."""
    base = _base(scene, body)
    whole = sum(b.mass_kg for b in rigid.scene.bodies if isinstance(b, RigidBody))
    own = next(b.mass_kg for b in rigid.scene.bodies if isinstance(b, RigidBody) and b.name == body)
    if isinstance(base, Free):
        return own / whole
    driven = rigid.system.constants.speed["prescribed"]
    return 0.0 if np.all(driven >= 0) else 1.0


def _base(scene: Scene, body: str) -> Hinge | None:
    """The hinge between the ground and the tree that contains the body."""
    hinge = _inboard(scene, body)
    while hinge is not None and hinge.parent != GROUND:
        hinge = _inboard(scene, hinge.parent)
    return hinge


def _floats(scene: Scene, body: str) -> bool:
    return isinstance(_base(scene, body), Free)


def _inboard(scene: Scene, body: str) -> Hinge | None:
    return next((hinge for hinge in scene.hinges if hinge.child == body), None)


def _into(turn: Real, vectors: Real) -> Real:
    """World components (T,3,m) turned to body axes; `turn` (T,3,3) is body -> World."""
    return np.asarray(np.swapaxes(turn, 1, 2) @ vectors)
