"""The Pinocchio adapter: what it supports, and how hard it may try."""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_args

from crosscheck.engines.connections import KNOWN
from crosscheck.engines.contract import Effort, Model
from crosscheck.engines.hybrid.refusals import is_hybrid
from crosscheck.engines.pace import pace
from crosscheck.engines.peer import Library
from crosscheck.engines.scipy_loop import METHODS, RTOL_LADDER
from crosscheck.engines.tree_engine import TreeCapabilities, TreeEngine
from flexmb.scene.hinges import ClosureKind
from flexmb.scene.schema import Scene

MOST_JOINTS = 500
WHY_NOT_MORE = "Pinocchio's data hold arrays of n x n x n numbers for n speeds, and more than 20 GB for 1000"
STIFF_LADDER = tuple(Effort("tolerance", rtol, "Radau") for rtol in (1e-6, 1e-8, 1e-10))
STIFF = 1e5
"""Radians or decay times of the fastest spring or damper in a run, from which an explicit method would make tens of
thousands of steps for stability alone: joints with damping or friction and hardly any inertia."""


class PinocchioEngine(TreeEngine):
    """Rigid trees, exact: articulated-body accelerations, hybrid dynamics where coordinates are prescribed."""

    name = "pinocchio"
    takes = ("connectors", "couplings", "controllers", "events", "t_start")
    summary = "rigid trees in minimal coordinates"
    algorithm = "articulated bodies, O(N)"
    settings = (
        "Its articulated-body algorithm, or its proximal constrained dynamics for closed loops, compiled and called "
        "from Python. It has no integrator: SciPy's DOP853 steps it, or Radau where joints are stiff, in Python, so "
        "that on small scenes most of the time is SciPy's and Python's; events and controllers are in a loop in Python "
        "around it. No contacts. Outputs are computed after the timed solve."
    )
    library = Library("Pinocchio", "pinocchio", "pin")
    capabilities = TreeCapabilities(get_args(ClosureKind), KNOWN, screws=True, couplings=True, armatures=True)
    methods = METHODS

    def own_refusals(self, scene: Scene) -> Iterator[str]:
        if len(scene.hinges) > MOST_JOINTS:
            yield f"{len(scene.hinges)} hinges are too many: {WHY_NOT_MORE}"

    def efforts_for(self, scene: Scene, duration_s: float) -> tuple[Effort, ...]:
        """Tolerances of an explicit method, of an implicit one for stiff joints; the loop of events has none."""
        is_stiff = not is_hybrid(scene) and pace(scene, duration_s).elastic * duration_s > STIFF
        return STIFF_LADDER if is_stiff else RTOL_LADDER

    def model(self, scene: Scene) -> Model:
        from crosscheck.engines.pinocchio.model import compiled

        return compiled(scene)
