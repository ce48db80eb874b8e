"""Eight runs at once: their differential equations, and the arrays of an integrator of lanes.

Expensive computations are done in SIMD lanes. Decisions, such as step sizes, are made for each lane separately, on the
same memory as arrays of floats. A lane whose state is not finite any more continues with NaN at no cost; the caller
detects it and runs it separately.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from flexmb.integrate.control import EVALUATIONS, copy
from flexmb.integrate.dop853_tableau import STAGES_DENSE
from flexmb.jit.bundle import AnyBundle, bundle
from flexmb.jit.kernel import helper, kernel, written_out
from flexmb.jit.lanes import LANE, LANES, select
from flexmb.jit.pointer import STATUS, VOID, Pointer, pointer
from flexmb.jit.wide_arrays import wide_zeros
from flexmb.typing import Index, Real


@bundle
class LaneStages:
    """A step of LANES runs with states of n numbers."""

    numbers = LANE

    time: Real  # (1,LANES) s, at which a state is evaluated or projected
    trial: Real  # (n,LANES) the state that is evaluated or projected
    y: Real  # (n,LANES) where the step starts
    y_new: Real  # (n,LANES) where it ends
    k: Real  # (stages,n,LANES) slopes
    f: Real  # (7,n,LANES) coefficients of an interpolant
    h: Real  # (1,LANES) s, length of the step
    fraction: Real  # (1,LANES) of the step, at which the interpolant is evaluated
    norm: Real  # (3,LANES) sums over the components of a state
    chosen: Real  # (1,LANES) 1 for lanes that accept the step, 0 for others
    stage: Index  # (1,) index of the slope that is evaluated


@bundle
class LaneEntries:
    """The same memory as arrays of floats, so that single lanes can be read and written."""

    time: Real
    trial: Real
    y: Real
    y_new: Real
    k: Real
    h: Real
    fraction: Real
    norm: Real
    chosen: Real
    doubt: Index  # (1,) that of the workspace


class LaneProblem(NamedTuple):
    """y' = f(t, y) for LANES states y.

    rhs(stages, constants, workspace) puts f of stages.trial into stages.k[stages.stage[0]] and returns a status code,
    OK unless no lane has a derivative; project(stages, manifold) puts stages.trial back on its manifold.
    """

    rhs: Pointer
    project: Pointer
    stages: AnyBundle
    constants: AnyBundle
    workspace: AnyBundle
    manifold: AnyBundle


def lane_stages(n: int) -> LaneStages:
    """Arrays for states of n numbers; each thread needs its own."""
    stages = STAGES_DENSE  # the largest number of any method
    shapes = {"time": (1,), "k": (stages, n), "f": (7, n), "h": (1,), "fraction": (1,), "norm": (3,), "chosen": (1,)}
    shapes |= {name: (n,) for name in ("trial", "y", "y_new")}
    return LaneStages(**{name: wide_zeros(shape) for name, shape in shapes.items()}, stage=np.zeros(1, np.int64))


def lane_entries(s: LaneStages, doubt: Index) -> LaneEntries:
    """The arrays of s as floats, and `doubt` (1,) of a workspace."""
    names = [field.name for field in fields(LaneEntries) if field.name != "doubt"]
    return LaneEntries(**{name: getattr(s, name) for name in names}, doubt=doubt)


def lane_problem(rhs: Any, project: Any, stages: LaneStages, constants: Any, workspace: Any) -> LaneProblem:
    """A `LaneProblem` from kernels and bundles."""
    return LaneProblem(
        pointer(rhs, STATUS, stages, constants, workspace),
        pointer(project, VOID, stages, constants),
        AnyBundle(stages),
        AnyBundle(constants),
        AnyBundle(workspace),
        AnyBundle(constants),
    )


@written_out
def lane_derivative(problem, s, stage, counts):
    """Evaluate the slope of this stage; returns a status code. counts (LANES,COUNTS)."""
    for lane in range(LANES):
        counts[lane, EVALUATIONS] += 1
    s.stage[0] = stage
    return problem.rhs(problem.stages, problem.constants, problem.workspace)


@helper
def set_all(row, value):
    """Set all lanes of row (1,LANES) to the same value."""
    for lane in range(LANES):
        row[0, lane] = value


@helper
def any_chosen(entries):
    """Whether any lane is marked in entries.chosen."""
    total = 0.0
    for lane in range(LANES):
        total += entries.chosen[0, lane]
    return total > 0.0


@helper
def store_lane(values, lane, out):
    """out (n,) = one lane of values (n,LANES)."""
    for i in range(out.shape[0]):
        out[i] = values[i, lane]


@helper
def mark_finite(values, mark):
    """mark[0] = 1 for lanes whose values (n,) are all finite, 0 for others."""
    total = 0.0
    for i in range(values.shape[0]):
        total += values[i] - values[i]
    mark[0] = select(total == 0.0, 1.0, 0.0)


@helper
def project_start(problem, s, entries, t):
    """Project the states s.y to their manifold at time t."""
    set_all(entries.time, t)
    copy(s.y, s.trial)
    problem.project(problem.stages, problem.manifold)
    copy(s.trial, s.y)


@kernel
def first_derivative(problem, s, entries, t, counts):
    """Project the states s.y to their manifold at time t and evaluate their slopes; returns a status code."""
    project_start(problem, s, entries, t)
    return lane_derivative(problem, s, 0, counts)
