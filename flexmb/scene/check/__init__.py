"""Can this scene be simulated? Every defect is found before anything runs, with its place and its remedy."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite

from flexmb.scene.check.beams import beams
from flexmb.scene.check.control import control
from flexmb.scene.check.events import events
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
PHYSICS = (
    rigid_bodies, beams, modal_bodies, modal_states, hinges, closures, wheels, point_masses, control, events,
)  # fmt: skip


def check_scene(scene: Scene, t_end: float | None = None, t_start: float = 0.0) -> None:
    """Raise SceneError with all problems of a scene, or return. Profiles must cover t_start (s), with `t_end` (s) the
    run from there.

    SID bodies and every fidelity level pass: `compile` decides whether they can be run. Raises TypeError for anything
    but a Scene.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"a Scene is needed, not {type(scene).__name__}: load_scene reads one, SceneBuilder makes one")
    with collector_paused():
        problems = _problems(scene, t_end, t_start)
    if problems:
        raise SceneError(scene.name, problems)


def _problems(scene: Scene, t_end: float | None, t_start: float) -> list[Defect]:
    refuse_wrong_types(scene)  # a struct built by hand may hold values of any type
    problems = [*_run_time(t_end, t_start)]
    problems += [problem for check in EVERYWHERE + STRUCTURE + PHYSICS for problem in check(scene)]
    problems += functions(scene, t_end, t_start)
    if not problems:  # needs sound numbers, names and a tree to stand on
        problems += moved_inertia(scene)
    return problems


def check_run(scene: Scene, t_end: float, t_start: float = 0.0) -> None:
    """Raise SceneError unless a scene that was checked before can be run from `t_start` to `t_end` (s), which its
    profiles have to cover."""
    problems = [*_run_time(t_end, t_start), *functions(scene, t_end, t_start)]
    if problems:
        raise SceneError(scene.name, problems)


def _run_time(t_end: float | None, t_start: float) -> Iterator[Defect]:
    if t_end is not None and not (isfinite(t_end) and t_end > t_start):
        remedy = f"give a finite time after its start at {t_start:g} s" if t_start else "give a positive, finite time"
        yield Defect("t_end", f"the run ends at {t_end} s", remedy)


__all__ = ["Defect", "SceneError", "check_run", "check_scene"]
