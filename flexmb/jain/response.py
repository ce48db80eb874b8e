"""What the recursions of the innovations factorisation write: forces in, innovations and accelerations out.

It stands beside the workspace whose sweeps hold the factors and the poses; nothing there is overwritten, hence the
factors of one forward dynamics serve as many responses as are asked for.
"""

from __future__ import annotations

import numpy as np

from flexmb.jit.bundle import bundle
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
SPEED_RESPONSE = np.dtype([
    ("applied", np.float64),  # generalised force T
    ("innovation", np.float64),  # y = D^-1/2 (1 - H Psi K) T
    ("acceleration", np.float64),  # M^-1 T
])


@bundle
class Response:
    """Accelerations that forces add, at the pose and with the factors that a workspace holds."""

    ground: Real  # (3,) zero: gravity is no part of a response
    body: Record  # (N,) BODY_RESPONSE
    mode: Record  # (N,m) MODE_RESPONSE
    speed: Record  # (nu,) SPEED_RESPONSE


def response(c: Constants) -> Response:
    """A response of the right sizes, all zero."""
    n, m = c.mode.shape
    return Response(
        ground=np.zeros(3),
        body=np.zeros(n, BODY_RESPONSE),
        mode=np.zeros((n, m), MODE_RESPONSE),
        speed=np.zeros(len(c.speed), SPEED_RESPONSE),
    )
