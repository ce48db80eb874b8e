"""The MuJoCo adapter: what it supports, and how hard it may try."""

from __future__ import annotations

from collections.abc import Iterator

from crosscheck.engines.connections import KNOWN
from crosscheck.engines.contract import Effort, Model
from crosscheck.engines.hybrid.refusals import is_hybrid
from crosscheck.engines.links import is_bare_frame, links
from crosscheck.engines.pace import pace
from crosscheck.engines.peer import Library
from crosscheck.engines.steps import ladder
from crosscheck.engines.tree_engine import TreeCapabilities, TreeEngine, inertia_refusals
from flexmb.scene.schema import Scene

_RUNGS = 4
_SOFT = (
    "closures and couplings are springs and dampers (its defaults): loops open by 1e-4 to 1e-3 of their size under "
    "load, and near a stiff position loads may be off by their size"
)
_CLOSED = "events and controllers of scenes with closures or couplings: MuJoCo's are soft, and need its own steps"


class MujocoEngine(TreeEngine):
    """Rigid trees with RK4, exact but for two artifices whose errors are at round-off (see `mujoco.tree`)."""

    name = "mujoco"
    takes = ("connectors", "couplings", "controllers", "events")
    summary = "rigid trees in minimal coordinates, fixed steps"
    algorithm = "composite bodies, sparse factors"
    settings = (
        "Its own RK4, its most accurate integrator for smooth motion, in its own C loop: one call of mj_step makes all "
        "steps between two samples. Contacts are off, and bodies have no geometry. Prescribed motion, motors and "
        "functions of time are callbacks in Python where a scene has them. Scenes with events or controllers are "
        "stepped in Python, by the same method around its accelerations. Outputs are computed after the timed solve."
    )
    methods = ("RK4", "Euler", "implicit", "implicitfast")
    library = Library("MuJoCo", "mujoco", "mujoco")
    capabilities = TreeCapabilities(("spherical", "revolute", "weld"), KNOWN, couplings=True, armatures=True)

    def own_refusals(self, scene: Scene) -> Iterator[str]:
        yield from inertia_refusals((link for link in links(scene) if not is_bare_frame(link)), "MuJoCo")
        if is_hybrid(scene) and scene.constraints:
            yield _CLOSED

    def approximations(self, scene: Scene) -> Iterator[str]:
        if scene.constraints:
            yield _SOFT

    def efforts_for(self, scene: Scene, duration_s: float) -> tuple[Effort, ...]:
        """Steps by halves; the coarsest fits the scene's fastest motion."""
        return ladder("RK4", pace(scene, duration_s), duration_s, _RUNGS)

    def model(self, scene: Scene) -> Model:
        if is_hybrid(scene):
            from crosscheck.engines.hybrid.model import HybridModel
            from crosscheck.engines.mujoco.mechanics import MujocoMechanics, works

            return HybridModel(scene, MujocoMechanics, works(scene))
        from crosscheck.engines.mujoco.model import MujocoModel

        return MujocoModel(scene)
