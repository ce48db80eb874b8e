"""Forces that act beside those of a workspace, and the accelerations they add: what later right sides are solved in.

It stands beside the workspace whose sweeps hold the factors and the poses; nothing there is overwritten, hence the
factors of one forward dynamics serve as many responses as are asked for.
"""

from __future__ import annotations

import numpy as np

from flexmb.jain.forces import add_port_force
from flexmb.jain.ports import moved_by_modes
from flexmb.jit.bundle import bundle
from flexmb.jit.kernel import helper
from flexmb.jit.strips import strip_zeros
from flexmb.spatial.spatial_vector import scale6, shift_motion, sum6, vec6
from flexmb.spatial.vector import vec3
from flexmb.tables.arrays import Constants
from flexmb.typing import Real, Record

BODY_RESPONSE = np.dtype(
    [
        ("force", np.float64, (6,)),  # z_r: minus the load on the body, with what its children hand on; body axes
        ("accel", np.float64, (6,)),  # of the body frame, body axes
    ]
)


@bundle
class Response:
    """Accelerations that forces add, at the pose and with the factors that a workspace holds."""

    ground: Real  # (3,) zero: gravity is no part of a response
    body: Record  # (N,) BODY_RESPONSE
    zf: Real  # (N,m) z_f: minus the loads on modes
    etadd: Real  # (N,m)
    speed: Real  # (nu,) generalised forces T, their innovations y, accelerations M^-1 T: each in place of the last


def response(c: Constants) -> Response:
    """A response of the right sizes, all zero."""
    n, _, m = c.mfr.shape
    return Response(
        ground=np.zeros(3),
        body=np.zeros(n, BODY_RESPONSE),
        zf=strip_zeros((n, m)),
        etadd=strip_zeros((n, m)),
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
        x.zf[k, n] = 0.0


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
    return sum6(A, moved_by_modes(c, w, x, k, port))
