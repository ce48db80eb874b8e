"""Can this scene be simulated? Every defect is found before anything runs, with its place and its remedy."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite

from flexmb.scene.check.beams import beams
from flexmb.scene.check.control import control
from flexmb.scene.check.hinges import closures, hinges, point_masses, wheels
from flexmb.scene.check.inertia import rigid_bodies
from flexmb.scene.check.modal import modal_bodies, modal_states
from flexmb.scene.check.names import references, unique_names
from flexmb.scene.check.outboard import moved_inertia
from flexmb.scene.check.profiles import functions
from flexmb.scene.check.topology import tree
from flexmb.scene.check.walk import finite_numbers, unit_quaternions, unit_vectors
from flexmb.scene.convert import refuse_wrong_types
from flexmb.scene.garbage import collector_paused
from flexmb.scene.problems import Defect, SceneError
from flexmb.scene.schema import Scene

EVERYWHERE = (finite_numbers, unit_vectors, unit_quaternions)
STRUCTURE = (unique_names, references, tree)
PHYSICS = (rigid_bodies, beams, modal_bodies, modal_states, hinges, closures, wheels, point_masses, control)


def check_scene(scene: Scene, t_end: float | None = None) -> None:
    """Raise SceneError with all problems of a scene, or return. With `t_end` (s) profiles must cover the run.

    SID bodies and every fidelity level pass: `compile` decides whether they can be run. Raises TypeError for anything
    but a Scene.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"a Scene is needed, not {type(scene).__name__}: load_scene reads one, SceneBuilder makes one")
    with collector_paused():
        problems = _problems(scene, t_end)
    if problems:
        raise SceneError(scene.name, problems)


def _problems(scene: Scene, t_end: float | None) -> list[Defect]:
    refuse_wrong_types(scene)  # a struct built by hand may hold values of any type
    problems = [*_run_time(t_end), *(problem for check in EVERYWHERE + STRUCTURE + PHYSICS for problem in check(scene))]
    problems += functions(scene, t_end)
    if not problems:  # needs sound numbers, names and a tree to stand on
        problems += moved_inertia(scene)
    return problems


def check_run(scene: Scene, t_end: float) -> None:
    """Raise SceneError unless a scene that was checked before can be run to `t_end` (s): its profiles cover the run."""
    problems = [*_run_time(t_end), *functions(scene, t_end)]
    if problems:
        raise SceneError(scene.name, problems)


def _run_time(t_end: float | None) -> Iterator[Defect]:
    if t_end is not None and not (isfinite(t_end) and t_end > 0.0):
        yield Defect("t_end", f"the run ends at {t_end} s", "give a positive, finite time")


__all__ = ["Defect", "SceneError", "check_run", "check_scene"]
