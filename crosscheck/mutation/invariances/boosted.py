"""Galilean invariance: free scenes in a uniformly moving frame."""

from __future__ import annotations

import msgspec
import numpy as np

from crosscheck.mutation.invariances.counterpart import (
    Channels,
    Counterpart,
    Invariance,
    NotApplicable,
    total_mass,
    vector,
    with_energy,
    without_feedback,
)
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.hinges import Free, Hinge
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.schema import Scene
from flexmb.scene.tree import GROUND
from flexmb.typing import Real

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
    mass, gravity = total_mass(scene), np.asarray(scene.gravity_m_s2)
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
