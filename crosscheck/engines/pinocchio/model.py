"""One scene compiled for Pinocchio."""

from __future__ import annotations

import numpy as np

from crosscheck.engines.contract import Model, Snapshot
from crosscheck.engines.functions_of_time import Signals
from crosscheck.engines.hybrid.model import HybridModel
from crosscheck.engines.hybrid.refusals import is_hybrid
from crosscheck.engines.links import Link, links
from crosscheck.engines.pinocchio.dynamics import Dynamics
from crosscheck.engines.pinocchio.linear import linearised
from crosscheck.engines.pinocchio.observer import PinocchioObserver
from crosscheck.engines.pinocchio.tree import PinocchioSlot, PinocchioTree, build_tree
from crosscheck.engines.rigid_tree import TreeState
from crosscheck.engines.scipy_loop import ScipyModel
from flexmb.scene.schema import Scene


def compiled(scene: Scene) -> Model:
    if is_hybrid(scene):
        return HybridModel(scene, PinocchioMechanics)
    dynamics = Dynamics(_tree(scene, links(scene)), scene)
    observer = PinocchioObserver(dynamics, scene)
    return ScipyModel(scene, dynamics, observer, linearised(dynamics, scene))


class PinocchioMechanics(Dynamics):
    """The dynamics and what is seen of it, between two events."""

    def __init__(self, scene: Scene, chain: tuple[Link, ...], signals: Signals) -> None:
        super().__init__(_tree(scene, chain), scene, signals)
        self._observer = PinocchioObserver(self, scene)

    @property
    def slots(self) -> tuple[PinocchioSlot, ...]:
        return self.tree.slots

    def observe(self, t: float, state: TreeState) -> Snapshot:
        return self._observer.observe(t, state)


def _tree(scene: Scene, chain: tuple[Link, ...]) -> PinocchioTree:
    return build_tree(chain, np.array(scene.gravity_m_s2, dtype=float))
