"""Calls on the scenes, one function for each kind of use, which together compile every general kernel.

A use is small and independent of the others, so that several processes can divide them among themselves. A kernel that
two uses need is compiled by one of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import islice

import numpy as np

from flexmb.advisor.advice import advise
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.integrate.integrator import Method
from flexmb.jain.elimination import Elimination
from flexmb.linear.campbell import campbell
from flexmb.linear.controlled_motion import ControlledMotion
from flexmb.linear.equilibrium import equilibrium
from flexmb.linear.linearize import linearize
from flexmb.linear.linearize_sampled import linearize_sampled
from flexmb.linear.spin import steady_spin
from flexmb.ready import scenes
from flexmb.run.simulate import simulate
from flexmb.run.simulate_batch import simulate_batch
from flexmb.scene.bodies import Level
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from flexmb.sensitivity.gradient import gradient
from flexmb.sensitivity.scalars import FinalValue
from flexmb.sensitivity.sensitivities import sensitivities
from flexmb.system.algorithm import Algorithm
from flexmb.system.algorithms import ALGORITHMS, ON_CHAINS, RUNNING, WITH_JACOBIAN
from flexmb.system.by_recursion import MANY_SPEEDS
from flexmb.system.compile import compile, compile_batch

Use = Callable[[], object]
BODIES: tuple[tuple[int, Level, Elimination], ...] = (
    (2, "full", "explicit"), (2, "ruthless", "woodbury"), (18, "ruthless", "fastest"),
)  # fmt: skip
LOOPS = {"loop": scenes.looped, "loop at rest shape": scenes.looped_at_rest_shape}  # the second has no Jacobians
FIRST = (
    "linear models", "radau5, tree, articulated", "single states of a loop", "dop853, loop, composite",
    "generalised_alpha, tree, articulated", "single states", "dop853, loop at rest shape", "dop853, loop, articulated",
    "single states of a rigid tree", "single states on single axes", "rk4, tree, frisch", "dop853, tree, composite",
)  # fmt: skip
"""Those that the canonical cases and README's first examples need, the dearest first: an installation of a checkout
does these. They were found by what each loads."""
T_END, STEP = 1e-3, 2.5e-4  # s
BATCHED: tuple[Method, ...] = ("rk4", "dop853")


def uses() -> Iterator[tuple[str, Use]]:
    """The uses by name: those of `FIRST`, then all others."""
    every = dict(_uses())
    for name in FIRST:
        yield name, every.pop(name)
    yield from every.items()


def _uses() -> Iterator[tuple[str, Use]]:
    """In an order in which neighbours share few kernels: else the processes wait for each other.

    Derivatives in dual numbers come beside those by recursion; what shares most kernels with others comes late.
    """
    yield "derivatives by numbers, tree", partial(_numbers, scenes.pendulum)
    yield "linear models", _linear_models
    yield "linear models with controllers", _controlled_linear_models
    yield "steady spins", _spins
    yield "derivatives of runs, loop", partial(_derivatives, scenes.looped)
    yield "derivatives by numbers, loop", partial(_numbers, scenes.looped)
    yield "laws that a scene may name", _laws
    yield "batches", partial(_batches, scenes.panelled(2, "full").scene())
    yield "batches on single axes", partial(_batches, scenes.pendulum().scene())
    yield "batches of rigid trees", partial(_batches, scenes.turning().scene())
    between = iter((
        ("single states", partial(_single_states, *BODIES[:1])),
        ("single states on single axes", partial(_single_states_of_a_rigid_tree, scenes.pendulum)),
        ("single states of a rigid tree", partial(_single_states_of_a_rigid_tree, scenes.turning)),
        ("derivatives on single axes", _derivatives_on_single_axes),
        ("single states, reduced bodies", _single_states_of_reduced_bodies),
        ("single states of a loop at rest shape", partial(_single_states_of_a_loop, scenes.looped_at_rest_shape)),
        ("derivatives of runs, tree", partial(_derivatives, scenes.pendulum)),
        ("single states of a loop", partial(_single_states_of_a_loop, scenes.looped)),
    ))  # fmt: skip
    for method in sorted(INTEGRATORS, key=lambda name: not INTEGRATORS[name].linearises):
        yield from _runs(method)
        yield from islice(between, 1)
    yield from between
    yield "advice", _advice


def _runs(method: Method) -> Iterator[tuple[str, Use]]:
    """All kinds of runs by one method."""
    loops = {"loop": scenes.looped} if INTEGRATORS[method].linearises else LOOPS
    for name, builder in {"tree": scenes.pendulum, **loops}.items():
        yield f"{method}, {name}, feedback", partial(_regulated, builder, method)
        yield f"{method}, {name}, events", partial(_eventful, builder, method)
    for algorithm in RUNNING:
        if algorithm in WITH_JACOBIAN or not INTEGRATORS[method].linearises:
            yield f"{method}, tree, {algorithm}", partial(_run, scenes.pendulum().scene(), method, algorithm)
            if algorithm in ON_CHAINS:
                yield f"{method}, loop, {algorithm}", partial(_run, scenes.looped().scene(), method, algorithm)
    if not INTEGRATORS[method].linearises:
        yield f"{method}, loop at rest shape", partial(_run, scenes.looped_at_rest_shape().scene(), method)
    if INTEGRATORS[method].keeps_jacobian:
        yield f"{method}, many speeds", partial(_run, scenes.panelled(MANY_SPEEDS, "full").scene(), method)
    yield f"{method}, condensed", partial(_run, scenes.panelled(18, "ruthless").scene(), method, "articulated")


def _run(scene: Scene, method: Method, algorithm: Algorithm = "articulated") -> None:
    step = STEP if INTEGRATORS[method].fixed else None
    _ = simulate(scene, T_END, method, samples=3, step=step, algorithm=algorithm).envelope


def _eventful(builder: Callable[[], SceneBuilder], method: Method) -> None:
    _run(scenes.with_events(builder(), "pivot.rotation"), method)


def _regulated(builder: Callable[[], SceneBuilder], method: Method) -> None:
    _run(scenes.with_feedback(builder(), period=4e-4, delay=1e-4), method)
    _run(scenes.with_feedback(builder()), method)


def _derivatives(builder: Callable[[], SceneBuilder]) -> None:
    of = ["pivot.rotation", "centre.position.x", "signal.place[1]"]
    for scene in (
        scenes.with_events(builder(), "pivot.rotation"),
        scenes.with_feedback(builder(), period=4e-4, delay=1e-4),
        scenes.with_feedback(builder()),
    ):
        sensitivities(scene, T_END, ["bob.mass_kg"], of, samples=3)
    final = FinalValue("pivot.rotation")
    if not builder().scene().constraints:
        gradient(builder().scene(), T_END, ["bob.mass_kg"], [final, FinalValue("work")])
        gradient(scenes.with_feedback(builder(), period=4e-4, delay=1e-4), T_END, ["bob.mass_kg", "servo.kp"], final)


def _linear_models() -> None:
    rest = equilibrium(scenes.panelled(2, "full").scene())
    linearize(scenes.panelled(2, "full").scene(), rest, held=True)
    linearize(scenes.looped().scene())


def _controlled_linear_models() -> None:
    linearize(scenes.with_feedback(scenes.pendulum()))
    linearize(scenes.with_feedback(scenes.looped()))
    sampled = compile(scenes.with_feedback(scenes.pendulum(), period=4e-4, delay=1e-4))
    linearize_sampled(sampled, state=sampled.initial_state)
    for builder in (scenes.pendulum, scenes.looped):
        controlled = scenes.with_feedback(builder())
        ControlledMotion(controlled).evaluation_derivatives(compile(controlled).initial_state)


def _spins() -> None:
    steady_spin(scenes.spinner().scene(), "pivot", 1.0)
    campbell(scenes.spinner().scene(), "pivot", [0.0, 1.0])


def _single_states_of_reduced_bodies() -> None:
    _single_states(*BODIES[1:])
    system = compile(scenes.panelled(18, "ruthless").scene())
    state, nested = system.initial_state, system.nested()
    y = np.concatenate([state.q, state.u, [0.0]])
    nested.motion(0.0, y)
    nested.partitions(0.0, y)
    nested.relative_motion(0.0, y)


def _single_states_of_a_rigid_tree(builder: Callable[[], SceneBuilder]) -> None:
    """What has kernels of its own for these; the trees of runs are rigid, too."""
    system = compile(builder().scene())
    state = system.initial_state
    system.accelerations(state)
    system.evaluate(state.t, state.q, state.u)
    system.hinge_loads(state)
    evaluator = system.evaluator()
    evaluator(state.t, state.q, state.u)
    evaluator(state.t, state.q.tolist(), state.u.tolist())
    _run(builder().scene(), "dop853")


def _derivatives_on_single_axes() -> None:
    system = compile(scenes.pendulum().scene())
    state = system.initial_state
    system.derivative_evaluator()(state.t, state.q, state.u)
    system.acceleration_derivatives(state)
    system.inverse_dynamics_derivatives(state, system.accelerations(state))


def _single_states(*bodies: tuple[int, Level, Elimination]) -> None:
    for modes, level, elimination in bodies:
        system = compile(scenes.panelled(modes, level).scene(), elimination)
        state = system.initial_state
        for algorithm in ALGORITHMS:
            if level == "ruthless" or not algorithm.startswith("frisch"):
                rates = system.accelerations(state, algorithm)
                system.evaluate(state.t, state.q, state.u, algorithm)
                evaluator = system.evaluator(algorithm)
                evaluator(state.t, state.q, state.u)
                evaluator(state.t, state.q.tolist(), state.u.tolist())
        system.inverse_dynamics(state, rates)
        system.consistent_inverse_dynamics(state, rates)
        system.modal_residual(state, rates)
        system.hinge_loads(state)
        system.hinge_loads(state, rates)
        system.section_loads(state, "panel", np.array([0.5]))
        system.mass_matrix(state)
        system.energy(state)
        system.momentum(state)
        system.precision(state)
        factors = system.factorise(state)
        for solve in (factors.solve, factors.half_solve, factors.half_multiply, factors.multiply):
            solve(rates)
        system.acceleration_derivatives(state)
        system.inverse_dynamics_derivatives(state, rates)
        system.derivative_evaluator()(state.t, state.q, state.u)
        system.evaluation_derivatives(state)
        assert np.isfinite(factors.log_determinant)


def _numbers(builder: Callable[[], SceneBuilder]) -> None:
    system = compile(builder().scene())
    state, found = system.initial_state, system.parameters(["bob.mass_kg"])
    rates = found.accelerations(state)[:, 0]
    found.evaluate(state)
    found.inverse_dynamics(state, rates)
    regressor = system.inertia_regressor()
    regressor.at(state, rates)
    regressor.rest(state, rates)


def _laws() -> None:
    _run(scenes.slewed(), "dop853")


def _single_states_of_a_loop(builder: Callable[[], SceneBuilder]) -> None:
    system = compile(builder().scene())
    state = system.initial_state
    for algorithm in ON_CHAINS:
        system.accelerations(state, algorithm)
        system.evaluate(state.t, state.q, state.u, algorithm)
    system.hinge_loads(state)
    system.closure_gaps(state)
    system.closure_operators(state)
    if not system.closures.at_rest:
        system.acceleration_derivatives(state)
        system.derivative_evaluator()(state.t, state.q, state.u)
        system.evaluation_derivatives(state)


def _batches(scene: Scene) -> None:
    batch = compile_batch([scene] * 9)
    system = compile(scene)
    state = system.initial_state
    system.accelerations_batch(np.tile(state.q, (9, 1)), np.tile(state.u, (9, 1)))
    for method in BATCHED:
        step = STEP if INTEGRATORS[method].fixed else None
        for copies in (batch, system):
            simulate_batch(copies, T_END, method, samples=3, step=step)


def _advice() -> None:
    advise(scenes.panelled(2, "full").scene(), 1e-2, t_end=1e-2)
