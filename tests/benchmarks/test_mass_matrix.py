"""Composite against articulated bodies, and what the recursions around the mass matrix cost, one kernel call each.

python -m pytest tests/benchmarks/test_mass_matrix.py --benchmark-columns=min,median
"""

from functools import cache

import numpy as np
import pytest

import flexmb as fm
from flexmb.entry import articulated as entry
from flexmb.entry import composite, consistent, factorisation
from flexmb.jain.places import matrices
from flexmb.jain.response import response
from tests.benchmarks.rivals import flexible_chain, interleaved, record, rigid_chain
from tests.benchmarks.routes import IN_A_RUN, articulated, composite_body


@pytest.mark.parametrize("level", ["ruthless", "full"])
@pytest.mark.parametrize("modes", [1, 2, 5, 10, 20])
def test_ten_flexible_bodies(benchmark, modes, level):
    """Figure 2 of Jain & Rodriguez, measured; goal for composite_ratio: 4 at 5 modes, 7 at 10, 20 at 20.

    As evaluations follow each other in a run; ratio_from_python has the call of each in it.
    """
    system = fm.compile(flexible_chain(10, modes, level))
    recursion, rival = articulated(system), composite_body(system)
    times = interleaved(recursion.in_a_run, rival.in_a_run, recursion, rival)
    record(benchmark, times[0] / IN_A_RUN, composite=times[1] / IN_A_RUN)
    benchmark.extra_info["ratio_from_python"] = round(times[3] / times[2], 2)
    benchmark.extra_info["elimination"] = sorted(set(system.elimination.values()))
    benchmark.pedantic(recursion, rounds=20, iterations=10)


@pytest.mark.parametrize("modes", [0, 3])
@pytest.mark.parametrize("kernel", ["accelerations", "inverse", "consistent", "factorise", "solve", "half_solve"])
def test_cost_of_each_body(benchmark, kernel, modes):
    """O(N): time per body at N = 1000 over that at N = 10, goal at most 1.3; both in one interleaved run."""
    short, long = (_call(kernel, bodies, modes) for bodies in (10, 1000))
    times = interleaved(short, long)
    benchmark.extra_info["us_per_body_of_10"] = round(1e5 * times[0], 3)
    benchmark.extra_info["us_per_body_of_1000"] = round(1e3 * times[1], 3)
    benchmark.extra_info["ratio"] = round(times[1] / times[0] / 100.0, 2)
    benchmark.pedantic(short, rounds=20, iterations=10)


@pytest.mark.parametrize("bodies", [10, 30, 100])
@pytest.mark.parametrize("modes", [0, 5])
def test_one_right_side(benchmark, bodies, modes):
    """M^-1 b by recursion, factors included, against M by composite bodies and LAPACK."""
    system = _chain(bodies, modes)
    state, b = system.initial_state, np.ones(system.nu)
    times = interleaved(
        lambda: system.factorise(state).solve(b), lambda: np.linalg.solve(system.mass_matrix(state), b)
    )
    record(benchmark, times[0], dense=times[1])
    benchmark.pedantic(lambda: system.factorise(state), rounds=5)


@cache
def _chain(bodies, modes):
    return fm.compile(flexible_chain(bodies, modes, "full") if modes else rigid_chain(bodies))


def _call(kernel, bodies, modes):
    """A call without arguments at the scene's own state."""
    system = _chain(bodies, modes)
    state, c, w = system.initial_state, system.constants, system.workspace()
    y, rates, x = np.concatenate([state.q, state.u, [0.0]]), np.ones(system.nu), response(c)
    tau, loads, b = np.zeros(system.nu), np.zeros((bodies, 6)), np.ones((1, system.nu))
    factorisation.factorise(0.0, y, c, c, w)
    held = consistent.held_hinges(c, system.workspace())
    return {
        "accelerations": articulated(system),
        "inverse": lambda: entry.inverse_dynamics(0.0, y, rates, c, w, tau, loads),
        "consistent": lambda: consistent.consistent_accelerations(0.0, y, rates, c, *held),
        "factorise": lambda: factorisation.factorise(0.0, y, c, c, w),
        "solve": lambda: factorisation.solve(c, w, x, b),
        "half_solve": lambda: factorisation.half_solve(c, w, x, b),
    }[kernel]


@pytest.mark.parametrize("bodies", [1, 10, 100])
def test_mass_matrix(benchmark, bodies):
    """By composite bodies, in units of one inverse dynamics; by columns it would take one for each speed."""
    system = _chain(bodies, 5)
    state, c, w = system.initial_state, system.constants, system.workspace()
    y, M = np.concatenate([state.q, state.u, [0.0]]), np.zeros((system.nu, system.nu))
    tau, loads, m = np.zeros(system.nu), np.zeros((bodies, 6)), matrices(c)

    def native():
        composite.mass_matrix(0.0, y, c, w, m, M)

    times = interleaved(native, lambda: entry.inverse_dynamics(0.0, y, tau, c, w, tau, loads))
    benchmark.extra_info["speeds"] = system.nu
    benchmark.extra_info["inverse_dynamics"] = round(times[0] / times[1], 1)
    benchmark.pedantic(native, rounds=20)
