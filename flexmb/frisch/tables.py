"""Arrays of Frisch's equations: constants with the mode-dependent parameters, and the workspace of an evaluation.

The expanded velocities of (126) are, in this order, relative angular rates of the N bodies (3 each), of the W wheels
(3 each), rates of all modes, and rates of the N hinge points (3 each): nx = 6 N + 3 W + modes rows. Point masses are
bodies without rotary inertia. All vectors of the workspace are in World axes. The sparse matrix S = (126) (133) from
speeds to expanded velocities is stored by columns, one for each speed.
"""

from __future__ import annotations

import numpy as np

from flexmb.jit.bundle import bundle
from flexmb.jit.strips import strip_zeros
from flexmb.tables.arrays import SPEED_STATE, Constants
from flexmb.tables.workspaces import connector_states
from flexmb.typing import Index, Real, Record

_F, _I = np.float64, np.int64


def _record(*fields: tuple) -> np.dtype:
    return np.dtype(list(fields), align=True)


ELEMENTS = _record(  # one body: the sums over its elements that are not mode-dependent
    ("mass", _F),
    ("alpha", _F, (3,)),  # undeformed mass centre from the hinge point (8), body axes
    ("Phi", _F, (6,)),  # inertia about it (17), without the wheels' tensors
    ("mode_row", _I),  # expanded row of its first mode
    ("slope", _I),  # its row of M1_slope; -1 where the modal mass does not depend on deformation
    ("inboard_entry", _I),  # place of its rows in a column of the parent's modes; -1 where its hinge point is at rest
    ("outboard_entry", _I),  # place of its rows in a column of its own modes; -1 where its frame is that of the hinge
)
ELEMENT_MODE = _record(  # mode n of a body
    ("A", _F, (3,)),  # (48)
    ("E", _F, (6,)),  # (52)
    ("Q", _F, (3,)),  # (56)
    ("H", _F, (6,)),  # (68), symmetric part
)
ELEMENT_PAIR = _record(  # modes m, n of a body
    ("M1", _F),  # modal mass: m delta for modes normalised by (41)
    ("F", _F, (6,)),  # (70), symmetric part
    ("K", _F, (3,)),  # (72)
    ("A1", _F, (3,)),  # dA_n/da_m
    ("Q1", _F, (3,)),  # dQ_n/da_m
)
SPEED_COLUMN = _record(  # a column of S: its entries start .. stop
    ("start", _I),
    ("own", _I),  # entries start .. own are those of (133), own .. stop those of the modal partitions of (126)
    ("stop", _I),
    ("body", _I),
)

# Defects of the print that change the algorithm (indices of `printed`); the others change parameters of the bodies.
ONE_SIDED, NO_LOADS_ON_MODES, FIXED_SPIN_AXIS, FIXED_SHAPES, SECOND_ORDER = range(5)


@bundle
class NestedConstants(Constants):
    """The constants of a scene and the additional tables of Frisch's equations."""

    element: Record  # (N,) ELEMENTS
    element_mode: Record  # (N,m) ELEMENT_MODE
    element_pair: Record  # (N,m,m) ELEMENT_PAIR, first index m, second n
    M1_slope: Real  # (B,m,m,m) dM1_mn/da_k as [k,m,n], for the bodies that have one
    wheel_entry: Index  # (W,) place of a wheel's rows in a column of its body's modes; -1 where its node is at rest
    column: Record  # (nu,) SPEED_COLUMN
    entry_row: Index  # (nnz,) expanded row of each entry of S
    printed: Index  # (5,) 1 where the defect of the print is kept


