"""The arrays of closures: constants of a scene, and the workspace of one evaluation.

C closures and couplings with G suppressed motions ("rows") in all, on N bodies with at most m modes and nu speeds.
Frame A is on body_a (the inboard side), frame B on body_b, both turned so that an axis is z; rows are in A axes. A
coupling, whose one row is a linear relation of coordinates, has terms in place of frames; couplings come last.

Closures form K groups by the bodies that their loads move, and groups form L clusters by the bodies that carry them
(`flexmb.closure.groups`); Lambda^-1 is block diagonal with a block for each cluster. Rows are numbered group by group,
groups cluster by cluster. The matrices of all groups, (rows, columns) each, are stored row by row in one array; the
columns are the speeds that loads of the group may change, first its own, then those that its cluster shares.
"""

from __future__ import annotations

import numpy as np

from flexmb.jain.places import Matrices
from flexmb.jain.response import Response, response
from flexmb.jit.bundle import bundle
from flexmb.jit.features import GENERAL
from flexmb.tables.arrays import Constants, Workspace
from flexmb.tables.features import WITH_EVERYTHING
from flexmb.typing import Index, Real, Record

ROTATION, TRANSLATION = range(2)
ON_GROUND = -1  # body of a frame that is fixed in World
COUPLINGS = "couplings"  # a feature of the constants, see `flexmb.jit.features`

_F, _I = np.float64, np.int64


def _record(*fields: tuple) -> np.dtype:
    return np.dtype(list(fields), align=True)


SIDE = _record(
    ("body", _I),  # -1 for ground
    ("port", _I),
    ("position", _F, (3,)),  # World, on the ground only
    ("rotation", _F, (9,)),  # R_World_port, on the ground only
)
CLOSURE = _record(
    ("row_start", _I),
    ("row_stop", _I),
    ("path_start", _I),  # range of `path`
    ("path_stop", _I),
    ("group", _I),
    ("term_start", _I),  # of a coupling, range of `term`, the coordinate that is led first; empty for a closure
    ("term_stop", _I),
    ("offset", _F),  # of a coupling, rad or m
)
TERM = _record(
    ("coordinate", _I),  # index in q
    ("speed", _I),  # index in u
    ("factor", _F),  # of the coordinate in the relation: 1 for the one that is led, minus the ratio for the others
    ("body", _I),  # that the hinge holds
    ("place", _I),  # number of the speed in the hinge
)
GROUP = _record(
    ("row_start", _I),  # range of rows, also in the order of pivots
    ("row_stop", _I),
    ("column_start", _I),  # range of `column`
    ("own_stop", _I),  # index in it where the shared columns begin
    ("column_stop", _I),
    ("half", _I),  # start index of its matrices in `half`, `basis` and `former`
    ("factor", _I),  # and in `factor`, (rows, rows)
)
CLUSTER = _record(
    ("group_start", _I),  # range of groups
    ("group_stop", _I),
    ("shared", _I),  # number of speeds that the groups share
    ("factor", _I),  # start index of its matrix in `shared_factor`, (shared, shared)
)
ROW = _record(
    ("closure", _I),
    ("type", _I),  # ROTATION or TRANSLATION; of a coupling, whether the coordinate that is led is an angle
    ("axis", _I),  # 0, 1, 2
)


@bundle
class ClosureConstants:
    """Constants of a run."""

    side: Record  # (C,2) SIDE, A then B; without meaning for couplings
    closure: Record  # (C,) CLOSURE
    term: Record  # TERM, of all couplings
    row: Record  # (G,) ROW
    path: Index  # bodies between a closure and the ground, outermost first
    group: Record  # (K,) GROUP
    column: Index  # by group, the speeds of the bodies on its paths
    cluster: Record  # (L,) CLUSTER
    weight: Real  # (G,) to compare rows: 1 for translations, `length` for rotations
    length: Real  # (1,) m, a length of the scene
    kernels: Index  # (1,) of the tree, `flexmb.tables.features`

    def features(self) -> frozenset[str]:
        """Whether kernels for these constants contain couplings; general ones do."""
        if self.kernels[0] in WITH_EVERYTHING:
            return frozenset({GENERAL})
        return frozenset({COUPLINGS}) if len(self.term) else frozenset()


ROW_STATE = _record(
    ("direction", _F, (3,)),  # unit load of the row: torque or force on B, A axes; of a coupling in axes of the body
    ("value", _F),  # g: 0 where the closure is closed (m, or sine of an angle; of a coupling m or rad)
    ("rate", _F),  # J u
    ("acceleration", _F),  # J udot + Jdot u
    ("load", _F),  # constraint load along `direction` that acts: whoever differentiates the motion reads it
)
CLOSURE_STATE = _record(
    ("rotation", _F, (9,)),  # R_A_B
    ("position", _F, (3,)),  # of B in A
    ("world", _F, (9,)),  # R_World_A; of a coupling that of the body on the hinge that is led
    ("size", _F),  # m, scale of row values: the scene's length and the distance from the origin
    ("speed", _F),  # m/s, scale of row rates: speeds of the ports, and the fastest of the scene
    ("former_speed", _F),  # `speed` at the last accepted state, `flexmb.closure.branch`
)


