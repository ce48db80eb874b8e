"""A rigid tree as an Exudyn script: one kinematic tree in minimal coordinates, with gravity, springs and state.

Exudyn's `ObjectKinematicTree` has one turn or slide a link, along a coordinate axis: every elementary joint is a link,
its frame turned so that z is the joint's axis; links without a joint are part of what carries them. Ball joints, free
flight and screws it does not know: other objects of Exudyn hold them, in redundant coordinates.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, assert_never

import numpy as np

from crosscheck.engines.conventions import IDENTITY_FRAME, Frame
from crosscheck.engines.links import Ball, Floating, Link, Scalar, placed
from crosscheck.export.formats.written import Written, beside_the_tree, chain_of, number
from flexmb.scene.rigid_equivalent import Inertia, combine
from flexmb.scene.schema import Scene
from flexmb.typing import Real

NOTHING = Inertia(0.0, np.zeros(3), np.zeros((3, 3)))
SCRIPT = '''\
"""{name}: a kinematic tree for Exudyn, written by `crosscheck export`.

Coordinates: {coordinates}. Run it to integrate for one second, or import `build`.
"""

import exudyn as exu
from exudyn.itemInterface import NodeGenericODE2, ObjectKinematicTree

JOINTS = {joints}
PARENTS = {parents}
TRANSFORMATIONS = {transformations}
OFFSETS = {offsets}
MASSES = {masses}
MASS_CENTRES = {centres}
INERTIA = {inertia}
STIFFNESS = {stiffness}
DAMPING = {damping}
REST = {rest}
GRAVITY = {gravity}
START = {start}
RATES = {rates}


def build(start=START, rates=RATES):
    """The assembled system and the number of its node, from coordinates and rates at the start."""
    mbs = exu.SystemContainer().AddSystem()
    n = len(JOINTS)
    node = mbs.AddNode(NodeGenericODE2(
        referenceCoordinates=[0.0] * n, initialCoordinates=list(start), initialCoordinates_t=list(rates),
        numberOfODE2Coordinates=n,
    ))
    mbs.AddObject(ObjectKinematicTree(
        nodeNumber=node, gravity=GRAVITY, jointTypes=[getattr(exu.JointType, kind) for kind in JOINTS],
        linkParents=PARENTS, jointTransformations=exu.Matrix3DList(TRANSFORMATIONS),
        jointOffsets=exu.Vector3DList(OFFSETS), linkInertiasCOM=exu.Matrix3DList(INERTIA),
        linkCOMs=exu.Vector3DList(MASS_CENTRES), linkMasses=MASSES,
        jointPControlVector=STIFFNESS, jointDControlVector=DAMPING, jointPositionOffsetVector=REST,
        jointVelocityOffsetVector=[0.0] * n,
    ))
    mbs.Assemble()
    return mbs, node


def integrate(mbs, until, steps):
    """Coordinates and rates after `until` seconds, by Runge and Kutta's method."""
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = until, steps
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.RK44, showHints=False)
    return list(mbs.systemData.GetODE2Coordinates()), list(mbs.systemData.GetODE2Coordinates_t())


if __name__ == "__main__":
    print(*integrate(build()[0], 1.0, 1000), sep="\\n")
'''


@dataclass
class _TreePart:
    """A link of the kinematic tree; its frame has z along the joint. `inertia` grows by what is welded to it."""

    name: str
    kind: str
    parent: int
    frame: Frame
    inertia: list[Inertia]
    joint: Scalar


def exudyn_script(scene: Scene, name: str) -> Written:
    """The scene as a script, if it is a rigid tree of turns and slides that moves at all."""
    chain, why = chain_of(scene, "Exudyn's kinematic tree")
    for link in chain:
        if any(isinstance(freedom, Ball | Floating) for freedom in link.freedoms):
            what = "a ball joint or a free flight, which Exudyn's kinematic tree does not know"
            why = why or f'"{link.joint}" is {what}'
    if not why and not any(link.freedoms for link in chain):
        why = "nothing in it moves"
    return Written(refused=why) if why else Written(_script(_parts(chain), scene, name), left_out=_left_out(scene))


def _left_out(scene: Scene) -> tuple[str, ...]:
    return (*(f"marker {marker.name}" for marker in scene.markers), *beside_the_tree(scene))


def _parts(chain: tuple[Link, ...]) -> list[_TreePart]:
    parts: list[_TreePart] = []
    places: list[tuple[int, Frame]] = []  # of each link: the part that carries it, and its frame there
    for link in chain:
        carrier, frame = places[link.parent] if link.parent >= 0 else (-1, IDENTITY_FRAME)
        frame = frame @ link.inboard
        for place, freedom in enumerate(link.freedoms):
            match freedom:
                case Scalar():
                    turned = Frame(np.zeros(3), _upright(freedom.axis))
                    kind = {"turn": "RevoluteZ", "slide": "PrismaticZ"}[freedom.motion]
                    parts.append(_TreePart(f"{link.joint} {place}", kind, carrier, frame @ turned, [NOTHING], freedom))
                    carrier, frame = len(parts) - 1, turned.inverse()
                case Ball() | Floating():
                    raise NotImplementedError("a ball joint or a free flight, which is refused, has reached the writer")
                case _:
                    assert_never(freedom)
        if carrier >= 0:
            parts[carrier].inertia.append(placed(link.inertia, frame))
        places.append((carrier, frame))
    return parts


def _script(parts: list[_TreePart], scene: Scene, name: str) -> str:
    inertia = [combine(part.inertia) for part in parts]
    joints = [part.joint for part in parts]
    return SCRIPT.format(
        name=name,
        coordinates=", ".join(part.name for part in parts),
        joints=[part.kind for part in parts],
        parents=[part.parent for part in parts],
        transformations=_rows(part.frame.rotation for part in parts),
        offsets=_rows(part.frame.position for part in parts),
        masses=_rows(part.mass for part in inertia),
        centres=_rows(part.com for part in inertia),
        inertia=_rows(part.inertia for part in inertia),
        stiffness=_rows(joint.stiffness for joint in joints),
        damping=_rows(joint.damping for joint in joints),
        rest=_rows(joint.rest for joint in joints),
        gravity=_rows(scene.gravity_m_s2),
        start=_rows(joint.value for joint in joints),
        rates=_rows(joint.rate for joint in joints),
    )


def _rows(values: Iterable[Any]) -> str:
    """Numbers, vectors or matrices as a Python list with all digits."""
    return "[" + ", ".join(_row(value) for value in values) + "]"


def _row(value: Any) -> str:
    return _rows(value) if np.ndim(value) else number(value)


def _upright(axis: Real) -> Real:
    """A rotation whose z axis is the unit vector `axis`."""
    least = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(least, axis)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])
