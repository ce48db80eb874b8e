"""Makes the transposed equations of one part of a run, and reads the gradient by parameters from their tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from flexmb.closure.closures import Closures
from flexmb.entry.pulled import pull_workspace
from flexmb.jain.derivatives.pull_tables import ARMATURE, DAMPING, REST, STIFFNESS
from flexmb.jain.derivatives.tables import ports_in_use
from flexmb.jit.bundle import broaden
from flexmb.jit.direct import addresses
from flexmb.jit.duals import DUAL, RATES
from flexmb.jit.pointer import MATRIX, REAL, STATUS, VECTOR
from flexmb.parameters.tables import DualClosureConstants, DualConstants
from flexmb.sensitivity.adjoint import transposed
from flexmb.sensitivity.adjoint.sampling import DrivenFunctions
from flexmb.sensitivity.blocks import Blocks, DualTables, array_parts, dual_parts
from flexmb.system.system import System
from flexmb.tables.arrays import Constants
from flexmb.typing import Flags, Index, Real

_SPRING = {"stiffness": STIFFNESS, "damping": DAMPING, "rest": REST, "armature": ARMATURE}


class Transposes:
    """The transposed equations of one part of a run.

    transpose, unproject: kernels; tables: theirs; held: what controllers drive.
    """

    def __init__(self, blocks: Blocks, count: int, functions: Sequence[int], of_power: bool) -> None:
        """blocks: the constants in dual numbers, whose first `count` directions are those of parameters and of values
        at which coordinates are held. functions (F,): those that controllers drive. of_power: whether the scalar
        depends on the work done."""
        self._blocks, self._count, plant = blocks, count, blocks.system
        c, by_recursion = plant.constants, not of_power and plant.closures is None
        self._chains: list[Any] = []
        self._x = pull_workspace(c, plant.nq, plant.nu) if by_recursion else None
        acts = [_acting(dual, c, by_recursion, functions) for dual in blocks.duals[: -(-count // RATES)]]
        self._chosen = np.flatnonzero(np.concatenate(acts)[:count])
        self._driven = len(functions)
        lanes = len(self._chosen) + self._driven
        self._lanes = Blocks(plant, _gathered(blocks, self._chosen, functions), lanes) if lanes else None
        table = self._lanes_table(plant)
        self._gradient = table.gradient
        self.unproject, self.transpose = transposed.unproject, transposed.pull_back
        of_lanes = [] if self._lanes is None else [dual.constants for dual in self._lanes.duals]
        if self._x is not None:
            self.tables: Any = transposed.ByRecursion(c, self._x, table)
            self.held = DrivenFunctions(np.array(functions, np.int64), [c, *of_lanes])
            return
        route = plant.route("articulated", 0.0)
        assert route.linear is not None  # of trees and closed chains
        self._linear = route.linear(*route.tables())
        exact, n = self._linear.exact, plant.nq + plant.nu + 1
        where = addresses(self._linear.jacobian, STATUS, REAL, VECTOR, MATRIX, exact, self._linear.tangent)
        if plant.closures is not None:
            self._chains = [exact, *([] if self._lanes is None else [self._lanes.chain])]
        self.transpose = transposed.transpose
        self.tables = transposed.ByJacobian(np.array(where), np.zeros((n, n)), c, table)
        self.held = DrivenFunctions(np.array(functions, np.int64), [exact, *of_lanes])

    def _lanes_table(self, plant: System) -> transposed.Lanes:
        if self._lanes is None:
            nothing = np.zeros((0, plant.nq + plant.nu + 1, DUAL.width))
            return transposed.Lanes(np.zeros(2, np.int64), np.zeros(0, np.int64), nothing, nothing, np.zeros(0))
        return transposed.Lanes(
            np.array([self._lanes.motion, self._lanes.manifold]), np.array(self._lanes.where, np.int64),
            self._lanes.state, self._lanes.slope, np.zeros(RATES * len(self._lanes)),
        )  # fmt: skip

    def choose(self, t: float, y: Real) -> None:
        """Choose the independent rows of closures for times up to t (s), near the state y there."""
        for chain in self._chains:
            Closures.begin_in(chain, t, y)

    def by_driven(self) -> Real:
        """(F,) by what controllers drive, since the last call."""
        place = slice(len(self._chosen), len(self._chosen) + self._driven)
        rates = self._gradient[place].copy()
        self._gradient[place] = 0.0
        return rates

    def by_parameters(self) -> Real:
        """The gradient (count,) by the first directions that the steps passed so far have left."""
        rates = np.zeros(self._count)
        rates[self._chosen] = self._gradient[: len(self._chosen)]
        if self._x is not None:
            p, c = self._x.p, self._blocks.system.constants
            for b, dual in enumerate(self._blocks.duals[: -(-self._count // RATES)]):
                own = by_constants(p, c, dual.constants)
                count = min(RATES, self._count - RATES * b)
                chosen = np.isin(np.arange(RATES * b, RATES * b + count), self._chosen)
                rates[RATES * b : RATES * b + count] += np.where(chosen, 0.0, own[:count])
        return rates


def by_constants(p: Any, c: Constants, duals: DualConstants) -> Real:
    """(RATES,) by the parameters of a block, from the derivatives by the constants that `Pulled` has."""
    rates = np.einsum("ki,kil->l", p.rigid, duals.body["rigid"][..., 1:])
    rates = rates + np.einsum("ki,kil->l", p.placement[:, :3], duals.body["placement_position"][..., 1:])
    R = c.body["placement_rotation"].reshape(-1, 3, 3)
    dR = duals.body["placement_rotation"][..., 1:].reshape(len(R), 3, 3, RATES)
    turn = np.einsum("kijl,kmj->kiml", dR, R)  # of the axes against themselves: a skew matrix
    turn = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1)
    rates = rates + np.einsum("ki,kil->l", p.placement[:, 3:], turn)
    for name, column in _SPRING.items():
        rates = rates + p.spring[:, column] @ duals.speed[name][..., 1:]
    return np.asarray(rates + p.gravity @ duals.gravity[..., 1:])


def _acting(duals: DualTables, c: Constants, by_recursion: bool, driven: Sequence[int]) -> Flags:
    """(RATES,) which parameters of a block the motion depends on; by recursion, but for constants that `Pulled` has.

    What controllers drive has directions of its own.
    """
    known = dict[tuple[str, str | None], Flags | bool]()
    known["function", "data"] = ~np.isin(np.arange(len(c.function)), driven)
    if by_recursion:
        modes, on_ports = c.body["modes"] > 0, c.body["inboard_port"] >= 0
        simple = not (np.any(c.body["ball_spring"]) or len(c.hinge_spring) or len(c.coordinate_law))
        known |= {("body", "rigid"): modes, ("gravity", None): False}
        known |= {("body", f"placement_{name}"): on_ports for name in ("position", "rotation")}
        known |= {("speed", "armature"): False, ("port", None): ports_in_use(c)}
        known |= {("speed", name): False for name in ("stiffness", "damping", "rest")} if simple else {}
    lanes = np.zeros(RATES, bool)
    for table in (duals.constants, duals.closures):
        for name, field, part in dual_parts(table) if table is not None else ():
            rates = part[..., 1:] != 0.0
            kept = known.get((name, field), known.get((name, None), True))
            if kept is False:
                continue
            if kept is not True:
                rates = rates[kept]
            lanes |= np.any(rates.reshape(-1, RATES), axis=0)
    return lanes


def _gathered(blocks: Blocks, chosen: Index, functions: Sequence[int]) -> list[DualTables]:
    """Blocks of the chosen directions, then of the values of functions of time."""
    found, sources = list[DualTables](), [dual.constants for dual in blocks.duals]
    closures = [dual.closures for dual in blocks.duals if dual.closures is not None]
    count = len(chosen) + len(functions)
    for first in range(0, count, RATES):
        arrays = _lanes_of(sources, chosen[first : first + RATES])
        arrays["function"]["data"][functions, 0, 1:] = 0.0
        for lane in range(min(RATES, count - first)):
            if first + lane >= len(chosen):
                arrays["function"]["data"][functions[first + lane - len(chosen)], 0, 1 + lane] = 1.0
        of_closures = _lanes_of(closures, chosen[first : first + RATES]) if closures else None
        own = None if of_closures is None else DualClosureConstants(**of_closures)
        found.append(DualTables(DualConstants(**arrays), own))
    broaden([dual.constants for dual in found])
    broaden([dual.closures for dual in found if dual.closures is not None])
    return found


def _lanes_of(tables: Sequence[Any], chosen: Index) -> dict[str, Any]:
    """The arrays of a table in duals with the lanes of the chosen directions."""
    lanes = {}
    for field in fields(tables[0]):
        arrays = [getattr(table, field.name) for table in tables]
        wide = arrays[0].copy()
        sources = [[part for _, part in array_parts(array)] for array in arrays]
        for i, (_, part) in enumerate(array_parts(wide)):
            part[..., 1:] = 0.0
            for lane, k in enumerate(chosen):
                part[..., 1 + lane] = sources[k // RATES][i][..., 1 + k % RATES]
        lanes[field.name] = wide
    return lanes
