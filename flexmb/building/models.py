"""Inertia points, modes and nodes of the bodies of a scene, in the bodies' own frames, made at the first access."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import assert_never

import numpy as np

from flexmb.levels.body import BY_NAME
from flexmb.levels.level import FidelityLevel
from flexmb.modal.flexible import flexible_model
from flexmb.modal.flexible_model import FlexibleModel, FlexibleNode, with_node
from flexmb.scene import schema as s
from flexmb.scene.bodies import ZERO
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.tree import GROUND, NodeFrame, rest_frames

_NO_MODES = np.zeros((3, 0))
ORIGIN = FlexibleNode(np.zeros(3), np.eye(3), _NO_MODES, _NO_MODES)
"""The frame of a rigid body as a node."""


class Models:
    """The models of bodies and of the ground, by name. Wheels are parts of their bodies, despun (Frisch)."""

    def __init__(self, scene: s.Scene, like: s.Scene | None = None) -> None:
        """like: the same scene with slightly other numbers; see `flexmb.modal.flexible.flexible_model`."""
        self.body: dict[str, s.Body] = {body.name: body for body in scene.bodies}
        self._like: dict[str, s.Body] = {} if like is None else {body.name: body for body in like.bodies}
        self.wheels = wheels_by_body(scene)
        self._made: dict[str, FlexibleModel] = {}
        self._frames: dict[str, dict[str, NodeFrame]] = {}

    def __getitem__(self, name: str) -> FlexibleModel:
        if name not in self._made:
            self._made[name] = self._model(name)
        return self._made[name]

    def node(self, name: str, node: str) -> FlexibleNode:
        """A node of a body, without making the model of a rigid one."""
        if name != GROUND and not isinstance(self.body[name], s.RigidBody):
            return self[name].nodes[node]
        if node == "origin":
            return ORIGIN
        return _at(self.frame(name, node))

    def frame(self, name: str, node: str) -> NodeFrame:
        """Rest frame of a node of a body of the scene."""
        if name not in self._frames:
            self._frames[name] = rest_frames(self.body[name])
        return self._frames[name][node]

    def _model(self, name: str) -> FlexibleModel:
        if name == GROUND:
            return one_point(0.0, ZERO, (ZERO, ZERO, ZERO), {"origin": ORIGIN})
        body = self.body[name]
        match body:
            case s.RigidBody():
                if self._like and name in self.wheels:
                    return _kept(body, tuple(self.wheels[name]))
                model = _rigid(body)
            case s.BeamBody() | s.ModalBody():
                followed = self._like.get(name)
                assert not isinstance(followed, s.RigidBody | s.SidBody)  # it is the same body with other numbers
                model = flexible_model(body, like=followed)
                model = model if level_of(body).flexible else _without_modes(model)
            case s.SidBody():
                raise NotImplementedError(f'body "{name}": SID files are not supported yet; use kind = "modal"')
            case _:
                assert_never(body)
        for wheel in self.wheels.get(name, ()):
            model = _with_wheel(model, wheel)
        return model


def _rigid(body: s.RigidBody) -> FlexibleModel:
    nodes = {node: ORIGIN if node == "origin" else _at(frame) for node, frame in rest_frames(body).items()}
    return one_point(body.mass_kg, body.com_m, body.inertia_kg_m2, nodes)


@lru_cache(maxsize=64)
def _kept(body: s.RigidBody, wheels: tuple[s.Wheel, ...]) -> FlexibleModel:
    """A rigid body with its wheels, of which many copies of a scene with other numbers elsewhere share the tables."""
    model = _rigid(body)
    for wheel in wheels:
        model = _with_wheel(model, wheel)
    return model


def _at(frame: NodeFrame) -> FlexibleNode:
    """A node that does not move in its body."""
    return FlexibleNode(np.array(frame.position, float), rotation_matrix(frame.quaternion), _NO_MODES, _NO_MODES)


def wheels_by_body(scene: s.Scene) -> dict[str, list[s.Wheel]]:
    """Wheels of every body that has some, in the scene's order."""
    wheels: dict[str, list[s.Wheel]] = {}
    for wheel in scene.wheels:
        wheels.setdefault(wheel.body, []).append(wheel)
    return wheels


def level_of(body: s.Body) -> FidelityLevel:
    """The fidelity level of a body."""
    return BY_NAME[body.level]


def one_point(mass: float, com: s.Vector, inertia: s.Matrix3, nodes: dict[str, FlexibleNode]) -> FlexibleModel:
    """A body without modes as one inertia point at its centre of mass."""
    return FlexibleModel(
        mass=np.array([mass]),
        position=np.array([com], float),
        com_offset=np.zeros((1, 3)),
        inertia=np.array([inertia], float),
        translation=np.zeros((1, 3, 0)),
        rotation=np.zeros((1, 3, 0)),
        stiffness=np.zeros((0, 0)),
        damping=np.zeros((0, 0)),
        nodes=nodes,
        clamped=True,
    )


def _without_modes(model: FlexibleModel) -> FlexibleModel:
    return replace(
        model,
        translation=model.translation[:, :, :0],
        rotation=model.rotation[:, :, :0],
        stiffness=model.stiffness[:0, :0],
        damping=model.damping[:0, :0],
        nodes={
            name: replace(n, translation=n.translation[:, :0], rotation_modes=n.rotation_modes[:, :0])
            for name, n in model.nodes.items()
        },
    )


def _with_wheel(model: FlexibleModel, wheel: s.Wheel) -> FlexibleModel:
    """The body with the despun wheel as one more inertia point at the wheel's node."""
    node = model.nodes[wheel.node]
    axis = node.rotation @ np.asarray(wheel.axis, float)
    axial, transverse = wheel.axial_inertia_kg_m2, wheel.transverse_inertia_kg_m2
    inertia = transverse * np.eye(3) + (axial - transverse) * np.outer(axis, axis)
    return replace(
        model,
        mass=np.append(model.mass, wheel.mass_kg),
        position=np.vstack([model.position, node.position]),
        com_offset=np.vstack([model.com_offset, node.rotation @ np.asarray(wheel.offset_m, float)]),
        inertia=np.concatenate([model.inertia, inertia[None]]),
        translation=np.concatenate([model.translation, node.translation[None]]),
        rotation=np.concatenate([model.rotation, node.rotation_modes[None]]),
        second=with_node(model, node),
        section=None if model.section is None else np.append(model.section, node.section),
    )
