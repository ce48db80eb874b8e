"""Derivatives and frequencies by flexmb: exact ones by the O(N) recursion, differences by its other algorithms.

Of closed chains the frequencies alone, by their independent coordinates.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence

import numpy as np

from crosscheck.engines.linear.coordinates import coordinate_names, obstacle, places
from crosscheck.engines.linear.matrices import Errors, LinearMatrices, differentiated, exact, norm, rounding
from crosscheck.engines.linear.outputs import NOTHING, LinearOutputs, outputs
from crosscheck.engines.linear.parts import DERIVATIVES, LinearPart
from flexmb.linear.equations import equations_of
from flexmb.linear.variations import Equations, Variations
from flexmb.system.algorithm import Algorithm
from flexmb.system.algorithms import ALGORITHMS
from flexmb.system.evaluator import Evaluator
from flexmb.system.system import System
from flexmb.tables.state import State
from flexmb.typing import Real


def linear_outputs(
    system: System, algorithm: Algorithm, states: Iterable[State], asked: Collection[LinearPart]
) -> LinearOutputs:
    """What is asked at every state of a run, as far as the algorithm has it."""
    scene = system.scene
    if not asked or scene.controllers or scene.events:
        return NOTHING
    if scene.constraints:
        return _of_closed(system, states) if "frequencies" in asked and algorithm == "articulated" else NOTHING
    if obstacle(scene):
        return NOTHING
    equations = Equations(system)
    order = places(coordinate_names(scene), [name for name, _ in equations.labels.displacements])
    derivatives = (
        _exactly(equations, states) if algorithm == "articulated" else _by_differences(equations, algorithm, states)
    )
    return outputs(asked, (at.ordered(order) for at in derivatives), _offered(algorithm))


def _of_closed(system: System, states: Iterable[State]) -> LinearOutputs:
    """The frequencies of a closed chain, where it has a linear model."""
    try:
        equations = equations_of(system)
    except NotImplementedError:
        return NOTHING
    return outputs(("frequencies",), _exactly(equations, states))


def _offered(algorithm: Algorithm) -> Sequence[str]:
    """Frisch's equations take no loads along coordinates."""
    return DERIVATIVES[:2] if ALGORITHMS[algorithm].is_first_order else DERIVATIVES


def _exactly(equations: Equations, states: Iterable[State]) -> Iterator[LinearMatrices]:
    return (_exact(equations, state) for state in states)


def _exact(equations: Equations, state: State) -> LinearMatrices:
    at = equations.variations(state)
    return exact(at.by_displacement, at.by_speed, np.linalg.inv(at.mass), at.transport, state.u, at.rates)


def _by_differences(equations: Equations, algorithm: Algorithm, states: Iterable[State]) -> Iterator[LinearMatrices]:
    """By differences of the accelerations; the mass matrix is that of composite bodies."""
    accelerations = equations.system.evaluator(algorithm)
    for state in states:
        yield _differenced(equations, equations.variations(state), accelerations)


def _differenced(equations: Equations, at: Variations, accelerations: Evaluator) -> LinearMatrices:
    state, free, n = at.state, equations.free, len(at.rates)

    def displaced(xi: Real) -> Real:
        moved = equations.moved(at, xi)
        return accelerations(moved.t, moved.q, moved.u)[free].copy()

    def hurried(du: Real) -> Real:
        u = state.u.copy()
        u[free] += du
        return accelerations(state.t, state.q, u)[free].copy()

    by_force = np.linalg.inv(at.mass)
    unit = rounding(by_force, len(state.u))
    noise = unit * (norm(at.rates) + norm(state.u) ** 2)
    by_displacement, apart = differentiated(displaced, n, noise)
    by_speed, asunder = differentiated(hurried, n, noise)
    errors = Errors(apart, asunder, unit * norm(by_force))
    return LinearMatrices(by_displacement, by_speed, by_force, at.transport, errors)
