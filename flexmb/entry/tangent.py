"""Derivatives of the equations of motion, exact to round-off, by a complex step through the compiled kernels.

    w = tangent_workspace(system.constants, system.nq, system.nu)
    status = jacobian(t, y, J, system.constants, w)

The kernels of the recursion are compiled once more for a workspace whose numbers are complex. One evaluation at
y + i h e_j has the derivative with respect to y_j as its imaginary part over h: no difference is formed, nothing
cancels, and h = 2^-100 leaves no error of its own.

y = [q, u, work] as in `flexmb.entry.articulated.rhs`. The constants must be those of the system (`System.constants`),
not those with reduced bodies: every body is eliminated explicitly here.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from flexmb.entry.articulated import rhs
from flexmb.jit.bundle import bundle
from flexmb.jit.kernel import kernel
from flexmb.tables.arrays import Constants, Workspace
from flexmb.tables.status import OK
from flexmb.tables.workspaces import workspace
from flexmb.typing import Index, Real

STEP = 2.0**-100  # its square is nothing beside 1; a power of two, so that it divides out exactly


@bundle
class TangentWorkspace(Workspace):
    """A workspace whose numbers carry a derivative, and what a Jacobian needs besides."""

    state: Real  # (nq+nu+1,) complex y
    slope: Real  # (nq+nu+1,) complex dy/dt
    column: Index  # (C,) places in y that dy/dt depends on; the others' columns vanish


def tangent_workspace(c: Constants, nq: int, nu: int) -> TangentWorkspace:
    """What `jacobian` and `time_derivative` write; one per thread."""
    n = nq + nu + 1
    tables = workspace(c, nq, nu)
    return TangentWorkspace(
        **{field.name: _complex_array(getattr(tables, field.name)) for field in fields(tables)},
        state=np.zeros(n, np.complex128),
        slope=np.zeros(n, np.complex128),
        column=_columns(c, nq, nu),
    )


@kernel
def jacobian(t, y, J, c, w):
    """J (n,n) = d(dy/dt)/dy at y = [q, u, work] (n,), row by row as `rhs` orders them; returns a status code.

    Prescribed coordinates and speeds are functions of time: their columns vanish, and so do their rows.
    """
    n = y.shape[0]
    for i in range(n):
        w.state[i] = y[i]
        for j in range(n):
            J[i, j] = 0.0
    time = complex(t, 0.0)
    if w.column.shape[0] == 0:
        return rhs(time, w.state, w.slope, c, w)
    for place in range(w.column.shape[0]):
        j = w.column[place]
        w.state[j] = complex(y[j], STEP)
        status = rhs(time, w.state, w.slope, c, w)
        w.state[j] = y[j]
        if status != OK:
            return status
        for i in range(n):
            J[i, j] = w.slope[i].imag / STEP
    return OK


@kernel
def time_derivative(t, y, out, c, w):
    """out (n,) = partial d(dy/dt)/dt at fixed y, of the functions of time; returns a status code."""
    for i in range(y.shape[0]):
        w.state[i] = y[i]
    status = rhs(complex(t, STEP), w.state, w.slope, c, w)
    for i in range(y.shape[0]):
        out[i] = w.slope[i].imag / STEP
    return status


def _complex_array(array: Real | Index) -> Real:
    """A copy whose float64 fields are complex128."""
    return array.astype(_complex_type(array.dtype))


def _complex_type(dtype: np.dtype) -> np.dtype:
    if dtype.subdtype is not None:
        base, shape = dtype.subdtype
        return np.dtype((_complex_type(base), shape))
    if dtype.names is not None:
        return np.dtype([(name, _complex_type(dtype[name])) for name in dtype.names], align=True)
    return np.dtype(np.complex128) if dtype == np.float64 else dtype


def _columns(c: Constants, nq: int, nu: int) -> Index:
    """All places in y but those of work, prescribed coordinates with their speeds, and angles of unsprung wheels."""
    needed = np.ones(nq + nu, bool)
    prescribed = np.flatnonzero(c.speed["prescribed"] >= 0)
    needed[c.speed["coordinate"][prescribed]] = needed[nq + prescribed] = False
    needed[[wheel["q_index"] for wheel in c.wheel if c.speed["stiffness"][wheel["u_index"]] == 0.0]] = False
    return np.flatnonzero(needed)
