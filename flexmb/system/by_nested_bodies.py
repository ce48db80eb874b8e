"""Accelerations by the nested-body equations of Frisch (1975), corrected and to the letter of the print."""

from __future__ import annotations

from typing import Any

from flexmb.entry.observation import Outputs
from flexmb.frisch.errata import AS_PRINTED, CORRECTED
from flexmb.motion import coordinates
from flexmb.system.algorithm import Algorithm, DynamicsAlgorithm, Route
from flexmb.system.mechanics import Mechanics
from flexmb.typing import Real


def _declared(name: Algorithm, summary: str, **more: Any) -> DynamicsAlgorithm:
    def accelerations(system: Mechanics, t: float, y: Real) -> Real:
        nested = system.nested(name)
        status, rates = nested.accelerations(t, y)
        system._check(status, nested.fault)
        system._trust(t, y, nested)
        return rates

    def observe(system: Mechanics, t: float, y: Real, out: Outputs) -> None:
        nested = system.nested(name)
        status, motion = nested.motion(t, y)
        system._check(status, nested.fault)
        system._trust(t, y, nested)
        out.rates[:], out.drives[:], out.loads[:] = motion.accelerations, motion.drives, motion.loads
        system._observe_motion(t, y, out)
        out.wheel_loads[:, :3] = motion.wheel_torques

    def tables(system: Mechanics) -> tuple[Any, Any]:
        nested = system.nested(name)
        return nested.constants, nested.workspace()

    def kernel(system: Mechanics) -> tuple[Any, tuple[Any, ...]]:
        from flexmb.frisch import evaluation  # who uses the recursion waits for none of it

        return evaluation.accelerations, tables(system)

    def route(system: Mechanics) -> Route:
        from flexmb.frisch import evaluation

        system.nested(name)  # refused here, not in the run
        return Route(lambda: tables(system), evaluation.rhs, coordinates.project)

    return DynamicsAlgorithm(name, summary, accelerations, observe, kernel=kernel, route=route, **more)


FRISCH = _declared("frisch", "the nested-body equations of 1975, corrected", errata=CORRECTED)
FRISCH_AS_PRINTED = _declared("frisch_as_printed", "the same to the letter of the print", errata=AS_PRINTED)
