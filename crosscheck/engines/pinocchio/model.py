"""One scene compiled for Pinocchio."""

from __future__ import annotations

import numpy as np

from crosscheck.engines.links import links
from crosscheck.engines.pinocchio.dynamics import Dynamics
from crosscheck.engines.pinocchio.linear import linearised
from crosscheck.engines.pinocchio.observer import PinocchioObserver
from crosscheck.engines.pinocchio.tree import build_tree
from crosscheck.engines.scipy_loop import ScipyModel
from flexmb.scene.schema import Scene


def compiled(scene: Scene) -> ScipyModel:
    dynamics = Dynamics(build_tree(links(scene), np.array(scene.gravity_m_s2, dtype=float)), scene)
    observer = PinocchioObserver(dynamics, scene)
    return ScipyModel(scene, dynamics, observer, linearised(dynamics, scene))
