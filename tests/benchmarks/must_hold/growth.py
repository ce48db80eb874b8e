"""Time per body of large trees over that of small ones: the recursion is O(N)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

import flexmb as fm
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from tests.benchmarks.must_hold.native import kernel
from tests.benchmarks.must_hold.row import Call, Measured, Row, duration, measured
from tests.benchmarks.rivals import turns
from tests.benchmarks.routes import articulated

GROUP = "Time per body, large trees over small ones"
PARENTS: dict[str, Callable[[int], int]] = {
    "chain": lambda k: k - 1,
    "star": lambda k: -1,
    "binary tree": lambda k: (k - 1) // 2 if k else -1,
}


def rows() -> list[Row]:
    """By the recursion; rigid bodies on revolute hinges."""
    ends = [("chain", 10, 1000, 1.2), *((tree, 1000, 100_000, 1.3) for tree in PARENTS)]
    return [
        Row(
            f"growth_{tree.replace(' ', '_')}_{few}_{many}", GROUP, f"{tree}, {many:,} over {few:,} bodies", goal,
            partial(_growth, tree, few, many), "at most",
        )
        for tree, few, many, goal in ends
    ]  # fmt: skip


def rigid_tree(tree: str, bodies: int) -> Scene:
    """Rigid bodies on revolute hinges, joined as PARENTS says; -1 is the ground."""
    rng, parent = np.random.default_rng(bodies), PARENTS[tree]
    scene = SceneBuilder(f"{tree} of {bodies}", gravity=(0.0, 0.0, -9.81))
    axes, places = rng.standard_normal((2, bodies, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    rates = rng.uniform(-1.0, 1.0, bodies)
    for k in range(bodies):
        scene.rigid_body(f"b{k}", mass=1.0, com=(0.1, 0.2, 0.0), inertia=np.diag([0.08, 0.06, 0.12]))
        inboard = "ground" if parent(k) < 0 else f"b{parent(k)}"
        scene.revolute(f"h{k}", inboard, f"b{k}", axis=axes[k], parent_position=0.5 * places[k], rate=rates[k])
    return scene.scene()


def _growth(tree: str, few: int, many: int) -> Measured:
    calls = [_once(rigid_tree(tree, bodies)) for bodies in (few, many)]
    seconds = turns(*(call.call for call in calls))
    seconds /= [call.samples * bodies for call, bodies in zip(calls, (few, many), strict=True)]
    short, long = np.median(seconds, axis=0)
    return measured(seconds[:, 1] / seconds[:, 0], f"{duration(long)} against {duration(short)} a body")


def _once(scene: Scene) -> Call:
    """Short chains in a loop, so that the call from Python does not count; long ones once."""
    system = fm.compile(scene)
    return kernel(system) if len(scene.bodies) < 1000 else Call(articulated(system), 1, lambda: np.zeros(0))
