"""The equations of motion of a system in dual numbers: one block of tables for every seven directions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from flexmb.entry.observed_tangent import OutputsTangent, outputs_tangent
from flexmb.entry.tangent import TangentWorkspace
from flexmb.jit.direct import address, addresses
from flexmb.jit.duals import DUAL, RATES
from flexmb.jit.pointer import REAL, STATUS, VOID
from flexmb.jit.wide_arrays import as_duals, wide_zeros
from flexmb.parameters.kernels import chain_rates, parameter_workspace
from flexmb.parameters.tables import DualClosureConstants, DualConstants
from flexmb.sensitivity import chain, tree
from flexmb.system.system import System
from flexmb.tables.status import Status
from flexmb.typing import Real


class DualTables(NamedTuple):
    """The constants of a block of directions, whose lanes carry their changes; closures: None of a tree."""

    constants: DualConstants
    closures: DualClosureConstants | None


class ObservedRates(NamedTuple):
    """Everything observable, laid out as `Observation.columns`: values (...,m), derivatives (...,m,P)."""

    row: Real
    rates: Real


class RowResponse(NamedTuple):
    """Accelerations (nu,) due to loads of rows, their derivatives (nu,P), those of the drive loads (nu,P) that keep
    prescribed speeds, and of the rows' rates (G,P)."""

    gain: Real
    gain_rates: Real
    drive_rates: Real
    row_rates: Real


