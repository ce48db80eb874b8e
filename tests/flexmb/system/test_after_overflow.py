"""A state whose motion overflows is refused, and leaves nothing in workspaces that changes what is asked next."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flexmb as fm
from tests.flexmb.system.shared_calls import numbers

CASES = Path(__file__).parents[3] / "cases"
LARGE = 1e150, 1e152, 1e160, 1e307, -1e152


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
    return [each.tobytes() if isinstance(each, np.ndarray) else each for each in numbers(result)]


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
