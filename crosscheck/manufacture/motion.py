"""Smooth motions of all coordinates of a scene: each is its initial value and two sines that begin at zero.

Attitudes turn about x, then y, then z of the carried axes, from the initial one. In closed chains so many coordinates
follow sines as the rows leave free; the others close the loops by Newton's method, from one time to the next.
"""

from __future__ import annotations

from typing import NamedTuple, assert_never

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from crosscheck.library.case_error import CaseError
from flexmb.dense import DenseSystem
from flexmb.dense.body_frames import Motions
from flexmb.dense.closures import DEPENDENT, rows
from flexmb.dense.hinge_frames import coordinate_rates, rotation_of
from flexmb.dense.jets import profile
from flexmb.dense.members import Member
from flexmb.scene import schema as s
from flexmb.scene.freedoms import Ball, Floating, ScalarFreedom
from flexmb.scene.schema import Scene
from flexmb.typing import Real

SLOW, FAST = 0.3, 0.9
"""Turns of the two sines in the duration of the run: loads have some five times the frequency."""
DEFLECTION = 0.02
"""Largest displacement (over the body's size) and turn (rad) at its nodes by the softest mode of a body."""
LARGEST = 1.5
"""Turn (rad) of a sprung ball joint from where its spring is at rest, at which a motion begins at most."""
CLOSED = 1e-13
"""Gaps of loops, m and cosines, at which Newton's method ends."""
NEWTON = 30


class DrawnState(NamedTuple):
    """q (nq,), u (nu,) and the rates of u (nu,), in the order of `flexmb.dense.members`."""

    q: Real
    u: Real
    rates: Real


class Waves(NamedTuple):
    """n signals: start (n,), and sines of size, angular frequency and phase (n,2)."""

    start: Real
    size: Real
    frequency: Real
    phase: Real

    def at(self, t: float) -> Real:
        """(3,n) values, rates, accelerations."""
        angle, w = self.frequency * t + self.phase, self.frequency
        value = self.start + np.sum(self.size * (np.sin(angle) - np.sin(self.phase)), axis=1)
        rate, second = self.size * w * np.cos(angle), -self.size * w**2 * np.sin(angle)
        return np.array([value, np.sum(rate, axis=1), np.sum(second, axis=1)])


