"""A small adapter as an outsider would write it: trees of rigid bodies by Newton and Euler, integrated by SciPy.

It keeps every clause on what it represents. The campaign beside it changes its text, line by line, into what outsiders
got wrong; so formulas stand here plainly, and none is written twice.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from crosscheck.engines.contract import Effort, MarkerSnapshot, Run, Snapshot, Support, Trajectory
from crosscheck.engines.functions_of_time import profile
from crosscheck.engines.trajectories import stack
from flexmb.scene.hinges import Free, Prismatic, Revolute, Spherical, Weld
from flexmb.scene.schema import RigidBody, Scene
from flexmb.scene.tree import node_frame, ordered

KINDS = {Revolute: "turn", Prismatic: "slide", Spherical: "ball", Free: "free", Weld: "weld"}
SIZES = {"turn": (1, 1), "slide": (1, 1), "ball": (4, 3), "free": (7, 6), "weld": (0, 0)}  # coordinates, speeds
EFFORTS = tuple(Effort("tolerance", value, "DOP853") for value in (1e-6, 1e-8, 1e-10))


def cross(a, b):
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def matrix(quaternion):
    return Rotation.from_quat(quaternion, scalar_first=True).as_matrix()


def turned(axis, angle):
    return Rotation.from_rotvec(np.multiply(axis, angle)).as_matrix()


def attached(body, node, position=(0.0, 0.0, 0.0), quaternion=(1.0, 0.0, 0.0, 0.0)):
    """Rotation and origin, in the body's frame, of a frame fixed to one of its nodes."""
    if body is None:
        return matrix(quaternion), np.array(position)
    at = node_frame(body, node)
    R = matrix(at.quaternion)
    return R @ matrix(quaternion), at.position + R @ position


@dataclass
class Part:
    """A body, wheel or point mass with its joint: inboard frame in the parent, outboard frame in itself."""

    name: str
    joint: str
    sort: str  # body, wheel or point
    kind: str
    parent: int
    inboard: tuple
    outboard: tuple
    mass: float
    com: np.ndarray
    inertia: np.ndarray
    axis: np.ndarray
    start: tuple  # coordinates, speeds
    scalar: object = None  # the coordinate of a turn or slide
    q: object = None  # the slices of its coordinates and speeds
    v: object = None


@dataclass
class Motion:
    """A part in World axes: its frame, and the point O of its outboard joint frame."""

    R: np.ndarray
    p: np.ndarray
    w: np.ndarray
    v: np.ndarray
    alpha: np.ndarray
    a: np.ndarray  # less gravity
    O: np.ndarray
    axes: np.ndarray  # of the joint: those along which its speeds are counted


class SmallEngine:
    name = "small"
    summary = "tests: trees of rigid bodies in a few lines"

    def version(self):
        return "1"

    def supports(self, scene: Scene) -> Support:
        for body in scene.bodies:
            if not isinstance(body, RigidBody):
                return Support("no", f"{body.name} is flexible")
        for hinge in scene.hinges:
            if type(hinge) not in KINDS:
                return Support("no", f"{hinge.name}: no such hinge here")
        if scene.closures or any(point.directions for point in scene.point_masses):
            return Support("no", "no closures, no moving point masses")
        return Support("exact")

    def efforts(self, scene: Scene):
        return EFFORTS

    def compile(self, scene: Scene):
        return SmallModel(scene)


