"""Compile ahead: `python -m flexmb.warmup SCENE` compiles the special kernels of a scene, which later runs then use.

Special kernels contain only what the scene needs, and serve all scenes with the same kinds of hinges, levels, loads and
so on. Without scenes, general kernels are compiled, which serve all scenes, unless the installation contains them. By
default the kernels for the default arguments of `simulate` are compiled; --method, --algorithm and --scene add others.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Literal, get_args

import msgspec
import numpy as np

from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.integrate.integrator import Method
from flexmb.jit.folder import cache_directory
from flexmb.jit.warmed import note_warm
from flexmb.run.simulate import simulate
from flexmb.run.simulate_batch import simulate_batch
from flexmb.scene.build import SceneBuilder
from flexmb.scene.files import load_scene
from flexmb.scene.schema import Scene
from flexmb.scene.shapes import beam_section
from flexmb.system.algorithm import Algorithm
from flexmb.system.algorithms import ON_CHAINS, RUNNING, WITH_JACOBIAN
from flexmb.system.compile import compile, compile_batch
from flexmb.system.system import System
from flexmb.tables import arguments
from flexmb.tables.features import BATCHES, asking, contained

Kind = Literal["tree", "condensed", "closed"]


def pendulum() -> Scene:
    """One rigid body on one revolute hinge, under gravity."""
    return _bob().revolute("pivot", "ground", "bob").scene()


def with_panel() -> Scene:
    """The pendulum with a beam that has so many modes that they are eliminated in condensed form."""
    panel = _bob().revolute("pivot", "ground", "bob").beam(
        "panel", length=1.0, elements=8, modes=16, level="ruthless",
        section=beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=1.7e-10, Iz=1.7e-10, rho=2700.0),
    )  # fmt: skip
    return panel.weld("root", "bob", "panel").scene()


def looped() -> Scene:
    """The pendulum held by a closure."""
    return _bob().free("float", "ground", "bob").closure("pivot", "revolute", "ground", "bob").scene()


SCENES = {"tree": pendulum, "condensed": with_panel, "closed": looped}


def warm_up(
    methods: Sequence[Method] = ("dop853", "rk4"),
    algorithms: Sequence[Algorithm] = ("articulated",),
    scenes: Sequence[Kind | Scene] = ("tree",),
) -> float:
    """Compile all kernels of `simulate` and `System` that are not compiled yet; returns the seconds it took.

    scenes: a scene, for its special kernels, which systems of such scenes use from then on unless `compile` is told
    otherwise; or the name of a kind, for general kernels: "tree"; "condensed", trees with bodies that have so many
    modes that they are eliminated in condensed form; "closed", scenes with closures. Every method is compiled with
    every algorithm and scene that `simulate` supports it for. Raises ValueError for an unknown name, and what `compile`
    raises for a scene.
    """
    for what, names, known in (
        ("method", methods, INTEGRATORS), ("algorithm", algorithms, RUNNING),
        ("scene", [scene for scene in scenes if not isinstance(scene, Scene)], SCENES),
    ):  # fmt: skip
        for name in names:
            arguments.one_of(what, name, known)
    start = perf_counter()
    for scene in scenes:
        if isinstance(scene, Scene):
            with asking("special"):
                system = _compile(scene, "closed" if scene.constraints else "tree", methods, algorithms)
            note_warm(contained(system.constants))
        else:
            with asking("general"):
                _compile(SCENES[scene](), scene, methods, algorithms)
    return perf_counter() - start


def _compile(scene: Scene, kind: Kind, methods: Sequence[Method], algorithms: Sequence[Algorithm]) -> System:
    system = compile(scene)
    for algorithm in algorithms:
        for method in methods:
            if _runs(kind, algorithm, method):
                step = 1e-3 if INTEGRATORS[method].fixed else None
                run = simulate(system, 1e-3, method, samples=2, step=step, algorithm=algorithm)
                _ = run.envelope  # by recorded steps, as runs of flexible bodies are
    _pointwise(system)
    return system


def warm_beside(scene: Scene, what: str) -> None:
    """Compile what systems of such trees take for RECURSION or BATCHES (`flexmb.tables.features`), and note it.

    The rest of their kernels stay those that came with the installation.
    """
    with asking("beside"):
        if what == BATCHES:
            system = compile(scene)
            state, batch = system.initial_state, compile_batch([scene, scene])
            system.accelerations_batch(np.tile(state.q, (2, 1)), np.tile(state.u, (2, 1)))
            for method in ("dop853", "rk4"):
                for copies in (batch, system):
                    simulate_batch(copies, 1e-3, method, samples=2, step=1e-3 if method == "rk4" else None)
        else:
            system = _compile(scene, "tree", ("dop853", "rk4"), ("articulated",))
            state = system.initial_state
            system.hinge_loads(state)
            system.evaluate(state.t, state.q, state.u)
            if not scene.controllers:
                system.evaluator()(state.t, state.q, state.u)
    note_warm(contained(system.constants) | {what})


def _runs(kind: Kind, algorithm: Algorithm, method: Method) -> bool:
    """Whether `simulate` supports this combination; "condensed" concerns the articulated algorithm only."""
    if INTEGRATORS[method].linearises and algorithm not in WITH_JACOBIAN:
        return False
    if kind == "closed":
        return algorithm in ON_CHAINS
    return kind == "tree" or algorithm == "articulated"


def _pointwise(system: System) -> None:
    state = system.initial_state
    rates = system.accelerations(state)
    if not system.scene.constraints:
        system.inverse_dynamics(state, rates)
    system.mass_matrix(state)


def _bob() -> SceneBuilder:
    return (
        SceneBuilder("pendulum", gravity=(0.0, -9.81, 0.0))
        .rigid_body("bob", mass=1.0, com=(1.0, 0.0, 0.0), inertia=(1e-2, 1e-2, 1e-2))
        .marker("centre", "bob", offset=(1.0, 0.0, 0.0))
    )


def main(words: Sequence[str] | None = None) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m flexmb.warmup", description=__doc__)
    parser.add_argument("files", nargs="*", type=Path, metavar="SCENE", help="scene.toml; none: general kernels")
    parser.add_argument("--method", action="append", choices=tuple(INTEGRATORS), help="beside dop853 and rk4")
    parser.add_argument("--algorithm", action="append", choices=RUNNING, help="beside articulated")
    parser.add_argument("--scene", action="append", choices=get_args(Kind), help="general kernels, beside trees")
    parser.add_argument("--beside", action="store_true", help=argparse.SUPPRESS)  # see `flexmb.run.beside`
    asked = parser.parse_args(words)
    if asked.beside:
        if hasattr(os, "nice"):
            os.nice(19)
        return warm_beside(*msgspec.json.decode(sys.stdin.buffer.read(), type=tuple[Scene, str]))
    scenes: list[Kind | Scene] = [load_scene(path) for path in asked.files] or ["tree"]
    seconds = warm_up(
        ("dop853", "rk4", *(asked.method or ())),
        ("articulated", *(asked.algorithm or ())),
        [*scenes, *(asked.scene or ())],
    )
    print(f"compiled in {seconds:.1f} s, kept in {cache_directory() or 'memory only: no folder is writable'}")


if __name__ == "__main__":
    main()