class DrawnMotion:
    """q(t), u(t) and the rates of u of a scene, whose initial values they begin with; t in s."""

    def __init__(self, scene: Scene, dense: DenseSystem, waves: Waves) -> None:
        self._scene, self._dense, self._waves = scene, dense, waves
        self._known: dict[float, DrawnState] = {}
        self.dependent = self._dependent()

    @property
    def independent(self) -> NDArray[np.bool_]:
        """(nu,) which speeds follow sines, or functions that the scene prescribes."""
        return ~self.dependent

    def at(self, t: float) -> DrawnState:
        """The state at one time; CaseError where loops cannot be closed."""
        if t not in self._known:
            state = self._open(t)
            self._known[t] = self._closed(t, state) if np.any(self.dependent) else state
        return self._known[t]

    def _open(self, t: float) -> DrawnState:
        """The state with all coordinates on their sines, as if there were no closures."""
        tree, x = self._dense.tree, self._waves.at(t)
        q, u, rates = np.zeros(tree.nq), np.zeros(tree.nu), np.zeros(tree.nu)
        for scalar in tree.scalars:
            if scalar.prescribed is not None:
                f = profile(scalar.prescribed, t)
                x[:, scalar.u] = f.value, f.rate, f.acceleration
        for member in tree.members:
            _place(member, x, q, u, rates)
        for rotor in tree.rotors:
            q[rotor.q], u[rotor.u], rates[rotor.u] = x[:, rotor.u]
        return DrawnState(q, u, rates)

    def _dependent(self) -> NDArray[np.bool_]:
        """(nu,) speeds that close loops, so many as there are independent rows, with whole attitudes among them."""
        found = np.zeros(self._dense.nu, dtype=bool)
        if not self._scene.constraints:
            return found
        start = self._assembled()
        J = self._rows(start.q, np.eye(self._dense.nu), np.zeros((self._dense.nu,) * 2))[1].T
        J = J / np.maximum(np.linalg.norm(J, axis=1, keepdims=True), DEPENDENT)
        free = np.array([x.u for x in self._dense.tree.scalars if x.prescribed is not None], dtype=int)
        weights = np.ones(self._dense.nu)
        groups = [g for member in self._dense.tree.members for g in _attitudes(member)]
        for group in groups:
            weights[group] = 1e3  # they come first: a whole attitude depends, or none of it
        for member in self._dense.tree.members:
            weights[member.u_modes] = 1e-3
        weights[free] = 0.0
        _, R, order = qr(J * weights, mode="economic", pivoting=True)
        rank = int(np.count_nonzero(np.linalg.svd(J, compute_uv=False) > DEPENDENT))
        found[order[:rank]] = True
        chosen = np.linalg.svd(J[:, found], compute_uv=False)
        if rank and not chosen[rank - 1] > 1e-6 * chosen[0]:
            raise CaseError("prescribed coordinates leave too few others to close the loops: prescribe fewer")
        for group in groups:
            if 0 < np.count_nonzero(found[group]) < len(found[group]):
                raise CaseError(
                    "a ball joint or a free body in a loop depends on other coordinates in part: use a gimbal, or "
                    "close the loop at another joint"
                )
        return found

    def _rows(self, q: Real, u: Real, rates: Real) -> Real:
        """(3,B,G) of all constraints."""
        motion = Motions(q, u, rates)
        return np.concatenate([rows(self._dense, constraint, motion) for constraint in self._scene.constraints], axis=2)

    def _assembled(self) -> DrawnState:
        """The open state at t = 0 with the loops closed by the least change of all coordinates."""
        state, nu = self._open(0.0), self._dense.nu
        free = np.ones(nu, dtype=bool)
        free[[x.u for x in self._dense.tree.scalars if x.prescribed is not None]] = False
        q = self._newton(0.0, state.q, free)
        for scalar in self._dense.tree.scalars:
            self._waves.start[scalar.u] = q[scalar.q]
        self._starts = q
        return DrawnState(q, state.u, state.rates)

    def _newton(self, t: float, q: Real, moved: NDArray[np.bool_]) -> Real:
        nu = self._dense.nu
        for _ in range(NEWTON):
            value, J = self._rows(q, np.eye(nu), np.zeros((nu, nu)))[:2]
            if np.max(np.abs(value[0])) <= CLOSED:
                return q
            step = np.zeros(nu)
            step[moved] = np.linalg.lstsq(J.T[:, moved], -value[0], rcond=1e-10)[0]
            q = q + tangent(self._dense, q, step)
        raise CaseError(f"the loops cannot be closed at t = {t:.3g} s: take a smaller --amplitude, or another --seed")

    def _closed(self, t: float, state: DrawnState) -> DrawnState:
        """The state with the dependent coordinates where they close the loops, near those of the nearest known time."""
        near = min(self._known, key=lambda known: abs(known - t), default=None)
        q, D, nu = state.q.copy(), self.dependent, self._dense.nu
        before = self._starts if near is None else self._known[near].q
        for place, speed in _places(self._dense):
            if D[speed]:
                q[place] = before[place]
        q = self._newton(t, q, D)
        J = self._rows(q, np.eye(nu), np.zeros((nu, nu)))[1].T
        u, rates = np.where(D, 0.0, state.u), np.where(D, 0.0, state.rates)
        u[D] = np.linalg.lstsq(J[:, D], -J @ u, rcond=1e-10)[0]
        rates[D] = np.linalg.lstsq(J[:, D], -self._rows(q, u[None], rates[None])[2, 0], rcond=1e-10)[0]
        return DrawnState(q, u, rates)


