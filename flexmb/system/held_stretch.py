"""Whether loads would stretch beams of level exact whose stretch is held, as it is by default.

A stretch of one polynomial makes explicit runs of a strip under a tip force forty times as long, so that it is not a
default (docs/exact.md). What it would be is known without it: the axial force over EA, by the balance of momentum
beyond each section (`flexmb.system.section_loads`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from flexmb.scene.bodies import BeamBody
from flexmb.scene.collocation import gauss_rule
from flexmb.scene.schema import Scene
from flexmb.scene.sections import EXTENSION, mass_per_length, stiffness_on_axis
from flexmb.scene.strains import strains
from flexmb.system.level_range import of_hinges
from flexmb.system.section_loads import SectionBalance
from flexmb.system.system import System
from flexmb.tables.state import DynamicsError, State
from flexmb.typing import Real

ALLOWED = 1e-3
"""Mean strain along the axis up to which nothing is said: what a steel at 200 MPa stretches."""
LOOKED_AT = 3
"""States of a run that are looked at: those with the largest forces and turns."""
_SECTIONS = 6
"""Gauss points of the mean."""
_BALANCE = "balance of a beam that is held against stretch"


class Unstretched(NamedTuple):
    """At t (s) loads would stretch a beam whose stretch is held by the part `strain` of its length."""

    body: str
    t: float
    strain: float

    @property
    def size(self) -> float:
        return abs(self.strain)

    @property
    def remedy(self) -> str:
        return 'give it "axial" among the families of its modes, or polynomials'

    @property
    def what(self) -> str:
        """By how much, and when."""
        what = "lengthen" if self.strain > 0.0 else "shorten"
        return (
            f'beam "{self.body}" is held against stretch, and at t = {self.t:g} s its loads would {what} it by '
            f"{abs(self.strain):.2g} of its length"
        )


def unstretchable(scene: Scene) -> list[BeamBody]:
    """The beams of level exact whose stretch is held."""
    beams = [body for body in scene.bodies if isinstance(body, BeamBody) and body.level == "exact"]
    return [body for body in beams if "axial" not in strains(body)]


def unstretched(system: System, t: Real, q: Real, u: Real, loads: Mapping[str, Real]) -> Iterator[Unstretched]:
    """The beams that loads in some of the states at t (T,) s would stretch by more than ALLOWED, at the worst of them.

    loads: (T,6) of hinges and closures, by name. Nothing of scenes with controllers, whose loads do not follow from a
    state.
    """
    held = unstretchable(system.scene)
    if system.scene.controllers or not held or not len(t):
        return
    force, turn = _largest(system, u, loads)
    for body in held:
        weight = body.length_m**2 * max(mass_per_length(station) for station in body.stations)
        least = min(float(stiffness_on_axis(station)[EXTENSION, EXTENSION]) for station in body.stations)
        suspects = (force + weight * turn**2) / least
        order = np.argsort(-suspects, kind="stable")[:LOOKED_AT]
        findings = [_stretched(system, body, State(q[n], u[n], float(t[n]))) for n in order if suspects[n] > ALLOWED]
        worst = max(findings, key=lambda finding: finding.size, default=None)
        if worst is not None and worst.size > ALLOWED:
            yield worst


def _largest(system: System, u: Real, loads: Mapping[str, Real]) -> tuple[Real, Real]:
    """The largest force (T,) N across any hinge or closure, infinite where undetermined, and the speeds (T,) of hinges,
    which bound how fast a beam turns (rad/s): with its weight they bound what pulls at its sections."""
    force = np.zeros(len(u))
    for load in loads.values():
        force = np.maximum(force, np.nan_to_num(np.linalg.norm(load[:, 3:], axis=1), nan=np.inf))
    return force, np.abs(u[:, of_hinges(system)]).sum(axis=1)


def _stretched(system: System, body: BeamBody, state: State) -> Unstretched:
    places, weights = gauss_rule(_SECTIONS)
    balance = system.kept.get((_BALANCE, body.name))
    if balance is None:
        balance = SectionBalance(system, body.name, body.length_m * (1.0 + places) / 2.0)
        balance = system.kept.setdefault((_BALANCE, body.name), balance)
    try:
        strain = balance.loads(balance.at(system.all_loads(state))).strain[:, 0]
    except DynamicsError:
        return Unstretched(body.name, state.t, 0.0)  # a run that failed says so itself
    mean = float(weights @ strain / 2.0)
    return Unstretched(body.name, state.t, mean if np.isfinite(mean) else 0.0)
