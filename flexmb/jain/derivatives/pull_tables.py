"""The arrays of a row of virtual speeds times the derivatives of inverse dynamics."""

from __future__ import annotations

import numpy as np

from flexmb.jain.response import Response, response
from flexmb.jit.bundle import bundle
from flexmb.jit.lanes import LANES
from flexmb.jit.strips import strip_zeros
from flexmb.tables.arrays import Constants
from flexmb.typing import Real

# Rows of `body` and `port`, six each, World axes about the base point. W: virtual velocity. G2, G1, G0: what a unit of
# s2, s1 and s0 of a body or port does to the virtual power of it and of all that it carries. W_HINGE: W of the hinge
# point O of a body, which differs from that of the body where the modes move O in it.
W, G2, G1, G0, W_HINGE, PULLED_ROWS = 0, 6, 12, 18, 24, 30
# Columns of `spring`: derivatives by stiffness, damping, rest and armature of a speed.
STIFFNESS, DAMPING, REST, ARMATURE, SPRING_COLUMNS = 0, 1, 2, 3, 4


@bundle
class Pulled:
    """Virtual speeds, and what they pull: rows of derivatives. One set per thread."""

    virtual: Response  # its `speed` are the virtual speeds, in the order of u
    body: Real  # (N,PULLED_ROWS)
    port: Real  # (P,PULLED_ROWS)
    row: Real  # (2nu,) by displacements, then by speeds, in the order of places
    square: Real  # (n,n) of rates of quaternions; (0,0) without
    # by constants, added up over evaluations:
    rigid: Real  # (N,10) of rigid bodies
    placement: Real  # (N,6) displacements and turns of inboard frames that no mode moves, axes of the parent
    spring: Real  # (nu,SPRING_COLUMNS)
    gravity: Real  # (3,)


def pulled(c: Constants, nq: int, nu: int) -> Pulled:
    """Arrays of the right sizes, all zero."""
    n = nq + nu + 1 if np.any(c.body["quaternion"] >= 0) else 0
    return Pulled(
        virtual=response(c),
        body=np.zeros((len(c.body), PULLED_ROWS)),
        port=np.zeros((len(c.port), PULLED_ROWS)),
        row=strip_zeros((2 * nu + LANES,)),
        square=np.zeros((n, n)),
        rigid=np.zeros((len(c.body), 10)),
        placement=np.zeros((len(c.body), 6)),
        spring=np.zeros((nu, SPRING_COLUMNS)),
        gravity=np.zeros(3),
    )