def draw(scene: Scene, dense: DenseSystem, seed: int, duration_s: float, amplitude: float) -> DrawnMotion:
    """A motion of random sines: angles of `amplitude` (rad), displacements of `amplitude` times the scene's size."""
    rng, tree, start = np.random.default_rng([seed, 46]), dense.tree, np.zeros(dense.nu)
    size = np.zeros(dense.nu)
    length = _extent(dense)
    for member in tree.members:
        at = member.u_hinge.start
        for freedom in member.hinge.freedoms:
            match freedom:
                case ScalarFreedom(coordinate=coordinate):
                    start[at], size[at] = coordinate.value, amplitude * (1.0 if coordinate.ANGULAR else length)
                    at += 1
                case Ball():
                    size[at : at + 3], at = amplitude, at + 3
                case Floating(position=position):
                    start[at + 3 : at + 6], size[at : at + 3] = position, amplitude
                    size[at + 3 : at + 6], at = amplitude * length, at + 6
                case _:
                    assert_never(freedom)
        size[member.u_modes] = amplitude / 0.3 * _deflections(member)
    for state in scene.modal_states:
        modes = tree.members[tree.index(state.body)].u_modes
        start[modes] = state.coordinates[: modes.stop - modes.start]
    for rotor in tree.rotors:
        start[rotor.u], size[rotor.u] = rotor.wheel.angle_rad, 10.0 * amplitude
    turns = rng.uniform(SLOW, FAST, (dense.nu, 2))
    share = rng.uniform(0.3, 0.7, (dense.nu, 2)) * rng.choice([-1.0, 1.0], (dense.nu, 2))
    phase = rng.uniform(0.0, 2.0 * np.pi, (dense.nu, 2))
    return DrawnMotion(scene, dense, Waves(start, size[:, None] * share, 2.0 * np.pi / duration_s * turns, phase))


def tangent(dense: DenseSystem, q: Real, u: Real) -> Real:
    """dq/dt (nq,) at speeds u (nu,)."""
    found = np.zeros(dense.nq)
    for member in dense.tree.members:
        found[member.q_hinge] = coordinate_rates(member.hinge, q[member.q_hinge], u[member.u_hinge])
        found[member.q_modes] = u[member.u_modes]
    for rotor in dense.tree.rotors:
        found[rotor.q] = u[rotor.u]
    return found


def _places(dense: DenseSystem) -> list[tuple[slice, int]]:
    """Coordinates with the first speed of which they are: scalars one by one, attitudes whole."""
    found = [(slice(x.q, x.q + 1), x.u) for x in dense.tree.scalars]
    for member in dense.tree.members:
        found += [(member.q_hinge, group.start) for group in _attitudes(member)]
        found += [(slice(q, q + 1), u) for q, u in zip(_range(member.q_modes), _range(member.u_modes), strict=True)]
    return found


def _range(of: slice) -> range:
    return range(of.start, of.stop)


def _attitudes(member: Member) -> list[slice]:
    """The speeds of the ball joint or of the free flight that a hinge is, if any."""
    return [member.u_hinge for freedom in member.hinge.freedoms if isinstance(freedom, Ball | Floating)]


def _place(member: Member, x: Real, q: Real, u: Real, rates: Real) -> None:
    """Write a member's coordinates, speeds and their rates from its signals x (3,nu)."""
    p, at = member.q_hinge.start, member.u_hinge.start
    for freedom in member.hinge.freedoms:
        match freedom:
            case ScalarFreedom():
                q[p], u[at], rates[at] = x[:, at]
                p, at = p + 1, at + 1
            case Ball(quaternion=first, stiffness=stiffness):
                first = _within_half_a_turn(first) if stiffness else first
                q[p : p + 4], u[at : at + 3], rates[at : at + 3] = _turned(first, x[:, at : at + 3])
                p, at = p + 4, at + 3
            case Floating(quaternion=first):
                turn, w, w_rate = _turned(first, x[:, at : at + 3])
                position, velocity, acceleration = x[:, at + 3 : at + 6]
                back = rotation_of(turn).T
                v = back @ velocity
                q[p : p + 3], q[p + 3 : p + 7] = position, turn
                u[at : at + 3], u[at + 3 : at + 6] = w, v
                rates[at : at + 3], rates[at + 3 : at + 6] = w_rate, back @ acceleration - np.cross(w, v)
                p, at = p + 7, at + 6
            case _:
                assert_never(freedom)
    q[member.q_modes], u[member.u_modes], rates[member.u_modes] = x[:, member.u_modes]


