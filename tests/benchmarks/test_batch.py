"""Many copies of a scene at once, on one thread: per sample, against peers and against one copy at a time.

python -m pytest tests/benchmarks/test_batch.py --benchmark-columns=min,median
"""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.schema import Scene
from tests.benchmarks.must_hold.native import kernel
from tests.benchmarks.must_hold.row import Call, how_many_times
from tests.benchmarks.peers import aba_in_parallel
from tests.benchmarks.rivals import flexible_chain, rigid_chain

SAMPLES = 1024


def batch(scene: Scene, samples: int = SAMPLES) -> Call:
    """(call, samples per call, result): call() evaluates copies of the scene at its initial state, on one thread.

    result() gives the accelerations (samples, nu) of the last call.
    """
    system = fm.compile(scene)
    state, found = system.initial_state, list[np.ndarray]()
    q, u = (np.tile(each, (samples, 1)) for each in (state.q, state.u))

    def call() -> None:
        found[:] = [system.accelerations_batch(q, u, threads=1).accelerations]

    return Call(call, samples, lambda: found[0])


@pytest.mark.parametrize("bodies", [1, 10, 100])
def test_rigid_chain(benchmark, bodies):
    pytest.importorskip("pinocchio", reason="the rival is not installed: pip install flexmb[peers]")
    scene = rigid_chain(bodies)
    _timed(benchmark, batch(scene), aba_in_parallel(scene, SAMPLES))


@pytest.mark.parametrize("level", ["ruthless", "full"])
@pytest.mark.parametrize("modes", [2, 5, 10])
def test_flexible_chain(benchmark, modes, level):
    """Lanes against the scalar kernel."""
    scene = flexible_chain(10, modes, level)
    _timed(benchmark, batch(scene, 128), kernel(fm.compile(scene)))


def _timed(benchmark, native: Call, rival: Call) -> None:
    found = how_many_times(native, rival)
    benchmark.extra_info.update(ratio=round(found.value, 2), times=found.detail)
    benchmark.pedantic(native.call, rounds=20)
