"""Compile ahead: `python -m flexmb.warmup` fills the disk cache, so that the first real run starts at once.

Everything depends on types only, not on the scene: one small scene compiles what every scene runs.
"""

from __future__ import annotations

from pathlib import Path
from time import perf_counter

from flexmb import propagate
from flexmb.kernel import cache_directory
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from flexmb.simulation import simulate
from flexmb.system import System, compile


def pendulum() -> Scene:
    """One rigid body on one revolute hinge, under gravity."""
    return (
        SceneBuilder("pendulum", gravity=(0.0, -9.81, 0.0))
        .rigid_body("bob", mass=1.0, com=(1.0, 0.0, 0.0), inertia=(1e-2, 1e-2, 1e-2))
        .revolute("pivot", "ground", "bob")
        .marker("centre", "bob", offset=(1.0, 0.0, 0.0))
        .scene()
    )


def warm_up() -> float:
    """Compile, or find compiled, all kernels behind `simulate` and `System`; returns the seconds it took."""
    start = perf_counter()
    system = compile(pendulum())
    simulate(system, 1e-3, "dop853", samples=2)
    simulate(system, 1e-3, "rk4", step=1e-3, samples=2)
    _pointwise(system)
    return perf_counter() - start


def _pointwise(system: System) -> None:
    state = system.initial_state
    system.inverse_dynamics(state, system.accelerations(state))
    system.mass_matrix(state)


if __name__ == "__main__":
    kept = cache_directory(Path(propagate.__file__))
    print(
        f"compiled in {warm_up():.1f} s, kept in {Path(kept).parent if kept else 'memory only: no folder is writable'}"
    )
