"""What any system can be asked, and what only the tree and the closed chain of `argument_kinds.py` can be asked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import flexmb as fm
from tests.flexmb.system.argument_kinds import (
    ALGORITHM,
    Calls,
    World,
    but_modal,
    but_none,
    chosen,
    closed_states,
    itself,
    names,
    numbers,
    quaternion_first,
    seen,
    states,
    vectors,
    wrong_only,
    wrong_only_number,
)  # fmt: skip

SECTIONS = chosen(
    None, "root", [0.6], [-0.1], [[0.1]], [np.nan], [0.1j], plain=(([0.25, 0], np.array([0.25, 0.0])),)
)  # fmt: skip

REFUSED = {"partitions": ("state",), "operators": ("state",), "nested": (), "evaluator": ()}
"""What a closed chain is always refused, and its arguments."""
LOOKS: dict[str, Callable[[Any], Any]] = {
    "operators": lambda it: it.M,
    "closure_operators": lambda it: it.Lambda_inverse,
    "factorise": lambda it: it.log_determinant,
}
TREE, CHAIN = "tree", "chain"


def kind_of(system: fm.System) -> str:
    """What it is in the names of calls."""
    return CHAIN if system.constraints else TREE


def of_system(kind: str, call: str) -> str:
    """The name of a call: "System.accelerations, composite"; of a chain "System.accelerations, composite, chain"."""
    return f"System.{call}" if kind == TREE else f"System.{call}, {kind}"


def of_any(system: fm.System, state: fm.State) -> Calls:
    """Of a tree or a closed chain, with controllers or without; the kinds are of those in `argument_kinds.py`."""
    found, closed = Calls(), system.constraints is not None
    kind = kind_of(system)
    at, rates = closed_states if closed else states, np.arange(1.0, system.nu + 1.0)
    y, of_y = _of_y(system, state)
    pointwise = ["mass_matrix", "bias", "energy", "momentum", "digits_left", "precision", "admissible", "applied",
                 "mass_properties", "hinge_loads", "factorise"]  # fmt: skip
    pointwise += ["closure_operators", "closure_gaps", "determined_loads"] if closed else ["partitions", "operators"]
    for name in pointwise:
        found.add(of_system(kind, name), getattr(system, name), {"state": state}, LOOKS.get(name, itself), state=at)
    found.add(of_system(kind, "hinge_loads, outboard"), lambda state: system.hinge_loads(state, axes="outboard"),
              {"state": state}, state=at)  # fmt: skip
    hinge = system.scene.hinges[0]
    found.add(of_system(kind, "total_load"), lambda state: system.total_load(state, [hinge.name], hinge.child),
              {"state": state}, state=at)  # fmt: skip
    for algorithm in algorithms_of(system):
        asked = {"algorithm": algorithm}
        found.add(of_system(kind, f"accelerations, {algorithm}"), system.accelerations, {"state": state, **asked},
                  state=at, **ALGORITHM)  # fmt: skip
        found.add(of_system(kind, f"evaluate, {algorithm}"), system.evaluate, {**y, **asked}, **of_y, **ALGORITHM)
        if not closed:
            found.add(of_system(kind, f"evaluator, {algorithm}"), system.evaluator(algorithm), y, np.copy, **of_y)
    for name, speeds in {"inverse_dynamics": vectors, "modal_residual": vectors,
                         "consistent_inverse_dynamics": but_modal}.items():  # fmt: skip
        found.add(of_system(kind, name), getattr(system, name), {"state": state, "accelerations": rates},
                  state=at, accelerations=speeds)  # fmt: skip
    asked = {"algorithm": "articulated", "stabilise": 0.0}
    found.add(of_system(kind, "route"), system.route, asked, lambda it: it.rhs, stabilise=wrong_only_number,
              **ALGORITHM)  # fmt: skip
    found.add(of_system(kind, "scene_state"), system.scene_state, {"t": 0.5}, t=numbers)
    for name in ("coordinate", "speed"):
        found.add(of_system(kind, name), getattr(system, name), {"name": system.scene.hinges[0].name}, name=names)
    found.add(of_system(kind, "parameters"), system.parameters, {"names": ["gravity_m_s2.0", "gravity_m_s2.1"]},
              lambda by: by.accelerations(state),
              names=chosen(None, 5, "arm", [], ["nobody"], ["elbow"], [None], [1]))  # fmt: skip
    found.add(of_system(kind, "inertia_regressor"), system.inertia_regressor, {"bodies": [system.scene.bodies[0].name]},
              lambda regressor: regressor.values, bodies=chosen(5, "arm", ["nobody"], [None], [1]))  # fmt: skip
    found.add(f"simulate, {kind}", lambda state: fm.simulate(system, _soon(state), state=state, samples=3),
              {"state": state}, seen, state=but_none(at))  # fmt: skip
    if not system.scene.controllers:
        found.update(_differentiated(system, state))
    return found


def algorithms_of(system: fm.System) -> tuple[str, ...]:
    """Those that it can be asked for."""
    if system.constraints:
        return "articulated", "composite"
    return "articulated", "unsplit", "composite", "frisch", "frisch_as_printed"


def _of_y(system: fm.System, state: fm.State) -> tuple[dict[str, Any], dict[str, Any]]:
    """Time, coordinates and speeds as arguments, and their kinds."""
    kinds = (wrong_only, wrong_only) if system.constraints else (quaternion_first, vectors)
    return {"t": state.t, "q": state.q.copy(), "u": state.u.copy()}, dict(zip("tqu", (numbers, *kinds), strict=True))


def _soon(state: Any) -> float:
    """Runs take the time of the state that they start from."""
    return getattr(state, "t", 0.0) + 2e-3


def _differentiated(system: fm.System, state: fm.State) -> Calls:
    """Of what has no controllers."""
    found, kind = Calls(), kind_of(system)
    at = closed_states if system.constraints else states
    rates = np.arange(1.0, system.nu + 1.0)
    y, of_y = _of_y(system, state)
    evaluator = system.derivative_evaluator()

    def parts(value: np.ndarray) -> tuple[np.ndarray, ...]:
        """What the evaluator has written for this thread."""
        return value.copy(), *(each.copy() for each in (evaluator.by_displacement, evaluator.by_speed,
                                                        evaluator.by_force))  # fmt: skip

    found.add(of_system(kind, "derivative_evaluator"), evaluator, y, parts, **of_y)
    found.add(of_system(kind, "acceleration_derivatives"), system.acceleration_derivatives,
              {"state": state, "forces": rates}, state=at, forces=but_none(vectors))  # fmt: skip
    found.add(of_system(kind, "inverse_dynamics_derivatives"), system.inverse_dynamics_derivatives,
              {"state": state, "accelerations": rates}, state=at, accelerations=vectors)  # fmt: skip
    found.add(of_system(kind, "evaluation_derivatives"), system.evaluation_derivatives, {"state": state}, state=at)
    found.add(of_system(kind, "hinge_load_derivatives"), system.hinge_load_derivatives, {"state": state}, state=at)
    found.add(f"linearize, {kind}", lambda state: fm.linearize(system, state), {"state": state},
              lambda model: model.A, state=but_none(at))  # fmt: skip
    return found


def of_the_tree(w: World) -> Calls:
    """What it has by name, and the ways to ask that only trees have."""
    tree, state, rates, found = w.tree, w.state, w.rates, of_any(w.tree, w.state)
    found.add("System.hinge_loads, forced", tree.hinge_loads, {"state": state, "accelerations": rates}, state=states,
              accelerations=but_none(vectors))  # fmt: skip
    found.add("System.evaluation_derivatives, forced", tree.evaluation_derivatives,
              {"state": state, "accelerations": rates}, state=states, accelerations=but_none(vectors))  # fmt: skip
    found.add("System.evaluator", tree.evaluator, {"algorithm": "articulated"}, lambda it: it.accelerations,
              **ALGORITHM)  # fmt: skip
    found.add("System.mass_properties, of a body", tree.mass_properties, {"state": state, "body": "arm"},
              state=states, body=but_none(names))  # fmt: skip
    of_sections: dict[str, Any] = {"state": state, "body": "arm", "x": np.array([0.25, 0.0])}
    for name in ("section_loads", "section_load_derivatives"):
        found.add(f"System.{name}", getattr(tree, name), of_sections, state=states, body=names, x=SECTIONS)
    found.add("System.section_load_derivatives, nowhere", lambda: tree.section_load_derivatives(state, "arm", []))
    in_axes = {"state": state, "axes": "outboard", "about": ("arm", "tip")}
    found.add("System.hinge_load_derivatives, in axes", tree.hinge_load_derivatives, in_axes, state=states,
              axes=chosen(None, "body", 5),
              about=chosen("tip", ("arm", "nowhere"), ("nobody", "tip"), 5))  # fmt: skip
    found.add("System.state", tree.state, {"q": state.q.copy(), "u": state.u.copy(), "t": 0.5}, q=quaternion_first,
              u=vectors, t=numbers)  # fmt: skip
    found.add("System.nested", tree.nested, {"algorithm": "frisch"}, lambda nested: nested.reduced(0.0, w.y),
              **ALGORITHM)  # fmt: skip
    return found


def of_the_chain(w: World) -> Calls:
    """What it is always refused has no other arguments."""
    chain, start, found = w.chain, w.chain.initial_state, of_any(w.chain, w.chain.initial_state)
    found.add(of_system(CHAIN, "state"), chain.state, {"q": start.q.copy(), "u": start.u.copy(), "t": 0.5},
              q=wrong_only, u=wrong_only, t=numbers)  # fmt: skip
    for name, given in REFUSED.items():
        found.add(of_system(CHAIN, name), lambda name=name, given=given: refused(
            getattr(chain, name), *(start for _ in given)))  # fmt: skip
    return found


def refused(function: Callable[..., Any], *given: Any) -> str:
    """What is said by a call that is always refused."""
    try:
        function(*given)
    except NotImplementedError as said:
        return str(said)
    raise AssertionError("not refused")
