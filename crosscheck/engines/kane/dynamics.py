"""Kane's equations of free bodies, with the multipliers of their joints, as an ordinary differential equation.

The accelerations a of all bodies, in coordinates of their own, and the loads f of the joints follow from

    M a + h = J' f + (springs, dampers, motors)        J a = c

where the rows J are differences of the partial velocities of the two frames of each joint. c contains a damped spring
(Baumgarte) that closes what errors of the integration open; of an exact solution it is no part.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from crosscheck.engines.conventions import axis_rotation, quaternion_of, rotation_matrix
from crosscheck.engines.kane.bodies import KaneBody, body_data, wheel_data
from crosscheck.engines.kane.frames import BodyFrames, FramePlace, FreeBodies, MovedFrames, applied, skew
from crosscheck.engines.kane.joints import KaneFlight, KaneJoint, all_joints, motor, springs
from crosscheck.engines.kane.moments import tensors, with_modes
from flexmb.scene.schema import Marker, Scene
from flexmb.scene.tree import GROUND, ordered
from flexmb.typing import Real

# The scene's initial state: every body at the frame that its hinge gives it, from the ground outward.


def start(
    scene: Scene,
    held: Sequence[KaneJoint | KaneFlight],
    numbers: Mapping[str, int],
    data: Mapping[str, KaneBody],
    modes: int,
) -> tuple[FreeBodies, Real]:
    """All bodies, wheels and the ground at t = 0, and their quaternions (b+1, 4)."""
    count = len(numbers)
    bodies = FreeBodies(
        np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)), np.zeros((count, 3)),
        np.zeros((count, modes)), np.zeros((count, modes)),
    )  # fmt: skip
    for given in scene.modal_states:
        number, size = numbers[given.body], len(given.coordinates)
        if len(data[given.body].stiffness):
            bodies.eta[number, :size] = given.coordinates
            bodies.rate[number, : len(given.rates)] = given.rates
    named = {each.of.name: each for each in held}
    for name in [*(hinge.name for _, hinge in ordered(scene)), *(wheel.name for wheel in scene.wheels)]:
        _place(bodies, named[name], modes)
    return bodies, np.array([quaternion_of(R) for R in bodies.rotation])


def _place(bodies: FreeBodies, joint: KaneJoint | KaneFlight, modes: int) -> None:
    """Put the outboard body where the joint holds it."""
    at = BodyFrames([joint.inboard], modes).at(bodies)
    position, axes, (w, v) = at.position[0], at.axes[0], at.velocity[0].reshape(2, 3)
    if isinstance(joint, KaneFlight):
        own = joint.of
        arm, turn = axes @ np.array(own.position_m), axes @ rotation_matrix(own.quaternion)
        v = v + np.cross(w, arm) + turn @ np.array(own.velocity_m_s)
        position, axes, w = position + arm, turn, w + turn @ np.array(own.angular_velocity_rad_s)
    else:
        angle, rate = joint.start
        w = w + rate * axes[:, 2]
        axes = axes @ axis_rotation(np.array([0.0, 0.0, 1.0]), angle)
    _carry(bodies, joint.outboard, modes, position, axes, w, v)


def _carry(bodies: FreeBodies, place: FramePlace, modes: int, position: Real, axes: Real, w: Real, v: Real) -> None:
    """Move the body so that its frame has this position, these axes and velocities, World axes."""
    number = place.body
    own = BodyFrames([place], modes).at(bodies)  # the body is still at the origin, at rest
    bodies.rotation[number] = axes @ own.axes[0].T
    R = bodies.rotation[number]
    bodies.position[number] = position - R @ own.position[0]
    spin, shift = (R @ part for part in own.velocity[0].reshape(2, 3))
    bodies.angular[number] = R.T @ (w - spin)
    bodies.velocity[number] = v - shift - np.cross(w - spin, R @ own.position[0])


CLOSING = 5.0
"""1/s: rate at which errors of closed joints decay."""
_Z, _TURNS = 2, 3
_ROTATION = np.zeros((16, 9))  # of a unit quaternion, by its products q_i q_j
_QDOT = np.zeros((12, 4))  # of a quaternion q, by its products q_i w_j with the angular velocity in body axes


def _fill_quaternion_maps() -> None:
    for i in range(4):
        for j in range(4):
            a, b = np.eye(4)[i], np.eye(4)[j]
            polar = rotation_matrix(a + b) - rotation_matrix(a) - rotation_matrix(b)
            _ROTATION[4 * i + j] = 0.5 * polar.ravel()
        w, v = np.eye(4)[i][0], np.eye(4)[i][1:]
        for j in range(3):
            e = np.eye(3)[j]
            _QDOT[3 * i + j] = 0.5 * np.concatenate([[-v @ e], w * e + np.cross(v, e)])


_fill_quaternion_maps()


class KaneState(NamedTuple):
    """All bodies at a time, and the angles of joints whose coordinates are unknown."""

    t: float
    bodies: FreeBodies
    quaternion: Real
    angle: Real
    raw: Real


class KaneSolution(NamedTuple):
    """Accelerations (b, 6+m), loads (j, 6) [torque; force] of joints on the outboard body about its frame, World axes;
    drive loads (j,), rates of angles (j,), power (W) of all but springs and gravity, and the frames of the joints."""

    acceleration: Real
    load: Real
    drive: Real
    rate: Real
    power: float
    joints: MovedFrames


class KaneDynamics:
    def __init__(self, scene: Scene) -> None:
        data = {body.name: body_data(body) for body in scene.bodies}
        data |= {wheel.name: wheel_data(wheel) for wheel in scene.wheels}
        self.scene, self.data = scene, data
        self.numbers = {name: k for k, name in enumerate(data)} | {GROUND: len(data)}
        everything = all_joints(scene, self.numbers, data)
        self.flights = [each for each in everything if isinstance(each, KaneFlight)]
        self.joints = [each for each in everything if isinstance(each, KaneJoint)]
        self.count, self.modes = len(data), max((len(each.stiffness) for each in data.values()), default=0)
        self._set_bodies()
        self._set_joints()
        self.markers = BodyFrames([self._marker(marker) for marker in scene.markers], self.modes)

    def _set_bodies(self) -> None:
        b, m = self.count, self.modes
        self.moments = np.array([with_modes(each.moments, m) for each in self.data.values()])
        Q, S = tensors(self.moments)
        self._mass = Q.reshape(b, (m + 1) ** 2, (6 + m) ** 2)
        self._inertia = S.reshape(b, (m + 1) * (6 + m), -1)
        self.stiffness, self.damping, self._unused = np.zeros((3, b, m, m))
        for k, each in enumerate(self.data.values()):
            own = len(each.stiffness)
            self.stiffness[k, :own, :own], self.damping[k, :own, :own] = each.stiffness, each.damping
            self._unused[k, range(own, m), range(own, m)] = 1.0
        self._gravity = np.array(self.scene.gravity_m_s2, dtype=float)

    def _set_joints(self) -> None:
        joints = self.joints
        self._frames = BodyFrames([*(j.inboard for j in joints), *(j.outboard for j in joints)], self.modes)
        self._inboard = np.array([j.inboard.body for j in joints], dtype=np.intp)
        self._outboard = np.array([j.outboard.body for j in joints], dtype=np.intp)
        self._each = np.arange(len(joints))
        self._free = np.array([j.free for j in joints], dtype=bool)
        kept = np.ones((len(joints), 6), dtype=bool)
        kept[self._free, _Z] = False
        self._kept = np.flatnonzero(kept)
        self._springs = springs(joints)
        self._motions = [(k, j.motion) for k, j in enumerate(joints) if j.coordinate is not None and not j.free]
        self._motors = [
            (k, motor(j.coordinate)) for k, j in enumerate(joints) if j.coordinate and j.coordinate.torque_Nm
        ]
        self._rows = np.zeros((len(joints), 6, self.count + 1, 6 + self.modes))

    def _marker(self, marker: Marker) -> FramePlace:
        node = self.data[marker.body].nodes[marker.node]
        return FramePlace(self.numbers[marker.body], node, np.array(marker.offset_m), np.eye(3))

    def initial(self) -> Real:
        bodies, quaternion = start(self.scene, [*self.joints, *self.flights], self.numbers, self.data, self.modes)
        per_body = np.concatenate(
            [bodies.position, quaternion, bodies.eta, bodies.velocity, bodies.angular, bodies.rate], axis=1
        )[: self.count]
        angles = [each.start[0] for each in self.joints]
        return np.concatenate([per_body.ravel(), angles, [0.0]])

    def state(self, t: float, y: Real) -> KaneState:
        b, m = self.count, self.modes
        table = np.zeros((b + 1, 13 + 2 * m))  # the ground stands last, at rest
        table[:b] = y[: b * (13 + 2 * m)].reshape(b, -1)
        table[b, 3] = 1.0
        q = table[:, 3:7]
        unit = q / np.sqrt((q * q).sum(1))[:, None]
        R = ((unit[:, :, None] * unit[:, None]).reshape(-1, 16) @ _ROTATION).reshape(-1, 3, 3)
        velocity, angular = table[:, 7 + m : 10 + m], table[:, 10 + m : 13 + m]
        bodies = FreeBodies(table[:, :3], R, velocity, angular, table[:, 7 : 7 + m], table[:, 13 + m :])
        return KaneState(t, bodies, q, y[b * (13 + 2 * m) : -1], table)

    def mass_matrix(self, bodies: FreeBodies) -> Real:
        """(b, 6+m, 6+m), with ones for modes that a body does not have."""
        b, m = self.count, self.modes
        z = np.ones((b, m + 1))
        z[:, 1:] = bodies.eta[:b]
        products = (z[:, :, None] * z[:, None]).reshape(b, 1, -1)
        M = (products @ self._mass).reshape(b, 6 + m, 6 + m)
        M[:, 6:, 6:] += self._unused
        return M

    def _inertia_forces(self, bodies: FreeBodies) -> Real:
        """(b, 6+m): of velocities and gravity, and of stiffness and damping."""
        b, m = self.count, self.modes
        z, zdot = np.ones((b, m + 1)), np.zeros((b, m + 1))
        z[:, 1:], zdot[:, 1:] = bodies.eta[:b], bodies.rate[:b]
        w = skew(bodies.angular[:b])
        B = np.empty((b, 3, 4 + 3 * m))
        B[:, :, 0] = -(self._gravity @ bodies.rotation[:b])
        turning = (w @ w)[..., None] * z[:, None, None] + 2.0 * w[..., None] * zdot[:, None, None]
        B[:, :, 1:] = turning.reshape(b, 3, -1)
        h = (z[:, None] @ (self._inertia @ B.reshape(b, -1, 1)).reshape(b, m + 1, 6 + m))[:, 0]
        h[:, 6:] += applied(self.stiffness, bodies.eta[:b]) + applied(self.damping, bodies.rate[:b])
        return h

    def solve(self, state: KaneState) -> KaneSolution:
        bodies, n, count = state.bodies, 6 + self.modes, self.count
        M, h = self.mass_matrix(bodies), self._inertia_forces(bodies)
        at, joints = self._frames.at(bodies), len(self.joints)
        axes = at.axes[:joints]
        in_axes = axes.transpose(0, 2, 1)
        J = self._rows
        J[self._each, :, self._outboard] = at.partial[joints:]
        J[self._each, :, self._inboard] = -at.partial[:joints]
        flat = J.reshape(joints, 6, (count + 1) * n)
        flat[:, :_TURNS] = in_axes @ flat[:, :_TURNS]
        prescribed = np.zeros((joints, 3))
        for k, motion in self._motions:
            prescribed[k] = motion(state.t)
        target, rate = self._targets(at, in_axes, prescribed)
        torque = self._torques(state, prescribed, rate)
        rows = J[:, :, :count].reshape(joints * 6, count, n)
        kept = rows[self._kept]
        given = torque * self._free
        right = given @ J[:, _Z, :count].reshape(joints, count * n)
        columns = np.empty((count, n, len(kept) + 1))
        columns[:, :, :-1] = kept.transpose(1, 2, 0)
        columns[:, :, -1] = right.reshape(count, n) - h
        X = np.linalg.solve(M, columns).reshape(count * n, -1)
        flexibility = kept.reshape(len(kept), count * n) @ X
        kept_load = np.linalg.solve(flexibility[:, :-1], target.ravel()[self._kept] - flexibility[:, -1])
        load = np.zeros((joints, 6))
        load.reshape(-1)[self._kept] = kept_load
        load[:, _Z] += given
        drive: Real = np.where(self._free, 0.0, load[:, _Z] - torque)
        load[:, :_TURNS] = applied(axes, load[:, :_TURNS])
        acceleration = np.asarray(X[:, -1] + X[:, :-1] @ kept_load).reshape(count, n)
        elastic = self._spring_torque(state, prescribed)
        lost = applied(self.damping, bodies.rate[:count])
        power = float((drive + torque - elastic) @ rate - np.sum(lost * bodies.rate[:count]))
        return KaneSolution(acceleration, load, drive, rate, power, at)

    def _targets(self, at: MovedFrames, in_axes: Real, prescribed: Real) -> tuple[Real, Real]:
        """What J a has to be (j, 6), in axes of the joint for turns and in World axes, and the rates of angles (j,)."""
        joints = len(self.joints)
        moving = at.velocity[joints:] - at.velocity[:joints]
        turning = applied(in_axes, moving[:, :_TURNS])
        rate = np.where(self._free, turning[:, _Z], prescribed[:, 1])
        relative = in_axes @ at.axes[joints:]
        cosine, sine = np.cos(prescribed[:, 0]), np.sin(prescribed[:, 0])
        apart = np.empty((joints, 6))
        apart[:, 0], apart[:, 1] = -relative[:, 1, 2], relative[:, 0, 2]
        apart[:, _Z] = 0.5 * (
            (relative[:, 1, 0] - relative[:, 0, 1]) * cosine - (relative[:, 0, 0] + relative[:, 1, 1]) * sine
        )
        apart[:, _TURNS:] = at.position[joints:] - at.position[:joints]
        left = at.remaining[joints:] - at.remaining[:joints]
        spin = applied(in_axes, at.velocity[:joints, :_TURNS])
        target = np.empty((joints, 6))
        target[:, :_TURNS] = -applied(in_axes, left[:, :_TURNS])
        target[:, 0] += spin[:, 1] * rate
        target[:, 1] -= spin[:, 0] * rate
        target[:, _Z] += prescribed[:, 2]
        target[:, _TURNS:] = -left[:, _TURNS:]
        turning[:, _Z] -= rate
        target -= CLOSING * CLOSING * apart
        target[:, :_TURNS] -= 2.0 * CLOSING * turning
        target[:, _TURNS:] -= 2.0 * CLOSING * moving[:, _TURNS:]
        return target, rate

    def angles(self, state: KaneState, prescribed: Real) -> Real:
        """(j,) of all joints."""
        return np.where(self._free, state.angle, prescribed[:, 0])

    def _spring_torque(self, state: KaneState, prescribed: Real) -> Real:
        k, _, rest = self._springs
        return np.asarray(-k * (self.angles(state, prescribed) - rest))

    def _torques(self, state: KaneState, prescribed: Real, rate: Real) -> Real:
        """(j,): of springs, dampers and motors on the outboard body about z."""
        torque = self._spring_torque(state, prescribed) - self._springs[1] * rate
        for k, size in self._motors:
            torque[k] += size(state.t)
        return torque

    def spring_energy(self, state: KaneState) -> float:
        """J."""
        prescribed = np.zeros((len(self.joints), 3))
        for k, motion in self._motions:
            prescribed[k] = motion(state.t)
        k, _, rest = self._springs
        return float(0.5 * k @ (self.angles(state, prescribed) - rest) ** 2)

    def rate(self, t: float, y: Real) -> Real:
        """dy/dt."""
        state = self.state(t, y)
        solution, b, m = self.solve(state), self.count, self.modes
        bodies, a = state.bodies, solution.acceleration
        w = bodies.angular[:b]
        table = np.empty((b, 13 + 2 * m))
        table[:, :3] = bodies.velocity[:b]
        table[:, 3:7] = (state.quaternion[:b, :, None] * w[:, None]).reshape(b, 12) @ _QDOT
        table[:, 7 : 7 + m] = bodies.rate[:b]
        table[:, 7 + m : 10 + m] = applied(bodies.rotation[:b], a[:, :3])
        table[:, 10 + m :] = a[:, 3:]
        return np.concatenate([table.ravel(), solution.rate, [solution.power]])
