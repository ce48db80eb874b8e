"""Newton's method with the stiff part of the equations in place of their Jacobian: see `StiffKernels` in `problem`.

With sigma = 1/a and b = a^2, the equations (sigma - J) x = f of a method of Runge-Kutta are, for the coordinates and
speeds of J = [0 N; -M^-1 K N^-1  -M^-1 D],

    x_u = a (f_u - E^-1 (K z_q + D z_u)),    z_u = a f_u,    z_q = a (f_q + N z_u),    x_q = a (f_q + N x_u),

with E = M + a D + b K. What J leaves out makes corrections inexact, never the solution. Where Newton's method does not
converge at a state that was linearised just before, the Jacobian is used from then on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.integrate.control import copy
from flexmb.jit.kernel import helper
from flexmb.tables.status import OK

TIME, EXACT = range(2)  # entries of `numbers`


class StiffPlace(NamedTuple):
    """Where the stiff part was taken: y (n,), numbers (2,) the time, and whether the Jacobian is used instead; complex
    scratch z (n,), q (nq,), u (nu,).
    """

    y: np.ndarray
    numbers: np.ndarray
    z: np.ndarray
    q: np.ndarray
    u: np.ndarray


@helper
def stiff_place(n, coordinates, speeds):
    """For n components, of which the first are coordinates, then speeds."""
    return StiffPlace(
        np.zeros(n), np.zeros(2), np.zeros(n, np.complex128), np.zeros(coordinates, np.complex128),
        np.zeros(speeds, np.complex128),
    )  # fmt: skip


@helper
def begin_without_jacobian(problem, place):
    """Use the stiff part where the problem has one."""
    place.numbers[EXACT] = 0.0 if problem.separates else 1.0


@helper
def suffices(place):
    """Whether the stiff part is used in place of the Jacobian."""
    return place.numbers[EXACT] == 0.0


@helper
def give_up(place):
    """Use the Jacobian from now on; returns whether this is a change."""
    changed = place.numbers[EXACT] == 0.0
    place.numbers[EXACT] = 1.0
    return changed


@helper
def keep_place(place, rows):
    """Store the place in rows (k,n) that are those of J otherwise. Nothing depends on the work, the last component: its
    column of J is zero, and tells both apart."""
    last = place.y.shape[0] - 1
    copy(place.y, rows[0])
    rows[0, last], rows[1, last] = 1.0, place.numbers[TIME]


@helper
def recall_place(problem, place, rows):
    """Restore the place if it was stored, else use the Jacobian."""
    last = place.y.shape[0] - 1
    if problem.separates and rows[0, last] == 1.0:
        place.numbers[EXACT] = 0.0
        settle_at(problem, rows[1, last], rows[0], place)
    else:
        place.numbers[EXACT] = 1.0


@helper
def settle_at(problem, t, y, place):
    """Take the stiff part at (t, y); returns a status code."""
    copy(y, place.y)
    place.numbers[TIME] = t
    return problem.settle_at(t, y, problem.stiff)


@helper
def shift(problem, a, b, second):
    """Factorise E for these a and b; returns whether it has factors."""
    return problem.shift(complex(a), complex(b), second, problem.stiff) == OK


@helper
def answer(problem, a, second, x, place):
    """x (n,) := (1/a - J)^-1 x for the a of `shift`, with b = a^2."""
    nq, nu = place.q.shape[0], place.u.shape[0]
    for j in range(nu):
        place.u[j] = a * x[nq + j]
    problem.along(place.u, place.q, problem.stiff)
    for i in range(nq):
        place.q[i] = a * (x[i] + place.q[i])
    problem.restore(place.q, place.u, second, problem.stiff)
    for j in range(nu):
        place.u[j] = a * (x[nq + j] - place.u[j])
    problem.along(place.u, place.q, problem.stiff)
    for i in range(nq):
        x[i] = a * (x[i] + place.q[i])
    for j in range(nu):
        x[nq + j] = place.u[j]
    for i in range(nq + nu, x.shape[0]):
        x[i] *= a


@helper
def filtered(problem, a, b, x, place):
    """x (nu,) := (1 - a J_u - b J_q N)^-1 x for the a and b of `shift`: x less E^-1 (a D + b K N) x."""
    for j in range(x.shape[0]):
        place.u[j] = x[j]
    problem.along(place.u, place.q, problem.stiff)
    for i in range(place.q.shape[0]):
        place.q[i] *= b
    for j in range(x.shape[0]):
        place.u[j] *= a
    problem.restore(place.q, place.u, 0, problem.stiff)
    for j in range(x.shape[0]):
        x[j] -= place.u[j].real


@helper
def pulled_back(problem, y, moved, x, place):
    """x (nu,) := -E^-1 (K dq + D du) for the change of the state from y to `moved`."""
    nq = place.q.shape[0]
    for i in range(nq):
        place.q[i] = moved[i] - y[i]
    for j in range(x.shape[0]):
        place.u[j] = moved[nq + j] - y[nq + j]
    problem.restore(place.q, place.u, 0, problem.stiff)
    for j in range(x.shape[0]):
        x[j] = -place.u[j].real
