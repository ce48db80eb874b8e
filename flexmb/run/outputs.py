"""Makes a trajectory from an integrator's result: all observables at the samples reached, and how the run ended."""

from __future__ import annotations

from itertools import repeat
from time import perf_counter

from flexmb.integrate.control import ACCEPTED, EVALUATIONS, FACTORISATIONS, JACOBIANS, REJECTED
from flexmb.run.observing import PATIENCE, observe
from flexmb.run.propagate import Integration, Raw
from flexmb.run.provenance import with_drives
from flexmb.run.run_arrays import Statistics, fitting, told
from flexmb.run.total_loads import total_load
from flexmb.run.trajectory import Trajectory, gathered
from flexmb.system.algorithm import Algorithm
from flexmb.system.system import System
from flexmb.tables.state import DynamicsError, NotFiniteError
from flexmb.tables.status import Status
from flexmb.typing import Real

CHEAPER = 0.05
"""Samples that are evaluated at first, over the evaluations of the motion for which there is time between two looks at
the keyboard: the outputs of a state take no longer than ten of these."""


def observed(system: System, times: Real, raw: Raw, algorithm: Algorithm, solve: Integration) -> Trajectory:
    """The trajectory of an integration by `solve`: all observables at the samples reached, a subset of `times`."""
    start = perf_counter()
    many = int(CHEAPER * PATIENCE * raw.counts[EVALUATIONS] / raw.run_s) if raw.run_s else 1
    rows, trouble = observe(solve.feedback or system, algorithm, times, raw.states, solve.batch, max(1, many))
    status, stopped_at, message = raw.status, raw.t, ending(system, raw.status, raw.fault, raw.t)
    if trouble is not None and not (isinstance(trouble, NotFiniteError) and status is not Status.OK):
        status, stopped_at = _why(trouble), float(times[len(rows)])
        message = f"stopped at t = {stopped_at:g} s" + (
            f", while outputs were evaluated: {status.advice}" if status is Status.INTERRUPTED else f": {trouble}"
        )
    doubt = doubt_about(system, solve)
    if status is Status.OK and doubt is not None:
        message = f"{message}; {doubt}"
    states = raw.states[: len(rows)]
    signals, power = ({}, {}) if solve.feedback is None else solve.feedback.course(times, states)
    q_names, u_names = system.state_names
    parts = dict(
        scene=system.scene.name,
        status=status,
        message=message,
        stopped_at=stopped_at,
        t=times[: len(rows)],
        q=states[:, : system.nq],
        u=states[:, system.nq : system.nq + system.nu],
        q_names=q_names,
        u_names=u_names,
        **gathered(system.observation, rows),
        total_loads={},
        work=states[:, -1],
        signals=signals,
        power=power,
        statistics=Statistics(
            evaluations=raw.counts[EVALUATIONS],
            accepted_steps=raw.counts[ACCEPTED],
            rejected_steps=raw.counts[REJECTED],
            jacobians=raw.counts[JACOBIANS],
            factorisations=raw.counts[FACTORISATIONS],
            compile_s=raw.compile_s,
            run_s=raw.run_s,
            output_s=perf_counter() - start,
        ),
    )
    run = fitting(Trajectory, parts)
    return told(run, total_loads=_total_loads(run, system)) if system.scene.total_loads else run


def _total_loads(run: Trajectory, system: System) -> dict[str, Real]:
    """The sums of loads that the scene names (T,6), of a run without events."""
    return {
        total.name: total_load(
            run, with_drives(run, repeat(system, len(run.t))), total.joints, total.body, (total.body, total.node)
        )
        for total in system.scene.total_loads
    }


def _why(trouble: DynamicsError | KeyboardInterrupt) -> Status:
    """The status of a run whose outputs cannot be evaluated. This happens where the integration did not fail because
    squares overflow earlier than the state itself, and because fixed steps may pass over a singular mass matrix."""
    if isinstance(trouble, KeyboardInterrupt):
        return Status.INTERRUPTED
    return Status.NONFINITE if isinstance(trouble, NotFiniteError) else Status.NOT_POSITIVE_DEFINITE


def doubt_about(system: System, solve: Integration) -> str | None:
    """A warning if steps were too long for a singular position near which the run passed without failing."""
    if solve.noticed is None:
        return None
    t, fault = solve.noticed
    return (
        f"the step to t = {t:g} s was too long, or gaps too wide, for a singular position near it of closure "
        f'"{system.fault_name(Status.BRANCH_UNKNOWN, fault)}": branches of the motion nearly meet there, and from then '
        'on it may be on a wrong one or have another energy; use a shorter step, or "dop853" without stabilise'
    )


def ending(system: System, status: Status, fault: int, t: float) -> str:
    """How a run ended at t (s), in words; fault: the index of the item at which an evaluation failed."""
    if status is Status.OK:
        return f"finished at t = {t:g} s"
    return f"stopped at t = {t:g} s: " + status.advice.format(body=f'"{system.fault_name(status, fault)}"')
