"""Runs and evaluations of every kind, each for a moment. Run as a program: prints the kernels that it had to compile.

    python -m tests.flexmb.run.every_kind [methods] [algorithms] [calls] [cases]

Behind each stands "kept" where it is on disk afterwards, so that the next process finds it, else "not kept".
"""

from __future__ import annotations

import gc
import sys
import tomllib
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numba.core.dispatcher import Dispatcher

import flexmb as fm
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.jit.cache import KernelCache
from flexmb.run.simulate_batch import simulate_batch
from flexmb.run.warm_up import looped, with_panel
from flexmb.scene.sticking import events_of
from flexmb.system.algorithms import RUNNING
from tests.flexmb.closure.mechanisms import windows
from tests.flexmb.connectors.test_friction_that_sticks import decaying
from tests.flexmb.control import test_closed_chains as closed_loops
from tests.flexmb.control.scenes import pendulum, rotor
from tests.flexmb.control.test_satellite import craft
from tests.flexmb.control.test_taken_up import CONTINUOUS, SAMPLED
from tests.flexmb.run.test_docking import flung, gap
from tests.flexmb.run.test_events import arm, latch
from tests.flexmb.run.test_events_of_signals import ball, floor
from tests.flexmb.run.test_events_on_chains import four_bar, on
from tests.flexmb.run.test_restart import swinging
from tests.flexmb.system.public_calls import calls

CASES = Path(__file__).parents[3] / "cases"
ROUGH = {"rtol": 1e-6, "atol": 1e-8}


def _loop(law: Any) -> fm.Scene:
    return pendulum(law, torque=fm.ControlSignal(source="law")).scene()


def scenes() -> dict[str, tuple[fm.Scene, float]]:
    """What a run may contain, each with the time (s) that it takes to meet it."""
    due = fm.SceneEvent(name="due", watch="time", level=0.01, actions=(fm.EndRun(),))
    release = fm.SceneEvent(name="free", watch="time", level=0.4, actions=(fm.Release(coordinate="c.rotation"),))
    crossing = fm.SceneEvent(name="end", watch="foot 0.rotation", level=0.0, actions=(fm.EndRun(),))
    user = "tests.flexmb.control.laws:proportional"
    law = fm.UserLaw(name="law", function=user, inputs=("angle",), parameters=(2.0,))
    said = fm.SceneEvent(name="said", watch="law[0]", level=-0.5, actions=(fm.EndRun(),))
    latched = on("c.rotation", 1.95, fm.Latch(coordinate="c.rotation"))
    return {
        "nothing": (swinging(), 0.02),
        "modes that are condensed": (with_panel(), 1e-3),
        "a time": (rotor(due), 0.02),
        "a level": (arm(latch("elbow", 1.45)), 0.1),
        "a signal": (ball(floor("height[2]", restitution=0.5)), 0.5),
        "a stop to rest on": (ball(floor("rail.translation", restitution=0.0, rests=True)), 0.5),
        "friction that sticks": (decaying(), 1.0),
        "a continuous controller": (_loop(CONTINUOUS), 0.02),
        "a sampled controller": (_loop(SAMPLED), 0.12),
        "a law of the user's": (rotor(law), 0.02),
        "a law of flexmb's own": (craft().scene(), 0.02),
        "a controller that is watched": (rotor(law, said), 0.02),
        "closures": (looped(), 0.02),
        "a closure that opens": (flung(), 1.4),
        "a closure that closes": (gap(tolerance_m=0.03, tolerance_rad=0.03), 0.6),
        "closures and events": (four_bar(latched, release), 0.5),
        "closures and a controller": (closed_loops.windows(1, closed_loops.SAMPLED), 0.06),
        "a leap": (windows(1, 40.0, gravity=0.0), 0.06),
        "a leap to a level": (msgspec.structs.replace(windows(1, 40.0, gravity=0.0), events=(crossing,)), 0.06),
    }  # fmt: skip


def methods() -> None:
    """Every method with all that a run may contain, each run taken up once where it can be."""
    for scene, t_end in scenes().values():
        system = fm.compile(scene)
        for method, integrator in INTEGRATORS.items():
            given: dict[str, Any] = {"step": t_end / 8.0} if integrator.fixed else ROUGH
            run = fm.simulate(system, t_end, method, samples=5, **given)
            if run.restart is not None and run.stopped_at == t_end:
                left = run.restart.scene if events_of(run.restart.scene) else system  # events may have changed it
                fm.simulate(left, 1.5 * t_end, method, samples=3, state=run.restart, **given)


def algorithms() -> None:
    """Every algorithm, with events and without; many copies at once."""
    for algorithm in RUNNING:
        for scene in (swinging(), arm(latch("elbow", 1.45))):
            fm.simulate(scene, 0.02, samples=3, algorithm=algorithm, **ROUGH)
    system = fm.compile(arm())
    start, copies = system.initial_state, np.zeros((9, 1))
    simulate_batch(system, 0.02, q=start.q + copies, u=start.u + copies, samples=3)
    simulate_batch(system, 0.02, "rk4", q=start.q + copies, u=start.u + copies, samples=3, step=0.01)


def public_calls() -> None:
    """Evaluations, linear models, batches: whatever else is public; linear models of closed loops."""
    for call in calls().values():
        call.function(**call.arguments)
    fm.linearize(_loop(CONTINUOUS))
    fm.linearize(closed_loops.windows(1, closed_loops.LAGGING))


def cases() -> None:
    """All cases by the default method, events and all: to their ends, or two thousand steps."""
    for file in sorted(CASES.rglob("scene.toml")):
        duration = tomllib.loads(file.with_name("run.toml").read_text())["duration_s"]
        fm.simulate(fm.load_scene(file), duration, samples=5, max_steps=2000, **ROUGH)


PARTS: dict[str, Callable[[], None]] = {
    "methods": methods, "algorithms": algorithms, "calls": public_calls, "cases": cases
}  # fmt: skip


def compiled() -> Iterator[str]:
    """Kernels that this process did not find, and whether the next one will; laws of users' own are not among them."""
    for each in gc.get_objects():
        if not isinstance(each, Dispatcher) or not each.py_func.__module__.startswith("flexmb."):
            continue
        if each.targetoptions.get("no_cpython_wrapper"):  # a helper: it is compiled into kernels
            continue
        for signature in each.stats.cache_misses:
            places = each._cache._places(signature, each.targetctx.codegen()) if _has_places(each) else ()
            kept = any(file.is_file() for file in places)
            yield f"{each.py_func.__module__}.{each.py_func.__qualname__}: {'kept' if kept else 'not kept'}"


def _has_places(dispatcher: Dispatcher) -> bool:
    return isinstance(dispatcher._cache, KernelCache)


def main(*parts: str) -> None:
    """The command line."""
    warnings.simplefilter("ignore", fm.SceneWarning)
    warnings.simplefilter("ignore", fm.PrecisionWarning)
    for part in parts or PARTS:
        PARTS[part]()
    for line in sorted(compiled()):
        print(line)


if __name__ == "__main__":
    main(*sys.argv[1:])
