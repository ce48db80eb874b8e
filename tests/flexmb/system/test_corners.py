"""Public calls at a state where the law of a connector has a corner: what is a derivative there is refused.

Which calls give derivatives is found, not listed: their results jump where a state passes the corner, at which loads
and accelerations are continuous.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import msgspec
import numpy as np
import pytest
from scipy.optimize import brentq

import flexmb as fm
from flexmb.scene import schema
from tests.flexmb.system import public_calls
from tests.flexmb.system.argument_kinds import Call, Calls, World
from tests.flexmb.system.system_calls import of_the_chain, of_the_tree

AT = 0.5  # rad, the stop
BESIDE = 1e-10  # rad or m from the corner
JUMP = 1e-3  # of a result, or of 1, where the stiffness of the stop or of the cable appears
FEWEST = 14
"""Calls that jump: of a tree and a closed chain, nine kinds of derivatives."""
NO_DERIVATIVES = {"InertiaRegressor.base": "of one state, by pivots that are rounding"}
"""What jumps for another reason."""
INDEPENDENT = {
    *(f"Parameters.{name}" for name in ("accelerations", "evaluate", "inverse_dynamics", "loads", "slopes")),
    "System.inverse_dynamics_derivatives",
}
"""Derivatives that are refused although they do not jump here: by gravity."""


class Cornered(World):
    """The tree with a stop and the closed chain with a cable, at states beside their corners."""

    @cached_property
    def scene(self) -> schema.Scene:
        stop = schema.AngularSpring(name="stop", hinge="elbow", upper_rad=AT, stop_stiffness_Nm_rad=40.0)
        return msgspec.structs.replace(super().scene, connectors=(stop,))

    @cached_property
    def chain(self) -> fm.System:
        cable = schema.SpringDamper(name="cable", body_a="ground", body_b="bob", position_a_m=(0.0, 0.0, 1.0),
                                    free_length_m=1.0 - BESIDE, stiffness_N_m=40.0, acts="tension")  # fmt: skip
        return fm.compile(msgspec.structs.replace(super().chain.scene, connectors=(cable,)))

    @cached_property
    def renamed(self) -> fm.System:
        return World().renamed

    @cached_property
    def state(self) -> fm.State:
        return self.tree_at(1.0)

    def tree_at(self, side: float) -> fm.State:
        """With the elbow beside its stop, or at it."""
        q, start = self.tree.initial_state.q.copy(), super().state
        q[self.tree.coordinate("elbow")] = AT + side * BESIDE
        return self.tree.state(q, start.u, start.t)

    def chain_at(self, side: float) -> fm.State:
        """With the cable shorter or longer than where it is just slack, or there: the bob turned about its ball."""
        ball, end = np.array([0.25, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])

        def turned(angle: float) -> np.ndarray:
            return ball - 0.25 * np.array([np.cos(angle), 0.0, -np.sin(angle)])

        length = 1.0 + (side - 1.0) * BESIDE
        angle = brentq(lambda x: float(np.linalg.norm(turned(x) - end)) - length, -1e-3, 1e-3, xtol=1e-16)
        q, start = self.chain.initial_state.q.copy(), self.chain.initial_state
        q[self.chain.coordinate("float")] = [*turned(angle), np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0]
        return self.chain.state(q, start.u, start.t)


def asked(w: Cornered, call: Call, side: float) -> np.ndarray | None:
    """(n,) all numbers of a result at a state on this side of the corner, None where it is refused for the corner."""
    pairs = (w.state, w.tree_at(side)), (w.chain.initial_state, w.chain_at(side))
    given = {name: beside(argument, pairs) for name, argument in call.arguments.items()}
    try:
        return np.concatenate([np.zeros(0), *map(np.ravel, public_calls.arrays_of(call.function(**given)))])
    except fm.NotDifferentiableError as error:
        assert 'connector "' in str(error)
        return None


def beside(value: Any, pairs: Any) -> Any:
    """A state, or its coordinates, in place of the one that a call has."""
    if isinstance(value, list):
        return [beside(each, pairs) for each in value]
    for own, other in pairs:
        if isinstance(value, fm.State) and value.layout is own.layout:
            return other
        for part in ("q", "y"):
            if isinstance(value, np.ndarray) and np.array_equal(value, getattr(own, part)):
                return getattr(other, part).copy()
    return value


def some(w: Cornered) -> Calls:
    """Of systems alone, which are quickly made, and of a state."""
    found = of_the_tree(w) | of_the_chain(w)
    return Calls({
        name: call for name, call in found.items() if call.arguments.keys() & {"state", "q"} and "simulate" not in name
    })  # fmt: skip


@pytest.mark.filterwarnings("ignore::flexmb.SceneWarning")  # the stop turns the arm faster than its level describes
@pytest.mark.parametrize("calls", [some, pytest.param(public_calls.calls, marks=pytest.mark.slow)])
def test_what_jumps_is_refused_at_the_corner(calls):
    examine(Cornered(), calls)


def test_what_answers_on_one_side_is_noticed():
    """Negative control: a derivative that does not look for corners."""
    w = Cornered()
    slope = Calls()
    slope.add("System.slope", lambda state: np.array([float(state.q[w.tree.coordinate("elbow")][0] > AT)]),
              {"state": w.state}, state=())  # fmt: skip
    with pytest.raises(AssertionError, match="answered on one side"):
        examine(w, lambda _: slope)


def examine(w: Cornered, calls: Any) -> None:
    jumping, refused = set[str](), set[str]()
    for name, call in calls(w).items():
        if name.split(",")[0] in {*public_calls.LONG, *NO_DERIVATIVES}:
            continue
        before, at, behind = (asked(w, call, side) for side in (-1.0, 0.0, 1.0))
        assert before is not None and behind is not None, name
        size = max(1.0, float(np.max(np.abs(before), initial=0.0)))
        if before.shape != behind.shape or np.max(np.abs(behind - before), initial=0.0) > JUMP * size:
            jumping.add(name)
        if at is None:
            refused.add(name)
    assert not jumping - refused, "answered on one side"
    assert len(jumping) >= FEWEST
    assert {name.split(",")[0] for name in refused - jumping} <= INDEPENDENT
