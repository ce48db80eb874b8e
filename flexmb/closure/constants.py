"""From a scene's closures to the arrays of `flexmb.closure.tables`."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from flexmb.building.links import BodyLink, sides_of_closures
from flexmb.closure import tables as t
from flexmb.closure.groups import UNLOADED, clusters, group_tables, path, path_of_coupling
from flexmb.scene import schema as s
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.tree import coupled
from flexmb.tables.arrays import Constants

# Suppressed rotations and translations, axes of frame A; z is the axis of a closure that has one.
SUPPRESSED = {
    "weld": ("xyz", "xyz"),
    "revolute": ("xy", "xyz"),
    "prismatic": ("xyz", "xy"),
    "cylindrical": ("xy", "xy"),
    "universal": ("z", "xyz"),
    "spherical": ("", "xyz"),
    "planar": ("xy", "z"),
    "in_line": ("", "xy"),
    "in_plane": ("", "z"),
}


OPEN = ("", "")


def suppressed(closure: s.Closure) -> tuple[str, str]:
    """The rotations and translations that a closure suppresses as it is; none while it is open."""
    return SUPPRESSED[closure.type] if closure.closed else OPEN


def closure_constants(
    scene: s.Scene,
    constants: Constants,
    ports: Sequence[tuple[int, int]],
    chain: list[BodyLink],
    like: s.Scene | None = None,
) -> t.ClosureConstants:
    """Constants of a scene's closures and couplings. `like`: see `flexmb.building.links.links`.

    An open closure keeps its place among them, so that its load is an output in all parts of a run. It has no rows, and
    no body carries its load: it is a group of its own, which costs nothing.

    ports: (body, port) of both sides of each closure, (-1, -1) on the ground.
    """
    sides = np.zeros((len(scene.constraints), 2), t.SIDE)
    sides["body"] = t.ON_GROUND
    closures = np.zeros(len(scene.constraints), t.CLOSURE)
    for i, (_, both) in enumerate(sides_of_closures(scene, like)):
        for j, side in enumerate(both):
            sides[i, j]["body"], sides[i, j]["port"] = ports[2 * i + j]
            if sides[i, j]["body"] == t.ON_GROUND:
                sides[i, j]["position"] = side.offset
                sides[i, j]["rotation"] = (rotation_matrix(side.quaternion) @ side.turn).ravel()
    parent = constants.body["parent"].tolist()
    paths = [
        path(constants, parent, bodies) if closure.closed else UNLOADED
        for closure, bodies in zip(scene.closures, sides["body"][: len(scene.closures)].tolist(), strict=True)
    ]
    terms = _terms(scene, constants, chain, closures)
    for i in range(len(scene.closures), len(closures)):
        bodies = terms["body"][closures["term_start"][i] : closures["term_stop"][i]].tolist()
        paths.append(path_of_coupling(parent, bodies))
    closures["path_stop"] = np.cumsum([len(path.bodies) for path in paths])
    closures["path_start"] = closures["path_stop"] - [len(path.bodies) for path in paths]
    own = [_rows(scene, i, constraint) for i, constraint in enumerate(scene.constraints)]
    members = clusters(constants, paths)
    rows: list[tuple[int, int, int]] = []
    for group, i in (
        (number, i) for number, members_of_group in enumerate(itertools.chain(*members)) for i in members_of_group
    ):
        closures["group"][i], closures["row_start"][i] = group, len(rows)
        rows += own[i]
        closures["row_stop"][i] = len(rows)
    row_table = np.array(rows, t.ROW)
    tables = group_tables(constants, members, paths, list(map(len, own)))
    length = _length(constants, sides)
    return t.ClosureConstants(
        side=sides,
        closure=closures,
        term=terms,
        row=row_table,
        path=np.array([k for path in paths for k in path.bodies], np.int64),
        group=tables.groups,
        column=tables.columns,
        cluster=tables.clusters,
        weight=np.where(row_table["type"] == t.ROTATION, length, 1.0),
        length=np.array([length]),
        kernels=constants.kernels,
    )


def _terms(scene: s.Scene, constants: Constants, chain: list[BodyLink], closures: np.ndarray) -> np.ndarray:
    """TERM of all couplings; their ranges and offsets to `closures`, where they come after the closures."""
    held = {link.hinge.name: k for k, link in enumerate(chain)}
    rows: list[tuple[int, int, float, int, int]] = []
    for i, coupling in enumerate(scene.couplings, len(scene.closures)):
        closures["offset"][i], closures["term_start"][i] = coupling.offset, len(rows)
        for member in coupled(scene, coupling):
            k = held[member.hinge.name]
            speed = int(constants.body["u_index"][k]) + member.place
            rows.append((int(constants.speed["coordinate"][speed]), speed, member.factor, k, member.place))
        closures["term_stop"][i] = len(rows)
    return np.array(rows, t.TERM)


def _rows(scene: s.Scene, i: int, closure: s.Closure | s.Coupling) -> list[tuple[int, int, int]]:
    """(closure, type, axis) of the rows of closure or coupling number i."""
    if isinstance(closure, s.Coupling):
        led = coupled(scene, closure)[0].named.coordinate
        return [(i, t.ROTATION if led.ANGULAR else t.TRANSLATION, 0)]
    rotations, translations = suppressed(closure)
    turning = [(i, t.ROTATION, "xyz".index(axis)) for axis in rotations]
    return turning + [(i, t.TRANSLATION, "xyz".index(axis)) for axis in translations]


def _length(constants: Constants, sides: np.ndarray) -> float:
    """The largest distance of a frame from the one it is fixed to, on any body or the ground (m); 1 where all are 0."""
    points = [constants.port["position"] + constants.port["offset"], constants.body["placement_position"]]
    largest = max(
        float(np.max(np.linalg.norm(positions, axis=-1), initial=0.0)) for positions in (*points, sides["position"])
    )
    return largest or 1.0


def slowest_mode(chain: list[BodyLink]) -> float:
    """The lowest uncoupled modal frequency (rad/s), body held; infinite where no mode has stiffness."""
    slowest = [np.inf]
    for link in chain:
        if link.mode_count == 0:
            continue
        m = link.model
        mass = np.einsum("p,pan->n", m.mass, m.translation**2)
        mass += np.einsum("pan,pab,pbn->n", m.rotation, m.inertia, m.rotation)
        stiffness = np.diag(m.stiffness)
        moving = (stiffness > 0.0) & (mass > 0.0)
        slowest += np.sqrt(stiffness[moving] / mass[moving]).tolist()
    return min(slowest)