class Blocks:
    """The tables of all blocks of a system, and the addresses of its kernels.

    state, slope (B,nq+nu+1,8): [q, u, work] and its rate, the memory of the workspaces. every (B,m,8): everything
    observable, the memory of the outputs. Addresses of kernels: motion, manifold, observing_at, closure_loads_at.
    """

    def __init__(self, system: System, tables: Sequence[DualTables], directions: int) -> None:
        self.system, self.directions, self.duals = system, directions, list(tables)
        n = system.nq + system.nu + 1
        self.state, self.slope = (wide_zeros((len(tables), n), number=DUAL) for _ in range(2))
        self.workspaces = [
            _workspace(system, dual.constants, self.state[b], self.slope[b]) for b, dual in enumerate(tables)
        ]
        out, closures = system.observation.out, 0 if system.closures is None else len(system.scene.constraints)
        free = len(out.every) + len(out.drives)
        self.every = wide_zeros((len(tables), free + 6 * closures), number=DUAL)
        self.outputs: list[OutputsTangent] = [outputs_tangent(out, each[:free]) for each in self.every]
        self._kind: Any = tree if system.closures is None else chain
        self._loads = list[chain.ClosureLoads]()
        if system.closures is None:
            pairs = zip(tables, self.workspaces, strict=True)
            self.tables: list[Any] = [tree.TreeBlock(c=constants.constants, w=w) for constants, w in pairs]
        else:
            self._loads = [chain.ClosureLoads(each[free:].reshape(closures, 6, -1)) for each in self.every]
            self.tables = self._chains(system)
        self.motion, _ = addresses(self._kind.motion, STATUS, REAL, self.tables[0])
        self.manifold, _ = addresses(self._kind.manifold, VOID, REAL, self.tables[0])
        self.observing_at, *_ = addresses(self._kind.observing, VOID, self.tables[0], self.outputs[0])
        self.closure_loads_at = 0
        if self._loads:
            self.closure_loads_at, *_ = addresses(chain.closure_loads, VOID, self.tables[0], self._loads[0])

    def _chains(self, system: System) -> list[Any]:
        assert system.closures is not None
        self.chain = system.closures.chain("articulated")
        chains = []
        for dual, w in zip(self.duals, self.workspaces, strict=True):
            assert dual.closures is not None
            chains.append(
                chain.ChainBlock(
                    chain=self.chain,
                    c=dual.constants,
                    cc=dual.closures,
                    driven=np.array(list(system.signals), np.int64),
                    y=np.zeros(len(self.state[0])),
                    slope=np.zeros(len(self.state[0])),
                    x=chain_rates(w, system.closures.constants[1]),
                )  # fmt: skip
            )
        return chains

    def choose_rows(self, t: float, y: Real) -> None:
        """Have a chain choose its independent rows at y = [q, u, work]."""
        if self.system.closures is not None:
            self.system.closures.begin_in(self.chain, t, y)

    def __len__(self) -> int:
        return len(self.tables)

    @property
    def where(self) -> list[int]:
        """Addresses of the tables of all blocks."""
        return [address(table) for table in self.tables]

    @property
    def where_loads(self) -> list[int]:
        """Addresses of the loads of closures of all blocks; 0 in trees."""
        return [address(each) for each in self._loads] or [0] * len(self)

    @property
    def fault(self) -> int:
        """Index of the item at which the last evaluation failed."""
        if self.system.closures is not None and self.chain.fault[0]:
            return int(self.chain.fault[0])
        return max(int(w.fault[0]) for w in self.workspaces)

    def check(self, status: int) -> None:
        """DynamicsError unless a status is OK."""
        self.system.check_status(status, self.fault)

    def place(self, status: Status) -> str:
        """Name of the item at which the last evaluation failed."""
        return self.system.fault_name(status, self.fault)

    def inertia_forces(self, t: float, rates: Real) -> tuple[Real, Real]:
        """M rates (nu,) for given rates (nu,) at the coordinates of the blocks' states, and its derivatives (nu,P)."""
        forces = []
        for dual, w in zip(self.duals, self.workspaces, strict=True):
            x = tree.Inertial(as_duals(np.zeros(len(rates))))
            tree.inertia_forces(t, dual.constants, w, rates, x)
            moved = x.tau.copy()
            tree.inertia_forces(t, dual.constants, w, np.zeros(len(rates)), x)
            forces.append(moved - x.tau)
        return forces[0][:, 0], self.joined(forces)

    def response(self, t: float, load: Real) -> RowResponse:
        """How the motion of a closed chain at the blocks' states responds to loads of rows (G,)."""
        responses = []
        for block, w in zip(self.tables, self.workspaces, strict=True):
            parts = []
            for given in (load, np.zeros(len(load))):
                self.check(chain.under_loads(t, block, given))
                rates = w.slope[self.system.nq : self.system.nq + self.system.nu]
                parts.append((rates.copy(), w.speed["drive"].copy(), block.x.cw.row["rate"].copy()))
            (gained, drive, _), (own, idle, rate) = parts
            responses.append((gained - own, drive - idle, rate))
        gains, drives, of_rows = (self.joined([parts[i] for parts in responses]) for i in range(3))
        return RowResponse(responses[0][0][:, 0], gains, drives, of_rows)

    def joined(self, duals: Sequence[Real]) -> Real:
        """The derivatives (...,P) of one array of duals (...,8) for each block."""
        return np.concatenate([dual[..., 1:] for dual in duals], axis=-1)[..., : self.directions]


def dual_parts(table: Any) -> Iterator[tuple[str, str | None, Any]]:
    """Name, name of the field of its records, and the duals (...,8) of every array of a table in dual numbers."""
    for each in fields(table):
        for field, part in array_parts(getattr(table, each.name)):
            yield each.name, field, part


def array_parts(array: Any) -> Iterator[tuple[str | None, Any]]:
    """The duals (...,8) of an array, or of each field of its records, with the name of the field."""
    if array.dtype == np.float64:
        yield None, array
    for name in array.dtype.names or ():
        if (array.dtype[name].subdtype or (array.dtype[name],))[0] == np.float64:
            yield name, array[name]


def set_lanes(duals: Real, rates: Real, b: int) -> None:
    """Write the derivatives (...,P) of numbers, of which those of block b go into its duals (...,8)."""
    own = rates[..., RATES * b : RATES * (b + 1)]
    duals[..., 1 : 1 + own.shape[-1]] = own


def _workspace(system: System, c: DualConstants, state: Real, slope: Real) -> TangentWorkspace:
    """A workspace in duals, whose state and slope are these arrays."""
    w = parameter_workspace(c, system.constants, system.nq, system.nu)
    arrays = {field.name: getattr(w, field.name) for field in fields(w)}
    return TangentWorkspace(**(arrays | {"state": state, "slope": slope}))
