"""The MuJoCo adapter: what it supports, and how hard it may try."""

from __future__ import annotations

from crosscheck.engines.connections import KNOWN
from crosscheck.engines.contract import Effort, Model, Support
from crosscheck.engines.hybrid.refusals import is_hybrid, refusal
from crosscheck.engines.links import is_bare_frame, links, obstacle
from crosscheck.engines.pace import pace
from crosscheck.engines.peer import PeerEngine, inertia_obstacle, needed
from crosscheck.engines.steps import USUAL_S, ladder
from flexmb.scene.schema import Scene

_RUNGS = 4
_SOFT = (
    "closures and couplings are springs and dampers (its defaults): loops open by 1e-4 to 1e-3 of their size under "
    "load, and near a stiff position loads may be off by their size"
)
_CLOSED = "events and controllers of scenes with closures or couplings: MuJoCo's are soft, and need its own steps"


class MujocoEngine(PeerEngine):
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

    def version(self) -> str:
        with needed("MuJoCo", "mujoco"):
            import mujoco
        return mujoco.__version__

    def obstacle(self, scene: Scene) -> str:
        reason = obstacle(scene, "MuJoCo", ("spherical", "revolute", "weld"), KNOWN, couplings=True, armatures=True)
        reason = reason or inertia_obstacle((link for link in links(scene) if not is_bare_frame(link)), "MuJoCo")
        return reason or refusal(scene) or (_CLOSED if is_hybrid(scene) and scene.constraints else "")

    def supports(self, scene: Scene) -> Support:
        support = super().supports(scene)
        return Support("surrogate", _SOFT) if support.kind == "exact" and scene.constraints else support

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        return self.efforts_for(scene, USUAL_S)

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
