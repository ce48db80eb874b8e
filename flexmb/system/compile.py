"""Scenes become systems: `System` for trees, `ClosedSystem` where closures close loops."""

from __future__ import annotations

from typing import get_args

from flexmb.jain.elimination import Elimination
from flexmb.scene.check import check_scene
from flexmb.scene.garbage import collector_paused
from flexmb.scene.schema import Scene
from flexmb.system.tree_system import System
from flexmb.tables import arguments


def compile(scene: Scene, elimination: Elimination = "fastest") -> System:  # noqa: A001  (used as flexmb.compile)
    """Check a scene and turn it into arrays.

    elimination: how the recursion eliminates the modes of each body, (63) of Jain & Rodriguez: "explicit" factorises
    D_f, "woodbury" is their (B3), corrected, "condensed" costs O(n_m); where one does not apply, D_f is factorised.
    All give the same accelerations; "fastest" chooses by body, and `System.elimination` says what was chosen. Scenes
    with closures factorise D_f whatever is asked for.

    Raises SceneError for a scene that is wrong, ValueError for an elimination that does not exist, NotImplementedError
    for a scene that is right but needs what is not supported yet (SID files).
    """
    check_scene(scene)
    return assembled(scene, elimination)


def assembled(scene: Scene, elimination: Elimination = "fastest") -> System:
    """The system of a scene that was checked before."""
    arguments.one_of("elimination", elimination, get_args(Elimination))
    if scene.closures:
        from flexmb.system.closed import ClosedSystem  # a tree needs none of it

        with collector_paused():
            return ClosedSystem(scene)
    with collector_paused():
        return System(scene, elimination)
