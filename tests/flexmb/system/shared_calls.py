"""One system, asked everything by many threads at once. Run as a program: prints how many answers were wrong.

    python -m tests.flexmb.system.shared_calls [--span S] [--spoiled] [scene ...]

All ask the same question at once, again and again for a span of time. Each thread has a state of its own: one that
wrote over another's numbers would leave others. What is right is what one thread finds with a system of its own, to the
bit; the shared one is new, so that threads meet at all that is made when it is first asked for. `--spoiled` is the
negative control: what should be each thread's own is shared.
"""

from __future__ import annotations

import argparse
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np

THREADS = 4


def spoil() -> None:
    """What should be each thread's own is shared, and gates let every thread pass."""
    from flexmb.tables import per_thread

    per_thread.per_thread = cached_property  # type: ignore[assignment,misc]
    from flexmb.entry import gate
    from flexmb.jit.kernel import helper

    @helper
    def everybody(g):  # type: ignore[no-untyped-def]
        return True

    gate._is_owner = everybody


def scenes() -> dict[str, Any]:
    """A flexible tree with a wheel, connectors of all kinds, a closed chain, a controlled one, a long one."""
    from tests.benchmarks.rivals import rigid_chain
    from tests.flexmb.closure.mechanisms import bennett
    from tests.flexmb.connectors.connected_scenes import everything
    from tests.flexmb.system.argument_kinds import World
    from tests.flexmb.system.test_copies import controlled

    return {
        "tree": World().scene,
        "connected": everything(),
        "closed": bennett(),
        "controlled": controlled(),
        "long": rigid_chain(60),
    }


Question = Callable[[Any, Any], Any]


def questions(system: Any, state: Any) -> dict[str, Question]:
    """All that can be asked of a system at a state, by name; of what is shared there is one for all threads."""
    import flexmb as fm

    scene, shared = system.scene, {}
    is_tree, rates = not scene.closures, np.linspace(-1.0, 1.0, system.nu)
    found: dict[str, Question] = {
        name: lambda s, x, name=name: getattr(s, name)(x)
        for name in ("mass_matrix", "bias", "energy", "momentum", "digits_left", "precision", "mass_properties",
                     "applied", "hinge_loads", "admissible")
    }  # fmt: skip
    found["parameters"] = lambda s, x: s.parameters(["gravity_m_s2.0"]).accelerations(x)
    found["inertia_regressor"] = lambda s, x: s.inertia_regressor([scene.bodies[0].name]).values
    algorithms = ("articulated", "unsplit", "composite", "frisch") if is_tree else ("articulated", "composite")
    for each in algorithms:
        found[f"accelerations, {each}"] = lambda s, x, each=each: s.accelerations(x, each)
        found[f"evaluate, {each}"] = lambda s, x, each=each: s.evaluate(x.t, x.q, x.u, each)
    found |= {
        "inverse_dynamics": lambda s, x: s.inverse_dynamics(x, rates),
        "modal_residual": lambda s, x: s.modal_residual(x, rates),
        "consistent_inverse_dynamics": lambda s, x: s.consistent_inverse_dynamics(x, rates),
        "hinge_loads, outboard": lambda s, x: s.hinge_loads(x, axes="outboard"),
        "factorise": lambda s, x: s.factorise(x).solve(rates),
        "accelerations_batch": lambda s, x: s.accelerations_batch(x.q[None], x.u[None], x.t, threads=1),
        "initial_state": lambda s, x: s.initial_state,
        "scene_state": lambda s, x: s.scene_state(x.t),
        "simulate": lambda s, x: seen(fm.simulate(s, x.t + 2e-3, state=x, t_start=x.t, samples=3)),
        "simulate_batch": lambda s, x: fm.simulate_batch(s, 2e-3, q=x.q[None], u=x.u[None], samples=3, threads=1).q,
    }
    found["loads_in, of a run"] = lambda s, x: once(
        shared, (s, "run"), lambda: fm.simulate(s, 2e-3, samples=5)
    ).loads_in("outboard")  # fmt: skip
    if not scene.controllers:
        found["derivative_evaluator"] = lambda s, x: differentiated(
            once(shared, (s, "derivatives"), lambda: s.derivative_evaluator()), x
        )
    if is_tree:
        found["operators"] = lambda s, x: s.operators(x).M
        found["partitions"] = lambda s, x: s.partitions(x).matrix
        found["reduced"] = lambda s, x: s.nested().reduced(x.t, x.y)
        found["hinge_loads, forced"] = lambda s, x: s.hinge_loads(x, rates)
        for each in algorithms:
            found[f"evaluator, {each}"] = lambda s, x, each=each: once(
                shared, (s, each), lambda: s.evaluator(each)
            )(x.t, x.q, x.u).copy()  # fmt: skip
        found["factors"] = lambda s, x: once(shared, (s, "factors"), lambda: s.factorise(state)).solve(x.u)
    else:
        found["closure_operators"] = lambda s, x: tuple(vars(s.closure_operators(x)).values())
        found["closure_gaps"] = lambda s, x: s.closure_gaps(x)
        found["determined_loads"] = lambda s, x: s.determined_loads(x)
    if not scene.controllers:
        pushed = np.cos(np.arange(system.nu))
        found["acceleration_derivatives"] = lambda s, x: tuple(vars(s.acceleration_derivatives(x, pushed)).values())
        found["inverse_dynamics_derivatives"] = lambda s, x: s.inverse_dynamics_derivatives(x, rates).by_displacement
        found["evaluation_derivatives"] = lambda s, x: vars(s.evaluation_derivatives(x))
        found["hinge_load_derivatives"] = lambda s, x: s.hinge_load_derivatives(x, axes="outboard")
        found["linearize"] = lambda s, x: fm.linearize(s, x).A
        model = fm.linearize(system, state)
        found["frequency_response"] = lambda s, x: model.frequency_response(model.inputs[-1][0], [1.0 + 0.1 * x.t])
        found["displaced"] = lambda s, x: model.displaced(model.modes[-1], 0.1 * x.u[0])
    if any(body.name == "arm" for body in scene.bodies):
        found["section_load_derivatives"] = lambda s, x: s.section_load_derivatives(x, "arm", [0.25]).by_speed
        found["section_loads"] = lambda s, x: s.section_loads(x, "arm", [0.0, 0.25]).load
        found["equilibrium"] = lambda s, x: fm.equilibrium(s, x)
        found["steady_spin"] = lambda s, x: fm.steady_spin(s, "rotor", 0.5 + x.t).state
        found["campbell"] = lambda s, x: fm.campbell(s, "rotor", np.array([0.5, 1.0]) + x.t).eigenvalues
    return found


