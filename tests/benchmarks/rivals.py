"""Interleaved timing: rivals take turns, so that a busy machine slows both; time that others had does not count.

Processor time of the process, not of the thread: `simulate` runs compiled code in a thread of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Modes, Scene
from flexmb.scene.shapes import beam_section

SAMPLE_S = 0.01  # a sample shorter than this measures the clock and the scheduler
ROUNDS = 15

Ends = Literal["clamped-free", "free-free"]


def interleaved(*rivals: Callable[[], object]) -> list[float]:
    """Seconds per call of each rival: 20th percentile of ROUNDS samples, each of at least SAMPLE_S, taken in turns."""
    return np.percentile(turns(*rivals), 20, axis=0).tolist()


def turns(*rivals: Callable[[], object], rounds: int = ROUNDS) -> np.ndarray:
    """(rounds, rivals) seconds per call, a row for each round; a sample takes at least SAMPLE_S."""
    repeats = []
    for rival in rivals:
        rival()
        start = process_time()
        rival()
        repeats.append(max(1, int(SAMPLE_S / max(process_time() - start, 1e-7))))
    samples = np.empty((rounds, len(rivals)))
    for row in samples:
        for i, (rival, repeat) in enumerate(zip(rivals, repeats, strict=True)):
            start = process_time()
            for _ in range(repeat):
                rival()
            row[i] = (process_time() - start) / repeat
    return samples


def record(benchmark, native: float, **rivals: float) -> None:
    """Put the times (us) and the ratios rival / native into the benchmark's report."""
    benchmark.extra_info["native_us"] = round(1e6 * native, 3)
    for name, seconds in rivals.items():
        benchmark.extra_info[f"{name}_us"] = round(1e6 * seconds, 3)
        benchmark.extra_info[f"{name}_ratio"] = round(seconds / native, 2)


def rigid_chain(bodies: int) -> Scene:
    """Serial chain of rigid bodies on revolute hinges with general axes."""
    rng = np.random.default_rng(bodies)
    scene = SceneBuilder(f"chain of {bodies}", gravity=(0.0, 0.0, -9.81))
    for k in range(bodies):
        axis, turn = Rotation.random(2, rng)
        inertia = turn.as_matrix() @ np.diag([0.02, 0.03, 0.04]) @ turn.as_matrix().T
        scene.rigid_body(f"b{k}", mass=1.0, com=0.2 * rng.standard_normal(3), inertia=0.5 * (inertia + inertia.T))
        scene.revolute(
            f"h{k}",
            "ground" if k == 0 else f"b{k - 1}",
            f"b{k}",
            axis=axis.apply((0.0, 0.0, 1.0)),
            parent_position=0.5 * rng.standard_normal(3),
            angle=rng.uniform(-1.0, 1.0),
            rate=rng.uniform(-1.0, 1.0),
        )
    return scene.scene()


def flexible_chain(bodies: int, modes: int, level: str, node: str = "tip", boundary: Ends = "clamped-free") -> Scene:
    """Serial chain of beams, each hinged at its root to `node` of the one before; modes clamped there or free-free."""
    scene = SceneBuilder(f"{bodies} beams of {modes} modes", gravity=(0.0, 0.0, -9.81))
    section = beam_section(E=7e10, G=2.7e10, A=1e-3, Iy=2e-7, Iz=1e-7, rho=2700.0)
    for k in range(bodies):
        shapes = Modes(count=modes, boundary=boundary)
        scene.beam(f"b{k}", length=2.0, elements=12, section=section, modes=shapes, level=level)
        at = {"child_node": "root"} if k == 0 else {"parent_node": node, "child_node": "root"}
        axis = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0))[k % 2]
        scene.revolute(f"h{k}", "ground" if k == 0 else f"b{k - 1}", f"b{k}", axis=axis, angle=0.3, rate=0.2, **at)
    return scene.scene()
