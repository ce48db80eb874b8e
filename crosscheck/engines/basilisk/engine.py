"""The Basilisk adapter: what it supports, and how hard it may try."""

from __future__ import annotations

from importlib.metadata import version
from typing import TYPE_CHECKING

from crosscheck.engines.basilisk.craft import NoCraft, craft_of
from crosscheck.engines.contract import Effort, EngineMissing, Support
from crosscheck.engines.links import obstacle
from flexmb.scene.schema import Scene

if TYPE_CHECKING:
    from crosscheck.engines.basilisk.model import BasiliskModel


class BasiliskEngine:
    """One free hub with balanced wheels, and serial chains of hinged or of sliding parts on it."""

    name = "basilisk"
    summary = "one spacecraft: a free hub, balanced wheels, hinged and sliding parts"
    algorithm = "hub and effectors, back-substitution"
    settings = (
        "The equations of motion of its Spacecraft with its own effectors, compiled and called from Python, stepped by "
        "SciPy's DOP853, in Python. Its own integrators hold torques constant over a step of a clock of whole "
        "nanoseconds, and would be off by that. Outputs are observed after the timed solve."
    )

    def version(self) -> str:
        try:
            import Basilisk  # noqa: F401
        except ImportError as error:
            raise EngineMissing("Basilisk is not installed: pip install flexmb[more-peers]") from error
        return version("bsk")

    def supports(self, scene: Scene) -> Support:
        reason = obstacle(scene, "Basilisk", ())
        try:
            if not reason:
                craft_of(scene)
        except NoCraft as error:
            reason = str(error)
        return Support("no", reason) if reason else Support("exact")

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        return tuple(Effort("tolerance", rtol, "DOP853") for rtol in (1e-8, 1e-10, 1e-12))

    def compile(self, scene: Scene) -> BasiliskModel:
        self.version()
        from crosscheck.engines.basilisk.model import BasiliskModel

        support = self.supports(scene)
        if support.kind == "no":
            raise ValueError(f'scene "{scene.name}": {support.reason}')
        return BasiliskModel(scene)
