"""The systems of the parts of a run in dual numbers: what events change and what they hold keeps its derivatives.

The tables of the scene are differentiated once (`System.parameters`). After a latch or a release nothing but functions
of time and integers differ, so that the derivatives are taken over; after other changes they are found anew, by the
numbers of that part of the run (`flexmb.sensitivity.part_scene`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, NamedTuple

import numpy as np

from flexmb.jit.bundle import broaden
from flexmb.jit.wide_arrays import as_duals
from flexmb.parameters.numbers import Number
from flexmb.parameters.parameters import Parameters
from flexmb.parameters.tables import DualClosureConstants, DualConstants, ParameterBlock
from flexmb.scene.tree import rate_name, scalar_paths
from flexmb.sensitivity.blocks import Blocks, DualTables, set_lanes
from flexmb.system.system import System
from flexmb.tables.state import State, pack
from flexmb.typing import Real

_DIAGONAL = (
    "orthogonal",
    "uncoupled",
)  # integers of a body that hold for other numbers too, see flexmb.parameters.tables
_OF_TIME = "function", "table"  # tables of functions, of which events make others


class KnownTables(NamedTuple):
    """The tables of a system: with constants of floats, and in duals for each block."""

    system: System
    duals: list[DualTables]


class Start(NamedTuple):
    """The blocks at the start of a run, their tables, and the parameters of which these are."""

    blocks: Blocks
    tables: tuple[ParameterBlock, ...]
    parameters: Parameters


class HandedOver:
    """What a run takes over, once, from another one in which only values of its numbers differ, and what it leaves."""

    def __init__(self, before: Start | None = None) -> None:
        self.before = before
        self.left: Start | None = None


class Systems:
    """Makes the blocks of one part of a run after the other; scales (P,)."""

    def __init__(self, scales: Real, handed: HandedOver) -> None:
        self._scales, self._handed = scales, handed
        self._known: KnownTables | None = None
        self._chosen: list[int] = []

    def first(self, known: Parameters, chosen: Sequence[int]) -> tuple[Blocks, Real]:
        """The blocks of a run's own scene, from the parameters that are `chosen` among the directions, and the scaled
        derivatives (nq+nu+1,P) of its initial state."""
        start = np.zeros((known.plant.nq + known.plant.nu + 1, len(self._scales)))
        start[:, list(chosen)] = known.initial_state * self._scales[list(chosen)]
        before, self._handed.before = self._handed.before, None
        tables = known.arranged(chosen, self._scales, before and (before.parameters, before.tables))
        self._known, self._chosen = _known(known, tables), list(chosen)
        if before is not None and tables is before.tables:
            blocks = before.blocks
            blocks.system = self._known.system
        else:
            blocks = self._blocks(self._known, {})
        self._handed.left = Start(blocks, tables, known)
        return blocks, start

    def then(
        self, system: System, state: State, numbers: Sequence[Number | None], held: Mapping[str, Real], anew: bool
    ) -> Blocks:
        """The blocks after events, from a state on. numbers (P,): of this part, None for a direction on which no table
        depends. held: the scaled derivatives (P,) of the values at which coordinates are held, by name. anew: whether
        values have changed that depend on the numbers."""
        assert self._known is not None  # a run begins with `first`
        plant = system.with_numbers(system.scene)
        chosen = [k for k, number in enumerate(numbers) if number is not None]
        same = not anew and chosen == self._chosen
        taken = [_taken_over(self._known.system, plant, dual) if same else None for dual in self._known.duals]
        if all(table is not None for table in taken):
            found = KnownTables(plant, [table for table in taken if table is not None])
            _alike(found.duals)
        else:
            parameters = Parameters(system, [number for number in numbers if number is not None], starts=False)
            found = _known(parameters, parameters.arranged(chosen, self._scales))
        self._known, self._chosen = found, chosen
        if found.system.closures is not None:  # the rows that are independent here
            found.system.closures.begin_at(state.t, pack(state))
        return self._blocks(found, held)

    def _blocks(self, known: KnownTables, held: Mapping[str, Real]) -> Blocks:
        """The blocks with derivatives of what is held, and with functions of their own where controllers write into
        them: those that are taken over have neither."""
        if not held and not known.system.scene.controllers:
            return Blocks(known.system, known.duals, len(self._scales))
        blocks = []
        for b, dual in enumerate(known.duals):
            functions = dual.constants.function.copy()
            for name, rates in held.items():
                set_lanes(functions["data"][_function_of(known.system, name), :1], rates[None], b)
            blocks.append(dual._replace(constants=replace(dual.constants, function=functions)))
        _alike(blocks)
        return Blocks(known.system, blocks, len(self._scales))


def _known(parameters: Parameters, tables: Sequence[ParameterBlock]) -> KnownTables:
    """The tables of a system that are arranged along directions."""
    plant = parameters.plant
    assert isinstance(plant, System)  # it is the same one with its functions of time kept apart
    return KnownTables(plant, [DualTables(table.constants, table.closures) for table in tables])


def _alike(duals: Sequence[DualTables]) -> None:
    """Give the tables of all blocks the features of any, so that they share kernels."""
    broaden([dual.constants for dual in duals])
    closures = [dual.closures for dual in duals if dual.closures is not None]
    if closures:
        broaden(closures)


def _floats(wide: Any, own: Any) -> list[tuple[Any, str | None]]:
    """The floats of an array in duals, or of each field of its records, with the name of the field."""
    if own.dtype == np.float64:
        return [(wide, None)]
    names = own.dtype.names or ()
    return [(wide[name], name) for name in names if (own.dtype[name].subdtype or (own.dtype[name],))[0] == np.float64]


def _taken_over(before: System, now: System, duals: DualTables) -> DualTables | None:
    """The tables of a system in duals, with the derivatives of the system before; None if these do not suffice."""
    tree = _with_derivatives(before.constants, now.constants, duals.constants)
    if tree is None or now.closures is None or before.closures is None:
        return None if tree is None else DualTables(DualConstants(**tree), None)
    closed = _with_derivatives(before.closures.constants[1], now.closures.constants[1], duals.closures)
    return None if closed is None else DualTables(DualConstants(**tree), DualClosureConstants(**closed))


def _with_derivatives(before: Any, now: Any, duals: Any) -> dict[str, Any] | None:
    """The arrays of a table in duals, with the derivatives of a table before that has the same numbers; None if it does
    not. Functions of time may differ where they have no derivatives."""
    derivatives = {}
    for field in fields(now):
        old, new, known = (getattr(of, field.name) for of in (before, now, duals))
        wide = as_duals(new)
        for part, name in _floats(wide, new):
            source, one, other = (array if name is None else array[name] for array in (known, old, new))
            if field.name in _OF_TIME:
                if np.any(source[..., 1:]):
                    return None
            elif not np.array_equal(one, other):
                return None
            else:
                part[...] = source
        if field.name == "body":
            for name in _DIAGONAL:
                wide[name] = known[name]
        derivatives[field.name] = wide
    return derivatives


def _function_of(system: System, coordinate: str) -> int:
    """The number of the function that holds a coordinate."""
    rate = rate_name(coordinate, scalar_paths(system.scene)[coordinate])
    speed = [name for name, _ in system.state_names[1]].index(rate)
    return int(system.constants.speed["prescribed"][speed])
