"""The Pinocchio adapter: what it supports, and how hard it may try."""

from __future__ import annotations

from typing import TYPE_CHECKING

from crosscheck.engines.contract import Effort, EngineMissing, Support
from crosscheck.engines.links import obstacle
from flexmb.scene.schema import Scene

if TYPE_CHECKING:
    from crosscheck.engines.pinocchio.model import PinocchioModel


class PinocchioEngine:
    """Rigid trees, exact: articulated-body accelerations, hybrid dynamics where coordinates are prescribed."""

    name = "pinocchio"
    summary = "rigid trees in minimal coordinates"

    def version(self) -> str:
        try:
            import pinocchio
        except ImportError as error:
            raise EngineMissing("Pinocchio is not installed: pip install flexmb[peers]") from error
        return pinocchio.__version__

    def supports(self, scene: Scene) -> Support:
        reason = obstacle(scene, "Pinocchio")
        return Support("no", reason) if reason else Support("exact")

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        return tuple(Effort("tolerance", rtol, "DOP853") for rtol in (1e-6, 1e-9, 1e-12))

    def compile(self, scene: Scene) -> PinocchioModel:
        self.version()
        from crosscheck.engines.pinocchio.model import PinocchioModel

        support = self.supports(scene)
        if support.kind == "no":
            raise ValueError(f'scene "{scene.name}": {support.reason}')
        return PinocchioModel(scene)
