"""The inertia regressor of a tree: tau = M udot + c = Y(q, u, udot) pi + rest.

    r = system.inertia_regressor()
    Y = r.at(state, accelerations)          (nu,P)
    Y @ r.values + r.rest(state, accelerations)

Y is exact, because inverse dynamics is linear in the parameters (`flexmb.parameters.inertia`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from flexmb.building.links import BodyLink
from flexmb.entry import articulated
from flexmb.entry.tangent import tangent_workspace
from flexmb.jit.direct import Direct, direct
from flexmb.jit.pointer import MATRIX, REAL, VECTOR, VOID
from flexmb.jit.wide_arrays import as_duals
from flexmb.parameters import kernels
from flexmb.parameters.base import BaseParameters, base_parameters
from flexmb.parameters.inertia import body_parameters, places, table_numbers, without
from flexmb.parameters.inertia_kernels import regressor
from flexmb.parameters.plant import Plant
from flexmb.parameters.tables import DualConstants
from flexmb.tables.arguments import one_of
from flexmb.tables.per_thread import Own, per_thread
from flexmb.tables.state import State, finite_result
from flexmb.tables.workspaces import workspace
from flexmb.typing import Real


class InertiaRegressor:
    """The regressor of a tree; made by `System.inertia_regressor`. Threads may share it.

    names (P,) such as "rod.mass", "rod.first_moment.x", "rod.inertia.xy", "boom.coupling.0.z"; values (P,) of the
    scene. All are about the origin of the body's own frame, in its axes, SI.
    """

    def __init__(self, plant: Plant, links: Sequence[BodyLink], bodies: Sequence[str] | None = None) -> None:
        """bodies: those whose parameters are taken, all by default. ValueError for unknown ones."""
        self._plant = plant
        known = [link.name for link in links]
        chosen = known if bodies is None else [one_of("bodies", name, known) for name in bodies]
        parameters = [body_parameters(links[known.index(name)], plant.constants, known.index(name)) for name in chosen]
        self.names = tuple(name for rate in parameters for name in rate.names)
        self._entries = [entry for rate in parameters for entry in rate.entries]
        self._to_tables = [rate.to_tables for rate in parameters]
        numbers, start, values = table_numbers(self._entries, plant.constants), 0, list[Real]()
        for table in self._to_tables:
            values.append(np.linalg.solve(table, numbers[start : start + len(table)]))
            start += len(table)
        self.values: Real = np.concatenate(values) if values else np.zeros(0)
        self.values.flags.writeable = False
        self._without = replace(plant.constants, **without(self._entries, plant.constants))
        self.own = Own()

    def __repr__(self) -> str:
        return f"<InertiaRegressor of {len(self.names)} parameters>"

    def at(self, state: State, accelerations: Real) -> Real:
        """Y (nu,P) for accelerations (nu,)."""
        t, y, rates = self._given(state, accelerations)
        rows = np.empty((self._plant.nu, len(self.names)))
        self._evaluate(t, y, rates, rows)
        start = 0
        for table in self._to_tables:
            place = slice(start, start + len(table))
            rows[:, place] = rows[:, place] @ table
            start += len(table)
        return finite_result(rows, t)

    def stacked(self, states: Sequence[State], accelerations: Sequence[Real] | Real) -> Real:
        """(n nu,P) Y of n states with accelerations (n,nu), one above the other."""
        if len(states) != len(accelerations) or not len(states):
            raise ValueError(f"{len(states)} states and {len(accelerations)} accelerations: give as many, at least one")
        return np.concatenate([self.at(*pair) for pair in zip(states, accelerations, strict=True)])

    def base(self, states: Sequence[State], accelerations: Sequence[Real] | Real) -> BaseParameters:
        """The combinations of parameters that motions through these states, with accelerations (n,nu), can determine.

        Random states find those of the mechanism, states of an experiment those that it can tell apart. ValueError
        where no parameter has an effect, or their number is not clear.
        """
        return base_parameters(self.names, self.stacked(states, accelerations))

    def rest(self, state: State, accelerations: Real) -> Real:
        """(nu,) what tau contains beside Y pi: of other bodies, wheels, armatures, loads, connectors, and what levels
        have beyond the first order of the deformation."""
        t, y, rates = self._given(state, accelerations)
        tau, loads = np.zeros(self._plant.nu), np.zeros((len(self._without.body), 6))
        self._invert(t, y, rates, tau, loads)
        return finite_result(tau, t)

    def _given(self, state: State, accelerations: Real) -> tuple[float, Real, Real]:
        layout = self._plant.layout
        return *layout.entering(state), layout.rates("accelerations", accelerations)

    @per_thread
    def _evaluate(self) -> Direct:
        """(t, y, rates, Y)."""
        plant, c = self._plant, self._plant.constants
        duals = {field.name: as_duals(getattr(c, field.name)) for field in fields(c)}
        duals["moves"][..., 0] = 1.0  # no column is left out, because it may get a derivative
        dual = DualConstants(**duals)
        w = tangent_workspace(c, plant.nq, plant.nu)
        tables = places(self._entries, c), dual, w, kernels.loads(c, 0)
        return direct(regressor, VOID, REAL, VECTOR, VECTOR, MATRIX, *tables)

    @per_thread
    def _invert(self) -> Direct:
        """(t, y, rates, tau, loads) without the parameters."""
        w = workspace(self._without, self._plant.nq, self._plant.nu)
        tables = self._without, w
        return direct(articulated.inverse_dynamics, VOID, REAL, VECTOR, VECTOR, *tables, VECTOR, MATRIX)
