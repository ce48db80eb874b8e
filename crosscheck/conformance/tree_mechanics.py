"""Mechanics of the small trees of the clauses: what an engine must answer, by Kane's equations in World axes.

Every body is a frame with the Jacobians of its velocities; the mass matrix and the forces are sums over bodies, loads
across hinges sums over all that is outboard. It is dense and slow, and shares no code with any engine.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, assert_never

import numpy as np
from scipy.integrate import solve_ivp

from crosscheck.conformance.moving_frames import PlacedFrame, carried, cross, freed, ground
from crosscheck.engines.conventions import frame, rotation_matrix
from crosscheck.engines.functions_of_time import Profile, profile
from flexmb.scene.freedoms import Ball, Floating, Freedom, ScalarFreedom
from flexmb.scene.schema import BeamBody, Body, ModalBody, RigidBody, Scene, SidBody
from flexmb.scene.tree import GROUND, node_frame
from flexmb.typing import Real


class RigidPart(NamedTuple):
    """A rigid part at its mass centre: mass (kg), inertia (3,3) about it in its own axes; `body` carries it."""

    body: str
    item: str
    mass: float
    inertia: Real
    at: PlacedFrame


class Push(NamedTuple):
    """A load on a body: `force` (N) and `torque` (N m) in World axes, at a frame."""

    body: str
    force: Real
    torque: Real
    at: PlacedFrame


class Motion(NamedTuple):
    """Position (3,), rotation (3,3), velocity (6,) and acceleration (6,) of a marker."""

    position: Real
    rotation: Real
    velocity: Real
    acceleration: Real


class Answer(NamedTuple):
    """What the contract asks of one instant, as in `crosscheck.engines.contract.Snapshot`."""

    markers: dict[str, Motion]
    loads: dict[str, Real]
    wheel_loads: dict[str, Real]
    drives: dict[str, Real]
    energy: dict[str, float]
    momentum: Real


class _Column(NamedTuple):
    """A scalar speed: its coordinate's spring (stiffness, damping, rest), motor and prescribed motion."""

    item: str
    spring: tuple[float, float, float]
    effort: Callable[[float], Profile] | None
    prescribed: Callable[[float], Profile] | None


