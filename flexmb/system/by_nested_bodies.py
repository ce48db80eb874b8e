"""Accelerations by the nested-body equations of Frisch (1975), corrected and to the letter of the print."""

from __future__ import annotations

from collections.abc import Set
from typing import Any

from flexmb.frisch.errata import AS_PRINTED, CORRECTED, Erratum
from flexmb.motion import coordinates
from flexmb.system.algorithm import Algorithm, DynamicsAlgorithm, Route
from flexmb.system.mechanics import Mechanics
from flexmb.typing import Real


def _declared(name: Algorithm, summary: str, errata: Set[Erratum]) -> DynamicsAlgorithm:
    def kernel() -> Any:
        from flexmb.frisch import evaluation  # imported here, because users of other algorithms do not need it

        return evaluation.accelerations

    def own(system: Mechanics) -> tuple[Any, Any]:
        nested = system.nested_system(errata)
        return nested.constants, nested.own_workspace

    def fresh(system: Mechanics) -> tuple[Any, Any]:
        nested = system.nested_system(errata)
        return nested.constants, nested.workspace()

    def observe(system: Mechanics, t: float, y: Real) -> None:
        nested = system.nested_system(errata)
        status, motion = nested.motion(t, y)
        system.check_status(status, nested.fault)
        system.check_precision(t, y, nested)
        system.observe_motion(t, y, motion.accelerations, motion.drives, motion.loads)
        system.observation.out.wheel_loads[:, :3] = motion.wheel_torques

    def route(system: Mechanics) -> Route:
        from flexmb.frisch import evaluation

        system.nested_system(errata)  # raises here rather than in the run
        return Route(lambda: fresh(system), evaluation.rhs, coordinates.project)

    return DynamicsAlgorithm(name, summary, kernel, own, fresh, observe, route=route, matrices=4, errata=errata)


FRISCH = _declared("frisch", "the nested-body equations of 1975, corrected", CORRECTED)
FRISCH_AS_PRINTED = _declared("frisch_as_printed", "the same to the letter of the print", AS_PRINTED)
