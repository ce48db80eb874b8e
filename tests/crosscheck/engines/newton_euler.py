"""An independent check of a snapshot: Newton's and Euler's equations of every body, and every hinge's own forces.

Uses only the scene and what crosses the engine boundary. For each body there must be markers `<body>` (body frame),
`<body> com`, `<hinge> in` and `<hinge> out` (hinge frames); `with_markers` adds them. Together the equations of all
bodies and the projections of all hinge loads determine the accelerations, so an engine that passes has them right.
"""

import numpy as np
from msgspec.structs import replace

from crosscheck.engines.contract import MarkerSnapshot, Snapshot
from flexmb.scene import schema as s
from flexmb.scene.collecting import make
from flexmb.scene.functions import Constant


def with_markers(scene: s.Scene) -> s.Scene:
    """The scene with markers at body frames and mass centres, and at both frames of hinges as turned nodes.

    Scenes for this check attach hinges by the nodes "origin" with frames offset by position and quaternion.
    """
    bodies = {body.name: body for body in scene.bodies}
    markers = []
    for hinge in scene.hinges:
        child = bodies[hinge.child]
        placed = make(
            s.Node, name=f"{hinge.name} out", position=hinge.child_position_m, quaternion=hinge.child_quaternion
        )
        bodies[child.name] = replace(child, nodes=(*child.nodes, placed))
        markers.append(s.Marker(name=placed.name, body=child.name, node=placed.name))
        if hinge.parent != "ground":
            parent = bodies[hinge.parent]
            placed = make(
                s.Node, name=f"{hinge.name} in", position=hinge.parent_position_m, quaternion=hinge.parent_quaternion
            )
            bodies[parent.name] = replace(parent, nodes=(*parent.nodes, placed))
            markers.append(s.Marker(name=placed.name, body=parent.name, node=placed.name))
    for body in scene.bodies:
        markers += [
            s.Marker(name=body.name, body=body.name),
            s.Marker(name=f"{body.name} com", body=body.name, offset_m=body.com_m),
        ]
    return replace(scene, bodies=tuple(bodies[body.name] for body in scene.bodies), markers=tuple(markers))


def rotation(quaternion) -> np.ndarray:
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def body_residual(scene: s.Scene, snapshot: Snapshot, name: str) -> np.ndarray:
    """[torque; force] (6,) about the mass centre that Newton and Euler miss: zero for a right snapshot."""
    body = next(body for body in scene.bodies if body.name == name)
    frame, com = snapshot.markers[name], snapshot.markers[f"{name} com"]
    R = rotation(frame.quaternion)
    J = R @ np.array(body.inertia_kg_m2) @ R.T
    w, alpha, a = com.velocity[:3], com.acceleration[:3], com.acceleration[3:]
    rate = np.concatenate([J @ alpha + np.cross(w, J @ w), body.mass_kg * a])
    rate[3:] -= body.mass_kg * np.array(scene.gravity_m_s2)
    for hinge in scene.hinges:
        if name in (hinge.child, hinge.parent):
            load, point = snapshot.loads[hinge.name], snapshot.markers[f"{hinge.name} out"].position
            sign = 1.0 if hinge.child == name else -1.0
            rate[:3] -= sign * (load[:3] + np.cross(point - com.position, load[3:]))
            rate[3:] -= sign * load[3:]
    return rate


def inboard(scene: s.Scene, snapshot: Snapshot, hinge) -> MarkerSnapshot:
    if hinge.parent != "ground":
        return snapshot.markers[f"{hinge.name} in"]
    still = np.zeros(6)
    return MarkerSnapshot(np.array(hinge.parent_position_m), np.array(hinge.parent_quaternion), still, still)


def hinge_forces(scene: s.Scene, snapshot: Snapshot, hinge) -> tuple[np.ndarray, np.ndarray]:
    """Generalised forces that the load across the hinge has along its freedoms, and those its springs, dampers and
    motors should give (constant motors only)."""
    P, C = inboard(scene, snapshot, hinge), snapshot.markers[f"{hinge.name} out"]
    R_P, R_C = rotation(P.quaternion), rotation(C.quaternion)
    tau, f = snapshot.loads[hinge.name][:3], snapshot.loads[hinge.name][3:]
    match hinge:
        case s.Weld():
            return np.zeros(0), np.zeros(0)
        case s.Revolute():
            pairs = [(R_P @ hinge.axis @ tau, hinge.rotation)]
        case s.Prismatic():
            pairs = [(R_P @ hinge.axis @ f, hinge.translation)]
        case s.Cylindrical():
            pairs = [(R_P @ hinge.axis @ tau, hinge.rotation), (R_P @ hinge.axis @ f, hinge.translation)]
        case s.Universal():
            pairs = [(R_P[:, 0] @ tau, hinge.first), (R_C[:, 1] @ tau, hinge.second)]
        case s.Planar():
            pairs = [(R_P[:, 0] @ f, hinge.x), (R_P[:, 1] @ f, hinge.y), (R_P[:, 2] @ tau, hinge.rotation)]
        case s.Gimbal(sequence="zx"):
            pairs = [(R_P[:, 2] @ tau, hinge.rotations[0]), (R_C[:, 0] @ tau, hinge.rotations[1])]
        case s.Gimbal(sequence="zyx"):
            angle = hinge.rotations[0].angle_rad
            carried_y = R_P @ [-np.sin(angle), np.cos(angle), 0.0]
            axes = (R_P[:, 2], carried_y, R_C[:, 0])
            pairs = [(axis @ tau, turn) for axis, turn in zip(axes, hinge.rotations, strict=True)]
        case s.Spherical():
            w = R_C.T @ (C.velocity[:3] - P.velocity[:3])
            q = np.array(hinge.quaternion) * (1.0 if hinge.quaternion[0] >= 0.0 else -1.0)
            turn = 2.0 * np.arccos(q[0]) * q[1:] / np.linalg.norm(q[1:])
            return R_C.T @ tau, -hinge.stiffness_Nm_rad * turn - hinge.damping_Nms_rad * w
        case s.Free():
            return snapshot.loads[hinge.name], np.zeros(6)
    return np.array([load for load, _ in pairs]), np.array([_passive(each) for _, each in pairs])


def _passive(coordinate) -> float:
    """Of a coordinate without armature."""
    assert getattr(coordinate, coordinate.ARMATURE) == 0.0
    named = [key for key in coordinate.__struct_fields__ if key not in ("given", coordinate.ARMATURE)]
    value, rate, k, c, rest, motor = (getattr(coordinate, key) for key in named[:6])
    push = motor.value if isinstance(motor, Constant) else 0.0
    return push - k * (value - rest) - c * rate
