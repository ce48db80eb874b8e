"""Mass matrix, bias, accelerations, loads, energy and momentum of a scene as sums over its inertia points.

Bodies of level ruthless have eta = etadot = 0 in everything except elasticity and damping (Jain and Rodriguez, Appendix
B); markers move with the true deformation. Bodies of level linear are not summed point by point: each has a modal mass
matrix and bias of first order (`flexmb.dense.first_order_bodies`).
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexmb.dense.body_frames import InertiaPoints, Motions, member_frames, point_frames, points, seat_frame
from flexmb.dense.connectors import Grip, grip, hold
from flexmb.dense.first_order_bodies import FirstOrderBody, body_jacobian, first_order_body
from flexmb.dense.hinge_frames import ball_energy, ball_torque
from flexmb.dense.jets import MovingFrame, profile
from flexmb.dense.members import DenseTree, ScalarSpeed, Seat, build
from flexmb.kept import kept
from flexmb.scene import schema as s
from flexmb.scene.connectors import AlongHinge, BetweenNodes
from flexmb.typing import Real


class Jacobian(NamedTuple):
    """Velocities of K frames at unit speeds: angular (K,3,nu), linear (K,3,nu), World axes."""

    angular: Real
    linear: Real


class Wrenches(NamedTuple):
    """Torque (K,3) about each of K points, force (K,3) at it, and its position (K,3); World axes."""

    torque: Real
    force: Real
    position: Real

    def about(self, origin: Real, chosen: NDArray[np.bool_]) -> Real:
        """Sum (6,) [torque; force] of the chosen points about `origin`."""
        force = self.force[chosen]
        torque = self.torque[chosen] + np.cross(self.position[chosen] - origin, force)
        return np.concatenate([torque.sum(axis=0), force.sum(axis=0)])


class Instant:
    """One motion at one instant: q (nq,), u (nu,), rates of the speeds (nu,)."""

    def __init__(self, tree: DenseTree, q: Real, u: Real, rates: Real) -> None:
        self._tree, self._motion = tree, Motions(q, u[None], rates[None])
        self._frames = member_frames(tree, self._motion)

    @property
    def points(self) -> MovingFrame:
        """Mass centres and axes of all inertia points, (P, ...)."""
        return point_frames(self._tree, self._frames, self._motion).first

    @property
    def first_order(self) -> dict[int, FirstOrderBody]:
        """Members of level linear by their numbers."""
        tree = self._tree
        return {k: first_order_body(tree, k, self._frames[k], self._motion) for k in tree.linear}

    def seat(self, k: int, seat: Seat) -> MovingFrame:
        """One frame on member k."""
        frame = seat_frame(self._tree, self._frames, k, seat, self._motion).first
        return MovingFrame(frame.position[0], frame.rotation[0])


class SiteMotion(NamedTuple):
    """A marker in World: position (3,), rotation (3,3), velocity and classical acceleration (6,) [angular; linear]."""

    position: Real
    rotation: Real
    velocity: Real
    acceleration: Real


class DenseSystem:
    """A scene for the dense route. q and u are ordered as in `flexmb.dense.members`; SI, World axes."""

    def __init__(self, scene: s.Scene, folder: Path | None = None) -> None:
        self.scene = scene
        self.tree: DenseTree = build(scene, folder)
        self.nq, self.nu = self.tree.nq, self.tree.nu
        self._gravity = np.array(scene.gravity_m_s2)

    @kept
    def points(self) -> InertiaPoints:
        """All inertia points."""
        return points(self.tree)

    @kept
    def _summed(self) -> InertiaPoints:
        """The points that are summed: of bodies of level linear only the rotary inertia of their wheels."""
        truncated = np.isin(self.points.member, self.tree.linear)
        elements = truncated & (np.arange(len(truncated)) < len(truncated) - len(self.tree.rotors))
        inertia = np.where(elements[:, None, None], 0.0, self.points.inertia)
        return InertiaPoints(np.where(truncated, 0.0, self.points.mass), inertia, self.points.member)

    def mass_matrix(self, q: Real) -> Real:
        """M (nu,nu) = sum over points m v'v + w' J w, S' M_m S of bodies of level linear, and armatures."""
        J, now = self._jacobian(q), self._at(q)
        M = np.einsum("p,pai,paj->ij", self._summed.mass, J.linear, J.linear)
        M += np.einsum("pai,pab,pbj->ij", J.angular, _turned(self._summed, now.points), J.angular)
        S = self._body_jacobians(q)
        M += sum((S[k].T @ body.M @ S[k] for k, body in now.first_order.items()), start=np.zeros_like(M))
        return M + np.diag(self.armature)

    @kept
    def armature(self) -> Real:
        """(nu,) inertia along each speed alone, kg m^2 or kg."""
        armature = np.zeros(self.nu)
        for x in self.tree.scalars:
            armature[x.u] = x.armature
        return armature

    def bias(self, q: Real, u: Real, t: float = 0.0) -> Real:
        """c (nu,) in M udot + c = tau.

        Gyroscopic and centrifugal forces, gravity, elasticity, loads at nodes, connectors between nodes.
        """
        return self._inverse(q, u, np.zeros(self.nu), t)

    def needed(self, t: float, q: Real, u: Real, rates: Real) -> Real:
        """M udot + c - tau (nu,): the generalised forces that a motion needs beside all that the scene has.

        Each inertia point's own m (a - g) and J alpha + w x J w along its Jacobian, without a mass matrix. Of
        prescribed speeds they are the drive loads.
        """
        return self._inverse(q, u, rates, t) + self.armature * rates - self.applied(q, u, t)

    def _inverse(self, q: Real, u: Real, rates: Real, t: float) -> Real:
        """M udot + c (nu,), without armatures."""
        motion = self._unit_motions(q)
        frames = member_frames(self.tree, motion)
        J, now = _columns(point_frames(self.tree, frames, motion)), self._seen(q, u, rates)
        inertial = self._inertial(now, self._summed)
        c = np.einsum("pai,pa->i", J.linear, inertial.force) + np.einsum("pai,pa->i", J.angular, inertial.torque)
        for k, body in now.first_order.items():
            c += body_jacobian(self.tree.members[k], frames[k], self.nu).T @ body.force(self._gravity)
        sizes = [profile(load.function, t).value for load in self.scene.loads]
        c -= self.load_columns(q, frames) @ np.array(sizes, dtype=float)
        for name, gripped in self.grips(q, u, t).items():
            for side, wrench in (("a", gripped.on_a), ("b", gripped.on_b)):
                site = self._site_columns(f"connector {side}:{name}", frames, motion)
                c -= wrench[:3] @ site.angular[0] + wrench[3:] @ site.linear[0]
        for member in self.tree.members:
            c[member.u_modes] += member.model.stiffness @ q[member.q_modes]
            c[member.u_modes] += member.model.damping @ u[member.u_modes]
        return c

    def load_columns(self, q: Real, frames: list[MovingFrame] | None = None) -> Real:
        """(nu,L) generalised forces of the scene's L loads at nodes, each of size one.

        `frames` are those of the members in unit motions, if they are known.
        """
        columns = np.zeros((self.nu, len(self.scene.loads)), q.dtype)  # complex where derivatives are taken by steps
        if not self.scene.loads:
            return columns
        motion = self._unit_motions(q)
        frames = member_frames(self.tree, motion) if frames is None else frames
        for i, load in enumerate(self.scene.loads):
            site = seat_frame(self.tree, frames, *self.tree.sites[f"load:{load.name}"], motion)
            J, along = _columns(site), _direction(load, site.rotation.value[0, 0])
            columns[:, i] = along @ (J.angular[0] if load.type == "torque" else J.linear[0])
        return columns

    def applied(self, q: Real, u: Real, t: float = 0.0) -> Real:
        """tau (nu,) of springs, dampers and motors of hinges, point masses and wheels."""
        tau = np.zeros(self.nu)
        for x in self.tree.scalars:
            tau[x.u] -= x.stiffness * (q[x.q] - x.rest) + x.damping * u[x.u]
            if x.motor is not None:
                tau[x.u] += profile(x.motor, t).value
        for member in self.tree.members:
            tau[member.u_hinge] += ball_torque(member.hinge, q[member.q_hinge], u[member.u_hinge])
        for connector in self.scene.connectors:
            if isinstance(connector, AlongHinge):
                held = hold(self.scene, self.tree, connector, q, u, t)
                tau[held.u] += held.load
        return tau

    def grips(self, q: Real, u: Real, t: float = 0.0) -> dict[str, Grip]:
        """Loads of the connectors between nodes, by name."""
        between = [connector for connector in self.scene.connectors if isinstance(connector, BetweenNodes)]
        if not between:
            return {}
        now, found = self._at(q, u), {}
        for connector in between:
            a, b = (now.seat(*self.tree.sites[f"connector {side}:{connector.name}"]) for side in "ab")
            found[connector.name] = grip(connector, a, b, t)
        return found

    def on_profile(self, q: Real, u: Real, t: float) -> tuple[Real, Real]:
        """q and u with every prescribed coordinate at its function's value and rate."""
        q, u = q.copy(), u.copy()
        for x in self._prescribed:
            f = profile(x.prescribed, t)  # type: ignore[arg-type]
            q[x.q], u[x.u] = f.value, f.rate
        return q, u

    def accelerations(self, t: float, q: Real, u: Real) -> Real:
        """udot (nu,): M_ff udot_f = tau_f - c_f - M_fp udot_p, where p are the prescribed speeds."""
        q, u = self.on_profile(q, u, t)
        rates, free = np.zeros(self.nu), np.ones(self.nu, dtype=bool)
        for x in self._prescribed:
            rates[x.u], free[x.u] = profile(x.prescribed, t).acceleration, False  # type: ignore[arg-type]
        M = self.mass_matrix(q)
        right = self.applied(q, u, t) - self.bias(q, u, t) - M @ rates
        rates[free] = np.linalg.solve(M[np.ix_(free, free)], right[free])
        return rates

    def drives(self, t: float, q: Real, u: Real, rates: Real) -> dict[str, Real]:
        """Drive loads of prescribed coordinates by hinge, point mass or wheel, beyond springs, dampers and motors."""
        q, u = self.on_profile(q, u, t)
        needed = self.needed(t, q, u, rates)
        drives: dict[str, Real] = {}
        for x in self._prescribed:
            drives[x.owner] = np.append(drives.get(x.owner, np.zeros(0)), needed[x.u])
        return drives

    def hinge_loads(self, t: float, q: Real, u: Real, rates: Real) -> dict[str, Real]:
        """Total load (6,) [torque; force] on the outboard body about the outboard hinge point, by hinge.

        Newton and Euler for everything outboard of the hinge: inertia minus gravity minus loads at nodes and of
        connectors. Armatures are no mass of the bodies.
        """
        q, u = self.on_profile(q, u, t)
        now = self._seen(q, u, rates)
        inertial, loads, grips = self._inertial(now, self._summed), self._loads(q, t), self.grips(q, u, t)
        bodies = {k: Wrenches(*body.world(body.force(self._gravity))) for k, body in now.first_order.items()}
        found = {}
        for k, member in enumerate(self.tree.members):
            outboard = self.outboard(k)
            origin = now.seat(k, member.outboard).position.value
            total = inertial.about(origin, np.isin(self.points.member, outboard))
            for i in bodies.keys() & set(outboard):
                total += bodies[i].about(origin, np.array([True]))
            for load in self.scene.loads:
                if self.tree.index(load.body) in outboard:
                    total -= loads[load.name].about(origin, np.array([True]))
            for name, gripped in grips.items():
                for side, wrench in (("a", gripped.on_a), ("b", gripped.on_b)):
                    body, seat = self.tree.sites[f"connector {side}:{name}"]
                    if body in outboard:
                        arm = now.seat(body, seat).position.value - origin
                        total -= np.concatenate([wrench[:3] + np.cross(arm, wrench[3:]), wrench[3:]])
            found[member.hinge.name] = total
        return found

    def wheel_loads(self, t: float, q: Real, u: Real, rates: Real) -> dict[str, Real]:
        """Load (6,) [torque; force] of bearing and motor on each wheel about its centre."""
        q, u = self.on_profile(q, u, t)
        inertial = self._inertial(self._seen(q, u, rates), self.points)
        first = len(self.points.mass) - len(self.tree.rotors)
        return {
            rotor.wheel.name: np.concatenate([inertial.torque[first + i], inertial.force[first + i]])
            for i, rotor in enumerate(self.tree.rotors)
        }

    def markers(self, t: float, q: Real, u: Real, rates: Real) -> dict[str, SiteMotion]:
        """Motion of all markers, with the true deformation at every level."""
        q, u = self.on_profile(q, u, t)
        now = Instant(self.tree, q, u, rates)
        markers = {}
        for marker in self.scene.markers:
            f = now.seat(*self.tree.sites[f"marker:{marker.name}"])
            velocity = np.concatenate([f.angular_velocity(), f.position.rate])
            acceleration = np.concatenate([f.angular_acceleration(), f.position.acceleration])
            markers[marker.name] = SiteMotion(f.position.value, f.rotation.value, velocity, acceleration)
        return markers

    def energy(self, q: Real, u: Real) -> dict[str, float]:
        """Kinetic, strain, spring and gravity energy (J)."""
        now = self._at(q, u)
        frames, bodies = now.points, now.first_order.values()
        w, v = frames.angular_velocity(), frames.position.rate
        mass, inertia = self._summed.mass, _turned(self._summed, frames)
        first_moment = mass @ frames.position.value + sum((body.mass_moment() for body in bodies), start=np.zeros(3))
        kinetic = 0.5 * float(mass @ (v * v).sum(axis=1) + np.einsum("pa,pab,pb->", w, inertia, w))
        kinetic += 0.5 * float(self.armature @ u**2)
        spring = sum(0.5 * x.stiffness * (q[x.q] - x.rest) ** 2 for x in self.tree.scalars)
        strain = 0.0
        for member in self.tree.members:
            eta = q[member.q_modes]
            strain += 0.5 * float(eta @ member.model.stiffness @ eta)
            spring += ball_energy(member.hinge, q[member.q_hinge])
        spring += sum(gripped.energy for gripped in self.grips(q, u).values())
        for connector in self.scene.connectors:
            if isinstance(connector, AlongHinge):
                spring += hold(self.scene, self.tree, connector, q, u, 0.0).energy
        return {
            "kinetic": kinetic + sum(body.kinetic for body in bodies),
            "strain": strain,
            "spring": spring,
            "gravity": -float(first_moment @ self._gravity),
        }

    def momentum(self, q: Real, u: Real) -> Real:
        """(6,) [angular about the World origin; linear]."""
        now = self._at(q, u)
        frames = now.points
        spin = np.einsum("pab,pb->pa", _turned(self._summed, frames), frames.angular_velocity())
        linear = self._summed.mass[:, None] * frames.position.rate
        total = Wrenches(spin, linear, frames.position.value).about(np.zeros(3), np.ones(len(linear), dtype=bool))
        for body in now.first_order.values():
            total += Wrenches(*body.world(body.M @ body.speeds)).about(np.zeros(3), np.array([True]))
        return total

    @property
    def _prescribed(self) -> list[ScalarSpeed]:
        return [x for x in self.tree.scalars if x.prescribed is not None]

    def undeformed(self, q: Real) -> Real:
        """q with the modal coordinates of ruthless bodies at zero."""
        q = q.copy()
        for member in self.tree.members:
            if member.level == "ruthless":
                q[member.q_modes] = 0.0
        return q

    def _seen(self, q: Real, u: Real, rates: Real) -> Instant:
        """The motion in the inertia forces: eta = etadot = 0 for ruthless bodies."""
        u = u.copy()  # the rates stay: at the rest shape, too, inertia couples modal accelerations to the others
        for member in self.tree.members:
            if member.level == "ruthless":
                u[member.u_modes] = 0.0
        return Instant(self.tree, self.undeformed(q), u, rates)

    def _at(self, q: Real, u: Real | None = None) -> Instant:
        """Configuration and velocities: eta = 0 for ruthless bodies, at rest without u."""
        zero = np.zeros(self.nu)
        return Instant(self.tree, self.undeformed(q), zero if u is None else u, zero)

    def _unit_motions(self, q: Real) -> Motions:
        return Motions(self.undeformed(q), np.eye(self.nu), np.zeros((self.nu, self.nu)))

    def _jacobian(self, q: Real) -> Jacobian:
        """Jacobian of all inertia points."""
        motion = self._unit_motions(q)
        return _columns(point_frames(self.tree, member_frames(self.tree, motion), motion))

    def _body_jacobians(self, q: Real) -> dict[int, Real]:
        """Jacobians (m+6,nu) of the bodies of level linear by their numbers."""
        frames = member_frames(self.tree, self._unit_motions(q)) if self.tree.linear else []
        return {k: body_jacobian(self.tree.members[k], frames[k], self.nu) for k in self.tree.linear}

    def _site_columns(self, name: str, frames: list[MovingFrame], motion: Motions) -> Jacobian:
        """Jacobian of the frame of one site, from the members' frames in unit motions."""
        return _columns(seat_frame(self.tree, frames, *self.tree.sites[name], motion))

    def _inertial(self, now: Instant, chosen: InertiaPoints) -> Wrenches:
        """The wrench that causes the motion of each point in addition to gravity: m (a - g), J alpha + w x J w."""
        frames = now.points
        J, w, alpha = _turned(chosen, frames), frames.angular_velocity(), frames.angular_acceleration()
        torque = np.einsum("pab,pb->pa", J, alpha) + np.cross(w, np.einsum("pab,pb->pa", J, w))
        force = chosen.mass[:, None] * (frames.position.acceleration - self._gravity)
        return Wrenches(torque, force, frames.position.value)

    def _loads(self, q: Real, t: float) -> dict[str, Wrenches]:
        """Loads at nodes by name, one point each."""
        now, loads = self._at(q), {}
        for load in self.scene.loads:
            site = now.seat(*self.tree.sites[f"load:{load.name}"])
            size = profile(load.function, t).value * _direction(load, site.rotation.value)[None]
            none = np.zeros((1, 3))
            torque, force = (size, none) if load.type == "torque" else (none, size)
            loads[load.name] = Wrenches(torque, force, site.position.value[None])
        return loads

    def outboard(self, k: int) -> list[int]:
        """Member k and all members outboard of it."""
        outboard = [k]
        for i, member in enumerate(self.tree.members):
            if member.parent in outboard:
                outboard.append(i)
        return outboard


def _direction(load: s.Load, rotation: Real) -> Real:
    """Direction (3,) of a load in World at a node of this rotation (3,3)."""
    direction = np.array(load.direction)
    return np.asarray(rotation @ direction) if load.frame == "node" else direction


def _turned(chosen: InertiaPoints, frames: MovingFrame) -> Real:
    """Inertia tensors (P,3,3) in World axes."""
    R = frames.rotation.value
    return np.asarray(R @ chosen.inertia @ np.swapaxes(R, -1, -2))


def _columns(frames: MovingFrame) -> Jacobian:
    """Column j is the velocity of the K frames for u = e_j."""
    turning, moving = np.broadcast_arrays(frames.angular_velocity(), frames.position.rate)
    return Jacobian(np.moveaxis(turning, 0, -1), np.moveaxis(moving, 0, -1))
