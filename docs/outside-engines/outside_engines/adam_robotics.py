"""adam-robotics as an engine: its mass matrix, bias and Jacobians, stepped by SciPy's DOP853.

adam knows robots with a floating base: the base is here a massless link that stands still, and of every matrix the part
of the joints is taken. Its spatial vectors have the linear part first, in World axes at the frame's origin.
"""

from __future__ import annotations

import time

import numpy as np

from crosscheck.engines.contract import Effort, EngineMissing, MarkerSnapshot, Run, Snapshot, Support, Trajectory
from crosscheck.engines.conventions import angular_first, cross, quaternion_of
from crosscheck.engines.functions_of_time import scene_functions
from crosscheck.engines.links import Attachment, Scalar, links
from crosscheck.engines.scipy_loop import RTOL_LADDER, integrate
from crosscheck.engines.trajectories import stack
from flexmb.scene.schema import Scene
from outside_engines.robot import Robot, beyond, joint_name, link_name

STANDS = np.eye(4)  # the pose of the base


class AdamEngine:
    name = "adam"
    summary = "adam-robotics: mass matrix, bias and Jacobians by NumPy"

    def version(self) -> str:
        from importlib.metadata import PackageNotFoundError, version

        try:
            return version("adam-robotics")
        except PackageNotFoundError as error:
            raise EngineMissing("adam-robotics is not installed: pip install adam-robotics") from error

    def supports(self, scene: Scene) -> Support:
        reason = beyond(scene, "adam-robotics") or _unknown(scene)
        return Support("no", reason) if reason else Support("exact")

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        return RTOL_LADDER

    def compile(self, scene: Scene) -> AdamModel:
        return AdamModel(scene)


class AdamModel:
    def __init__(self, scene: Scene) -> None:
        from adam.numpy import KinDynComputations

        self.robot = Robot(scene)
        joints = [joint_name(each.link) for each in self.robot.moving]
        pull = np.concatenate([self.robot.gravity, np.zeros(3)])
        self.code = KinDynComputations(self.robot.urdf, joints, gravity=pull)
        self.functions = scene_functions(scene)
        self.mass = sum(link.inertia.mass for link in self.robot.links)

    def warm_up(self) -> None:
        """Nothing is compiled."""

    def acceleration(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        M = self.code.mass_matrix(STANDS, q)[6:, 6:]
        bias = self.code.bias_force(STANDS, q, np.zeros(6), v)[6:]
        return np.linalg.solve(M, self.robot.efforts(t, q, v) - bias)

    def rate(self, t: float, y: np.ndarray) -> np.ndarray:
        q, v = np.split(y, 2)
        return np.concatenate([v, self.acceleration(t, q, v)])

    def evaluate(self) -> Snapshot:
        return self.observed(0.0, *self.robot.start)

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        before = time.perf_counter()
        states, count, message = integrate(self.rate, self.robot.start.ravel(), self.functions, run.times, effort)
        wall = time.perf_counter() - before
        seen = [self.observed(t, *np.split(y, 2)) for t, y in zip(run.times, states, strict=False)]
        return stack(run.times, seen, message=message, wall_s=wall, evaluations=count)

    def observed(self, t: float, q: np.ndarray, v: np.ndarray) -> Snapshot:
        code, moved, turning = self.code, np.concatenate([np.zeros(6), v]), self.acceleration(t, q, v)
        momentum = code.centroidal_momentum_matrix(STANDS, q) @ moved
        centre = np.ravel(code.CoM_position(STANDS, q))
        linear, about_centre = momentum[:3], momentum[3:]
        M = code.mass_matrix(STANDS, q)[6:, 6:]
        energy = {
            "kinetic": float(0.5 * v @ M @ v),
            "gravity": float(-self.mass * self.robot.gravity @ centre),
            "spring": self.robot.stored(q),
        }
        markers = {name: self.marker(at, q, v, turning) for name, at in self.robot.markers.items()}
        turn = about_centre + cross(centre, linear)
        return Snapshot(markers, {}, {}, {}, energy, np.concatenate([turn, linear]))

    def marker(self, at: Attachment, q: np.ndarray, v: np.ndarray, turning: np.ndarray) -> MarkerSnapshot:
        """A frame fixed to a link, from the link's own motion."""
        link, still, moved = link_name(at.link), np.zeros(6), np.concatenate([np.zeros(6), v])
        pose, J = self.code.forward_kinematics(link, STANDS, q), self.code.jacobian(link, STANDS, q)
        velocity = angular_first(J @ moved)
        drift = self.code.jacobian_dot(link, STANDS, q, still, v) @ moved
        acceleration = angular_first(J @ np.concatenate([still, turning]) + drift)
        R = pose[:3, :3]
        arm, w, alpha = R @ at.frame.position, velocity[:3], acceleration[:3]
        return MarkerSnapshot(
            pose[:3, 3] + arm,
            quaternion_of(R @ at.frame.rotation),
            velocity + np.concatenate([np.zeros(3), cross(w, arm)]),
            acceleration + np.concatenate([np.zeros(3), cross(alpha, arm) + cross(w, cross(w, arm))]),
        )


def _unknown(scene: Scene) -> str:
    """What adam 0.5 by NumPy raises an error for, "" if there is nothing."""
    moving = [each for link in links(scene) for each in link.freedoms if isinstance(each, Scalar)]
    if not moving:
        return "adam-robotics needs a joint that moves"
    if any(each.motion != "turn" for each in moving):
        return "adam-robotics by NumPy cannot evaluate prismatic joints"
    return ""
