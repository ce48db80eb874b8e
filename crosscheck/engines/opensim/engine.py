"""The OpenSim adapter: what it supports, and how hard it may try."""

from __future__ import annotations

from collections.abc import Iterator

from crosscheck.engines.connections import KNOWN
from crosscheck.engines.contract import Model
from crosscheck.engines.links import links
from crosscheck.engines.peer import Library
from crosscheck.engines.scipy_loop import METHODS, RTOL_LADDER, ScipyModel
from crosscheck.engines.tree_engine import TreeCapabilities, TreeEngine
from flexmb.scene.hinges import ClosureKind
from flexmb.scene.schema import Scene

CLOSED_BY: tuple[ClosureKind, ...] = ("spherical", "weld")
MASSLESS = 1e-13
"""kg: OpenSim drops the inertia of bodies lighter than 2e-14 kg, so lighter ones are refused where they have one."""


class OpensimEngine(TreeEngine):
    """Rigid trees and loops, exact: the forward dynamics of Simbody, OpenSim's multibody code."""

    name = "opensim"
    takes = ("connectors", "couplings", "t_start")
    summary = "rigid trees in minimal coordinates, by Simbody"
    algorithm = "articulated bodies, O(N)"
    settings = (
        "Simbody's articulated-body dynamics through a Model of OpenSim, compiled and called from Python, with SciPy's "
        "DOP853, also in Python: on small scenes much of the time is Python's. Simbody's own integrators see forces "
        "through classes of C++ alone. No contacts. Outputs are computed after the timed solve."
    )
    library = Library("OpenSim", "opensim", "opensim")
    capabilities = TreeCapabilities(CLOSED_BY, KNOWN, screws=True, couplings=True)
    ladder, methods = RTOL_LADDER, METHODS

    def own_refusals(self, scene: Scene) -> Iterator[str]:
        for link in links(scene):
            if link.inertia.mass < MASSLESS and link.inertia.inertia.any():
                yield f'OpenSim drops the inertia of a link without mass ("{link.name}"): give it some mass'

    def model(self, scene: Scene) -> Model:
        from crosscheck.engines.opensim.dynamics import OpensimDynamics
        from crosscheck.engines.opensim.linear import linearised
        from crosscheck.engines.opensim.observer import OpensimObserver
        from crosscheck.engines.opensim.tree import build_tree

        dynamics = OpensimDynamics(build_tree(scene, links(scene)), scene)
        return ScipyModel(scene, dynamics, OpensimObserver(dynamics, scene), linearised(dynamics, scene))
