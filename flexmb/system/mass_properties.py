"""Mass, mass centre and inertia of bodies with what they carry, at a state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexmb.kept import kept
from flexmb.scene.problems import closest
from flexmb.scene.quaternions import cross_matrix
from flexmb.scene.rigid_equivalent import combined, steiner
from flexmb.system.frames import AT_GROUND, body_pose, link_pose
from flexmb.system.scene_arrays import SceneArrays
from flexmb.tables import arguments
from flexmb.tables.arrays import Workspace
from flexmb.typing import Real


@dataclass(frozen=True, eq=False)
class MassProperties:
    """Mass properties of a deformed body or scene taken as rigid, with its wheels and point masses.

    mass kg; centre (3,) m, World; inertia (3,3) kg m² about the centre, World axes; rotation (3,3) R_World_body and
    origin (3,) m of the body's frame, which for a whole scene is World.
    """

    mass: float
    centre: Real
    inertia: Real
    rotation: Real
    origin: Real

    @property
    def centre_in_body(self) -> Real:
        """Mass centre (3,) m in the body's frame."""
        return self.rotation.T @ (self.centre - self.origin)

    @property
    def inertia_in_body(self) -> Real:
        """Inertia (3,3) kg m² about the mass centre, body axes."""
        return self.rotation.T @ self.inertia @ self.rotation

    def about(self, point: Real) -> Real:
        """Inertia (3,3) kg m² about a point (3,) m of World, World axes.

        ValueError or TypeError for no point, OverflowError for one that is too far away.
        """
        arm = cross_matrix(self.centre - arguments.finite("point", arguments.vector("point", point, 3)))
        return arguments.representable(self.inertia - self.mass * arm @ arm)

    @kept
    def principal(self) -> tuple[Real, Real]:
        """Moments (3,) kg m², ascending, and their axes (3,3) in its columns, World, right-handed."""
        moments, axes = np.linalg.eigh(self.inertia)
        return moments, axes * np.array([1.0, 1.0, np.sign(np.linalg.det(axes))])


def mass_properties(arrays: SceneArrays, w: Workspace, inertias: Real, body: str | None) -> MassProperties:
    """Mass properties of a body and all that it carries, or of all bodies, from the inertias (N,21) of the links and
    their poses in `w`."""
    names, parent = arrays.body_names, arrays.constants.body["parent"]
    if body is None:
        counted, frame = list(range(len(names))), AT_GROUND
    elif body in names:
        first = names.index(body)
        counted, frame = _carried(parent.tolist(), first), body_pose(arrays, w, first)
    else:
        raise ValueError(f'there is no body "{body}": {closest(body, names)}')
    parts = zip(*(_of_link(inertias[k]) for k in counted), strict=True)
    mass, first_moment, inertia = (np.array(part) for part in parts)
    poses = [link_pose(w, k) for k in counted]
    R, origins = np.array([pose.rotation for pose in poses]), np.array([pose.position for pose in poses])
    own = np.divide(first_moment, mass[:, None], out=np.zeros_like(first_moment), where=mass[:, None] > 0.0)
    centres = origins + np.einsum("kab,kb->ka", R, own)
    # Each about its own centre first: far from the World's origin, differences of squares would lose all digits.
    whole = combined(mass, centres, R @ (inertia - steiner(mass, own)) @ np.swapaxes(R, 1, 2))
    centre = whole.com if whole.mass > 0.0 else frame.position.copy()
    return MassProperties(whole.mass, centre, whole.inertia, frame.rotation.copy(), frame.position.copy())


def _carried(parent: list[int], first: int) -> list[int]:
    """A body and all that it carries; parents precede their children, and bodies precede point masses."""
    bodies = {first}
    for k in range(first + 1, len(parent)):
        if parent[k] in bodies:
            bodies.add(k)
    return sorted(bodies)


def _of_link(inertia: Real) -> tuple[float, Real, Real]:
    """Mass, first moment (3,) and inertia about the origin (3,3) of a rigid inertia's 21 numbers."""
    xx, yy, zz, xy, xz, yz = inertia[:6]
    coupling = inertia[6:15]
    s = np.array([coupling[7], coupling[2], coupling[3]])
    return float(inertia[15]), s, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
