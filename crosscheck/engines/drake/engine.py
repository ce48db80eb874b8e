"""The Drake adapter: what it supports, and how hard it may try."""

from __future__ import annotations

from importlib.metadata import version

from crosscheck.engines.connections import KNOWN
from crosscheck.engines.contract import Effort, Model
from crosscheck.engines.links import links, obstacle
from crosscheck.engines.peer import PeerEngine, inertia_obstacle, needed
from flexmb.scene.schema import Scene


class DrakeEngine(PeerEngine):
    """Rigid trees in continuous time, exact but for the artifice of prescribed coordinates (see `drake.tree`)."""

    name = "drake"
    takes = ("connectors",)
    summary = "rigid trees in minimal coordinates, error-controlled Runge-Kutta 5"

    def version(self) -> str:
        with needed("Drake", "drake"):
            import pydrake  # noqa: F401
        return version("drake")

    def obstacle(self, scene: Scene) -> str:
        reason = _open_loops_only(scene) or obstacle(scene, "Drake", (), KNOWN, armatures=True)
        return reason or inertia_obstacle(links(scene), "Drake")

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        """Accuracies bound the absolute error of one step; that of a run is about a thousand times as large."""
        return tuple(Effort("tolerance", accuracy, "runge_kutta5") for accuracy in (1e-8, 1e-10, 1e-12, 1e-13))

    def model(self, scene: Scene) -> Model:
        from crosscheck.engines.drake.model import DrakeModel

        return DrakeModel(scene)


def _open_loops_only(scene: Scene) -> str:
    """Why a closed loop is refused: continuous plants throw on constraints."""
    if not scene.closures:
        return ""
    name = scene.closures[0].name
    return f'closure "{name}": Drake closes loops in its discrete-time plants only, by a method of first order'
