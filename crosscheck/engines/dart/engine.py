"""The DART adapter: what it supports, and how hard it may try."""

from __future__ import annotations

from crosscheck.engines.contract import Model
from crosscheck.engines.links import links
from crosscheck.engines.peer import Library
from crosscheck.engines.scipy_loop import METHODS, RTOL_LADDER, ScipyModel
from crosscheck.engines.tree_engine import TreeCapabilities, TreeEngine
from flexmb.scene.schema import Scene


class DartEngine(TreeEngine):
    """Rigid trees, exact: DART's forward dynamics, hybrid where coordinates are prescribed."""

    name = "dart"
    summary = "rigid trees in minimal coordinates, hybrid dynamics of its own"
    algorithm = "articulated bodies, O(N)"
    settings = (
        "The articulated-body dynamics of its Skeleton, compiled and called from Python, with SciPy's DOP853, also in "
        "Python: on small scenes much of the time is Python's. DART's own World.step is a semi-implicit Euler method "
        "of first order with implicit springs and dampers, too inaccurate for a comparison. No contacts. Outputs are "
        "computed after the timed solve."
    )
    library = Library("DART", "dartpy", "dartpy")
    # its constraints are impulses in a step and no part of the forward dynamics
    capabilities = TreeCapabilities(loops="closes loops by impulses of its own steps only, to first order")
    ladder, methods = RTOL_LADDER, METHODS

    def model(self, scene: Scene) -> Model:
        from crosscheck.engines.dart.dynamics import DartDynamics
        from crosscheck.engines.dart.observer import DartObserver
        from crosscheck.engines.dart.tree import build_tree

        dynamics = DartDynamics(build_tree(scene, links(scene)), scene)
        return ScipyModel(scene, dynamics, DartObserver(dynamics, scene))
