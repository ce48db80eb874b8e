"""Points on lines and in planes: closures against trees in which carriages without mass run along the same lines."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.schema import Scene

PLACE, TURN = np.array([0.2, -0.1, 0.3]), np.array([0.8, 0.1, -0.5, 0.3]) / np.linalg.norm([0.8, 0.1, -0.5, 0.3])
AXIS = np.array([0.6, 0.0, 0.8])
SPIN = (0.4, -0.9, 1.3)
OFFSET = (0.1, 0.05, -0.2)


def begun(name: str) -> fm.SceneBuilder:
    """A body whose point "eye" is guided."""
    tree = fm.SceneBuilder(name, gravity=(0.3, -0.2, -9.81))
    tree.rigid_body("body", mass=1.3, com=(0.2, 0.05, -0.1), inertia=np.diag([0.02, 0.05, 0.06]), nodes={"eye": OFFSET})
    return tree


def closed(kind: str, along: np.ndarray) -> Scene:
    """The body in free flight with its eye where the guide is, which moves by `along` (m/s)."""
    velocity = rotation_matrix(TURN).T @ along - np.cross(SPIN, OFFSET)
    tree = begun("closed").free(
        "flight", "ground", "body", position=PLACE - rotation_matrix(TURN) @ OFFSET, quaternion=TURN,
        angular_velocity=SPIN, velocity=velocity,
    )  # fmt: skip
    tree.closure("guide", kind, "ground", "body", node_b="eye", position_a=PLACE, axis=AXIS)
    return tree.marker("seen", "body").scene()


def guided(axes: list[np.ndarray], rates: list[float]) -> Scene:
    """The body on a ball joint at its eye, which carriages without mass take along these axes."""
    tree, parent, at = begun("guided"), "ground", PLACE
    for k, (axis, rate) in enumerate(zip(axes, rates, strict=True)):
        tree.rigid_body(f"carriage {k}", mass=0.0, inertia=np.zeros((3, 3)))
        tree.prismatic(f"rail {k}", parent, f"carriage {k}", axis=axis, rate=rate, parent_position=at)
        parent, at = f"carriage {k}", np.zeros(3)
    tree.spherical("guide", parent, "body", child_node="eye", quaternion=TURN, angular_velocity=SPIN)
    return tree.marker("seen", "body").scene()


@pytest.mark.parametrize("kind", ["in_line", "in_plane"])
def test_motion_and_load_are_those_of_carriages(kind: str) -> None:
    across = np.cross(AXIS, (0.0, 1.0, 0.0))
    axes = [AXIS] if kind == "in_line" else [across, np.cross(AXIS, across)]
    rates = [0.7, -0.4][: len(axes)]
    along = sum((rate * axis for axis, rate in zip(axes, rates, strict=True)), np.zeros(3))
    ours, theirs = (
        fm.simulate(scene, 1.0, samples=11, method="dop853", rtol=1e-11, atol=1e-13)
        for scene in (closed(kind, along), guided(axes, rates))
    )
    assert ours.finished and theirs.finished
    seen, expected = ours.markers["seen"], theirs.markers["seen"]
    assert np.abs(seen.position - expected.position).max() <= 1e-8
    assert np.abs(ours.loads["guide"] - theirs.loads["guide"]).max() <= 1e-7
    eye = seen.position + np.array([rotation_matrix(q) @ OFFSET for q in seen.quaternion]) - PLACE
    off = eye @ AXIS if kind == "in_plane" else np.linalg.norm(np.cross(eye, AXIS), axis=1)
    assert np.abs(off).max() <= 1e-9 and np.abs(eye).max() >= 0.3  # it moves, where it may
    assert np.abs(ours.loads["guide"][:, 3:]).max() >= 1.0


def test_a_pin_in_a_slot_is_a_line() -> None:
    """A crank's pin in the slot of a yoke on a rail: the yoke moves as the sine of the crank's angle."""
    tree = fm.SceneBuilder("scotch yoke", gravity=(0.0, 0.0, 0.0))
    tree.rigid_body("crank", mass=1.0, inertia=np.diag([0.01, 0.01, 0.02]), nodes={"pin": (0.25, 0.0, 0.0)})
    tree.rigid_body("yoke", mass=2.0, inertia=np.diag([0.1, 0.1, 0.1]))
    tree.revolute("shaft", "ground", "crank", prescribed=fm.Ramp(value=0.2, rate=3.0))
    tree.prismatic("rail", "ground", "yoke", axis=(1.0, 0.0, 0.0), position=0.25 * np.cos(0.2))
    tree.closure("slot", "in_line", "yoke", "crank", node_b="pin", axis=(0.0, 1.0, 0.0))
    run = fm.simulate(tree.marker("yoke", "yoke").scene(), 2.0, samples=21)
    assert run.finished
    assert np.abs(run.markers["yoke"].position[:, 0] - 0.25 * np.cos(0.2 + 3.0 * run.t)).max() <= 1e-9
    # the yoke's inertia is what the pin pushes it with, the reaction to the load on the crank
    assert np.abs(run.loads["slot"][:, 3] - 2.0 * 0.25 * 9.0 * np.cos(0.2 + 3.0 * run.t)).max() <= 1e-7