class TreeMechanics:
    """A tree of rigid and raw modal bodies (level "full") with wheels, fixed point masses and loads at nodes.

    Modes turn all nodes about one axis only, so that their rotations may be added; springs of ball joints, connectors
    and closures are none of it.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._bodies = {body.name: body for body in scene.bodies}
        self._inboard = {hinge.child: hinge for hinge in scene.hinges}
        self._states = {state.body: state for state in scene.modal_states}
        self._places: dict[str, slice] = {}
        self._columns: dict[int, _Column] = {}
        self._size = 0
        start: list[tuple[float, float]] = []
        for item in (*scene.hinges, *scene.wheels):
            begin = self._size
            for freedom in item.freedoms:
                start += self._add(item.name, freedom)
            self._places[item.name] = slice(begin, self._size)
        self._stiffness: dict[str, tuple[Real, Real]] = {}
        for body in scene.bodies:
            if isinstance(body, ModalBody):
                start += self._add_modes(body)
        self._start = np.array(start).reshape(-1, 2).T
        self._free = [n for n in range(self._size) if n not in self._columns or not self._columns[n].prescribed]
        self._driven = [n for n in range(self._size) if n not in self._free]

    def initial(self) -> Answer:
        """The answer at t = 0 in the scene's initial state."""
        return self._answer(0.0, *self._start)

    def at(self, times: Real) -> list[Answer]:
        """The answers at sample times of a run, by DOP853 at a tolerance beyond that of engines.

        All coordinates must be scalar.
        """
        n = self._size
        run = solve_ivp(
            lambda t, y: np.concatenate([y[n:], self._solve(t, y[:n], y[n:])[1]]), (times[0], times[-1]),
            np.concatenate(self._prescribed(0.0, *self._start)), "DOP853", times, rtol=1e-11, atol=1e-11,
        )  # fmt: skip
        return [self._answer(t, y[:n], y[n:]) for t, y in zip(times, run.y.T, strict=True)]

    def accelerations(self, q: Real, u: Real) -> Real:
        """Those of the free coordinates where the initial q and u are changed by these, at t = 0.

        Coordinates of ball joints and of free flight stay.
        """
        return np.asarray(self._solve(0.0, self._start[0] + q, self._start[1] + u)[1][self._free])

    def mass_matrix(self) -> Real:
        """Of the free coordinates in the initial state."""
        now = _Instant(self, 0.0, *self._prescribed(0.0, *self._start))
        return np.asarray(_mass_matrix(now.parts, self._size)[np.ix_(self._free, self._free)])

    @property
    def free(self) -> list[int]:
        """The numbers of the free coordinates among all."""
        return self._free

    @property
    def size(self) -> int:
        """The number of all coordinates."""
        return self._size

    def _add(self, item: str, freedom: Freedom) -> list[tuple[float, float]]:
        """Number the speeds of a freedom; its initial coordinates and speeds."""
        match freedom:
            case ScalarFreedom(coordinate=c):
                motor, moved = (profile(each) if each is not None else None for each in (c.effort, c.prescribed))
                self._columns[self._size] = _Column(item, c.spring, motor, moved)
                found = [(c.value, c.rate)]
            case Ball():
                found = [(0.0, rate) for rate in freedom.angular_velocity]
            case Floating():
                found = [(0.0, rate) for rate in (*freedom.angular_velocity, *freedom.velocity)]
            case _:
                assert_never(freedom)
        self._size += len(found)
        return found

    def _add_modes(self, body: ModalBody) -> list[tuple[float, float]]:
        count = len(body.stiffness)
        self._places[body.name] = slice(self._size, self._size + count)
        self._size += count
        state = self._states[body.name]
        zero = np.zeros((count, count))
        damping = np.array(body.damping) if body.damping else zero
        self._stiffness[body.name] = np.array(body.stiffness), damping
        return list(zip(state.coordinates, state.rates or (0.0,) * count, strict=True))

    def _prescribed(self, t: float, q: Real, u: Real) -> tuple[Real, Real]:
        q, u = q.copy(), u.copy()
        for n, column in self._columns.items():
            if column.prescribed is not None:
                q[n], u[n], _ = column.prescribed(t)
        return q, u

    def _solve(self, t: float, q: Real, u: Real) -> tuple[_Instant, Real, Real]:
        """The instant, the accelerations of all coordinates, and the loads that prescribed ones need beyond others."""
        q, u = self._prescribed(t, q, u)
        now = _Instant(self, t, q, u)
        M, f = _mass_matrix(now.parts, self._size), self._own_forces(t, q, u)
        for lump in now.parts:
            w, J = lump.at.w, lump.at.R @ lump.inertia @ lump.at.R.T
            f += lump.at.Jv.T @ (lump.mass * (self._gravity - lump.at.a))
            f -= lump.at.Jw.T @ (J @ lump.at.alpha + cross(w, J @ w))
        for push in now.pushes:
            f += push.at.Jv.T @ push.force + push.at.Jw.T @ push.torque
        udot, free, driven = np.zeros(self._size), self._free, self._driven
        for n in driven:
            moved = self._columns[n].prescribed
            assert moved is not None
            udot[n] = moved(t).acceleration
        udot[free] = np.linalg.solve(M[np.ix_(free, free)], f[free] - M[np.ix_(free, driven)] @ udot[driven])
        return now, udot, M[driven] @ udot - f[driven]

    def _own_forces(self, t: float, q: Real, u: Real) -> Real:
        """Springs, dampers and motors along the coordinates."""
        f = np.zeros(self._size)
        for n, (_, (stiffness, damping, rest), effort, _) in self._columns.items():
            f[n] = (effort(t).value if effort else 0.0) - stiffness * (q[n] - rest) - damping * u[n]
        for body, (K, D) in self._stiffness.items():
            place = self._places[body]
            f[place] = -K @ q[place] - D @ u[place]
        return f

    @property
    def _gravity(self) -> Real:
        return np.array(self._scene.gravity_m_s2)

    def _answer(self, t: float, q: Real, u: Real) -> Answer:
        now, udot, drive = self._solve(t, q, u)
        drives: dict[str, Real] = {}
        for n, load in zip(self._driven, drive, strict=True):
            item = self._columns[n].item
            drives[item] = np.append(drives.get(item, np.zeros(0)), load)
        kinetic, momentum, gravity = 0.0, np.zeros(6), 0.0
        for lump in now.parts:
            w, spin = lump.at.w, lump.at.R @ lump.inertia @ lump.at.R.T @ lump.at.w
            p = lump.mass * lump.at.v
            kinetic += 0.5 * float(w @ spin + p @ lump.at.v)
            momentum += np.concatenate([spin + cross(lump.at.p, p), p])
            gravity -= lump.mass * float(self._gravity @ lump.at.p)
        springs = [0.5 * each.spring[0] * (now.q[n] - each.spring[2]) ** 2 for n, each in self._columns.items()]
        strain = [0.5 * now.q[self._places[body]] @ K @ now.q[self._places[body]] for body, (K, _) in
                  self._stiffness.items()]  # fmt: skip
        energy = {"kinetic": kinetic, "gravity": gravity, "spring": float(sum(springs)), "strain": float(sum(strain))}
        markers = {each.name: now.node(each.body, each.node, each.offset_m) for each in self._scene.markers}
        return Answer(
            {name: Motion(at.p, at.R, np.concatenate([at.w, at.v]), _acceleration(at, udot))
             for name, at in markers.items()},
            {hinge.name: self._load(now, udot, self._outboard(hinge.child), now.outer[hinge.name].p)
             for hinge in self._scene.hinges},
            {wheel.name: self._wheel_load(now, udot, wheel.name) for wheel in self._scene.wheels},
            drives, energy, momentum,
        )  # fmt: skip

    def _outboard(self, body: str) -> set[str]:
        """A body and all that hangs on it."""
        children = [hinge.child for hinge in self._scene.hinges if hinge.parent == body]
        return {body}.union(*(self._outboard(child) for child in children))

    def _wheel_load(self, now: _Instant, udot: Real, wheel: str) -> Real:
        (lump,) = (each for each in now.parts if each.item == wheel)
        return self._inertial(lump, udot, lump.at.p)

    def _load(self, now: _Instant, udot: Real, bodies: set[str], point: Real) -> Real:
        """[torque; force] about a point that bodies need from inboard: Newton and Euler, less what else acts on
        them."""
        total = sum((self._inertial(each, udot, point) for each in now.parts if each.body in bodies), np.zeros(6))
        for push in now.pushes:
            if push.body in bodies:
                total -= np.concatenate([push.torque + cross(push.at.p - point, push.force), push.force])
        return np.asarray(total)

    def _inertial(self, lump: RigidPart, udot: Real, point: Real) -> Real:
        acceleration = _acceleration(lump.at, udot)
        J, w = lump.at.R @ lump.inertia @ lump.at.R.T, lump.at.w
        force = lump.mass * (acceleration[3:] - self._gravity)
        torque = J @ acceleration[:3] + cross(w, J @ w) + cross(lump.at.p - point, force)
        return np.concatenate([torque, force])


