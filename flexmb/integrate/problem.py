"""Differential equations as integrators take them: functions and tables by address, so that each is compiled once."""

from __future__ import annotations

from typing import Any, NamedTuple

from flexmb.jit.bundle import AnyBundle
from flexmb.jit.pointer import MATRIX, NOTHING, REAL, STATUS, VECTOR, Pointer, pointer


class Problem(NamedTuple):
    """y' = f(t, y) for y (n,) on a manifold.

    rhs(t, y, dy, constants, workspace) puts f into dy and returns a status code; project(t, y, constants) puts y back
    on its manifold.
    """

    rhs: Pointer
    project: Pointer
    constants: AnyBundle
    workspace: AnyBundle


class StiffProblem(NamedTuple):
    """The same with its linearisation.

    jacobian(t, y, J, exact, tangent) puts df/dy (n,n) into J and returns a status code.
    move(y, increment, result, constants) puts y = [q, u, ...] with q o exp(increment) into result, for methods on Lie
    groups; increment (nu,).
    """

    rhs: Pointer
    project: Pointer
    constants: AnyBundle
    workspace: AnyBundle
    jacobian: Pointer
    move: Pointer
    exact: AnyBundle
    tangent: AnyBundle


def problem(rhs: Any, project: Any, constants: Any, workspace: Any) -> Problem:
    """Of kernels and bundles."""
    return Problem(
        pointer(rhs, STATUS, REAL, VECTOR, VECTOR, constants, workspace),
        pointer(project, NOTHING, REAL, VECTOR, constants),
        AnyBundle(constants),
        AnyBundle(workspace),
    )


def stiff_problem(
    rhs: Any, project: Any, constants: Any, workspace: Any, jacobian: Any, move: Any, exact: Any, tangent: Any
) -> StiffProblem:
    """Likewise."""
    return StiffProblem(
        *problem(rhs, project, constants, workspace),
        pointer(jacobian, STATUS, REAL, VECTOR, MATRIX, exact, tangent),
        pointer(move, NOTHING, VECTOR, VECTOR, VECTOR, constants),
        AnyBundle(exact),
        AnyBundle(tangent),
    )
