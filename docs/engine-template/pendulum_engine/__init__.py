"""A template of an engine: one rigid body on a revolute hinge to the ground, integrated by SciPy.

theta'' = (torque of gravity about the hinge's axis) / (moment of inertia about it). Everything that leaves this file is
in World axes and SI, spatial vectors are [angular; linear], quaternions scalar-first.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np
import scipy
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from crosscheck.engines.contract import Effort, MarkerPath, MarkerSnapshot, Run, Snapshot, Support, Trajectory
from flexmb.scene.schema import Revolute, RigidBody, Scene
from flexmb.scene.tree import node_frame

EFFORTS = tuple(Effort("tolerance", value, "DOP853") for value in (1e-6, 1e-8, 1e-10, 1e-12))


class PendulumEngine:
    """The engine: `crosscheck engines` shows its summary."""

    name = "pendulum"
    summary = "template: one body on a hinge, by SciPy"

    def version(self) -> str:
        return scipy.__version__  # raise crosscheck.engines.contract.EngineMissing where your library is not there

    def supports(self, scene: Scene) -> Support:
        """Refuse what would come out wrong, with the reason: a refusal is an answer, a wrong number is a fault."""
        reason = _beyond(scene)
        return Support("no", reason) if reason else Support("exact")

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        return EFFORTS

    def compile(self, scene: Scene) -> PendulumModel:
        return PendulumModel(scene)


class PendulumModel:
    """A scene with its hinge in World axes: point `pivot` (m), unit `axis`, body axes at angle zero `rest`."""

    def __init__(self, scene: Scene) -> None:
        (self.body,), (self.hinge,) = scene.bodies, scene.hinges
        joint, joint_axes = _place(self.body, self.hinge.child_node, self.hinge.child_position_m)
        self.markers = {}
        for marker in scene.markers:
            position, axes = _place(self.body, marker.node, marker.offset_m)
            self.markers[marker.name] = position - joint, axes
        self.gravity = np.array(scene.gravity_m_s2)
        self.pivot = np.array(self.hinge.parent_position_m)
        frame = _rotation(self.hinge.parent_quaternion)
        self.axis = frame.apply(np.array(self.hinge.axis) / np.linalg.norm(self.hinge.axis))
        self.rest = frame * (joint_axes * _rotation(self.hinge.child_quaternion)).inv()
        self.com = np.array(self.body.com_m) - joint  # from the hinge point, body axes
        self.inertia = np.array(self.body.inertia_kg_m2)
        own = self.rest.inv().apply(self.axis)  # the axis in body axes, where it stays
        self.about_axis = own @ self.inertia @ own + self.body.mass_kg * np.sum(np.cross(own, self.com) ** 2)
        self.start = np.array([self.hinge.rotation.angle_rad, self.hinge.rotation.rate_rad_s])

    def warm_up(self) -> None:
        """Nothing is compiled here."""

    def rate(self, t: float, y: np.ndarray) -> np.ndarray:
        """Rates of [angle; rate]."""
        arm = self._turned(y[0]).apply(self.com)
        return np.array([y[1], self.axis @ np.cross(arm, self.body.mass_kg * self.gravity) / self.about_axis])

    def evaluate(self) -> Snapshot:
        run = self._observed(np.zeros(1), self.start[None])
        spin, turn = self.start[1] * self.axis, self.rate(0.0, self.start)[1] * self.axis
        markers = {}
        for name, path in run.markers.items():
            arm = path.position[0] - self.pivot
            linear = np.cross(turn, arm) + np.cross(spin, np.cross(spin, arm))
            first = (values[0] for values in (path.position, path.quaternion, path.velocity))
            markers[name] = MarkerSnapshot(*first, np.concatenate([turn, linear]))
        loads = {name: values[0] for name, values in run.loads.items()}
        energy = {kind: float(values[0]) for kind, values in run.energy.items()}
        return Snapshot(markers, loads, {}, {}, energy, run.momentum[0])

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        before = perf_counter()
        solution = solve_ivp(
            self.rate, (0.0, run.times[-1]), self.start, effort.method, run.times,
            rtol=effort.value, atol=effort.value * 1e-2,
        )  # fmt: skip
        wall = perf_counter() - before
        states, times = solution.y.T, np.asarray(solution.t)
        status = "finished" if solution.success else "diverged"
        return self._observed(times, states, status, "" if solution.success else solution.message, wall, solution.nfev)

    def _observed(self, times, states, status="finished", message="", wall_s=0.0, evaluations=1) -> Trajectory:
        """Everything asked of a run, from angle and rate at each sample."""
        turned = self._turned(states[:, 0])
        spin = states[:, 1:] * self.axis
        turn = np.array([self.rate(0.0, state)[1] for state in states])[:, None] * self.axis
        arm = turned.apply(self.com)
        velocity = np.cross(spin, arm)
        acceleration = np.cross(turn, arm) + np.cross(spin, velocity)
        mass, place = self.body.mass_kg, self.pivot + arm
        own = turned.inv()  # to body axes, where the inertia is constant
        spinning = turned.apply(own.apply(spin) @ self.inertia)
        moment = turned.apply(own.apply(turn) @ self.inertia) + np.cross(spin, spinning)
        force = mass * (acceleration - self.gravity)
        markers = {}
        for name, (offset, axes) in self.markers.items():
            reach = turned.apply(offset)
            speeds = np.hstack([spin, np.cross(spin, reach)])
            markers[name] = MarkerPath(self.pivot + reach, (turned * axes).as_quat(scalar_first=True), speeds)
        kinetic = 0.5 * (np.sum(spin * spinning, axis=1) + mass * np.sum(velocity**2, axis=1))
        return Trajectory(
            status, message, times, markers,
            loads={self.hinge.name: np.hstack([moment + np.cross(arm, force), force])},
            energy={"kinetic": kinetic, "gravity": -mass * place @ self.gravity},
            momentum=np.hstack([spinning + np.cross(place, mass * velocity), mass * velocity]),
            wall_s=wall_s, evaluations=evaluations,
        )  # fmt: skip

    def _turned(self, angle: np.ndarray | float) -> Rotation:
        """Body axes to World axes at some angles (rad)."""
        return Rotation.from_rotvec(np.multiply.outer(angle, self.axis)) * self.rest


def _rotation(quaternion: tuple[float, ...]) -> Rotation:
    return Rotation.from_quat(quaternion, scalar_first=True)


def _place(body: RigidBody, node: str, offset: tuple[float, ...]) -> tuple[np.ndarray, Rotation]:
    """A point at a node plus an offset in node axes: where it is in the body, and the node's axes."""
    frame = node_frame(body, node)
    axes = _rotation(frame.quaternion)
    return np.array(frame.position) + axes.apply(offset), axes


def _beyond(scene: Scene) -> str:
    """Why this engine cannot represent a scene; "" if it can."""
    others = {"wheel": scene.wheels, "point mass": scene.point_masses, "load": scene.loads, "closure": scene.closures}
    for what, found in others.items():
        if found:
            return f"the scene has a {what}, and this engine knows none"
    if len(scene.bodies) != 1 or not isinstance(scene.bodies[0], RigidBody):
        return "this engine knows scenes with one rigid body"
    hinge = scene.hinges[0]
    if not isinstance(hinge, Revolute):
        return f"this engine knows revolute hinges, and {hinge.name} is {type(hinge).__name__.lower()}"
    turning = hinge.rotation
    if turning.stiffness_Nm_rad or turning.damping_Nms_rad or turning.torque_Nm or turning.prescribed_rad:
        return f"this engine knows no springs, dampers, motors and prescribed motions, and {hinge.name} has one"
    return ""
