"""The Exudyn engine: rigid bodies in redundant coordinates, flexible ones in floating frames of reference."""

from __future__ import annotations

from collections.abc import Iterator

from crosscheck.engines.contract import Effort, Model
from crosscheck.engines.exudyn.assembly import flexible, unconstrained
from crosscheck.engines.exudyn.library import LIBRARY, METHODS
from crosscheck.engines.exudyn.solve import EXPLICIT
from crosscheck.engines.exudyn.support import approximations, refusals
from crosscheck.engines.pace import fastest_mode, pace
from crosscheck.engines.peer import PeerEngine
from crosscheck.engines.steps import ladder
from flexmb.scene.modal_data import modal_arrays
from flexmb.scene.schema import ModalBody, Scene

RUNGS = 3


class ExudynEngine(PeerEngine):
    library, methods = LIBRARY, METHODS
    name = "exudyn"
    takes = ("connectors",)
    summary = "rigid bodies and floating frames in redundant coordinates"
    algorithm = "redundant coordinates, Lagrange multipliers"
    settings = (
        "Its own solvers in their own C++ loop, without files, messages or contacts. Linear algebra is dense for "
        "small scenes and Eigen's sparse one for large ones, whichever is faster. A sensor in Python takes the state "
        "at every sample, and functions of time are called in Python where a scene has them; both are in the timed "
        "solve. A single free body is restarted at every sample, as its solver does not stop there by itself. Newton's "
        "method keeps its Jacobian as long as it contracts. Where it does not reach the first tolerance, the solve is "
        "made again with other settings, and only the one that is taken counts as time."
    )

    def refusals(self, scene: Scene) -> Iterator[str]:
        return refusals(scene, scene.bodies)

    def approximations(self, scene: Scene) -> Iterator[str]:
        return approximations(scene)

    def efforts_for(self, scene: Scene, duration_s: float) -> tuple[Effort, ...]:
        """One free body: error-controlled steps; else the trapezoidal rule at three steps, each half the one before.

        Generalised-alpha rings on drive torques (percents at the same step), so it is not the default.
        """
        if unconstrained(scene):
            return tuple(Effort("tolerance", tolerance, EXPLICIT) for tolerance in (1e-7, 1e-9, 1e-11))
        return ladder("TrapezoidalIndex2", pace(scene, duration_s, _fastest_mode(scene)), duration_s, RUNGS)

    def model(self, scene: Scene) -> Model:
        from crosscheck.engines.exudyn.model import ExudynModel

        return ExudynModel(scene)


def _fastest_mode(scene: Scene) -> float:
    """Of all flexible bodies (rad/s)."""
    every = [modal_arrays(body) for body in scene.bodies if isinstance(body, ModalBody) and flexible(body)]
    return max(
        (fastest_mode(a.mass, a.translation_modes, a.inertia, a.rotation_modes, a.stiffness) for a in every),
        default=0.0,
    )