class _Instant:
    """All frames, lumps and loads of a tree at one state."""

    def __init__(self, tree: TreeMechanics, t: float, q: Real, u: Real) -> None:
        self._tree, self.q, self.u = tree, q, u
        self._frames: dict[str, PlacedFrame] = {GROUND: ground(len(q))}
        self.outer: dict[str, PlacedFrame] = {}  # outboard frames of hinges
        scene = tree._scene
        self.parts = [lump for body in scene.bodies for lump in self._parts(body)]
        for wheel in scene.wheels:
            at = self._moved(self.node(wheel.body, wheel.node, wheel.offset_m), wheel.name, wheel.freedoms)
            axis = np.array(wheel.axis)
            across = wheel.transverse_inertia_kg_m2 * (np.eye(3) - np.outer(axis, axis))
            inertia = across + wheel.axial_inertia_kg_m2 * np.outer(axis, axis)
            self.parts.append(RigidPart(wheel.body, wheel.name, wheel.mass_kg, inertia, at))
        for point in scene.point_masses:
            at = self.node(point.body, point.node, point.offset_m)
            self.parts.append(RigidPart(point.body, point.name, point.mass_kg, np.zeros((3, 3)), at))
        self.pushes = []
        for load in scene.loads:
            at = self.node(load.body, load.node)
            direction = np.array(load.direction)
            size = profile(load.function)(t).value * (direction if load.frame == "world" else at.R @ direction)
            none = np.zeros(3)
            force, torque = (size, none) if load.type == "force" else (none, size)
            self.pushes.append(Push(load.body, force, torque, at))

    def node(self, body: str, node: str, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> PlacedFrame:
        """A frame at a node, plus an offset in its axes."""
        if body == GROUND:
            return carried(self._frames[GROUND], np.array(offset))
        owner, base = self._tree._bodies[body], self._frame(body)
        at = node_frame(owner, node)
        if isinstance(owner, ModalBody) and node != "origin":
            (modal,) = (each for each in owner.nodes if each.name == node)
            base = self._deformed(carried(base, np.array(at.position)), body, modal.translation_modes,
                                  modal.rotation_modes)  # fmt: skip
            return carried(carried(base, np.zeros(3), rotation_matrix(at.quaternion)), np.array(offset))
        return carried(carried(base, np.array(at.position), rotation_matrix(at.quaternion)), np.array(offset))

    def _frame(self, body: str) -> PlacedFrame:
        """The frame of a body, from that of its parent through the hinge between them."""
        if body not in self._frames:
            hinge = self._tree._inboard[body]
            owner = self._tree._bodies[body]
            own = frame(hinge.parent_position_m, hinge.parent_quaternion)
            inner = carried(self.node(hinge.parent, hinge.parent_node), own.position, own.rotation)
            outer = self._moved(inner, hinge.name, hinge.freedoms)
            self.outer[hinge.name] = outer
            child = frame(*node_frame(owner, hinge.child_node)) @ frame(hinge.child_position_m, hinge.child_quaternion)
            back = child.inverse()
            self._frames[body] = carried(outer, back.position, back.rotation)
        return self._frames[body]

    def _moved(self, at: PlacedFrame, item: str, freedoms: tuple[Freedom, ...]) -> PlacedFrame:
        place = self._tree._places[item].start
        for freedom in freedoms:
            at = freed(at, freedom, place, self.q, self.u)
            place += freedom.sizes[1]
        return at

    def _deformed(self, at: PlacedFrame, body: str, shifts: object, turns: object) -> PlacedFrame:
        """A node of a flexible body: shifted along the shapes of its modes, then turned about theirs."""
        first = self._tree._places[body].start
        size = self._tree._places[body].stop - first
        for kind, shapes in (("slide", np.array(shifts)), ("turn", np.array(turns))):
            for n, shape in enumerate(shapes.reshape(-1, 3)[:size]):
                at = at.moved(kind == "turn", shape, first + n, float(self.q[first + n]), float(self.u[first + n]))
        return at

    def _parts(self, body: Body) -> list[RigidPart]:
        match body:
            case RigidBody():
                at = carried(self._frame(body.name), np.array(body.com_m))
                return [RigidPart(body.name, body.name, body.mass_kg, np.array(body.inertia_kg_m2), at)]
            case ModalBody():
                base, found = self._frame(body.name), []
                for point in body.points:
                    at = self._deformed(carried(base, np.array(point.position_m)), body.name,
                                        point.translation_modes, point.rotation_modes)  # fmt: skip
                    found.append(RigidPart(body.name, body.name, point.mass_kg, np.array(point.inertia_kg_m2), at))
                return found
            case BeamBody() | SidBody():
                raise NotImplementedError(f"{body.name}: clauses on trees have rigid and raw modal bodies")
            case _:
                assert_never(body)


def _acceleration(at: PlacedFrame, udot: Real) -> Real:
    return np.concatenate([at.alpha + at.Jw @ udot, at.a + at.Jv @ udot])


def _mass_matrix(parts: list[RigidPart], size: int) -> Real:
    M = np.zeros((size, size))
    for lump in parts:
        J = lump.at.R @ lump.inertia @ lump.at.R.T
        M += lump.mass * lump.at.Jv.T @ lump.at.Jv + lump.at.Jw.T @ J @ lump.at.Jw
    return M
