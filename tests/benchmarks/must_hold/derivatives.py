"""Derivatives of accelerations and inverse dynamics: of rigid chains over Pinocchio, flexible ones in evaluations."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

import flexmb as fm
from crosscheck.library.find import shipped_folder
from flexmb.entry import articulated, tangent
from flexmb.entry.derivatives import (
    acceleration_derivatives,
    derivative_workspace,
    inverse_dynamics_derivatives,
    jacobian,
)
from flexmb.jit.kernel import kernel
from tests.benchmarks import peers
from tests.benchmarks.compiled import pinocchio
from tests.benchmarks.must_hold.row import Call, Measured, Row, duration, how_many_times, measured
from tests.benchmarks.rivals import flexible_chain, rigid_chain, turns
from tests.flexmb.entry import dual_jacobian

COMPILED, EVALUATIONS = "Derivatives from compiled code", "Jacobian of flexible chains"
PYTHON, CALLS = "Derivatives from Python", "Public calls for one state"
PUBLIC = {"derivatives": "`System.acceleration_derivatives`", "linearize": "`linearize`"}
TO_ROUNDING = 1e-10  # of the largest element, in chains of at most 100 bodies
BEAMS = {5: 8.0, 10: 12.0}
"""Evaluations at most, by the number of modes."""


def rows() -> list[Row]:
    """Revolute chains of N bodies with general axes, then chains of ten beams."""
    return [
        *(
            Row(
                f"derivatives_{n}", COMPILED, f"pin.computeABADerivatives in C++, {n} bodies", 2.5,
                partial(_rigid, n, inverse=False),
            )
            for n in (10, 35, 100)
        ),
        *(
            Row(
                f"inverse_derivatives_{n}", COMPILED, f"pin.computeRNEADerivatives in C++, {n} bodies", 2.0,
                partial(_rigid, n, inverse=True),
            )
            for n in (10, 35)
        ),
        *(
            Row(
                f"derivatives_python_{n}", PYTHON, f"pin.computeABADerivatives, {n} bodies", 2.0,
                partial(_from_python, n),
            )
            for n in (10, 35, 100)
        ),
        *(
            Row(
                f"jacobian_{modes}_modes", EVALUATIONS, f"10 beams of {modes} modes, level full", goal,
                partial(_flexible, modes), "at most", "evaluations of the accelerations",
            )
            for modes, goal in BEAMS.items()
        ),
        *(
            Row(
                f"call_{call}_{name}", CALLS, f"{what}, {words}", goal, partial(_public, scene, call), "at most",
                "evaluations of the same derivatives",
            )
            for name, words, scene, goals in (
                ("chain", "10 bodies", partial(rigid_chain, 10), (4.0, 35.0)),
                ("loop", "a four-bar", _four_bar, (4.5, 100.0)),
            )
            for (call, what), goal in zip(PUBLIC.items(), goals, strict=True)
        ),
    ]  # fmt: skip


def _rigid(bodies: int, *, inverse: bool) -> Measured:
    scene = rigid_chain(bodies)
    native = _inverse(scene) if inverse else _forward(scene)
    x = np.linspace(-1.0, 1.0, bodies) if inverse else np.zeros(bodies)
    return how_many_times(native, pinocchio.derivatives(scene, x, inverse=inverse), TO_ROUNDING)


def _from_python(bodies: int) -> Measured:
    """Both as users call them again and again, with arrays of their own."""
    scene = rigid_chain(bodies)
    system = fm.compile(scene)
    q, u, evaluate = system.initial_state.q, system.initial_state.u, system.derivative_evaluator()
    results = evaluate.by_displacement, evaluate.by_speed, evaluate.by_force
    native = Call(lambda: evaluate(0.0, q, u), 1, lambda: np.concatenate([result.ravel() for result in results]))
    return how_many_times(native, peers.pinocchio_derivatives(scene, np.zeros(bodies)), TO_ROUNDING)


def _four_bar() -> fm.Scene:
    return fm.load_scene(shipped_folder() / "closed_chains" / "four_bar" / "scene.toml")


def _public(scene: Callable[[], fm.Scene], call: str) -> Measured:
    """What a call takes whose result is an object of its own, over an evaluator that overwrites its arrays."""
    system = fm.compile(scene())
    state, evaluate = system.initial_state, system.derivative_evaluator()
    of_state = {"derivatives": system.acceleration_derivatives, "linearize": partial(fm.linearize, system)}[call]
    seconds = turns(partial(of_state, state), partial(evaluate, state.t, state.q, state.u))
    mine, other = np.median(seconds, axis=0)
    return measured(seconds[:, 0] / seconds[:, 1], f"{duration(mine)} against {duration(other)}")


def _forward(scene: fm.Scene, times: int = 100) -> Call:
    system, y = _started(scene)
    out = np.zeros((3, system.nu, system.nu))
    c, w = system.derivative_constants, derivative_workspace(system.constants, system.nq, system.nu)
    return Call(lambda: _accelerations(times, y, *out, c, w), times, lambda: out.ravel())


def _inverse(scene: fm.Scene, times: int = 100) -> Call:
    system, y = _started(scene)
    rates = np.linspace(-1.0, 1.0, system.nu)
    out = np.zeros((3, system.nu, system.nu))
    c, w = system.derivative_constants, derivative_workspace(system.constants, system.nq, system.nu)
    return Call(lambda: _inverse_dynamics(times, y, rates, *out, c, w), times, lambda: out.ravel())


def _flexible(modes: int) -> Measured:
    """A Jacobian over an evaluation, both from compiled code; what it takes by dual numbers is in the detail."""
    system, y = _started(flexible_chain(10, modes, "full"))
    c, nq, nu = system.constants, system.nq, system.nu
    J, expected = np.zeros((2, len(y), len(y)))
    w, by_duals = derivative_workspace(c, nq, nu), tangent.tangent_workspace(c, nq, nu)
    evaluation = system.recursion_constants, system.recursion_workspace()
    jacobian(0.0, y, J, c, w)
    dual_jacobian.jacobian(0.0, y, expected, c, by_duals)
    difference = float(np.max(np.abs(J - expected)) / np.max(np.abs(expected)))
    seconds = turns(lambda: _evaluations(100, y, *evaluation), lambda: _jacobians(10, y, J, c, w)) / [100, 10]
    by_dual_numbers = partial(dual_jacobian.jacobian, 0.0, y, J, c, by_duals)
    dual = turns(lambda: _evaluations(100, y, *evaluation), by_dual_numbers) / [100, 1]
    today = np.median(dual[:, 1] / dual[:, 0])
    return measured(seconds[:, 1] / seconds[:, 0], f"{today:.0f} by dual numbers", difference)


def _started(scene: fm.Scene) -> tuple[fm.System, np.ndarray]:
    system = fm.compile(scene)
    state = system.initial_state
    return system, np.concatenate([state.q, state.u, [0.0]])


@kernel
def _accelerations(times, y, by_displacement, by_speed, by_force, c, w):
    status = 0
    for _ in range(times):
        status = max(status, acceleration_derivatives(0.0, y, by_displacement, by_speed, by_force, c, w))
    return status


@kernel
def _inverse_dynamics(times, y, rates, by_displacement, by_speed, by_acceleration, c, w):
    for _ in range(times):
        inverse_dynamics_derivatives(0.0, y, rates, by_displacement, by_speed, by_acceleration, c, w)


@kernel
def _evaluations(times, y, c, w):
    status = 0
    for _ in range(times):
        status = max(status, articulated.accelerations(0.0, y, c, w))
    return status


@kernel
def _jacobians(times, y, J, c, w):
    status = 0
    for _ in range(times):
        status = max(status, jacobian(0.0, y, J, c, w))
    return status
