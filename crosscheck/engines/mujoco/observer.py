"""From MuJoCo's data to what engines exchange: World axes, angular first, scalar-first."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from crosscheck.engines.contract import Snapshot
from crosscheck.engines.conventions import cross, shift_wrench
from crosscheck.engines.links import Scalar, by_motion
from crosscheck.engines.mujoco.forces import Forces
from crosscheck.engines.mujoco.tree import MujocoClosure, MujocoTree
from crosscheck.engines.rigid_tree import by_joint, placed_couplings
from crosscheck.engines.tree_observer import BodyMotion, Energies, TreeObserver
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class MujocoObserver(TreeObserver):
    """Reads `data` after `mj_forward` and `mj_rnePostConstraint`.

    MuJoCo's spatial vectors (`cvel`, `cacc`, `cfrc_int`) are [angular; linear] in World axes about the mass centre of
    the tree that the body belongs to; `cacc` starts from -gravity at the ground; `cfrc_int` is the wrench of the parent
    on the body.
    """

    def __init__(
        self, tree: MujocoTree, forces: Forces, scene: Scene, closures: tuple[MujocoClosure, ...] = ()
    ) -> None:
        super().__init__(scene, tree.links)
        self._tree, self._forces, self._data = tree, forces, mujoco.MjData(tree.model)
        self._closures, self._couplings = closures, placed_couplings(scene, tree.slots)
        self._numbers = {body: link for link, body in enumerate(tree.bodies.tolist())}
        self._armature = np.zeros(tree.model.nv)
        for slot in tree.slots:
            if isinstance(slot.freedom, Scalar):
                self._armature[slot.v] = slot.freedom.armature

    def observe(self, data: mujoco.MjData) -> Snapshot:
        model = self._tree.model
        with self._forces.active():
            mujoco.mj_forward(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        self._data, applied = data, self._forces.loads
        loads, (kinetic, momentum) = self._loads(data), self._motion(data)
        weight = -float(model.body_mass @ data.xipos @ self.gravity)
        energies = Energies(kinetic, self._forces.spring_energy(data.qpos), weight)
        return self.snapshot(
            loads, self._drives(data, loads), energies, momentum,
            closed=self._closed(data), along=applied.along(data.time, data.qpos, data.qvel),
            exerted=applied.exerted(data.time, lambda link: self._forces.link_motion(link, data)),
        )  # fmt: skip

    def body_motion(self, link: int) -> BodyMotion:
        """MuJoCo's spatial acceleration lacks w x v of the point; it counts from -gravity."""
        data, body, at = self._data, self._tree.bodies[link], self._forces.link_motion(link, self._data)
        alpha, arm = data.cacc[body, :3], at.position - self._pole(body, data)
        acceleration = data.cacc[body, 3:] + self.gravity + cross(alpha, arm) + cross(at.angular, at.linear)
        return BodyMotion(*at, alpha, acceleration)

    def _pole(self, bodies: int | NDArray[np.intp], data: mujoco.MjData) -> Real:
        """The points about which MuJoCo's spatial vectors of bodies are given."""
        return data.subtree_com[self._tree.model.body_rootid[bodies]]

    def _loads(self, data: mujoco.MjData) -> Real:
        """[torque; force] (links, 6) on each link about its frame's origin, which is the outboard hinge point."""
        bodies = self._tree.bodies
        return shift_wrench(data.cfrc_int[bodies], self._pole(bodies, data) - data.xpos[bodies])

    def _closed(self, data: mujoco.MjData) -> dict[str, Real]:
        """[torque; force] of every closure on body_b about frame B, and of every coupling along what it leads.

        The three rows of each point of a closure are along World's axes, of A less B; the only row of a coupling is its
        load.
        """
        loads, forces, start = {}, self._rows(data), 0
        for number, closed in enumerate(self._closures):
            loads[closed.name] = np.zeros(6)
            body = 0 if closed.b.link < 0 else self._tree.bodies[closed.b.link]
            place = data.xpos[body] + data.xmat[body].reshape(3, 3) @ closed.b.frame.position
            for _, site in closed.sites(number):
                force = -forces[start : start + 3]
                torque = cross(data.site(site).xpos - place, force)
                loads[closed.name] += np.concatenate([torque, force])
                start += 3
        for coupling, size in zip(self._couplings, self._held(data).tolist(), strict=True):
            loads[coupling.name] = coupling.load(size, data.xaxis[coupling.slots[0].joint].copy())
        return loads

    def _rows(self, data: mujoco.MjData) -> Real:
        """Forces of the rows of all closures, three for each point, then of all couplings, one for each.

        MuJoCo leaves out those that no coordinate moves, as of a pin on the axis of another one: their forces are zero.
        """
        points = sum(len(closed.points) for closed in self._closures)
        rows = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        which = data.efc_id[: data.nefc][rows]
        of_its_own = np.arange(len(which)) - np.searchsorted(which, which)
        found = np.zeros(3 * points + len(self._couplings))
        found[np.where(which < points, 3 * which, 2 * points + which) + of_its_own] = data.efc_force[: data.nefc][rows]
        return found

    def _held(self, data: mujoco.MjData) -> Real:
        """Loads of the couplings."""
        return self._rows(data)[3 * sum(len(closed.points) for closed in self._closures) :]

    def _motion(self, data: mujoco.MjData) -> tuple[float, Real]:
        """Kinetic energy and momentum by summing bodies: MuJoCo's own energy would count what moves the drives."""
        model = self._tree.model
        pole = self._pole(np.arange(model.nbody), data)
        w = data.cvel[:, :3]
        v = data.cvel[:, 3:] + cross(w, data.xipos - pole)
        axes = data.ximat.reshape(-1, 3, 3)
        spin = np.einsum("bij,bi->bj", axes, w)
        p = model.body_mass[:, None] * v
        about_com = np.einsum("bij,bj->bi", axes, model.body_inertia * spin)
        kinetic = 0.5 * (np.sum(p * v) + np.sum(model.body_inertia * spin**2))
        kinetic += 0.5 * np.sum(self._armature * data.qvel**2)
        return float(kinetic), np.concatenate([np.sum(about_com + cross(data.xipos, p), axis=0), p.sum(axis=0)])

    def _drives(self, data: mujoco.MjData, loads: Real) -> dict[str, Real]:
        """Load across the joint along the prescribed axis and on the armature, less what spring and damper give."""
        drives = []
        for slot in self._forces.driven:
            load = loads[self._numbers[slot.body]]
            about_axis = shift_wrench(load, data.xpos[slot.body] - data.xanchor[slot.joint])
            half = by_motion(slot.freedom, about_axis[:3], about_axis[3:])
            freedom = slot.freedom
            passive = freedom.stiffness * (freedom.rest - data.qpos[slot.q]) - freedom.damping * data.qvel[slot.v]
            along = self._forces.loads.along(data.time, data.qpos, data.qvel).values()
            passive += sum(held.load for v, held in along if v == slot.v)
            for coupling, size in zip(self._couplings, self._held(data).tolist(), strict=True):
                own = zip(coupling.slots, coupling.factors, strict=True)
                passive += sum(factor * size for member, factor in own if member.v == slot.v)
            rotor = freedom.armature * data.qacc[slot.v]
            drives.append(half @ data.xaxis[slot.joint] + rotor - passive)
        return by_joint(self._forces.driven, drives)
