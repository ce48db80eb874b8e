"""Eight runs at once: their differential equations and all that an integrator of lanes writes.

What is heavy is done in lanes; what decides, step sizes for example, is done for one lane after the other, on the same
numbers as arrays of floats. A lane whose state is no longer finite goes on as NaN and costs nothing more: who called
finds it, and runs it alone.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flexmb.integrate.control import EVALUATIONS
from flexmb.integrate.dop853_tableau import STAGES_DENSE
from flexmb.jit.bundle import AnyBundle, bundle
from flexmb.jit.kernel import helper, kernel, written_out
from flexmb.jit.lane_arrays import lane_zeros
from flexmb.jit.lanes import LANES, select
from flexmb.jit.pointer import NOTHING, STATUS, Pointer, pointer
from flexmb.typing import Real


@bundle
class LaneStages:
    """A step of LANES runs with states of n numbers."""

    in_lanes = True

    time: Real  # (1,LANES) s, of what is evaluated or projected
    trial: Real  # (n,LANES) the state that is evaluated or projected
    y: Real  # (n,LANES) where the step starts
    y_new: Real  # (n,LANES) where it ends
    k: Real  # (stages,n,LANES) slopes
    f: Real  # (7,n,LANES) coefficients of an interpolant
    h: Real  # (1,LANES) s, length of the step
    fraction: Real  # (1,LANES) of the step, where the interpolant is asked
    norm: Real  # (3,LANES) sums over the components of a state
    chosen: Real  # (1,LANES) 1 for lanes that go on, 0 for those that stay


class LaneEntries(NamedTuple):
    """The same numbers as arrays of floats, of which each lane reads and writes its own."""

    time: Real
    trial: Real
    y: Real
    y_new: Real
    k: Real
    h: Real
    fraction: Real
    norm: Real
    chosen: Real


class LaneProblem(NamedTuple):
    """y' = f(t, y) for LANES states y.

    rhs(stage, stages, constants, workspace) puts f of stages.trial into stages.k[stage] and returns a status code, OK
    unless no lane has a derivative; project(stages, constants) puts stages.trial back on its manifold.
    """

    rhs: Pointer
    project: Pointer
    stages: AnyBundle
    constants: AnyBundle
    workspace: AnyBundle


def lane_stages(n: int) -> LaneStages:
    """For states of n numbers; one per thread."""
    stages = STAGES_DENSE  # of the method that has most
    shapes = {"time": (1,), "k": (stages, n), "f": (7, n), "h": (1,), "fraction": (1,), "norm": (3,), "chosen": (1,)}
    shapes |= {name: (n,) for name in ("trial", "y", "y_new")}
    return LaneStages(**{name: lane_zeros(shape) for name, shape in shapes.items()})


def lane_entries(s: LaneStages) -> LaneEntries:
    """The same arrays."""
    return LaneEntries(*(getattr(s, name) for name in LaneEntries._fields))


def lane_problem(rhs: Any, project: Any, stages: LaneStages, constants: Any, workspace: Any) -> LaneProblem:
    """Of kernels and bundles."""
    return LaneProblem(
        pointer(rhs, STATUS, STATUS, stages, constants, workspace),
        pointer(project, NOTHING, stages, constants),
        AnyBundle(stages),
        AnyBundle(constants),
        AnyBundle(workspace),
    )


@written_out
def lane_derivative(problem, stage, counts):
    """The slope of this stage; returns a status code. counts (LANES,COUNTS)."""
    for lane in range(LANES):
        counts[lane, EVALUATIONS] += 1
    return problem.rhs(stage, problem.stages, problem.constants, problem.workspace)


@helper
def lane_copy(source, target):
    """target = source, of states."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@helper
def set_all(row, value):
    """The same number in all lanes of row (1,LANES)."""
    for lane in range(LANES):
        row[0, lane] = value


@helper
def any_chosen(entries):
    """Whether a lane is marked in entries.chosen."""
    total = 0.0
    for lane in range(LANES):
        total += entries.chosen[0, lane]
    return total > 0.0


@helper
def store_lane(values, lane, out):
    """out (n,) = that lane of values (n,LANES)."""
    for i in range(out.shape[0]):
        out[i] = values[i, lane]


@helper
def mark_finite(values, mark):
    """mark[0] = 1 for lanes whose values (n,) are all finite, 0 for others."""
    total = 0.0
    for i in range(values.shape[0]):
        total += values[i] - values[i]
    mark[0] = select(total == 0.0, 1.0, 0.0)


@kernel
def first_derivative(problem, s, entries, t, counts):
    """Put the states s.y on their manifold at time t and evaluate their slopes; returns a status code."""
    set_all(entries.time, t)
    lane_copy(s.y, s.trial)
    problem.project(problem.stages, problem.constants)
    lane_copy(s.trial, s.y)
    return lane_derivative(problem, 0, counts)