def once(shared: dict[Any, Any], key: Any, make: Callable[[], Any]) -> Any:
    """One for all threads, whoever comes first."""
    return shared[key] if key in shared else shared.setdefault(key, make())


def differentiated(evaluator: Any, state: Any) -> tuple[Any, ...]:
    rates = evaluator(state.t, state.q, state.u).copy()
    return rates, evaluator.by_displacement.copy(), evaluator.by_speed.copy(), evaluator.by_force.copy()


def seen(run: Any) -> tuple[Any, ...]:
    return run.q, run.u, run.energy, run.loads, run.message


def states(system: Any) -> list[Any]:
    """One for each thread, on one motion, which closes all closures."""
    import flexmb as fm

    rng = np.random.default_rng(0)
    if system.scene.closures:
        run = fm.simulate(system, 0.3, samples=THREADS + 1)
        return [system.state(*(part[i] for part in (run.q, run.u)), float(run.t[i])) for i in range(1, THREADS + 1)]
    start = system.initial_state
    return [system.state(start.q, start.u + rng.normal(size=system.nu), 0.01 * i) for i in range(THREADS)]


def numbers(result: Any) -> Iterator[Any]:
    """All that can be compared in a result."""
    if isinstance(result, dict):
        for key in result:
            yield from numbers(result[key])
    elif is_dataclass(result) and not isinstance(result, type):
        for field in fields(result):
            if field.name not in ("layout", "made_by"):
                yield from numbers(getattr(result, field.name))
    elif isinstance(result, tuple | list):
        for each in result:
            yield from numbers(each)
    else:
        yield result


def same(one: Any, other: Any) -> bool:
    """To the bit."""
    return all(
        a.tobytes() == b.tobytes() if isinstance(a, np.ndarray) else a == b
        for a, b in zip(numbers(one), numbers(other), strict=True)
    )


def wrong(scene: Any, span: float) -> tuple[int, dict[str, int]]:
    """How many questions were asked, and how many answers were wrong, by question; each is asked for so long (s)."""
    import flexmb as fm

    alone, system = fm.compile(scene), fm.compile(scene)
    given = states(alone)
    asked = questions(alone, given[0])
    right = [{name: ask(alone, state) for name, ask in asked.items()} for state in given]
    found, count, at_once = dict.fromkeys(asked, 0), [0] * THREADS, threading.Barrier(THREADS)

    def work(i: int) -> None:
        for name, ask in asked.items():
            at_once.wait()
            end = perf_counter() + span
            while True:
                try:
                    is_right = same(ask(system, given[i]), right[i][name])
                except Exception as problem:
                    is_right = False
                    print(f"{name}: {type(problem).__name__}: {problem}"[:300], file=sys.stderr)
                found[name] += not is_right
                count[i] += 1
                if perf_counter() > end:
                    break

    threads = [threading.Thread(target=work, args=(i,)) for i in range(THREADS)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    return sum(count), {name: number for name, number in found.items() if number}


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", help="by default all")
    parser.add_argument("--span", type=float, default=0.005, help="seconds for each question")
    parser.add_argument("--spoiled", action="store_true")
    asked = parser.parse_args()
    if asked.spoiled:
        spoil()
    sys.setswitchinterval(1e-5)  # so that threads meet in the middle of everything
    warnings.simplefilter("ignore")
    for name, scene in scenes().items():
        if name in (asked.scenes or scenes()):
            count, found = wrong(scene, asked.span)
            print(f"{name}: {sum(found.values())} wrong of {count} {found}", flush=True)


if __name__ == "__main__":
    main()
