"""The Drake adapter: what it supports, and how hard it may try."""

from __future__ import annotations

from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np

from crosscheck.engines.connections import KNOWN
from crosscheck.engines.contract import Effort, EngineMissing, Support
from crosscheck.engines.links import Link, links, obstacle
from flexmb.scene.schema import Scene

if TYPE_CHECKING:
    from crosscheck.engines.drake.model import DrakeModel


class DrakeEngine:
    """Rigid trees in continuous time, exact but for the artifice of prescribed coordinates (see `drake.tree`)."""

    name = "drake"
    takes = ("connectors",)
    summary = "rigid trees in minimal coordinates, error-controlled Runge-Kutta 5"

    def version(self) -> str:
        try:
            import pydrake  # noqa: F401
        except ImportError as error:
            raise EngineMissing("Drake is not installed: pip install flexmb[more-peers]") from error
        return version("drake")

    def supports(self, scene: Scene) -> Support:
        reason = _open_loops_only(scene) or obstacle(scene, "Drake", (), KNOWN)
        if not reason:
            reason = next(filter(None, map(_refusal, links(scene))), "")
        return Support("no", reason) if reason else Support("exact")

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        """Accuracies bound the error of one step, absolutely; that of a run is a thousand times as large."""
        return tuple(Effort("tolerance", accuracy, "runge_kutta5") for accuracy in (1e-8, 1e-10, 1e-12, 1e-13))

    def compile(self, scene: Scene) -> DrakeModel:
        self.version()
        from crosscheck.engines.drake.model import DrakeModel

        support = self.supports(scene)
        if support.kind == "no":
            raise ValueError(f'scene "{scene.name}": {support.reason}')
        return DrakeModel(scene)


def _open_loops_only(scene: Scene) -> str:
    """Why a closed loop is refused: continuous plants throw on constraints."""
    if not scene.closures:
        return ""
    name = scene.closures[0].name
    return f'closure "{name}": Drake closes loops in its discrete-time plants only, by a method of first order'


def _refusal(link: Link) -> str:
    """Why Drake would reject a link's spatial inertia."""
    if link.inertia.mass <= 0.0:
        return f'Drake needs a positive mass on every link ("{link.name}"): its inertia is a multiple of the mass'
    a, b, c = np.linalg.eigvalsh(link.inertia.inertia)
    if a < -1e-12 * c or a + b < c * (1.0 - 1e-12):
        return f'Drake refuses the inertia of "{link.name}": principal moments {a:g}, {b:g}, {c:g} kg m^2'
    return ""
