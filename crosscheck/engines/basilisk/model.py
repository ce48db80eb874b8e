"""One scene compiled for Basilisk."""

from __future__ import annotations

from crosscheck.engines.basilisk.craft import craft_of
from crosscheck.engines.basilisk.dynamics import CraftDynamics
from crosscheck.engines.basilisk.observer import BasiliskObserver
from crosscheck.engines.scipy_loop import ScipyModel
from flexmb.scene.schema import Scene


def compiled(scene: Scene) -> ScipyModel:
    dynamics = CraftDynamics(craft_of(scene), scene)
    return ScipyModel(scene, dynamics, BasiliskObserver(dynamics, scene))
