"""A gate between Python and the kernel of an algorithm's accelerations: one call that checks, evaluates and checks.

Compiled once for all algorithms and scenes: the kernel behind it is called by address.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flexmb.jit.bundle import bundle
from flexmb.jit.direct import at_address, status_at
from flexmb.jit.kernel import helper, kernel
from flexmb.tables.arrays import SPEED_STATE
from flexmb.tables.soundness import SOUND, soundness
from flexmb.tables.status import OK
from flexmb.typing import Index, Real, Record

REFUSED, OVERFLOWN, DOUBTED = -1, -2, -3  # beside the status codes: arguments, results, pivots that may be rounding


@bundle
class Gate:
    """What passes the gate; speed and doubt are those of the workspace of the kernel behind it."""

    quaternions: Index  # (k,) where each starts in q
    y: Real  # (nq+nu+1,) [q, u, 0]
    rates: Real  # (nu,) udot
    speed: Record  # (nu,) SPEED_STATE, where the kernel leaves udot
    doubt: Index  # (1,)
    addresses: Index  # (3 or 4,) of the kernel, and of the bundles that it takes after t and y


def gate(quaternions: Index, nq: int, speed: Record, doubt: Index, addresses: Sequence[int]) -> Gate:
    """Of a workspace's arrays."""
    nu = len(speed)
    return Gate(quaternions, np.zeros(nq + nu + 1), np.zeros(nu), speed, doubt, np.array(addresses, np.int64))


_NOTHING = np.zeros(0, np.int64)
gate_at = at_address(gate(_NOTHING, 0, np.zeros(0, SPEED_STATE), _NOTHING, ()))


@kernel
def accelerations(address, t, q, u):
    """udot of q (nq,) and u (nu,) at t into the rates of the gate at an address; a status code, or one of the above."""
    g = gate_at(address)
    if not _admitted(t, q, u, g):
        return REFUSED
    function, c, w = g.addresses[0], g.addresses[1], g.addresses[2]
    if g.addresses.shape[0] == 3:
        return _left(status_at(function, (t, g.y, c, w)), g)
    return _left(status_at(function, (t, g.y, c, w, g.addresses[3])), g)


@helper
def _admitted(t, q, u, g):
    """Whether time and state can be used; they are in g.y then."""
    nq, nu = q.shape[0], u.shape[0]
    if nu != g.rates.shape[0] or nq + nu + 1 != g.y.shape[0] or not math.isfinite(t):
        return False
    for i in range(nq):
        g.y[i] = q[i]
    for j in range(nu):
        g.y[nq + j] = u[j]
    return soundness(g.y, g.quaternions) == SOUND


@helper
def _left(status, g):
    """The rates, and what is to be said of them."""
    if status != OK:
        return status
    for j in range(g.rates.shape[0]):
        g.rates[j] = g.speed[j].acceleration
    for j in range(g.rates.shape[0]):
        if not math.isfinite(g.rates[j]):
            return OVERFLOWN
    return DOUBTED if g.doubt[0] != 0 else OK
