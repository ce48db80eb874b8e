"""Derivatives of the equations of motion along seven directions in one evaluation, exact to round-off.

The kernels of the recursion are compiled once more for a workspace whose numbers are duals (`flexmb.jit.duals`), which
carry derivatives along seven directions (forward differentiation). No differences are formed, so that nothing cancels.

y = [q, u, work] as in `flexmb.entry.articulated.rhs`. The constants must be those of the system (`System.constants`),
not `System.recursion_constants`, in which bodies may be reduced: here the modes of all bodies are eliminated
explicitly.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from flexmb.entry.articulated import slope
from flexmb.jit.bundle import bundle
from flexmb.jit.duals import DUAL, rate, seeded
from flexmb.jit.kernel import kernel
from flexmb.jit.wide_arrays import as_duals
from flexmb.tables.arrays import Constants, Workspace
from flexmb.tables.workspaces import workspace
from flexmb.typing import Index, Real


@bundle
class TangentWorkspace(Workspace):
    """A workspace whose numbers are duals, and further arrays."""

    numbers = DUAL

    time: Real  # (1,) s
    state: Real  # (nq+nu+1,) y
    slope: Real  # (nq+nu+1,) dy/dt
    column: Index  # (C,) indices in y of all but what is prescribed, or turns without springs


def tangent_workspace(c: Constants, nq: int, nu: int) -> TangentWorkspace:
    """The workspace of `time_derivative`; one per thread."""
    n = nq + nu + 1
    tables = workspace(c, nq, nu)
    return TangentWorkspace(
        **{field.name: as_duals(getattr(tables, field.name)) for field in fields(tables)},
        time=as_duals(np.zeros(1)),
        state=as_duals(np.zeros(n)),
        slope=as_duals(np.zeros(n)),
        column=_columns(c, nq, nu),
    )


@kernel
def time_derivative(t, y, out, c, w):
    """out (n,) = partial d(dy/dt)/dt at fixed y, of the functions of time; returns a status code."""
    w.time[0] = t
    w.time[0] = seeded(w.time[0], 0)
    for i in range(y.shape[0]):
        w.state[i] = y[i]
    status = slope(w.time[0], w.state, w.slope, c, w)
    for i in range(y.shape[0]):
        out[i] = rate(w.slope[i], 0)
    return status


def _columns(c: Constants, nq: int, nu: int) -> Index:
    """Indices in y of all but work, prescribed coordinates and speeds, and angles of wheels without springs."""
    needed = np.ones(nq + nu, bool)
    prescribed = np.flatnonzero(c.speed["prescribed"] >= 0)
    needed[c.speed["coordinate"][prescribed]] = needed[nq + prescribed] = False
    needed[[wheel["q_index"] for wheel in c.wheel if c.speed["stiffness"][wheel["u_index"]] == 0.0]] = False
    return np.flatnonzero(needed)
