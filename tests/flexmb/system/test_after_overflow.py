"""A state whose motion overflows is refused, and leaves nothing in workspaces that changes what is asked next."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flexmb as fm
from flexmb.integrate.catalogue import INTEGRATORS
from tests.flexmb.closure.mechanisms import four_bar
from tests.flexmb.system.argument_kinds import W
from tests.flexmb.system.shared_calls import numbers

CASES = Path(__file__).parents[3] / "cases"
LARGE = 1e150, 1e152, 1e160, 1e308, -1e152, -1e308


def questions(system: fm.System, rates: Any) -> dict[str, Any]:
    """All kinds of derivatives of a tree without controllers at one state."""
    evaluator = system.derivative_evaluator()
    beam = next(body.name for body in system.scene.bodies if isinstance(body, fm.BeamBody))

    def evaluated(x: fm.State) -> tuple[Any, ...]:
        return (evaluator(x.t, x.q, x.u).copy(), *(
            part.copy() for part in (evaluator.by_displacement, evaluator.by_speed, evaluator.by_force)
        ))  # fmt: skip

    return {
        "acceleration_derivatives": system.acceleration_derivatives,
        "under forces": lambda x: system.acceleration_derivatives(x, rates),
        "inverse_dynamics_derivatives": lambda x: system.inverse_dynamics_derivatives(x, rates),
        "evaluation_derivatives": system.evaluation_derivatives,
        "of given motion": lambda x: system.evaluation_derivatives(x, rates),
        "hinge_load_derivatives": system.hinge_load_derivatives,
        "section_load_derivatives": lambda x: system.section_load_derivatives(x, beam, [0.0, 0.1]),
        "derivative_evaluator": evaluated,
        "linearize": lambda x: vars(fm.linearize(system, x))["A"],
    }


def bits(result: Any) -> list[Any]:
    return [number.tobytes() if isinstance(number, np.ndarray) else number for number in numbers(result)]


@pytest.mark.parametrize("case", ["deploying_boom/flexible", "spacecraft/deploy_and_slew"])
def test_derivatives_are_the_same_to_the_bit_after_a_state_that_overflows(case: str) -> None:
    scene = fm.load_scene(CASES / case / "scene.toml")
    system = fm.compile(fm.open_loop(scene) if scene.controllers else scene)
    good, rates = system.initial_state, np.linspace(-1.0, 1.0, system.nu)
    asked = questions(system, rates)
    if scene.controllers:
        asked["ControlledMotion"] = fm.ControlledMotion(scene).acceleration_derivatives
    along, refused = np.ones(system.nq), 0
    for start in system.layout.quaternions:
        along[start : start + 4] = 0.0  # so long ones are refused before anything is evaluated
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of overflow, and of few digits
        right = {name: bits(ask(good)) for name, ask in asked.items()}
        for size in LARGE:
            for state in (system.state(good.q, good.u + size), system.state(good.q + size * along, good.u)):
                for ask in asked.values():
                    try:
                        ask(state)
                    except (fm.DynamicsError, ValueError, ArithmeticError):
                        refused += 1
                assert {name: bits(ask(good)) for name, ask in asked.items()} == right, size
    assert refused > 20


def all_questions(system: fm.System, rates: Any) -> dict[str, Any]:
    """What is asked of a system at one state, tree or closed chain, and short runs by all methods that it offers."""
    plain = (
        "accelerations", "energy", "momentum", "mass_matrix", "bias", "applied", "hinge_loads",
        "acceleration_derivatives", "evaluation_derivatives", "hinge_load_derivatives",
    )  # fmt: skip
    found: dict[str, Any] = {name: getattr(system, name) for name in plain}

    def run(method: Any) -> Any:
        def last(x: fm.State) -> tuple[Any, Any]:
            step = {"step": 5e-4} if INTEGRATORS[method].fixed else {}
            trajectory = fm.simulate(system, 1e-3, method, state=x, samples=2, max_steps=20, **step)
            return trajectory.q, trajectory.u

        return last

    return found | {f"run by {method}": run(method) for method in INTEGRATORS} | {
        "under forces": lambda x: system.acceleration_derivatives(x, rates),
        "inverse_dynamics": lambda x: system.inverse_dynamics(x, rates),
        "consistent_inverse_dynamics": lambda x: system.consistent_inverse_dynamics(x, rates),
        "inverse_dynamics_derivatives": lambda x: system.inverse_dynamics_derivatives(x, rates),
        "factorise": lambda x: system.factorise(x).solve(rates),
        "inertia_regressor": lambda x: system.inertia_regressor().at(x, rates),
        "linearize": lambda x: vars(fm.linearize(system, x))["A"],
        "equilibrium": lambda x: fm.equilibrium(system, x),
    }  # fmt: skip


SYSTEMS = {"four_bar": lambda: fm.compile(four_bar(modes=1)), "ball": lambda: W.chain, "tree": lambda: W.tree}


@pytest.mark.parametrize("name", SYSTEMS)
def test_all_answers_are_the_same_to_the_bit_after_each_refused_one(name: str) -> None:
    """After each question about a state that overflows, all questions about a right one: loops, and a tree."""
    system: Any = SYSTEMS[name]()
    good, refused, along = system.initial_state, 0, np.ones(system.nq)
    for start in system.layout.quaternions:
        along[start : start + 4] = 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of overflow, of few digits, and of starts that do not close
        asked, right = all_questions(system, np.linspace(-1.0, 1.0, system.nu)), {}
        for which in list(asked):
            try:
                right[which] = bits(asked[which](good))
            except NotImplementedError:  # not of closed chains, or not by this method
                del asked[which]
        assert len(asked) > 18
        for size in (1e150, 1e152, 1e160, 1e307):
            for state in (system.state(good.q, good.u + size), system.state(good.q + size * along, good.u)):
                for which, ask in asked.items():
                    try:
                        ask(state)
                    except (fm.DynamicsError, ValueError, ArithmeticError):
                        refused += 1
                    assert bits(ask(good)) == right[which], (which, size)
                assert {which: bits(ask(good)) for which, ask in asked.items()} == right, size
    assert refused > 30


def test_a_batch_is_the_same_to_the_bit_after_a_copy_that_overflows() -> None:
    batch = fm.compile_batch([W.scene] * 3)
    q, u = batch.initial_states()
    right = bits(batch.accelerations(q, u))
    for size in (1e152, 1e160, 1e307):
        spoiled = u.copy()
        spoiled[1] += size
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            batch.accelerations(q, spoiled)
        assert bits(batch.accelerations(q, u)) == right, size
