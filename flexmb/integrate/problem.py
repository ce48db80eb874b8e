"""The input of an integrator: a differential equation, output times and accuracy.

Functions and tables are passed by address, so that each integrator is compiled only once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from flexmb.jit.bundle import AnyBundle
from flexmb.jit.kernel import kernel
from flexmb.jit.pointer import COMPLEX, COMPLEX_VECTOR, MATRIX, REAL, STATUS, VECTOR, VOID, WHOLE, Pointer, pointer
from flexmb.tables.status import NOT_CONVERGED


class Problem(NamedTuple):
    """y' = f(t, y) for y (n,) on a manifold.

    rhs(t, y, dy, constants, workspace) puts f into dy and returns a status code; project(t, y, constants) projects y to
    its manifold. If a step fails, back(y, constants) puts the last good state into y and returns its time, from which
    leap(end, y, dy, y_new, dy_new, constants) may continue: see `flexmb.integrate.leap`.
    """

    rhs: Pointer
    project: Pointer
    constants: AnyBundle
    workspace: AnyBundle
    back: Pointer
    leap: Pointer


class StiffProblem(NamedTuple):
    """A `Problem` with its linearisation.

    jacobian(t, y, J, exact, tangent) puts df/dy (n,n) into J and returns a status code.
    move(y, increment, result, constants) puts y = [q, u, ...] with q o exp(increment) into result, for methods on Lie
    groups; increment (nu,). resolve(y, u, x, how, constants) resolves x (nu,) between the axes of speeds u (nu,) and
    those of increments, in place: see `flexmb.tables.axes`. settles: whether `project` displaces stiff components: see
    `flexmb.integrate.settling`. separates: whether the functions of `StiffKernels` exist, with its tables in `stiff`:
    Newton's method may then do without the Jacobian, see `flexmb.integrate.stiff_place`.
    """

    rhs: Pointer
    project: Pointer
    constants: AnyBundle
    workspace: AnyBundle
    back: Pointer
    leap: Pointer
    jacobian: Pointer
    move: Pointer
    resolve: Pointer
    exact: AnyBundle
    tangent: AnyBundle
    settles: bool
    separates: bool
    settle_at: Pointer
    shift: Pointer
    along: Pointer
    restore: Pointer
    stiff: AnyBundle


class Clock(NamedTuple):
    """times (T,) s: output times, increasing; the first is the start of the run and the last is its end.

    segment_ends (S,) s, increasing: no step crosses one, and stages before one use the right-hand side's limit from the
    left. The last is the end of the run, times[-1], which is repeated if a segment would end there in a longer run too;
    for methods of equal steps it is infinite, because the end of a run need not end a segment. farthest (s): time up to
    which a leap over a singular position may pass the end of the run.
    """

    times: np.ndarray
    segment_ends: np.ndarray
    farthest: float = -math.inf


class Accuracy(NamedTuple):
    """How a state y (n,) = [q (coordinates,), u, quadratures] is integrated; every method uses the entries it needs.

    rtol, atol    a norm divides component i by atol + rtol |y_i|
    controlled    number of first components that enter a norm. The others are quadratures (work), on which nothing
                  depends; they have no scale of their own to compare `atol` with, and are as smooth as the state, so
                  that the same steps integrate them as accurately
    max_steps     accepted and rejected together
    step          s, upper bound of the steps of methods that take equal ones
    radius        spectral radius at infinite frequency of generalised-alpha
    coordinates   number of entries of q, for methods of second-order equations
    """

    rtol: float
    atol: float
    controlled: int
    max_steps: int
    step: float = 0.0
    radius: float = 1.0
    coordinates: int = 0


class Leaping(NamedTuple):
    """Kernels `back` and `leap` of a `Problem` that can continue after a step has failed at a singular position.

    beside(t, y, dy, constants) evaluates slopes near singular positions, where `leap` does, for a closed loop around
    the problem; returns a status code. watch_steps(constants, shorter) prepares it for a method without error
    estimates: steps that are too long to resolve a singular position then fail, if it can take `shorter` ones.
    noticed(constants): where such steps were taken nevertheless, (end of the worst one (s), index of the closure), or
    None.
    """

    back: Any
    leap: Any
    beside: Any
    watch_steps: Callable[[Any, bool], None]
    noticed: Callable[[Any], tuple[float, int] | None]


class StiffKernels(NamedTuple):
    """Kernels for equations M udot = f of which the stiff part of f, -K (q - q0) - D (u - u0), is known; their tables.

    settle_at(t, y, tables) takes K, D, M and N = dqdot/du there; returns a status code. shift(a, b, second, tables)
    factorises M + a D + b K, as the first or the second of two matrices; returns a status code. along(u, q, tables)
    puts N u into q (nq,). restore(q, u, second, tables) replaces u (nu,) by (M + a D + b K)^-1 (K q + D u). Numbers are
    complex.
    """

    settle_at: Any
    shift: Any
    along: Any
    restore: Any
    tables: Any


class Linear(NamedTuple):
    """What a `StiffProblem` has in addition to a `Problem`: kernels jacobian, move, resolve, bundles exact, tangent."""

    jacobian: Any
    move: Any
    resolve: Any
    exact: Any
    tangent: Any
    settles: bool = False
    stiff: StiffKernels | None = None


@kernel
def _no_settling(t, y, tables):
    return NOT_CONVERGED


@kernel
def _no_shift(a, b, second, tables):
    return NOT_CONVERGED


@kernel
def _no_motion(u, q, tables):
    pass


@kernel
def _no_answer(q, u, second, tables):
    pass


@kernel
def _no_way_back(y, constants):
    return -math.inf


@kernel
def _no_leap(end, y, dy, y_new, dy_new, constants):
    return 0.0


def problem(rhs: Any, project: Any, constants: Any, workspace: Any, leaping: Leaping | None = None) -> Problem:
    """A `Problem` from kernels and bundles; without `leaping`, no leap is possible after a step has failed."""
    anything = AnyBundle._numba_type_
    back, leap = leaping[:2] if leaping else (_no_way_back, _no_leap)
    known = constants if leaping else anything
    return Problem(
        pointer(rhs, STATUS, REAL, VECTOR, VECTOR, constants, workspace),
        pointer(project, VOID, REAL, VECTOR, constants),
        AnyBundle(constants),
        AnyBundle(workspace),
        pointer(back, REAL, VECTOR, known),
        pointer(leap, REAL, REAL, VECTOR, VECTOR, VECTOR, VECTOR, known),
    )


def stiff_problem(
    rhs: Any, project: Any, constants: Any, workspace: Any, linear: Linear, leaping: Leaping | None = None
) -> StiffProblem:
    """A `StiffProblem` from kernels and bundles, see `problem`."""
    jacobian, move, resolve, exact, tangent, settles, stiff = linear
    nothing = StiffKernels(_no_settling, _no_shift, _no_motion, _no_answer, exact)
    settle_at, shift, along, restore, tables = stiff or nothing
    known = tables if stiff else AnyBundle._numba_type_
    return StiffProblem(
        *problem(rhs, project, constants, workspace, leaping),
        pointer(jacobian, STATUS, REAL, VECTOR, MATRIX, exact, tangent),
        pointer(move, VOID, VECTOR, VECTOR, VECTOR, constants),
        pointer(resolve, VOID, VECTOR, VECTOR, VECTOR, WHOLE, constants),
        AnyBundle(exact),
        AnyBundle(tangent),
        settles,
        stiff is not None,
        pointer(settle_at, STATUS, REAL, VECTOR, known),
        pointer(shift, STATUS, COMPLEX, COMPLEX, WHOLE, known),
        pointer(along, VOID, COMPLEX_VECTOR, COMPLEX_VECTOR, known),
        pointer(restore, VOID, COMPLEX_VECTOR, COMPLEX_VECTOR, WHOLE, known),
        AnyBundle(tables),
    )