class SmallModel:
    def __init__(self, scene: Scene):
        self.scene = scene
        self.gravity = np.array(scene.gravity_m_s2)
        self.bodies = {body.name: body for body in scene.bodies}
        self.parts = []
        self.index = {"ground": -1}
        for body, hinge in ordered(scene):
            self.index[body.name] = len(self.parts)
            self.parts.append(self.part_of(body, hinge))
        for wheel in scene.wheels:
            self.parts.append(self.wheel_part(wheel))
        for point in scene.point_masses:
            inboard = attached(self.bodies[point.body], point.node, point.offset_m)
            self.parts.append(
                Part(point.name, point.name, "point", "weld", self.index[point.body], inboard, attached(None, ""),
                     point.mass_kg, np.zeros(3), np.zeros((3, 3)), np.zeros(3), ((), ()))
            )  # fmt: skip
        nq = nv = 0
        for part in self.parts:
            size_q, size_v = SIZES[part.kind]
            part.q, part.v = slice(nq, nq + size_q), slice(nv, nv + size_v)
            nq, nv = nq + size_q, nv + size_v
        self.nq, self.nv = nq, nv
        self.driven = [part for part in self.parts if part.scalar is not None and part.scalar.prescribed is not None]
        self.rows = [part.v.start for part in self.driven]
        self.free = [n for n in range(nv) if n not in self.rows]
        self.pushes = []
        for load in scene.loads:
            size = profile(load.function)
            self.pushes.append((load, size, *attached(self.bodies[load.body], load.node)))
        self.markers = {}
        for marker in scene.markers:
            index, (R, p) = self.index[marker.body], attached(self.bodies[marker.body], marker.node, marker.offset_m)
            self.markers[marker.name] = lambda seen, index=index, R=R, p=p: self.observed(seen[index], R, p)

    def part_of(self, body, hinge):
        parent = self.bodies.get(hinge.parent)
        inboard = attached(parent, hinge.parent_node, hinge.parent_position_m, hinge.parent_quaternion)
        outboard = attached(body, hinge.child_node, hinge.child_position_m, hinge.child_quaternion)
        kind, axis, scalar, start = KINDS[type(hinge)], np.zeros(3), None, ((), ())
        if kind in ("turn", "slide"):
            scalar = hinge.rotation if kind == "turn" else hinge.translation
            axis, start = np.array(hinge.axis), ((scalar.value,), (scalar.rate,))
        elif kind == "ball":
            start = hinge.quaternion, hinge.angular_velocity_rad_s
        elif kind == "free":
            start = (*hinge.position_m, *hinge.quaternion), (*hinge.angular_velocity_rad_s, *hinge.velocity_m_s)
        return Part(
            body.name, hinge.name, "body", kind, self.index[hinge.parent], inboard, outboard,
            body.mass_kg, np.array(body.com_m), np.array(body.inertia_kg_m2), axis, start, scalar,
        )  # fmt: skip

    def wheel_part(self, wheel):
        axis = np.array(wheel.axis)
        across = np.eye(3) - np.outer(axis, axis)
        inertia = wheel.axial_inertia_kg_m2 * np.outer(axis, axis) + wheel.transverse_inertia_kg_m2 * across
        spin = wheel.freedoms[0].coordinate
        inboard = attached(self.bodies[wheel.body], wheel.node, wheel.offset_m)
        return Part(
            wheel.name, wheel.name, "wheel", "turn", self.index[wheel.body], inboard, attached(None, ""),
            wheel.mass_kg, np.zeros(3), inertia, axis, ((spin.value,), (spin.rate,)), spin,
        )  # fmt: skip

    def warm_up(self):
        pass

    # Motion

    def motions(self, q, v, a):
        """All parts from the ground outward, for coordinates, speeds and their rates."""
        none = np.zeros(3)
        ground = Motion(np.eye(3), none, none, none, none, -self.gravity, none, np.eye(3))
        seen = []
        for part in self.parts:
            before = ground if part.parent < 0 else seen[part.parent]
            seen.append(self.moved(part, before, q[part.q], v[part.v], a[part.v]))
        return seen

    def moved(self, part, before, q, v, a):
        R_in, p_in = part.inboard
        inner = before.R @ R_in
        shift, turn, axes = np.zeros(3), np.eye(3), inner
        w_rel = v_rel = alpha_rel = a_rel = np.zeros(3)
        if part.kind == "turn":
            turn = turned(part.axis, q[0])
            w_rel, alpha_rel = inner @ part.axis * v[0], inner @ part.axis * a[0]
        elif part.kind == "slide":
            shift = part.axis * q[0]
            v_rel, a_rel = inner @ part.axis * v[0], inner @ part.axis * a[0]
        elif part.kind == "ball":
            turn = matrix(q)
            axes = inner @ turn
            w_rel, alpha_rel = axes @ v, axes @ a
        elif part.kind == "free":
            shift, turn = q[:3], matrix(q[3:])
            axes = inner @ turn
            w_rel, v_rel = axes @ v[:3], axes @ v[3:]
            alpha_rel, a_rel = axes @ a[:3], axes @ a[3:] + cross(w_rel, v_rel)
        arm = before.R @ p_in + inner @ shift
        w = before.w + w_rel
        alpha = before.alpha + alpha_rel + cross(before.w, w_rel)
        v_O = before.v + cross(before.w, arm) + v_rel
        a_O = before.a + cross(before.alpha, arm) + cross(before.w, cross(before.w, arm))
        a_O = a_O + 2.0 * cross(before.w, v_rel) + a_rel
        R_out, p_out = part.outboard
        R = inner @ turn @ R_out.T
        O, back = before.p + arm, -R @ p_out
        return Motion(
            R, O + back, w, v_O + cross(w, back), alpha, a_O + cross(alpha, back) + cross(w, cross(w, back)), O, axes
        )

    def observed(self, at, R, p):
        """A marker at a frame of a part."""
        arm = at.R @ p
        spun = Rotation.from_matrix(at.R @ R).as_quat(scalar_first=True)
        velocity = np.concatenate([at.w, at.v + cross(at.w, arm)])
        linear = at.a + self.gravity + cross(at.alpha, arm) + cross(at.w, cross(at.w, arm))
        return MarkerSnapshot(at.p + arm, spun, velocity, np.concatenate([at.alpha, linear]))

    # Forces

    def joint_loads(self, t, seen):
        """[torque; force] that every part needs from inboard, about its O, in World axes."""
        needed = [None] * len(self.parts)
        for k, (part, at) in enumerate(zip(self.parts, seen, strict=True)):
            arm = at.R @ part.com
            inertia = at.R @ part.inertia @ at.R.T
            force = part.mass * (at.a + cross(at.alpha, arm) + cross(at.w, cross(at.w, arm)))
            torque = inertia @ at.alpha + cross(at.w, inertia @ at.w)
            needed[k] = [torque + cross(at.p + arm - at.O, force), force]
        for load, size, R, p in self.pushes:
            k = self.index[load.body]
            at = seen[k]
            direction = np.array(load.direction)
            push = size(t).value * (direction if load.frame == "world" else at.R @ R @ direction)
            if load.type == "force":
                needed[k][0] = needed[k][0] - cross(at.p + at.R @ p - at.O, push)
                needed[k][1] = needed[k][1] - push
            else:
                needed[k][0] = needed[k][0] - push
        for k in reversed(range(len(self.parts))):
            parent = self.parts[k].parent
            if parent >= 0:
                torque, force = needed[k]
                needed[parent][0] = needed[parent][0] + torque + cross(seen[k].O - seen[parent].O, force)
                needed[parent][1] = needed[parent][1] + force
        return needed

    def along(self, needed, seen):
        """Generalised forces: the joint loads along the joints' speeds."""
        found = np.zeros(self.nv)
        for part, at, (torque, force) in zip(self.parts, seen, needed, strict=True):
            if part.kind == "turn":
                found[part.v] = at.axes @ part.axis @ torque
            elif part.kind == "slide":
                found[part.v] = at.axes @ part.axis @ force
            elif part.kind == "ball":
                found[part.v] = at.axes.T @ torque
            elif part.kind == "free":
                found[part.v] = np.concatenate([at.axes.T @ torque, at.axes.T @ force])
        return found

    def own(self, t, q, v):
        """Springs, and what dampers and motors do, along the speeds."""
        springs, others = np.zeros(self.nv), np.zeros(self.nv)
        for part in self.parts:
            if part.scalar is not None:
                stiffness, damping, rest = part.scalar.spring
                springs[part.v] = -stiffness * (q[part.q] - rest)
                motor = profile(part.scalar.effort)(t).value if part.scalar.effort else 0.0
                others[part.v] = motor - damping * v[part.v]
        return springs, others

    def solved(self, t, q, v):
        """Accelerations, drive loads, motions, joint loads, and the power of motors, dampers, drives and loads."""
        still = np.zeros(self.nv)
        seen = self.motions(q, v, still)
        bias = self.along(self.joint_loads(t, seen), seen)
        columns = []
        for n in range(self.nv):
            unit = np.zeros(self.nv)
            unit[n] = 1.0
            there = self.motions(q, v, unit)
            columns.append(self.along(self.joint_loads(t, there), there) - bias)
        M = np.array(columns).T.reshape(self.nv, self.nv)
        springs, others = self.own(t, q, v)
        effort = springs + others
        a, free, rows = np.zeros(self.nv), self.free, self.rows
        for part in self.driven:
            a[part.v] = profile(part.scalar.prescribed)(t).acceleration
        a[free] = np.linalg.solve(M[np.ix_(free, free)], effort[free] - bias[free] - M[np.ix_(free, rows)] @ a[rows])
        seen = self.motions(q, v, a)
        needed = self.joint_loads(t, seen)
        drive = self.along(needed, seen)[rows] - effort[rows]
        power = others @ v + drive @ v[rows]
        for load, size, R, p in self.pushes:
            at = seen[self.index[load.body]]
            direction = np.array(load.direction)
            push = size(t).value * (direction if load.frame == "world" else at.R @ R @ direction)
            power += push @ (at.v + cross(at.w, at.R @ p) if load.type == "force" else at.w)
        return a, drive, seen, needed, power

    # Runs

    def initial(self):
        q = np.array([value for part in self.parts for value in part.start[0]])
        v = np.array([value for part in self.parts for value in part.start[1]])
        return np.concatenate([q, v, [0.0]])

    def parted(self, t, y):
        q, v = y[: self.nq].copy(), y[self.nq : -1].copy()
        for part in self.driven:
            q[part.q], v[part.v], _ = profile(part.scalar.prescribed)(t)
        return q, v

    def rate(self, t, y):
        q, v = self.parted(t, y)
        a, _, _, _, power = self.solved(t, q, v)
        rates = np.zeros(self.nq)
        for part in self.parts:
            own, speeds = q[part.q], v[part.v]
            if part.kind in ("turn", "slide"):
                rates[part.q] = speeds
            elif part.kind == "ball":
                rates[part.q] = self.quaternion_rate(own, speeds)
            elif part.kind == "free":
                linear = matrix(own[3:]) @ speeds[3:]
                rates[part.q] = np.concatenate([linear, self.quaternion_rate(own[3:], speeds[:3])])
        return np.concatenate([rates, a, [power]])

    def quaternion_rate(self, quaternion, w):
        """1/2 q o (0, w) for w in outboard axes."""
        scalar, vector = quaternion[0], quaternion[1:]
        return 0.5 * np.array([-vector @ w, *(scalar * w + cross(vector, w))])

    def evaluate(self) -> Snapshot:
        return self.seen_at(0.0, self.initial())

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        before = perf_counter()
        done = solve_ivp(
            self.rate, (0.0, run.times[-1]), self.initial(), effort.method, run.times,
            rtol=effort.value, atol=effort.value * 1e-2,
        )  # fmt: skip
        wall = perf_counter() - before
        seen = [self.seen_at(t, y) for t, y in zip(done.t, done.y.T, strict=True)]
        work = done.y[-1]
        return stack(run.times, seen, message=done.message, wall_s=wall, evaluations=done.nfev, work=work)

    def seen_at(self, t, y) -> Snapshot:
        q, v = self.parted(t, y)
        _, drive, seen, needed, _ = self.solved(t, q, v)
        kinetic = gravity = spring = 0.0
        momentum = np.zeros(6)
        for part, at in zip(self.parts, seen, strict=True):
            arm = at.R @ part.com
            centre, velocity = at.p + arm, at.v + cross(at.w, arm)
            spin = at.R @ part.inertia @ at.R.T @ at.w
            kinetic += 0.5 * part.mass * velocity @ velocity + 0.5 * at.w @ spin
            gravity -= part.mass * self.gravity @ centre
            momentum += np.concatenate([spin + part.mass * cross(centre, velocity), part.mass * velocity])
            if part.scalar is not None:
                stiffness, _, rest = part.scalar.spring
                spring += 0.5 * stiffness * float(q[part.q][0] - rest) ** 2
        loads = {(part.sort, part.joint): np.concatenate(each) for part, each in zip(self.parts, needed, strict=True)}
        return Snapshot(
            markers={name: marker(seen) for name, marker in self.markers.items()},
            loads={name: load for (sort, name), load in loads.items() if sort == "body"},
            wheel_loads={name: load for (sort, name), load in loads.items() if sort == "wheel"},
            drives={part.joint: np.array([each]) for part, each in zip(self.driven, drive, strict=True)},
            energy={"kinetic": float(kinetic), "gravity": float(gravity), "spring": float(spring)},
            momentum=momentum,
        )
