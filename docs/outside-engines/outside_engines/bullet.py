"""PyBullet as an engine: a robot on a base that stands still, in Bullet's own fixed steps, which are of first order.

By default Bullet brakes every joint, damps every link and limits speeds: all of that is switched off. What its steps do
not say, accelerations and loads across hinges, is left out.
"""

from __future__ import annotations

import math
import tempfile
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from crosscheck.engines.contract import Effort, EngineMissing, MarkerSnapshot, Run, Snapshot, Support, Trajectory
from crosscheck.engines.conventions import cross, quaternion_of, rotation_matrix, scalar_first
from crosscheck.engines.links import Attachment
from crosscheck.engines.pace import pace
from crosscheck.engines.steps import USUAL_S, ladder
from crosscheck.engines.trajectories import stack
from flexmb.scene.schema import Scene
from outside_engines.robot import Robot, beyond

METHOD, RUNGS = "semi-implicit Euler", 4
NO_DAMPING = {"linearDamping": 0.0, "angularDamping": 0.0, "jointDamping": 0.0, "maxJointVelocity": 1e9}


class BulletEngine:
    name = "bullet"
    summary = "PyBullet: articulated bodies, its own steps of first order"

    def version(self) -> str:
        from importlib.metadata import PackageNotFoundError, version

        try:
            return version("pybullet")
        except PackageNotFoundError as error:
            raise EngineMissing("PyBullet is not installed: pip install pybullet") from error

    def supports(self, scene: Scene) -> Support:
        reason = beyond(scene, "PyBullet")
        return Support("no", reason) if reason else Support("exact")

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        return self.efforts_for(scene, USUAL_S)

    def efforts_for(self, scene: Scene, duration_s: float) -> tuple[Effort, ...]:
        return ladder(METHOD, pace(scene, duration_s), duration_s, RUNGS)

    def compile(self, scene: Scene) -> BulletModel:
        return BulletModel(scene)


class BulletModel:
    def __init__(self, scene: Scene) -> None:
        self.robot = Robot(scene)

    def warm_up(self) -> None:
        """Nothing is compiled."""

    def evaluate(self) -> Snapshot:
        with World(self.robot) as world:
            return world.observed()

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        with World(self.robot) as world:
            seen, wall, steps = [world.observed()], 0.0, 0
            for begin, end in pairwise(run.times):
                count = math.ceil((end - begin) / effort.value * (1.0 - 1e-9))
                before = time.perf_counter()
                world.go(begin, (end - begin) / count, count)
                wall, steps = wall + time.perf_counter() - before, steps + count
                seen.append(world.observed())
        return stack(run.times, seen, message="", wall_s=wall, evaluations=steps)


class World:
    """A server of Bullet in this process with the robot in it, from its initial state; it ends with the `with`."""

    def __init__(self, robot: Robot) -> None:
        import pybullet

        self.robot, self.code, self.server = robot, pybullet, pybullet.connect(pybullet.DIRECT)
        call: dict[str, Any] = {"physicsClientId": self.server}
        self.call = call
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "scene.urdf"
            file.write_text(robot.urdf, encoding="utf-8")
            flags = pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_MAINTAIN_LINK_ORDER
            self.body = pybullet.loadURDF(str(file), useFixedBase=True, flags=flags, **call)
        pybullet.setGravity(*robot.gravity, **call)
        names = [pybullet.getJointInfo(self.body, k, **call)[12].decode() for k in range(len(robot.links))]
        self.place = {name: k for k, name in enumerate(names)}
        self.joints = [self.place[f"link {each.link}"] for each in robot.moving]
        for k in range(-1, len(robot.links)):
            pybullet.changeDynamics(self.body, k, **NO_DAMPING, **call)
        for joint, value, rate in zip(self.joints, *robot.start, strict=True):
            pybullet.setJointMotorControl2(self.body, joint, pybullet.VELOCITY_CONTROL, force=0.0, **call)
            pybullet.resetJointState(self.body, joint, value, rate, **call)

    def __enter__(self) -> World:
        return self

    def __exit__(self, *_: object) -> None:
        self.code.disconnect(self.server)

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        found = [self.code.getJointState(self.body, joint, **self.call)[:2] for joint in self.joints]
        q, v = np.array(found).reshape(-1, 2).T
        return q, v

    def go(self, begin: float, step: float, count: int) -> None:
        """Steps from `begin` (s); torques are those at the beginning of each."""
        code = self.code
        code.setTimeStep(step, **self.call)
        for n in range(count):
            push = self.robot.efforts(begin + n * step, *self.state())
            code.setJointMotorControlArray(
                self.body, self.joints, code.TORQUE_CONTROL, forces=push.tolist(), **self.call
            )
            code.stepSimulation(**self.call)

    def observed(self) -> Snapshot:
        links = [self.motion(k) for k in range(len(self.robot.links))]
        kinetic, gravity, momentum = 0.0, 0.0, np.zeros(6)
        for link, (R, p, w, v) in zip(self.robot.links, links, strict=True):
            mass, arm = link.inertia.mass, R @ link.inertia.com
            velocity, centre = v + cross(w, arm), p + arm
            spin = R @ link.inertia.inertia @ R.T @ w
            kinetic += 0.5 * float(mass * velocity @ velocity + w @ spin)
            gravity -= mass * float(self.robot.gravity @ centre)
            momentum += np.concatenate([spin + mass * cross(centre, velocity), mass * velocity])
        energy = {"kinetic": kinetic, "gravity": gravity, "spring": self.robot.stored(self.state()[0])}
        markers = {name: self.marker(at, *links[at.link]) for name, at in self.robot.markers.items()}
        return Snapshot(markers, {}, {}, {}, energy, momentum)

    def motion(self, link: int) -> tuple[np.ndarray, ...]:
        """Rotation, origin and velocities of a link's frame.

        From those of the mass centre along the principal axes: what `getLinkState` says of the link's own frame is
        rounded to single precision.
        """
        place = self.place[f"link {link}"]
        found = self.code.getLinkState(
            self.body, place, computeLinkVelocity=1, computeForwardKinematics=1, **self.call
        )
        own = self.code.getDynamicsInfo(self.body, place, **self.call)
        R = rotation_matrix(scalar_first(found[1])) @ rotation_matrix(scalar_first(own[4])).T
        arm, w = R @ np.array(own[3]), np.array(found[7])
        return R, np.array(found[0]) - arm, w, np.array(found[6]) - cross(w, arm)

    def marker(self, at: Attachment, R: np.ndarray, p: np.ndarray, w: np.ndarray, v: np.ndarray) -> MarkerSnapshot:
        arm = R @ at.frame.position
        return MarkerSnapshot(
            p + arm, quaternion_of(R @ at.frame.rotation), np.concatenate([w, v + cross(w, arm)]), None
        )
