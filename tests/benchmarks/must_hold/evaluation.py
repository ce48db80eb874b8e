"""One evaluation of the accelerations of a rigid chain: from Python, from compiled code, and in a batch."""

from __future__ import annotations

from functools import partial

import flexmb as fm
from tests.benchmarks import peers
from tests.benchmarks.must_hold.native import from_python, kernel
from tests.benchmarks.must_hold.row import Measured, Row, how_many_times
from tests.benchmarks.rivals import flexible_chain, rigid_chain
from tests.benchmarks.test_batch import SAMPLES, batch

PYTHON, KERNEL, BATCH = "Evaluation from Python", "Kernel", "Batch, per core"
CHAINS = f"{SAMPLES} copies of 10 bodies"
COPIES, STEPS = 128, 10  # of a rollout: long enough to hide what each copy costs at its start


def rows() -> list[Row]:
    """Revolute chains of N bodies with general axes."""
    from_outside = [("aba", n, goal) for n, goal in ((1, 1.3), (10, 2.6), (50, 3.3))]
    from_outside += [("forward", n, goal) for n, goal in ((10, 2.0), (100, 7.0))]
    names = {"aba": "pin.aba", "forward": "mj_forward"}
    return [
        *(
            Row(
                f"python_{peer}_{n}",
                PYTHON,
                f"{names[peer]}, {n} {'body' if n == 1 else 'bodies'}",
                goal,
                partial(_from_python, peer, n),
            )
            for peer, n, goal in from_outside
        ),
        *(
            Row(f"kernel_{n}", KERNEL, f"pin.abaInParallel on one thread, {n} bodies", 3.0, partial(_kernel, n))
            for n in (10, 50, 100)
        ),
        Row("batch_aba", BATCH, f"pin.aba, {CHAINS}", 20.0, partial(_batch, "aba")),
        Row("batch_parallel", BATCH, f"pin.abaInParallel, {CHAINS}", 14.0, partial(_batch, "parallel")),
        Row("batch_rollout", BATCH, "mujoco.rollout, Euler steps, 10 bodies", 10.0, partial(_batch, "rollout")),
        Row("batch_flexible", BATCH, "one copy at a time, 10 beams of 5 modes, ruthless", 3.5, _flexible_batch),
    ]


def _from_python(peer: str, bodies: int) -> Measured:
    scene = rigid_chain(bodies)
    rival = {"aba": peers.pinocchio_aba, "forward": peers.mujoco_forward}[peer](scene)
    return how_many_times(from_python(fm.compile(scene)), rival)


def _kernel(bodies: int) -> Measured:
    scene = rigid_chain(bodies)
    return how_many_times(kernel(fm.compile(scene)), peers.aba_in_parallel(scene, 512))


def _batch(peer: str) -> Measured:
    scene = rigid_chain(10)
    rival = {
        "aba": lambda: peers.pinocchio_aba(scene),
        "parallel": lambda: peers.aba_in_parallel(scene, SAMPLES),
        "rollout": lambda: peers.mujoco_rollout(scene, COPIES, STEPS),
    }[peer]()
    return how_many_times(batch(scene), rival)


def _flexible_batch() -> Measured:
    scene = flexible_chain(10, 5, "ruthless")
    return how_many_times(batch(scene, 256), kernel(fm.compile(scene)))
