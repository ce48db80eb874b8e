"""Rotation and translation of the World, with everything on the ground, gravity and loads in World axes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np

from crosscheck.mutation.invariances.counterpart import (
    Channels,
    Counterpart,
    Invariance,
    NotApplicable,
    by_kind,
    known_mass,
    product,
    quaternion,
    with_energy,
    without_feedback,
)
from crosscheck.mutation.invariances.linearised import relation
from flexmb.scene.bodies import IDENTITY, Quaternion, Vector
from flexmb.scene.connectors import BetweenNodes, Connector
from flexmb.scene.hinges import Closure, Free, Hinge
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.rigid_equivalent import vector
from flexmb.scene.schema import Load, Scene
from flexmb.scene.tree import GROUND
from flexmb.typing import Real

TURN = np.array([0.5, -0.1, 0.7, 0.5])  # of length 1, about no axis of any scene
STEP_M = np.array([0.75, -1.25, 0.5])
CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
Placed = Callable[[Vector, Quaternion], tuple[Vector, Quaternion]]


def _turned(scene: Scene) -> Counterpart:
    without_feedback(scene)
    R = rotation_matrix(TURN)

    def placed(position: Vector, orientation: Quaternion) -> tuple[Vector, Quaternion]:
        return vector(R @ np.asarray(position)), quaternion(product(TURN, np.array([orientation]))[0])

    def turned(load: Load) -> Load:
        if load.frame == "node":
            return load
        return msgspec.structs.replace(load, direction=vector(R @ np.asarray(load.direction)))

    other = msgspec.structs.replace(
        on_ground(scene, placed),
        gravity_m_s2=vector(R @ np.asarray(scene.gravity_m_s2)),
        loads=tuple(map(turned, scene.loads)),
    )

    def back(times: Real, channels: Channels) -> Channels:
        return by_kind(channels, lambda rows: rows @ R, lambda rows: rows @ R, lambda q: product(TURN * CONJUGATE, q))

    return Counterpart(other, back, linear=relation(scene, other))


def _moved(scene: Scene) -> Counterpart:
    without_feedback(scene)
    gravity = np.asarray(scene.gravity_m_s2)
    potential = known_mass(scene) * float(gravity @ STEP_M) if np.any(gravity) else 0.0

    def placed(position: Vector, orientation: Quaternion) -> tuple[Vector, Quaternion]:
        return vector(np.asarray(position) + STEP_M), orientation

    def back(times: Real, channels: Channels) -> Channels:
        channels_back = with_energy(channels, {"gravity": np.full(len(times), potential)})
        if "momentum.linear" in channels_back:
            channels_back["momentum.angular"] = channels_back["momentum.angular"] - np.cross(
                STEP_M, channels_back["momentum.linear"]
            )
        for total in (total for total in scene.total_loads if total.body == GROUND):  # about the origin of the World
            torque, force = (f"total_load:{total.name}.{part}" for part in ("torque", "force"))
            if torque in channels_back:
                channels_back[torque] = channels_back[torque] - np.cross(STEP_M, channels_back[force])
        return {name: rows - STEP_M if name.endswith(".position") else rows for name, rows in channels_back.items()}

    other = on_ground(scene, placed)
    return Counterpart(other, back, linear=relation(scene, other))


def on_ground(scene: Scene, placed: Placed) -> Scene:
    """The scene with the ends of hinges, closures and connectors on the ground moved."""
    hinges = []
    for hinge in scene.hinges:
        if hinge.parent == GROUND:
            position, orientation = placed(hinge.parent_position_m, hinge.parent_quaternion)
            hinge = msgspec.structs.replace(hinge, parent_position_m=position, parent_quaternion=orientation)
        hinges.append(hinge)

    def two_ended(item: Closure | Connector) -> Any:
        for side in "ab":
            if getattr(item, f"body_{side}", "") == GROUND:
                frame = f"position_{side}_m", f"quaternion_{side}"
                at = placed(getattr(item, frame[0]), getattr(item, frame[1], IDENTITY))
                known = {key: value for key, value in zip(frame, at, strict=True) if hasattr(item, key)}
                item = msgspec.structs.replace(item, **known)
        return item

    return msgspec.structs.replace(
        scene,
        hinges=tuple(hinges),
        closures=tuple(map(two_ended, scene.closures)),
        connectors=tuple(map(two_ended, scene.connectors)),
    )


TURNED = Invariance("turned", "the World turned, gravity and loads with it", _turned)
MOVED = Invariance("moved", "the World moved", _moved)


# Galilean invariance: free scenes in a uniformly moving frame.

BOOST_M_S = np.array([0.25, -0.125, 0.5])


def _boosted(scene: Scene) -> Counterpart:
    """The angular momentum about the World's origin, which the bodies fly away from, is left out; so is the work of
    forces, which depends on how fast their points move."""
    without_feedback(scene)
    held = [hinge.name for hinge in scene.hinges if hinge.parent == GROUND and not isinstance(hinge, Free)]
    pairs = [*scene.closures, *(connector for connector in scene.connectors if isinstance(connector, BetweenNodes))]
    held += [pair.name for pair in pairs if GROUND in (pair.body_a, pair.body_b)]
    if held:
        raise NotApplicable(f"it stands on the ground by {', '.join(held)}")
    mass, gravity = known_mass(scene), np.asarray(scene.gravity_m_s2)
    left_out = {"momentum.angular"} | ({"work"} if any(load.type == "force" for load in scene.loads) else set())

    def back(times: Real, channels: Channels) -> Channels:
        restored = {name: rows for name, rows in channels.items() if name not in left_out}
        changes = {"gravity": mass * float(gravity @ BOOST_M_S) * times}
        if "momentum.linear" in restored:
            momentum = restored["momentum.linear"]
            changes["kinetic"] = 0.5 * mass * float(BOOST_M_S @ BOOST_M_S) - momentum @ BOOST_M_S
            restored["momentum.linear"] = momentum - mass * BOOST_M_S
        else:
            restored = {name: rows for name, rows in restored.items() if name not in ("energy.kinetic", "energy.total")}
        restored = with_energy(restored, changes)
        for name, rows in restored.items():
            if name.endswith(".position"):
                restored[name] = rows - times[:, None] * BOOST_M_S
            elif name.endswith(".velocity"):
                restored[name] = rows - BOOST_M_S
        return restored

    hinges = tuple(_faster(hinge) if hinge.parent == GROUND else hinge for hinge in scene.hinges)
    return Counterpart(msgspec.structs.replace(scene, hinges=hinges), back)


def _faster(hinge: Hinge) -> Hinge:
    """A free hinge with the boost added to its velocity, which is in outboard axes."""
    assert isinstance(hinge, Free)
    R = rotation_matrix(hinge.parent_quaternion) @ rotation_matrix(hinge.quaternion)
    return msgspec.structs.replace(hinge, velocity_m_s=vector(np.asarray(hinge.velocity_m_s) + BOOST_M_S @ R))


BOOSTED = Invariance("boosted", "a constant velocity added to everything", _boosted)
