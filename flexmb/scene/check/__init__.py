"""Checks of scenes: every defect and doubtful value is found before a run, with its place and its remedy."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from math import isfinite

from flexmb.scene.check.beams import beams
from flexmb.scene.check.connectors import connectors, friction_that_sticks
from flexmb.scene.check.control import control
from flexmb.scene.check.events import events
from flexmb.scene.check.exact_beams import jumps, tapers
from flexmb.scene.check.hinges import closures, couplings, hinges, point_masses, wheels
from flexmb.scene.check.inertia import rigid_bodies
from flexmb.scene.check.modal import modal_bodies, modal_states
from flexmb.scene.check.names import references, tree, unique_names
from flexmb.scene.check.outboard import moved_inertia
from flexmb.scene.check.profiles import functions
from flexmb.scene.check.walk import numbers
from flexmb.scene.convert import refuse_wrong_types
from flexmb.scene.garbage import collector_paused
from flexmb.scene.loaded import called
from flexmb.scene.problems import Defect, Doubt, SceneError, SceneWarning, in_short
from flexmb.scene.schema import Scene

_LARGEST_BITS = 1000  # of integers that are finite as floats
STRUCTURE = (unique_names, references, tree)
PHYSICS = (
    rigid_bodies, beams, modal_bodies, modal_states, hinges, closures, couplings, wheels, point_masses, connectors,
    friction_that_sticks, control, events,
)  # fmt: skip


def check_scene(scene: Scene, t_end: float | None = None, t_start: float = 0.0) -> tuple[Doubt, ...]:
    """Raise SceneError with all defects of a scene that its numbers show; return its doubts.

    What `flexmb.check_scene` does before it compiles the scene. SID bodies and every fidelity level are accepted.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"a Scene is needed, not {type(scene).__name__}: load_scene reads one, SceneBuilder makes one")
    with collector_paused():
        problems = _problems(scene, t_end, t_start)
    defects = [problem for problem in problems if not isinstance(problem, Doubt)]
    if defects:
        raise SceneError(called(scene), defects)
    return tuple(doubt for doubt in problems if isinstance(doubt, Doubt) and doubt.waiver not in scene.allow)


def check_and_warn(scene: Scene, t_end: float | None = None, t_start: float = 0.0) -> None:
    """The same, with all doubts as one SceneWarning, attributed to the caller of the calling function."""
    doubts = check_scene(scene, t_end, t_start)
    if doubts:
        warnings.warn(in_short(called(scene), doubts), SceneWarning, stacklevel=3)


def _problems(scene: Scene, t_end: float | None, t_start: float) -> list[Defect]:
    refuse_wrong_types(scene)  # a struct built by hand may hold values of any type
    problems = [*_run_time(t_end, t_start)]
    problems += [problem for check in (numbers, *STRUCTURE, *PHYSICS) for problem in check(scene)]
    problems += functions(scene, t_end, t_start)
    if all(isinstance(problem, Doubt) for problem in problems):  # it needs valid numbers and names, and a tree
        problems += [*moved_inertia(scene), *jumps(scene), *tapers(scene)]
    return problems


def check_run(scene: Scene, t_end: float, t_start: float = 0.0) -> None:
    """Raise SceneError unless a checked scene can be run from `t_start` to `t_end` (s), which its tables must cover."""
    problems = [*_run_time(t_end, t_start), *functions(scene, t_end, t_start)]
    if problems:
        raise SceneError(called(scene), problems)


def _run_time(t_end: float | None, t_start: float) -> Iterator[Defect]:
    if isinstance(t_end, int) and t_end.bit_length() > _LARGEST_BITS:
        yield Defect("t_end", f"the run ends at a number of {t_end.bit_length()} bits", "give a positive, finite time")
    elif t_end is not None and not (isfinite(t_end) and t_end > t_start):
        remedy = f"give a finite time after its start at {t_start:g} s" if t_start else "give a positive, finite time"
        yield Defect("t_end", f"the run ends at {t_end} s", remedy)


__all__ = ["Defect", "Doubt", "SceneError", "SceneWarning", "check_and_warn", "check_run", "check_scene"]
