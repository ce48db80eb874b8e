"""One scene compiled for DART."""

from __future__ import annotations

from crosscheck.engines.dart.dynamics import DartDynamics
from crosscheck.engines.dart.observer import DartObserver
from crosscheck.engines.dart.tree import build_tree
from crosscheck.engines.links import links
from crosscheck.engines.scipy_loop import ScipyModel
from flexmb.scene.schema import Scene


def compiled(scene: Scene) -> ScipyModel:
    dynamics = DartDynamics(build_tree(scene, links(scene)), scene)
    return ScipyModel(scene, dynamics, DartObserver(dynamics, scene))
