"""Derivatives of the outputs that sensors use, exact to round-off, like those of `flexmb.entry.tangent`.

Rows are those of `flexmb.entry.observation.Outputs`: all of `every`, of which only accelerations, loads of hinges and
markers are computed and the others zero, then `drives`.
"""

from __future__ import annotations

from flexmb.entry.articulated import slope
from flexmb.entry.observation import Outputs, observe_free_motion, observe_markers, places
from flexmb.jit.bundle import bundle
from flexmb.jit.duals import DUAL, rate, seeded
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.lanes import LANES
from flexmb.jit.wide_arrays import as_duals
from flexmb.tables.status import OK


@bundle
class OutputsTangent(Outputs):
    """Outputs whose numbers are duals."""

    numbers = DUAL


def outputs_tangent(out: Outputs) -> OutputsTangent:
    """Dual outputs of the shapes and markers of `out`; one per thread."""
    every = as_duals(out.every)
    shapes = {name: getattr(out, name).shape for name in _PARTS}
    parts = {name: every[place].reshape(*shape, every.shape[-1]) for name, (place, shape) in places(shapes).items()}
    return OutputsTangent(
        marker_body=out.marker_body, marker_port=out.marker_port, drives=as_duals(out.drives), every=every, **parts
    )


_PARTS = ("rates", "markers", "loads", "wheel_loads", "energy", "momentum", "connectors", "hinge_forces")


@kernel
def observed_jacobian(t, y, J, c, w, out):
    """J (E+nu,n): derivatives of `every` (E,) and `drives` with respect to y = [q, u, work] (n,); returns a status.

    w is made by `flexmb.entry.tangent.tangent_workspace`. The values are in `out`.
    """
    columns = w.column.shape[0]
    w.time[0] = t
    for j in range(y.shape[0]):
        w.state[j] = y[j]
        for i in range(J.shape[0]):
            J[i, j] = 0.0
    for first in range(0, max(columns, 1), LANES):
        count = min(LANES, columns - first)
        for lane in range(count):
            j = w.column[first + lane]
            w.state[j] = seeded(w.state[j], lane)
        status = slope(w.time[0], w.state, w.slope, c, w)
        if status == OK:
            sense(c, w, out)
        for lane in range(count):
            j = w.column[first + lane]
            w.state[j] = y[j]
            read_outputs(J, j, lane, out)
        if status != OK:
            return status
    return OK


@helper
def sense(c, w, out):
    """The outputs that sensors use, after an evaluation of the right-hand side of the recursion with status OK."""
    observe_free_motion(c, w, out)
    observe_markers(c, w, out)


@helper
def read_outputs(J, j, lane, out):
    """Column j of a Jacobian: derivatives along the direction of this lane."""
    every = out.every.shape[0]
    for i in range(every):
        J[i, j] = rate(out.every[i], lane)
    for i in range(out.drives.shape[0]):
        J[every + i, j] = rate(out.drives[i], lane)
