"""Known steps of an explicit Runge-Kutta method forwards, with their stages, and their transposes backwards.

A step of size h with the stages Y_i and slopes k_i = f(Y_i), and the projection P, is

    Y_i = y + h sum_j a_ij k_j,    y+ = P(y + h sum_j b_j k_j).

For a scalar with the gradient g+ by y+, and F_i = df/dy at Y_i, the gradient g by y follows from the last stage to the
first (Hager 2000, Numerische Mathematik 87; Griewank & Walther, Evaluating Derivatives, 2nd ed., ch. 3 and 12):

    g+ := P'g+,    l_i = h (b_i g+ + sum_j>i a_ji m_j),    m_i = F_i' l_i,    g = g+ + sum_i m_i,

and its gradient by a number p is the sum of l_i . df/dp over all stages of all steps. This is the derivative of the
steps as they were taken: their sizes stay.
"""

from __future__ import annotations

from math import inf

import numpy as np

from flexmb.integrate.recorded import CONSTANTS, PROJECT, RHS, WORKSPACE
from flexmb.jit.bundle import bundle
from flexmb.jit.direct import nothing_at, status_at
from flexmb.jit.kernel import helper, kernel
from flexmb.tables.status import OK
from flexmb.typing import Index, Real

# Further indices in `Stages.address`: the kernels of `flexmb.sensitivity.adjoint.transposed`, and their tables.
TRANSPOSE, UNPROJECT, TABLES = range(4, 7)
ADDRESSES = 7


@bundle
class Stages:
    """The steps between two kept states, and the gradient that is carried backwards through them.

    S stages of the method; N steps of the part of the run; up to E steps at once.
    """

    address: Index  # (ADDRESSES,)
    a: Real  # (S+1,S), the last row b
    node: Real  # (S+1,)
    time: Real  # (N+1,) s
    limit: Index  # (N+1,) whether nothing is evaluated at that time before it is reached
    y: Real  # (n,) the state, forwards
    k: Real  # (S,n) slopes
    stage: Real  # (E,S+1,n), the last one y+ before its projection
    gradient: Real  # (n,) g
    pull: Real  # (n,) l_i
    moved: Real  # (S,n) m_i


@kernel
def forwards(first, stop, s):
    """Steps first .. stop from s.y; returns a status code."""
    count = s.k.shape[0]
    for i in range(first, stop):
        h = s.time[i + 1] - s.time[i]
        for j in range(count + 1):
            Y = s.stage[i - first, j]
            _combine(s.y, h, s.a[j], j, s.k, Y)
            if j < count:
                t = min(s.time[i] + s.node[j] * h, _latest(i, s))
                status = status_at(s.address[RHS], (t, Y, s.k[j], s.address[CONSTANTS], s.address[WORKSPACE]))
                if status != OK:
                    return status
        for m in range(s.y.shape[0]):
            s.y[m] = s.stage[i - first, count, m]
        nothing_at(s.address[PROJECT], (s.time[i + 1], s.y, s.address[CONSTANTS]))
    return OK


@kernel
def backwards(base, first, stop, s):
    """Steps stop-1 .. first backwards, whose stages are known from step `base` on; returns a status code."""
    count = s.k.shape[0]
    for i in range(stop - 1, first - 1, -1):
        h = s.time[i + 1] - s.time[i]
        unprojected = s.time[i + 1], s.stage[i - base, count], s.gradient, s.address[TABLES]
        nothing_at(s.address[UNPROJECT], unprojected)
        for j in range(count - 1, -1, -1):
            _pull(h, j, s)
            t = min(s.time[i] + s.node[j] * h, _latest(i, s))
            given = t, s.stage[i - base, j], s.pull, s.moved[j], s.address[TABLES]
            status = status_at(s.address[TRANSPOSE], given)
            if status != OK:
                return status
        for j in range(count):
            for m in range(s.y.shape[0]):
                s.gradient[m] += s.moved[j, m]
    return OK


@helper
def _latest(i, s):
    """The latest time (s) at which step i evaluates anything."""
    return np.nextafter(s.time[i + 1], s.time[i]) if s.limit[i + 1] else inf


@helper
def _combine(y, h, weights, count, k, result):
    """result = y + h * sum over j < count of weights[j] k[j]."""
    n = y.shape[0]
    for m in range(n):
        result[m] = 0.0
    for j in range(count):
        if weights[j] != 0.0:
            for m in range(n):
                result[m] += weights[j] * k[j, m]
    for m in range(n):
        result[m] = y[m] + h * result[m]


@helper
def _pull(h, j, s):
    """l_j = h (b_j g+ + sum over i > j of a_ij m_i)."""
    count, n = s.k.shape[0], s.y.shape[0]
    for m in range(n):
        s.pull[m] = s.a[count, j] * s.gradient[m]
    for i in range(j + 1, count):
        if s.a[i, j] != 0.0:
            for m in range(n):
                s.pull[m] += s.a[i, j] * s.moved[i, m]
    for m in range(n):
        s.pull[m] *= h