@bundle
class ClosureWorkspace:
    """Workspace of an evaluation. One per thread."""

    closure: Record  # (C,) CLOSURE_STATE
    row: Record  # (G,) ROW_STATE
    half: Real  # by group (rows, columns) B': D^-1/2 (1 - H Psi K) J' of every row; Lambda^-1 = B' B
    basis: Real  # likewise, chosen rows: orthonormal in a group's own columns, beside R'^-1 times the shared ones
    factor: Real  # by group (rows, rows) R, upper: B P = Q R in a group's own columns
    shared_factor: Real  # by cluster (shared, shared) C, upper, of `flexmb.closure.clusters`
    shared: Real  # scratch, as long as the largest number of shared speeds of a cluster
    chosen: Index  # (G,) by group, rows by pivot; the first `rank` of each are independent
    rank: Index  # (K,) independent rows; -1 until they are counted
    scratch: Real  # (G,) right-hand sides in the order of `chosen`
    solution: Real  # (G,) scratch, by row: what `solve` found
    size: Real  # (G,) response of the separate ports of a row's closure, `flexmb.closure.sizes`
    response: Response  # loads in the inward sweep, and the response to them
    coefficient: Real  # (nu,)
    step: Real  # (nu,) a displacement or a change of speeds
    former: Real  # `basis` at the last accepted state, `flexmb.closure.branch`
    former_pivot: Real  # (G,) diagonal of `factor` there
    former_rows: Index  # (G,) `chosen` there
    state: Real  # (nq+nu+1,) that state
    resolved: Real  # (1,) part of the distance to a singular position that a step may cover; 0 with error control
    notices: Index  # (1,) what is recorded of steps that must not be shortened, `flexmb.closure.branch`
    noticed: Real  # (3,) worst step that is at least twice too long: ratio, its end (s), the closure; -1 for none
    closer: Index  # (1,) whether steps may come closer to a singular position than leaps start from
    vanishing: Real  # (G,) s, in the order of `chosen`: when pivots vanish, `flexmb.closure.leap`
    demand: Real  # (4,G) m/s^2 over sqrt(kg) of row responses, same order: accelerations along rows of Q, by node
    time: Real  # (2,) time of `state`, -inf before the first; time from which on `failure` holds
    gain: Real  # (2,) stabilisation: g'' + gain[0] g' + gain[1] g = 0
    failure: Index  # (2,) status of the last projection, and the body or closure at fault


@bundle
class Recursion:
    """No arrays: unit loads need only the articulated-body quantities in the tree's workspace."""


@bundle
class Closed:
    """A closed chain for kernels: constants and workspaces of its tree (c, w) and its closures (cc, cw).

    route: how the mass matrix is factorised. Recursion: unit loads pass through the articulated-body quantities, and
    `seen` is w itself. Response or Matrices: closures act as generalised forces J'f, solved by the innovations of the
    recursion or the Cholesky factor of composite bodies, and `seen` is a separate workspace with deformed bodies.
    """

    c: Constants
    w: Workspace
    cc: ClosureConstants
    cw: ClosureWorkspace
    seen: Workspace
    route: Recursion | Response | Matrices

    @property
    def fault(self) -> Index:
        """(1,) body or closure where an evaluation failed."""
        return self.w.fault


def workspace(c: ClosureConstants, tree: Constants, coordinates: int) -> ClosureWorkspace:
    """A workspace for closures on a tree with `coordinates` coordinates."""
    rows, nu = len(c.row), len(tree.speed)
    heights, widths = (c.group[f"{side}_stop"] - c.group[f"{side}_start"] for side in ("row", "column"))
    size = int(heights @ widths)
    return ClosureWorkspace(
        closure=np.zeros(len(c.closure), CLOSURE_STATE),
        row=np.zeros(rows, ROW_STATE),
        half=np.zeros(size),
        basis=np.zeros(size),
        factor=np.zeros(int(heights @ heights)),
        shared_factor=np.zeros(int(c.cluster["shared"] @ c.cluster["shared"])),
        shared=np.zeros(int(np.max(c.cluster["shared"], initial=0))),
        chosen=np.arange(rows),
        rank=np.full(len(c.group), -1),
        scratch=np.zeros(rows),
        solution=np.zeros(rows),
        size=np.zeros(rows),
        response=response(tree),
        coefficient=np.zeros(nu),
        step=np.zeros(nu),
        former=np.zeros(size),
        former_pivot=np.zeros(rows),
        former_rows=np.arange(rows),
        state=np.zeros(coordinates + nu + 1),
        resolved=np.zeros(1),
        notices=np.zeros(1, np.int64),
        noticed=np.array([2.0, 0.0, -1.0]),
        closer=np.zeros(1, np.int64),
        vanishing=np.zeros(rows),
        demand=np.zeros((4, rows)),
        time=np.full(2, -np.inf),
        gain=np.zeros(2),
        failure=np.zeros(2, np.int64),
    )
