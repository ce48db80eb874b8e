"""The motion, the loads and the balance of a beam in Kratos at one time, in model axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.engines.conventions import cross, cross_matrix
from crosscheck.engines.kratos.mesh import Mesh
from flexmb.typing import Real


@dataclass(frozen=True)
class MeshState:
    """Of the n nodes: `position` (n,3) m, `rotation` (n,3,3) since t = 0, `rate` and `acceleration` (n,6) [linear;
    angular]. `held` (6,) [force; torque] on the beam at the hinge; `momentum` (6,) [linear; angular about the origin];
    `kinetic`, `strain`, `gravity` in J."""

    position: Real
    rotation: Real
    rate: Real
    acceleration: Real
    held: Real
    momentum: Real
    kinetic: float
    strain: float
    gravity: float


def accelerations(mesh: Mesh, t: float, applied: Real) -> Real:
    """Accelerations (n,6) by Kratos' mass matrices and forces under loads (n,6): M a = f where nothing is held.

    A beam without rotary inertia about its axis has no angular acceleration about it.
    """
    n, layout = len(mesh.nodes), mesh.layout
    M, f = np.zeros((6 * n, 6 * n)), applied.ravel().copy()
    for k, (mass, force) in enumerate(
        zip(mesh.of_elements("MassMatrix"), mesh.of_elements("RightHandSide"), strict=True)
    ):
        place = slice(6 * k, 6 * k + 12)
        M[place, place] += mass
        f[place] += force
    held = 6 * layout.root + np.array(layout.held, dtype=int)
    free = np.setdiff1d(np.arange(6 * n), held)
    a = np.zeros(6 * n)
    a[6 * layout.root + 5] = mesh.prescribed_acceleration(t)
    a[free] = np.linalg.lstsq(M[np.ix_(free, free)], (f - M @ a)[free], rcond=1e-13)[0]
    return a.reshape(n, 6)


def read(mesh: Mesh, applied: Real) -> MeshState:
    """The state that Kratos has now, under loads (n,6) on its nodes.

    An element's memory of rotations must be up to date: between Kratos' InitializeNonLinIteration and its
    FinalizeNonLinIteration, which takes in the last increments.
    """
    layout = mesh.layout
    moved = mesh.table((mesh.translation[0],))
    position = layout.position + moved
    rate = mesh.table((mesh.translation[1], mesh.rotation[1]))
    acceleration = mesh.table((mesh.translation[2], mesh.rotation[2]))
    pairs = np.concatenate([rate[:-1], rate[1:]], axis=1)
    carried = np.einsum("kij,kj->ki", mesh.of_elements("MassMatrix"), pairs)
    deformed, impulse = _Deformed(mesh, position), _summed(carried)
    return MeshState(
        position=position, rotation=deformed.rotations(), rate=rate, acceleration=acceleration,
        held=held(mesh, applied),
        momentum=np.concatenate([
            impulse[:, :3].sum(axis=0), (cross(position, impulse[:, :3]) + impulse[:, 3:]).sum(axis=0),
        ]),
        kinetic=float(np.sum(pairs * carried)) / 2.0, strain=deformed.energy(),
        gravity=-float(np.sum(deformed.first_moment() @ layout.to_model(layout.scene.gravity_m_s2))),
    )  # fmt: skip


def held(mesh: Mesh, applied: Real) -> Real:
    """What holds the beam at the hinge (6,) [force; torque], under loads (n,6): what its elements there lack."""
    root = mesh.layout.root
    which = slice(max(root - 1, 0), root + 1)
    acceleration = mesh.table((mesh.translation[2], mesh.rotation[2]))
    pairs = np.concatenate([acceleration[:-1], acceleration[1:]], axis=1)[which]
    lacking = np.einsum("kij,kj->ki", mesh.of_elements("MassMatrix", which), pairs)
    lacking -= mesh.of_elements("RightHandSide", which)
    return np.asarray(_summed(lacking)[root - which.start] - applied[root])


def _summed(pairs: Real) -> Real:
    """Vectors (n,6) at the nodes of those (n-1,12) at the ends of elements."""
    found = np.zeros((len(pairs) + 1, 6))
    found[:-1] += pairs[:, :6]
    found[1:] += pairs[:, 6:]
    return found


class _Deformed:
    """How the elements are deformed, from the forces in them, which Kratos gives in their turned axes.

    Krenk's modes: twist, symmetric bending about y and z, extension, antisymmetric bending about y and z. Four times a
    half-angle's vector part stands for an angle in them, so that the rotations of the ends follow without error.
    """

    def __init__(self, mesh: Mesh, position: Real) -> None:
        self.layout, core, info = mesh.layout, mesh.core, mesh.part.ProcessInfo
        self.ends = position
        self.axes = np.stack(
            [
                np.array([np.array(e.CalculateOnIntegrationPoints(axis, info)[1]) for e in mesh.elements])
                for axis in (core.LOCAL_AXIS_1, core.LOCAL_AXIS_2, core.LOCAL_AXIS_3)
            ],
            axis=2,
        )
        first, second = (
            np.array([[np.array(e.CalculateOnIntegrationPoints(kind, info)[k]) for k in (0, 2)] for e in mesh.elements])
            for kind in (core.FORCE, core.MOMENT)
        )
        force, moment = (_at_ends(each) for each in (first, second))
        self.length = np.linalg.norm(np.diff(self.layout.position, axis=0), axis=1)
        N = force[:, 1, 0]
        now = np.linalg.norm(np.diff(position, axis=0), axis=1)
        sections = self.layout.sections
        GJ, EIy, EIz, EA, GAy, GAz = (
            np.array([getattr(each, key) for each in sections]) for key in ("GJ", "EIy", "EIz", "EA", "GAy", "GAz")
        )
        bare = np.stack(
            [
                GJ, EIy, EIz, EA, 3.0 * EIy / _sheared(EIy, GAz, now), 3.0 * EIz / _sheared(EIz, GAy, now),
            ]
        ) / self.length  # fmt: skip
        stretched = N * now * np.array([0.0, 1 / 12, 1 / 12, 0.0, 1 / 20, 1 / 20])[:, None]
        loads = np.stack(
            [
                moment[:, 1, 0], (moment[:, 1, 1] - moment[:, 0, 1]) / 2.0, (moment[:, 1, 2] - moment[:, 0, 2]) / 2.0,
                N, (moment[:, 1, 1] + moment[:, 0, 1]) / 2.0, (moment[:, 1, 2] + moment[:, 0, 2]) / 2.0,
            ]
        )  # fmt: skip
        self.modes = loads / (bare + stretched)
        self._bare = bare

    def energy(self) -> float:
        """Strain energy (J)."""
        return float(np.sum(self._bare * self.modes**2)) / 2.0

    def rotations(self) -> Real:
        """Rotations (n,3,3) of the nodes since t = 0: each from the element before it, the first from that after it."""
        twist, about_y, about_z, _, swing_y, swing_z = self.modes / 4.0
        b = np.stack([np.sqrt(1.0 - swing_y**2 - swing_z**2), swing_z, -swing_y], axis=1)
        mirrored = np.eye(3) - 2.0 * b[:, :, None] * b[:, None, :]
        mean = self.axes @ (mirrored * np.array([-1.0, 1.0, 1.0])) @ np.swapaxes(self.layout.axes, 1, 2)
        half = np.einsum("kij,kj->ki", self.axes, np.stack([twist, about_y, about_z], axis=1))
        before, after = _turned(-half) @ mean, _turned(half) @ mean
        return np.concatenate([before[:1], after])

    def first_moment(self) -> Real:
        """Masses times the places of their centres from the World origin (n-1,3) kg m: the axis is a cubic."""
        mass = np.array([each.mass for each in self.layout.sections]) * self.length
        _, about_y, about_z, *_ = self.modes
        bow = np.stack([np.zeros(len(mass)), -about_z, about_y], axis=1) * (self.length / 12.0)[:, None]
        middle = self.layout.to_model(self.layout.world.position) + (self.ends[1:] + self.ends[:-1]) / 2.0
        return mass[:, None] * (middle + np.einsum("kij,kj->ki", self.axes, bow))


def _at_ends(quarters: Real) -> Real:
    """Forces (n-1,2,3) on the ends of elements, from what Kratos gives at a quarter and at three quarters of them."""
    near, far = quarters[:, 0], quarters[:, 1]
    return np.stack([far - 3.0 * near, 3.0 * far - near], axis=1) / 2.0


def _sheared(EI: Real, GA: Real, length: Real) -> Real:
    """1 + 12 EI/(GA length²), 1 where GA is zero: no shear."""
    return 1.0 + np.divide(12.0 * EI, GA * length**2, out=np.zeros_like(EI), where=GA > 0.0)


def _turned(half: Real) -> Real:
    """Rotations (n,3,3) whose quaternions have the vector parts `half` (n,3)."""
    w = np.sqrt(1.0 - np.sum(half**2, axis=1))
    skew = np.array([cross_matrix(each) for each in half])
    return np.eye(3) + 2.0 * w[:, None, None] * skew + 2.0 * skew @ skew
