"""The Basilisk adapter: what it supports, and how hard it may try."""

from __future__ import annotations

from collections.abc import Iterator

from crosscheck.engines.basilisk.craft import NoCraft, craft_of
from crosscheck.engines.contract import Model
from crosscheck.engines.peer import Library
from crosscheck.engines.scipy_loop import METHODS, RTOL_LADDER, ScipyModel
from crosscheck.engines.tree_engine import TreeCapabilities, TreeEngine
from flexmb.scene.schema import Scene


class BasiliskEngine(TreeEngine):
    """One free hub with balanced wheels, and serial chains of hinged or of sliding parts on it."""

    name = "basilisk"
    summary = "one spacecraft: a free hub, balanced wheels, hinged and sliding parts"
    algorithm = "hub and effectors, back-substitution"
    settings = (
        "The equations of motion of its Spacecraft with its own effectors, compiled and called from Python, with "
        "SciPy's DOP853, also in Python. Basilisk's own integrators hold torques constant in a step and count time in "
        "whole nanoseconds, which limits their accuracy. Outputs are computed after the timed solve."
    )
    library = Library("Basilisk", "Basilisk", "bsk")
    capabilities = TreeCapabilities()
    ladder, methods = RTOL_LADDER, METHODS

    def own_refusals(self, scene: Scene) -> Iterator[str]:
        try:
            craft_of(scene)
        except NoCraft as error:
            yield str(error)

    def model(self, scene: Scene) -> Model:
        from crosscheck.engines.basilisk.dynamics import CraftDynamics
        from crosscheck.engines.basilisk.observer import BasiliskObserver

        dynamics = CraftDynamics(craft_of(scene), scene)
        return ScipyModel(scene, dynamics, BasiliskObserver(dynamics, scene))
