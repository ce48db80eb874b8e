"""Forces that act beside those of a workspace, and the accelerations they add: what later right sides are solved in.

It stands beside the workspace whose sweeps hold the factors and the poses; nothing there is overwritten, hence the
factors of one forward dynamics serve as many responses as are asked for.
"""

from __future__ import annotations

import numpy as np

from flexmb.jain.forces import add_port_force
from flexmb.jain.ports import mode_motion
from flexmb.jit.bundle import bundle
from flexmb.jit.kernel import helper
from flexmb.spatial.spatial_vector import axpy6, scale6, shift_motion, vec6
from flexmb.spatial.vector import vec3
from flexmb.tables.arrays import Constants
from flexmb.typing import Real, Record

BODY_RESPONSE = np.dtype([
    ("force", np.float64, (6,)),  # z_r: minus the load on the body, with what its children hand on; body axes
    ("accel", np.float64, (6,)),  # of the body frame, body axes
])
MODE_RESPONSE = np.dtype([
    ("zf", np.float64),  # z_f: minus the load on the mode
    ("etadd", np.float64),
])


@bundle
class Response:
    """Accelerations that forces add, at the pose and with the factors that a workspace holds."""

    ground: Real  # (3,) zero: gravity is no part of a response
    body: Record  # (N,) BODY_RESPONSE
    mode: Record  # (N,m) MODE_RESPONSE
    speed: Real  # (nu,) generalised forces T, their innovations y, accelerations M^-1 T: each in place of the last


def response(c: Constants) -> Response:
    """A response of the right sizes, all zero."""
    n, m = c.mode.shape
    return Response(
        ground=np.zeros(3),
        body=np.zeros(n, BODY_RESPONSE),
        mode=np.zeros((n, m), MODE_RESPONSE),
        speed=np.zeros(len(c.speed)),
    )


@helper
def clear(c, x):
    """No forces, on bodies, modes or speeds."""
    for k in range(c.body.shape[0]):
        clear_body(c, x, k)
    for j in range(x.speed.shape[0]):
        x.speed[j] = 0.0


@helper
def clear_body(c, x, k):
    """No forces on body k and its modes."""
    for i in range(6):
        x.body[k].force[i] = 0.0
    for n in range(c.body[k].modes):
        x.mode[k, n].zf = 0.0


@helper
def read_speeds(x, y):
    """y (nu,) into x.speed."""
    for j in range(y.shape[0]):
        x.speed[j] = y[j]


@helper
def write_speeds(x, y):
    """x.speed into y (nu,)."""
    for j in range(y.shape[0]):
        y[j] = x.speed[j]


@helper
def push(c, w, x, k, port, F):
    """Add a load F = [tau; f] at a port of body k, body axes: A F with A = [Pi'; phi] of (14), (15)."""
    add_port_force(c, w, x, k, port, scale6(-1.0, F))


@helper
def port_response(c, w, x, k, port):
    """Acceleration of a port of body k that the forces cause, body axes."""
    A = shift_motion(vec6(x.body[k].accel, 0), vec3(w.port[port].r, 0))
    for n in range(c.body[k].modes):
        A = axpy6(x.mode[k, n].etadd, mode_motion(w, port, n), A)
    return A
