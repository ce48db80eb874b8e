"""What calls from Python cost besides the kernels: entries by address against numba's dispatcher, evaluators, runs.

python -m pytest tests/benchmarks/test_calls.py --benchmark-columns=min,median
"""

from time import perf_counter

import numpy as np
import pytest

import flexmb as fm
from flexmb.integrate.problem import Clock
from flexmb.integrate.settings import Settings
from flexmb.integrate.watch import nothing_watched
from flexmb.jit.direct import direct
from flexmb.jit.kernel import kernel
from flexmb.jit.pointer import REAL, STATUS, VECTOR
from flexmb.run.propagate import integration
from tests.benchmarks import routes
from tests.benchmarks.rivals import interleaved, record, rigid_chain


@kernel
def nothing(t, y, dy, c, w):
    return 0


def test_an_empty_kernel(benchmark):
    system = fm.compile(rigid_chain(1))
    y, tables = system.initial_state.y, (system.constants, system.workspace())
    call = direct(nothing, STATUS, REAL, VECTOR, VECTOR, *tables)
    times = interleaved(lambda: call(0.0, y, y), lambda: nothing(0.0, y, y, *tables))
    record(benchmark, times[0], dispatcher=times[1])
    benchmark.pedantic(call, (0.0, y, y), rounds=20, iterations=1000)


@pytest.mark.parametrize("bodies", [1, 10, 100])
def test_an_evaluation(benchmark, bodies):
    """`overhead_us`: of an evaluator, besides the kernel as compiled code calls it."""
    system = fm.compile(rigid_chain(bodies))
    state, evaluator, by_kernel = system.initial_state, system.evaluator(), routes.articulated(system)
    t, q, u = state.t, state.q, state.u
    times = interleaved(
        lambda: evaluator(t, q, u),
        by_kernel.in_a_run,
        by_kernel,
        lambda: system.accelerations(state),
        lambda: system.evaluate(t, q, u),
    )
    alone = times[1] / routes.IN_A_RUN
    record(benchmark, times[0], kernel=alone, dispatcher=times[2], accelerations=times[3], evaluate=times[4])
    benchmark.extra_info["overhead_us"] = round(1e6 * (times[0] - alone), 3)
    benchmark.pedantic(evaluator, (t, q, u), rounds=20, iterations=1000)


@pytest.mark.parametrize("samples", [2, 201])
@pytest.mark.parametrize("method", ["dop853", "rk4"])
def test_a_run_besides_its_steps(benchmark, method, samples):
    """`besides_us`, by the wall: another thread steps. The steps alone are timed in the same round."""
    system, settings = fm.compile(rigid_chain(10)), Settings(method, step=1.0 if method == "rk4" else None)
    times, accuracy = np.linspace(0.0, 1e-6, samples), settings.accuracy(system.nq, system.nu)
    out, counts = np.empty((samples, system.nq + system.nu + 1)), np.zeros(16, np.int64)
    options, memory = {"step": 1.0} if method == "rk4" else {}, settings.integrator.memory(len(out[0]))

    def whole() -> None:
        fm.simulate(system, 1e-6, method, samples=samples, **options)

    with integration(system, "articulated", 0.0, settings.integrator) as solve:

        def steps() -> None:
            counts[:] = 0
            solve(system.initial_state.y, Clock(times, times[-1:]), accuracy, out, counts, memory, nothing_watched())

        found = np.array([[_wall(whole), _wall(steps)] for _ in range(100)])
    besides = float(np.percentile(found[:, 0] - found[:, 1], 20))
    record(benchmark, float(np.percentile(found[:, 0], 20)), steps=float(np.percentile(found[:, 1], 20)))
    benchmark.extra_info["besides_us"] = round(1e6 * besides, 1)
    benchmark.pedantic(whole, rounds=20, iterations=5)


def _wall(call) -> float:
    start = perf_counter()
    call()
    return perf_counter() - start
