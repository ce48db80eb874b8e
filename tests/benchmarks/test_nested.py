"""Frisch's equations against the recursion: one evaluation of the accelerations, called from Python.

python -m pytest tests/benchmarks/test_nested.py --benchmark-columns=min,median
"""

import numpy as np
import pytest

import flexmb as fm
from flexmb.entry import articulated
from flexmb.frisch import evaluation
from flexmb.frisch.nested_system import NestedSystem, nested_system
from tests.benchmarks.rivals import flexible_chain, interleaved, record, rigid_chain


def recursion(system: fm.System):
    """The articulated-body accelerations as a call without arguments."""
    y, workspace = _start(system), system.workspace()
    return lambda: articulated.accelerations(0.0, y, system.constants, workspace)


def nested(system: fm.System, route: NestedSystem | None = None):
    """Frisch's accelerations as a call without arguments."""
    route = route or system.nested()
    y, constants, workspace = _start(system), route.constants, route.workspace()
    return lambda: evaluation.accelerations(0.0, y, constants, workspace)


def _start(system: fm.System) -> np.ndarray:
    state = system.initial_state
    return np.concatenate([state.q, state.u, [0.0]])


@pytest.mark.parametrize("modes", [2, 5, 10])
def test_flexible_chain(benchmark, modes):
    """Ten bodies on deforming nodes; goal: below 60 us with 5 modes."""
    system = fm.compile(flexible_chain(10, modes, "linear"))
    times = interleaved(nested(system), recursion(system))
    record(benchmark, times[0], recursion=times[1])
    benchmark.pedantic(nested(system), rounds=20, iterations=100)


@pytest.mark.parametrize("bodies", [1, 2, 5, 10, 30, 100])
@pytest.mark.parametrize("modes", [0, 5])
def test_cost_of_bodies(benchmark, bodies, modes):
    """O(N^2) assembly and O(n^3) solution against O(N)."""
    system = fm.compile(flexible_chain(bodies, modes, "linear") if modes else rigid_chain(bodies))
    times = interleaved(nested(system), recursion(system))
    record(benchmark, times[0], recursion=times[1])
    benchmark.pedantic(nested(system), rounds=10, iterations=5)


@pytest.mark.parametrize("stage", ["rigid", "undeformed hinges", "all"])
def test_stages(benchmark, stage):
    """What the flags for null partitions save: `kept` computes them."""
    scene = rigid_chain(10)
    if stage != "rigid":
        scene = flexible_chain(10, 5, "linear", node="tip" if stage == "all" else "root")
    system = fm.compile(scene)
    skipped, kept = nested(system), nested(system, nested_system(scene, null_partitions=True))
    times = interleaved(skipped, kept)
    record(benchmark, times[0], kept=times[1])
    benchmark.pedantic(skipped, rounds=20, iterations=100)
