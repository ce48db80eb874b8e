"""The inertia regressor of a tree, tau = M udot + c = Y(q, u, udot) pi + rest, and its base parameters.

    r = system.inertia_regressor()
    Y = r.at(state, accelerations)          (nu,P)
    Y @ r.values + r.rest(state, accelerations)

Y is exact, because inverse dynamics is linear in the parameters (`flexmb.parameters.inertia`). Base parameters are the
combinations of them that motions and loads along the speeds can determine.

    base = r.base(states, accelerations)
    found = base.fit(r.stacked(states, accelerations), tau)      from measured torques, with their covariance

Many states give W pi = tau, with their rows of Y one above the other. W has fewer independent columns than parameters.
QR with pivoting chooses r independent ones, and all others are W_2 = W_1 B, so that only pi_1 + B pi_2 has an effect
(Gautier 1991; Khalil & Dombre, Modeling, Identification and Control of Robots, ch. 12).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import NamedTuple

import numpy as np

from flexmb.building.links import BodyLink
from flexmb.entry import articulated
from flexmb.entry.tangent import tangent_workspace
from flexmb.jit.direct import Direct, direct
from flexmb.jit.pointer import MATRIX, REAL, VECTOR, VOID
from flexmb.jit.wide_arrays import as_duals
from flexmb.parameters import kernels
from flexmb.parameters.inertia import body_parameters, places, table_numbers, without
from flexmb.parameters.inertia_kernels import regressor
from flexmb.parameters.plant import Plant
from flexmb.parameters.tables import DualConstants
from flexmb.tables import arguments
from flexmb.tables.arguments import one_of
from flexmb.tables.per_thread import Own, per_thread
from flexmb.tables.state import State, finite_result
from flexmb.tables.workspaces import workspace
from flexmb.typing import Index, Real

CLEAR = 1e4
"""Least ratio of two neighbouring pivots between which the rank is taken: rounding leaves 1e8 and more as a rule."""
NOTHING = 1e-9
"""Elements of B below this, relative to the scales of both columns, are rounding errors of zero."""


class BaseFit(NamedTuple):
    """Identified base parameters: values (r,), their covariance (r,r), and the standard deviation of the torques."""

    values: Real
    covariance: Real
    noise: float

    @property
    def deviations(self) -> Real:
        """(r,) standard deviations of the values."""
        return np.sqrt(np.diag(self.covariance))


class BaseParameters(NamedTuple):
    """names (r,): each with the parameters that have the same effect, such as "upper.inertia.zz + 0.25 lower.mass".

    matrix (r,P): the values are matrix @ pi. chosen (r,): the parameters with coefficient 1 that have no other name in
    their column. gap: ratio of the last pivot that counts to the first that does not, infinite where all count.
    """

    names: tuple[str, ...]
    matrix: Real
    chosen: Index
    gap: float

    @property
    def rank(self) -> int:
        """How many there are."""
        return len(self.names)

    def reduced(self, Y: Real) -> Real:
        """The columns (...,r) of a regressor (...,P) by which the base parameters are multiplied.

        Raises TypeError or ValueError for what is no such array of finite numbers.
        """
        Y = arguments.finite("Y", arguments.array("Y", Y))
        matrix: Real = arguments.shaped("Y", Y, (*Y.shape[:-1], self.matrix.shape[1]))[..., self.chosen]
        return matrix

    def fit(self, Y: Real, tau: Real, noise: Real | float | None = None) -> BaseFit:
        """Least squares for measured tau (n,), less what is known, with the rows of Y (n,P).

        noise: standard deviation of the measurements, one or (n,); by default it is estimated from what remains. Raises
        ValueError where the rows determine fewer parameters, OverflowError for numbers whose products overflow.
        """
        Y, tau = arguments.array("Y", Y), arguments.array("tau", tau)
        Y, tau = arguments.finite("Y", Y), arguments.finite("tau", arguments.vector("tau", tau, len(Y)))
        W = self.reduced(arguments.shaped("Y", Y, (len(tau), self.matrix.shape[1])))
        weight = np.ones(len(tau)) if noise is None else 1.0 / np.broadcast_to(_positive(noise), len(tau))
        weighed, size = W * weight[:, None], np.linalg.norm(W * weight[:, None], axis=0)
        if len(tau) <= self.rank or not np.all(size > 0.0):
            raise ValueError(f"{len(tau)} measurements do not determine {self.rank} parameters: measure livelier ones")
        U, s, Vt = np.linalg.svd(weighed / size, full_matrices=False)
        if not s[-1] > s[0] / CLEAR**2:
            raise ValueError(
                f"these motions do not determine all of the {self.rank} parameters: measure livelier ones, or name "
                "fewer bodies"
            )
        values = Vt.T @ ((U.T @ (tau * weight)) / s) / size
        left = (tau - W @ values) * weight
        deviation = 1.0 if noise is not None else float(np.sqrt(left @ left / (len(tau) - self.rank)))
        half = Vt.T / s / size[:, None] * deviation
        remaining = arguments.representable(np.sqrt(np.mean((tau - W @ values) ** 2)))
        return BaseFit(arguments.representable(values), arguments.representable(half @ half.T), float(remaining))


def base_parameters(parameters: Sequence[str], W: Real) -> BaseParameters:
    """The base parameters of these names (P,) that the rows of W (n,P) can determine.

    ValueError where no parameter has an effect, or the rank is not clear because pivots become small without a gap.
    """
    from scipy.linalg import qr, solve_triangular  # slow to import, and only identification needs it

    size = np.linalg.norm(W, axis=0)
    acting = np.flatnonzero(size > 0.0)
    if not len(acting):
        raise ValueError("no parameter has an effect on the loads of these states: take states that move")
    R, order = qr(W[:, acting] / size[acting], mode="r", pivoting=True)
    pivots = np.abs(np.diag(R))
    rank, gap = _rank(pivots, len(W))
    B = solve_triangular(R[:rank, :rank], R[:rank, rank:])
    B = np.where(np.abs(B) > NOTHING * max(1.0, float(np.max(np.abs(B), initial=0.0))), B, 0.0)
    chosen, others = acting[order[:rank]], acting[order[rank:]]
    matrix = np.zeros((rank, len(parameters)))
    matrix[np.arange(rank), chosen] = 1.0
    matrix[:, others] = B / size[chosen, None] * size[others]
    in_order = np.argsort(chosen)
    matrix, chosen = matrix[in_order], chosen[in_order]
    names = tuple(_name(parameters, row, int(first)) for row, first in zip(matrix, chosen, strict=True))
    return BaseParameters(names, matrix, chosen, gap)


def _rank(pivots: Real, rows: int) -> tuple[int, float]:
    """The number of pivots before the largest gap below which they may be rounding errors."""
    floor = rows * np.finfo(float).eps * pivots[0]
    ratios = pivots[:-1] / np.maximum(pivots[1:], floor * 2.0**-20)
    candidates = np.flatnonzero(pivots[1:] < 1e-6 * pivots[0])
    if not len(candidates):
        return len(pivots), np.inf
    last = int(candidates[np.argmax(ratios[candidates])])
    if ratios[last] < CLEAR:
        raise ValueError(
            f"the rank is not clear: pivot {last + 1} is only {ratios[last]:.1g} times the next; take more states, "
            "with larger speeds and accelerations, or name fewer bodies"
        )
    return last + 1, float(ratios[last])


def _name(names: Sequence[str], row: Real, first: int) -> str:
    rest = [i for i in np.flatnonzero(row) if i != first]
    text = names[first]
    for i in rest:
        factor = abs(row[i])
        shown = "" if np.isclose(factor, 1.0, rtol=1e-9) else f"{factor:.6g} "
        text += f" {'-' if row[i] < 0.0 else '+'} {shown}{names[i]}"
    return text


def _positive(noise: Real | float) -> Real:
    noise_sizes = arguments.array("noise", noise)
    if not np.all(np.isfinite(noise_sizes)) or not np.all(noise_sizes > 0.0):
        raise ValueError("noise is a standard deviation: give positive numbers")
    return noise_sizes


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