NEST = _record(  # body k, the nest of hinge point k-1, World axes
    ("rotation", _F, (9,)),  # R_World_body
    ("origin", _F, (3,)),  # of the body frame, the hinge point
    ("omega", _F, (3,)),
    ("velocity", _F, (3,)),  # of the origin
    ("beta", _F, (3,)),  # from the parent's origin to this one
    ("hinge_point", _F, (3,)),  # outboard hinge point O from the origin
    ("spin_bias", _F, (3,)),  # derivative of the relative angular rate at udot = 0
    ("beta_bias", _F, (3,)),  # second derivative of beta, seen from the parent, at udot = 0
    ("path", _F, (3,)),  # centripetal and Coriolis acceleration of the origin: the sum in (100)
    ("alpha", _F, (3,)),  # deformed mass centre from the origin
    ("mass", _F),  # of the body, then of the nest
    ("first", _F, (3,)),  # first moment about the origin, of the body, then of the nest
    ("inertia", _F, (6,)),  # Phi + G about the origin, of the body, then of the nest
    ("force", _F, (3,)),  # right side of (108), of the body, then of the nest
    ("torque", _F, (3,)),  # right side of (107)
    ("hinge_map", _F, (6, 6)),
    ("load", _F, (6,)),  # total load across the hinge on the body about O
)
# row: right side of (110)
NEST_MODE = _record(("A", _F, (3,)), ("Q", _F, (3,)), ("row", _F))
NEST_PORT = _record(  # pose from the body origin and motion relative to the body
    ("r", _F, (3,)),
    ("R", _F, (9,)),
    ("v", _F, (6,)),  # velocity
    ("a", _F, (6,)),  # acceleration at etaddot = 0
)
NEST_WHEEL = _record(
    ("axis", _F, (3,)),
    ("inertia", _F, (6,)),  # I_W
    ("spin_bias", _F, (3,)),  # derivative of the relative angular rate, seen from the body, at udot = 0
    ("rate", _F, (3,)),  # rate of angular momentum at vanishing angular accelerations
    ("torque", _F, (3,)),  # of bearing and motor on the wheel
)


@bundle
class NestedWorkspace:
    """The arrays that one evaluation writes. One workspace per thread."""

    q: Real  # (nq,)
    u: Real  # (nu,)
    raw: Real  # (nq,)
    rate: Real  # (nq,)
    function: Real  # (F,3)
    speed: Record  # (nu,) SPEED_STATE
    connector: Record  # (C,) CONNECTOR_STATE
    hinge_spring: Record  # ALONG_HINGE_STATE
    coordinate_law: Record  # ALONG_HINGE_STATE
    nest: Record  # (N,) NEST
    modal: Real  # (N,m) modal coordinates as the level sees them
    modal_rate: Real  # (N,m)
    mode: Record  # (N,m) NEST_MODE
    port: Record  # (P,) NEST_PORT
    port_mode: Real  # (P,6,m) [angular; linear] velocity per modal speed
    wheel: Record  # (W,) NEST_WHEEL
    S: Real  # (nnz,) entries of S
    Z: Real  # (nx,nx) coefficient matrix of (111); blocks of bodies on different branches stay zero
    x: Real  # (nx,) expanded accelerations
    y: Real  # (nx,) Z x
    eta: Real  # (nx,) right side of (111) without hinge loads
    columns: Real  # (8,nx) eight columns of Z S, see `flexmb.frisch.reduction`
    product: Real  # (nx,nu) Z S
    M: Real  # (nu,nu) (136), corrected: S' Z S
    right: Real  # (nu,)
    free: Index  # (nu,) the free speeds, then the prescribed ones
    factor: Real  # (nu,nu) partition Z*_11 of (143) and its factor
    solution: Real  # (nu,)
    fault: Index  # (1,)
    doubt: Index  # (1,)


def workspace(c: NestedConstants, nq: int) -> NestedWorkspace:
    """A workspace of the right sizes."""
    n, m = c.element_mode.shape
    nu, modes = len(c.speed), int(np.sum(c.body["modes"]))
    nx = 6 * n + 3 * len(c.wheel) + modes
    fixed = c.speed["prescribed"] >= 0
    return NestedWorkspace(
        q=np.zeros(nq),
        u=np.zeros(nu),
        raw=np.zeros(nq),
        rate=np.zeros(nq),
        function=np.zeros((len(c.function), 3)),
        speed=np.zeros(nu, SPEED_STATE),
        **connector_states(c),
        nest=np.zeros(n, NEST),
        modal=strip_zeros((n, m)),
        modal_rate=strip_zeros((n, m)),
        mode=np.zeros((n, m), NEST_MODE),
        port=np.zeros(len(c.port), NEST_PORT),
        port_mode=strip_zeros((len(c.port), 6, m)),
        wheel=np.zeros(len(c.wheel), NEST_WHEEL),
        S=np.zeros(len(c.entry_row)),
        Z=np.zeros((nx, nx)),
        x=np.zeros(nx),
        y=np.zeros(nx),
        eta=np.zeros(nx),
        columns=np.zeros((8, nx)),
        product=np.zeros((nx, nu)),
        M=np.zeros((nu, nu)),
        right=np.zeros(nu),
        free=np.concatenate([np.flatnonzero(~fixed), np.flatnonzero(fixed)]).astype(np.int64),
        factor=np.zeros((nu, nu)),
        solution=np.zeros(nu),
        fault=np.zeros(1, np.int64),
        doubt=np.zeros(1, np.int64),
    )
