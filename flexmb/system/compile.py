"""Scenes become systems."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, get_args

from msgspec.structs import replace

from flexmb.jain.elimination import Elimination
from flexmb.scene.bodies import BeamBody, SidBody
from flexmb.scene.check import check_and_warn, check_scene
from flexmb.scene.check.starting import built
from flexmb.scene.garbage import collector_paused
from flexmb.scene.rest_curve import is_curved
from flexmb.scene.schema import Scene
from flexmb.scene.strains import points_of_piece
from flexmb.system.system import System
from flexmb.tables import arguments
from flexmb.tables.features import Kernels, asking

if TYPE_CHECKING:
    from flexmb.system.batch import Batch


def compile(  # noqa: A001  (used as flexmb.compile)
    scene: Scene, elimination: Elimination = "fastest", kernels: Kernels | None = None
) -> System:
    """Check a scene and turn it into arrays.

    elimination: how the recursion eliminates the modes of each body, (63) of Jain & Rodriguez: "explicit" factorises
    D_f, "woodbury" is their (B3), corrected, "condensed" costs O(n_m); where one does not apply, D_f is factorised.
    All give the same accelerations; "fastest" chooses by body, and `System.elimination` says what was chosen. Scenes
    with closures factorise D_f whatever is asked for.

    kernels: "general" ones take every scene and come with the installation; "special" ones are compiled for the kind of
    this scene, in seconds, when first needed, are kept on disk, and run faster by a tenth to a third; "auto" takes
    general ones where they are at hand, unless special ones were compiled ahead (`flexmb warmup SCENE`).
    None: what the environment variable FLEXMB_KERNELS says, or "auto". `System.kernels` says which it is; results of
    the two differ by rounding.

    SID bodies are read from their files here. Warns (`SceneWarning`) of what is doubtful. Raises SceneError for a scene
    that is wrong, SidError or OSError for a SID file that cannot be used, ValueError for an elimination or kernels that
    do not exist, NotImplementedError for a scene that is right but needs what is not supported yet.
    """
    if kernels is not None:
        arguments.one_of("kernels", kernels, get_args(Kernels))
    check_and_warn(scene)
    with asking(kernels):
        return assembled(scene, elimination)


def assembled(scene: Scene, elimination: Elimination = "fastest") -> System:
    """The system of a scene that has been checked."""
    arguments.one_of("elimination", elimination, get_args(Elimination))
    scene = _read(scene)
    with collector_paused(), built(scene):
        if scene.constraints:
            return System(scene, closed=True)
        return System(scene, elimination)


def compile_batch(scenes: Sequence[Scene]) -> Batch:
    """Check scenes of one structure and turn them into a batch, one copy for each.

    They may differ in all numbers: masses, inertias, lengths, axes, stiffnesses, dampings, loads, functions, initial
    states. Raises SceneError for a scene that is wrong, TypeError for anything but scenes, ValueError where there is
    none, or where one has another structure than the first: another hinge, level, mode or load, or another name.
    """
    from flexmb.system.batch import Batch, listed  # imported here, because only batches need lanes

    scenes = listed("scenes", scenes)
    for scene in scenes:
        check_and_warn(scene)
    return Batch([assembled(scene, "explicit") for scene in _with_equal_points(scenes)])


def _with_equal_points(scenes: Sequence[Scene]) -> list[Scene]:
    """The scenes, with as many default points of each curved beam as any of them has: these depend on numbers in which
    copies may differ, and are part of their structure."""
    most: dict[str, int] = {}
    for body in (body for scene in scenes for body in scene.bodies):
        if isinstance(body, BeamBody) and body.level == "exact" and body.modes.points is None and is_curved(body):
            most[body.name] = max(most.get(body.name, 0), points_of_piece(body))
    return [_with_points(scene, most) for scene in scenes] if most else list(scenes)


def _with_points(scene: Scene, points: dict[str, int]) -> Scene:
    """The scene with these points of beams that have default ones."""
    bodies = tuple(
        replace(body, modes=replace(body.modes, points=points[body.name]))
        if isinstance(body, BeamBody) and body.name in points and body.modes.points is None else body
        for body in scene.bodies
    )  # fmt: skip
    return replace(scene, bodies=bodies)


def _read(scene: Scene) -> Scene:
    """The scene with its SID bodies read, and checked again: only now their nodes and modes are known."""
    if not any(isinstance(body, SidBody) for body in scene.bodies):
        return scene
    from flexmb.interchange.sid import with_sid_bodies  # imported here, because few scenes need it

    scene = with_sid_bodies(scene)
    check_scene(scene)
    return scene
