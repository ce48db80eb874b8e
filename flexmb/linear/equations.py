"""The equations of a system or scene for its linear models: those of a tree, or of a closed chain."""

from __future__ import annotations

from typing import cast

from flexmb.building.numbering import speeds_at_least
from flexmb.linear.variations import Equations
from flexmb.scene.check import check_scene
from flexmb.scene.open_loop import refuse_feedback
from flexmb.scene.schema import Scene
from flexmb.scene.sizes import refuse_large_matrix
from flexmb.scene.sticking import refuse_sticking
from flexmb.system.compile import compile
from flexmb.system.system import System
from flexmb.tables.state import State

MATRICES = 3  # over the states: A, C, and A as it is made


def built(given: System | Scene) -> System:
    """The system of a scene, or the given one; ValueError if a linear model of it would not fit into memory, before
    anything is built or compiled."""
    if isinstance(given, Scene):
        check_scene(given)
    nu = speeds_at_least(given) if isinstance(given, Scene) else given.nu
    refuse_large_matrix(2 * nu, "a linear model", "take a scene of fewer bodies or modes: it is dense", MATRICES)
    return compile(given) if isinstance(given, Scene) else given


def equations_of(system: System, like: Equations | None = None) -> Equations:
    """The equations of a tree or a closed chain; NotImplementedError for closures on bodies of level "ruthless".

    like: equations of the same scene with other numbers, which are not used meanwhile; their workspaces are reused.
    Without it those of a system are kept.
    """
    refuse_sticking(system.scene, "a motion at rest is one of many, with no linear model and no equilibrium of its own")
    if like is not None:
        return _made(system, like)
    kept: Equations | None = system.kept.get("equations")
    return kept or cast(Equations, system.kept.setdefault("equations", _made(system, None)))


def _made(system: System, like: Equations | None) -> Equations:
    if system.constraints is None:
        return Equations(system, None, like)
    from flexmb.linear.closed_variations import ClosedEquations  # imported only for scenes with closures

    return ClosedEquations(system, None, cast(ClosedEquations | None, like))


def entering(system: System | Scene, state: State | None) -> tuple[Equations, State]:
    """The two parts of a linear model: the equations of a system or scene, and a state of it (default: initial).

    NotImplementedError for scenes with controllers and for closures on bodies of level "ruthless", ValueError or
    TypeError for a state that is not one of this system.
    """
    if not isinstance(system, System | Scene):
        raise TypeError(f"a System or a Scene is needed, not {type(system).__name__}")
    refuse_feedback(system if isinstance(system, Scene) else system.scene, "a linear model of the motion alone")
    equations = equations_of(built(system))
    if state is None:
        return equations, equations.system.initial_state
    equations.system.layout.entering(state)
    if equations.system.constraints:
        return equations, equations.system.admissible(state, "state")
    return equations, state
