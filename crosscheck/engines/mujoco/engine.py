"""The MuJoCo adapter: what it supports, and how hard it may try."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crosscheck.engines.connections import KNOWN
from crosscheck.engines.contract import Effort, EngineMissing, Support
from crosscheck.engines.links import Link, links, obstacle
from crosscheck.engines.pace import pace
from crosscheck.engines.steps import USUAL_S, ladder
from flexmb.scene.schema import Scene

if TYPE_CHECKING:
    from crosscheck.engines.mujoco.model import MujocoModel

_RUNGS = 4
_SOFT = "closures are springs and dampers (its defaults): loops open by 1e-4 to 1e-3 of their size under load"


class MujocoEngine:
    """Rigid trees with RK4, exact but for two artifices whose errors are at round-off (see `mujoco.tree`)."""

    name = "mujoco"
    takes = ("connectors",)
    summary = "rigid trees in minimal coordinates, fixed steps"
    algorithm = "composite bodies, sparse factors"
    settings = (
        "Its own RK4, its most accurate integrator for smooth motion, in its own C loop: one call of mj_step makes all "
        "steps between two samples. Contacts are off, and bodies have no geometry. Prescribed motion, motors and "
        "functions of time are callbacks in Python where a scene has them. Outputs are observed after the timed solve."
    )

    def version(self) -> str:
        try:
            import mujoco
        except ImportError as error:
            raise EngineMissing("MuJoCo is not installed: pip install flexmb[peers]") from error
        return mujoco.__version__

    def supports(self, scene: Scene) -> Support:
        reason = obstacle(scene, "MuJoCo", ("spherical",), KNOWN)
        if not reason:
            reason = next(filter(None, map(_refusal, links(scene))), "")
        if reason:
            return Support("no", reason)
        return Support("surrogate", _SOFT) if scene.closures else Support("exact")

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        return self.efforts_for(scene, USUAL_S)

    def efforts_for(self, scene: Scene, duration_s: float) -> tuple[Effort, ...]:
        """Steps by halves, the coarsest fitting the scene's pace."""
        return ladder("RK4", pace(scene, duration_s), duration_s, _RUNGS)

    def compile(self, scene: Scene) -> MujocoModel:
        self.version()
        from crosscheck.engines.mujoco.model import MujocoModel

        support = self.supports(scene)
        if support.kind == "no":
            raise ValueError(f'scene "{scene.name}": {support.reason}')
        return MujocoModel(scene)


def _refusal(link: Link) -> str:
    """Why MuJoCo's compiler would reject a link."""
    if link.inertia.mass <= 0.0:
        return f'MuJoCo needs a positive mass on every link ("{link.name}")'
    a, b, c = np.linalg.eigvalsh(link.inertia.inertia)
    if a < -1e-12 * c or a + b < c * (1.0 - 1e-12):
        return f'MuJoCo refuses the inertia of "{link.name}": principal moments {a:g}, {b:g}, {c:g} kg m^2'
    return ""
