"""The Drake adapter: what it supports, and how hard it may try."""

from __future__ import annotations

from collections.abc import Iterator

from crosscheck.engines.connections import KNOWN
from crosscheck.engines.contract import Effort, Model
from crosscheck.engines.links import links
from crosscheck.engines.peer import Library
from crosscheck.engines.tree_engine import TreeCapabilities, TreeEngine, inertia_refusals
from flexmb.scene.schema import Scene


class DrakeEngine(TreeEngine):
    """Rigid trees in continuous time, exact but for the artifice of prescribed coordinates (see `drake.tree`)."""

    name = "drake"
    takes = ("connectors",)
    summary = "rigid trees in minimal coordinates, error-controlled Runge-Kutta 5"
    library = Library("Drake", "pydrake", "drake")
    # continuous plants throw on constraints
    capabilities = TreeCapabilities(
        connected_by=KNOWN, armatures=True,
        loops="closes loops in its discrete-time plants only, by a method of first order",
    )  # fmt: skip
    # Accuracies bound the absolute error of one step; that of a run is about a thousand times as large.
    ladder = tuple(Effort("tolerance", accuracy, "runge_kutta5") for accuracy in (1e-8, 1e-10, 1e-12, 1e-13))

    methods = (
        "runge_kutta5", "runge_kutta3", "runge_kutta2", "bogacki_shampine3", "explicit_euler", "semi_explicit_euler",
        "implicit_euler", "radau1", "radau3", "velocity_implicit_euler",
    )  # fmt: skip

    def own_refusals(self, scene: Scene) -> Iterator[str]:
        yield from inertia_refusals(links(scene), "Drake")

    def model(self, scene: Scene) -> Model:
        from crosscheck.engines.drake.model import DrakeModel

        return DrakeModel(scene)
