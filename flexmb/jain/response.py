"""Additional forces on a system, and the accelerations they cause: further right-hand sides for given factors of M.

A response is an array set of its own beside the workspace that holds the factors and the poses, and overwrites nothing
there, so that the factors of one forward dynamics serve any number of responses.
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
        ("force", np.float64, (6,)),  # z_r: minus the load on the body and, after a sweep, its children; body axes
        ("accel", np.float64, (6,)),  # of the body frame, body axes
    ]
)


@bundle
class Response:
    """Forces and the accelerations they cause, at the pose and with the factors in a workspace."""

    ground: Real  # (3,) zero: gravity is no part of a response
    body: Record  # (N,) BODY_RESPONSE
    zf: Real  # (N,m) z_f: minus the loads on modes
    etadd: Real  # (N,m)
    speed: Real  # (nu,) generalised forces T, then their innovations y, then accelerations M^-1 T


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
    """Set all forces on bodies, modes and speeds to zero."""
    clear_forces(c, x)
    for j in range(x.speed.shape[0]):
        x.speed[j] = 0.0


@helper
def clear_forces(c, x):
    """Set all forces on bodies and modes to zero; those on speeds stay."""
    for k in range(c.body.shape[0]):
        clear_body(c, x, k)


@helper
def clear_body(c, x, k):
    """Set the forces on body k and its modes to zero."""
    for i in range(6):
        x.body[k].force[i] = 0.0
    for n in range(c.body[k].modes):
        x.zf[k, n] = 0.0


@helper
def read_speeds(x, y):
    """Copy y (nu,) to x.speed."""
    for j in range(y.shape[0]):
        x.speed[j] = y[j]


@helper
def write_speeds(x, y):
    """Copy x.speed to y (nu,)."""
    for j in range(y.shape[0]):
        y[j] = x.speed[j]


@helper
def push(c, w, x, k, port, F):
    """Apply a load F = [torque; force] at a port of body k, body axes: A F with A = [Pi'; phi] of (14), (15)."""
    add_port_force(c, w, x, k, port, scale6(-1.0, F))


@helper
def port_response(c, w, x, k, port):
    """Acceleration of a port of body k that the forces cause, body axes."""
    A = shift_motion(vec6(x.body[k].accel, 0), vec3(w.port[port].r, 0))
    return sum6(A, moved_by_modes(c, w, x, k, port))