def _within_half_a_turn(attitude: s.Quaternion) -> s.Quaternion:
    """The attitude, or one of LARGEST rad about the same axis: the spring of a ball joint jumps at half a turn."""
    x = np.array(attitude) * (1.0 if attitude[0] >= 0.0 else -1.0)
    axis = x[1:] / max(float(np.linalg.norm(x[1:])), 1e-300)
    half = min(float(np.arctan2(np.linalg.norm(x[1:]), x[0])), 0.5 * LARGEST)
    w, (a, b, c) = np.cos(half), np.sin(half) * axis
    return float(w), float(a), float(b), float(c)


def _turned(first: s.Quaternion, angles: Real) -> tuple[Real, Real, Real]:
    """Quaternion (4,), angular velocity (3,) and its rate in turning axes, of turns (3,3: values, rates, accelerations)
    about the carried x, y and z after the attitude `first`."""
    value, rate, second = angles
    quaternion = np.array(first, dtype=float)
    turns = np.eye(3)
    for i in range(3):
        half = 0.5 * value[i]
        quaternion = _product(quaternion, np.concatenate([[np.cos(half)], np.sin(half) * turns[i]]))
    z, (b, c) = turns[2], value[1:]
    y = rotation_of([np.cos(0.5 * c), 0.0, 0.0, -np.sin(0.5 * c)]) @ turns[1]  # the axes, in those after all turns
    x = rotation_of([np.cos(0.5 * c), 0.0, 0.0, -np.sin(0.5 * c)]) @ (
        rotation_of([np.cos(0.5 * b), 0.0, -np.sin(0.5 * b), 0.0]) @ turns[0]
    )
    axes = np.array([x, y, z])
    moving = np.array([-np.cross(rate[2] * z + rate[1] * y, x), -np.cross(rate[2] * z, y), np.zeros(3)])
    return quaternion / np.linalg.norm(quaternion), rate @ axes, second @ axes + rate @ moving


def _product(a: Real, b: Real) -> Real:
    return np.concatenate([[a[0] * b[0] - a[1:] @ b[1:]], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])])


def _extent(dense: DenseSystem) -> float:
    """Largest distance (m) of a place where anything is fixed to a body from that body's origin, 1 if there is none."""
    seats = [seat for member in dense.tree.members for seat in (member.inboard, member.outboard)]
    nodes = [node.position for member in dense.tree.members for node in member.model.nodes.values()]
    return max((float(np.linalg.norm(x)) for x in (*(seat.offset for seat in seats), *nodes)), default=0.0) or 1.0


def _deflections(member: Member) -> Real:
    """Sizes (m,) of modal coordinates: as the stiffness has it, the softest moves nodes by DEFLECTION."""
    model, nodes = member.model, list(member.model.nodes.values())
    stiffness = np.diag(model.stiffness)
    if not len(stiffness):
        return np.zeros(0)
    if model.field is not None:  # strains of level exact, in units of their own
        size = np.ones(len(stiffness))
    else:
        extent = max(float(np.ptp(model.position, axis=0).max()), 1e-9)
        moved = np.array([np.max(np.abs(node.translation), axis=0) for node in nodes]).max(axis=0) / extent
        turned = np.array([np.max(np.abs(node.rotation_modes), axis=0) for node in nodes]).max(axis=0)
        size = 1.0 / np.maximum(np.maximum(moved, turned), 1e-12)
    soft = np.min(stiffness * size**2)
    return np.asarray(DEFLECTION * size * np.minimum(1.0, soft / np.maximum(stiffness * size**2, 1e-300)))
