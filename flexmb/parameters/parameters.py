"""Derivatives of accelerations, loads and everything observable by the numbers of a scene.

    p = system.parameters(["rod.mass_kg", "boom.stations.0.EIy_Nm2", "pivot.rotation.stiffness_Nm_rad"])
    p.accelerations(state)          (nu,P)

From a number of the scene to the constants of the kernels, derivatives are those of interpolants (`spectral`), from
there on they are exact to rounding: the kernels are compiled once more for constants that are dual numbers (`kernels`).
What is held fixed are the numbers q and u of the state. Modal coordinates are those of the modes as they are normalised
and ordered in the scene; when a number changes, modes follow (`flexmb.modal.following`).
"""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flexmb.closure.tables import Closed
from flexmb.jit.direct import Direct, direct
from flexmb.jit.duals import RATES
from flexmb.jit.pointer import MATRIX, REAL, STATUS, VECTOR, VOID
from flexmb.kept import kept
from flexmb.parameters import kernels
from flexmb.parameters.many_numbers import First, Steady, derivatives_together, steady
from flexmb.parameters.numbers import Number, numbers
from flexmb.parameters.plant import Plant
from flexmb.parameters.spectral import WIDTHS, Derivative, NotSmooth, Parts, derivative
from flexmb.parameters.tables import (
    ParameterBlock,
    Tables,
    blocks,
    diagonal,
    moments,
    numbers_of,
    parts,
    put,
    structure,
    wholes,
)
from flexmb.scene.bodies import BeamBody
from flexmb.scene.pieces import cuts
from flexmb.scene.problems import SceneWarning
from flexmb.scene.schema import Scene
from flexmb.tables import arguments
from flexmb.tables.per_thread import Own, per_thread
from flexmb.tables.state import DynamicsError, State, finite_result
from flexmb.tables.status import OK
from flexmb.typing import Real


class ParameterError(ValueError):
    """A number of a scene by which motions have no derivative; the message names it, the reason and the remedy."""


class Parameters:
    """Numbers of a scene, and derivatives by them; made by `System.parameters`. Threads may share it.

    names (P,); values (P,); reached (P,): whether the tables depend on a number at all; errors (P,): estimates of the
    relative errors of the derivatives of the tables; blocks: the tables in dual numbers, RATES parameters each;
    initial_state (nq+nu+1,P): d[q, u, work]/dp of the scene's state at t = 0, for closed chains of the nearest one that
    closes all closures.

    All methods raise `NotDifferentiableError` (a DynamicsError) at states at which a law has a corner.
    """

    def __init__(
        self, plant: Plant, chosen: Sequence[Number], *, starts: bool = True, like: Parameters | None = None
    ) -> None:
        """starts: whether the initial state of the scene is that of the motion, and is differentiated. like: the same
        numbers of a scene that differs in their values only, whose steady derivatives are kept.

        ParameterError where there is no derivative by a number.
        """
        if plant.closures is not None and plant.closures.at_rest:
            raise NotImplementedError(
                f'scene "{plant.scene.name}" has closures and bodies of level "ruthless", whose inertia is not where '
                'closures join them: for derivatives use level "linear" or a better one'
            )
        self.names, self.values = tuple(number.name for number in chosen), np.array([number.value for number in chosen])
        self.values.flags.writeable = False
        self.plant = plant if plant.is_smooth and plant.closures is None else plant.with_numbers(plant.scene)
        """The same system, with equal functions of time kept apart: numbers of one may change without the other's."""
        differentiation = _Differentiation(self.plant, starts)
        held = None if like is None else differentiation.kept(like, chosen)
        rates = differentiation.by_all(chosen, {} if held is None else held.rates)
        self._held, self._found, self._rates = held, differentiation, rates
        self.errors = np.array([rate.error for rate in rates])
        self.reached = np.array([number.name in differentiation.reached or bool(np.any(rate.values))
                                 for number, rate in zip(chosen, rates, strict=True)])  # fmt: skip
        self._of_tables: Real = (
            np.array([rate.values[: differentiation.size] for rate in rates]).reshape(-1, differentiation.size).T
        )
        self.initial_state: Real = self._of_tables[-len(differentiation.tables.start) :].copy()
        for array in (self.errors, self.initial_state, self.reached):
            array.flags.writeable = False
        self.own = Own()

    def __repr__(self) -> str:
        return f"Parameters({list(self.names)!r})"

    @kept
    def blocks(self) -> tuple[ParameterBlock, ...]:
        """The tables in dual numbers."""
        return blocks(self._found.tables, self._found.diagonal, self.names, self._of_tables)

    def arranged(
        self, places: Sequence[int], scales: Real, spare: tuple[Parameters, tuple[ParameterBlock, ...]] | None = None
    ) -> tuple[ParameterBlock, ...]:
        """The tables in dual numbers along other directions (D,), to each of which belongs a change by its scale of the
        parameter that has this place, or of none.

        spare: the same parameters at other values, and what they were arranged to in the same way, which nobody needs
        any more: where that does, the tables are put into these, which are returned themselves.
        """
        rates = np.zeros((len(self._of_tables), len(scales)))
        rates[:, list(places)] = self._of_tables * scales[list(places)]
        tables, is_diagonal = self._found.tables, self._found.diagonal
        if spare is not None and spare[0]._found._structure == self._found._structure:
            moving = np.any(self._of_tables, axis=1) | np.any(spare[0]._of_tables, axis=1)
            if all(
                put(each, spare[0]._found.tables, tables, is_diagonal, rates[:, RATES * b : RATES * (b + 1)], moving)
                for b, each in enumerate(spare[1])
            ):
                return spare[1]
        names = np.full(len(scales), "", object)
        names[list(places)] = self.names
        return blocks(tables, is_diagonal, names.tolist(), rates)

    @property
    def differentiation(self) -> _Differentiation:
        """The tables as functions of the numbers."""
        return self._found

    @property
    def steady(self) -> Steady:
        """Which derivatives of the tables hold at other values of these numbers too."""
        if self._held is None:
            values = dict(zip(self.names, self.values.tolist(), strict=True))
            self._held = self._found.steady(values, self._rates)
        return self._held

    def accelerations(self, state: State) -> Real:
        """d udot/dp (nu,P) of the free motion at a fixed state; for closed chains with closures that stay closed.

        Raises DynamicsError where the accelerations do not exist.
        """
        t, y = self.plant.layout.entering(state)
        return finite_result(self._slopes(t, y, np.zeros((len(y), len(self.names))))[self.plant.nq : -1], t)

    def slopes(self, t: float, y: Real, dy: Real) -> Real:
        """d(dy/dt)/dp (n,P) at y (n,) = [q, u, work], which changes along dy (n,P), one column for each parameter.

        ValueError or TypeError for arrays that do not fit, DynamicsError where the accelerations do not exist.
        """
        t, y = self.plant.layout.whole(t, y)
        along = arguments.finite("dy", arguments.shaped("dy", dy, (len(y), len(self.names))))
        return finite_result(self._slopes(t, y, along), t)

    def _slopes(self, t: float, y: Real, dy: Real) -> Real:
        """The same of arrays that fit."""
        self.plant.refuse_corners(t, y)
        slopes = np.empty(dy.shape)
        for start, bound in self._bound:
            place = slice(start, start + bound.count)
            out, along = np.empty((len(y), RATES)), np.zeros((len(y), RATES))
            along[:, : bound.count] = dy[:, place]
            bound.check(bound.slopes(t, y, along, out))
            slopes[:, place] = out[:, : bound.count]
        return slopes

    def evaluate(self, state: State) -> dict[str, Any]:
        """By name of the parameter, the derivatives of everything observable, in the form of `System.evaluate`.

        NaN where redundant closures leave loads undetermined.
        """
        t, y = self.plant.layout.entering(state)
        self.plant.refuse_corners(t, y)
        evaluations = dict[str, Any]()
        for start, bound in self._bound:
            bound.check(bound.observe(t, y))
            for lane in range(bound.count):
                row = finite_result(bound.row(lane), t)
                evaluations[self.names[start + lane]] = self.plant.observation.evaluation(row + self._open(t, y))
        return evaluations

    def loads(self, state: State) -> dict[str, Real]:
        """d/dp (6,P) of the load [torque; force] across each hinge and closure on the outboard body, World axes."""
        loads = list(self.evaluate(state).values())
        return {
            name: np.column_stack([columns_of_part.loads[name] for columns_of_part in loads]) for name in loads[0].loads
        }

    def inverse_dynamics(self, state: State, accelerations: Real) -> Real:
        """d tau/dp (nu,P) of tau = M udot + c of the tree for given accelerations (nu,)."""
        t, y = self.plant.layout.entering(state)
        rates = self.plant.layout.rates("accelerations", accelerations)
        self.plant.refuse_corners(t, y)
        forces = np.empty((self.plant.nu, len(self.names)))
        for start, bound in self._bound:
            bound.invert(t, y, rates)
            forces[:, start : start + bound.count] = bound.loads.tau[:, 1 : 1 + bound.count]
        return finite_result(forces, t)

    def workspace(self, block: ParameterBlock) -> Any:
        """A new workspace for kernels that take the constants of a block; one per thread. ValueError for others."""
        plant = self.plant
        if not any(block is other for other in self.blocks):
            raise ValueError("block: give one of the `blocks` of these parameters")
        return kernels.parameter_workspace(block.constants, plant.constants, plant.nq, plant.nu)

    def _open(self, t: float, y: Real) -> Real:
        """(width,) NaN where loads are not determined by the motion, else zero."""
        observation, closures = self.plant.observation, self.plant.closures
        row = np.zeros(observation.width)
        if closures is not None and closures.rank < len(closures.constants[1].row):
            self.plant.observe_row(t, y, "articulated", row)
        return np.where(np.isnan(row), np.nan, 0.0)

    @per_thread
    def _bound(self) -> list[tuple[int, _Bound]]:
        """Number of the first parameter of each block, and the kernels bound to the block."""
        return [(i * RATES, _Bound(self, block)) for i, block in enumerate(self.blocks)]


class _Bound:
    """The kernels of one block, with workspaces of one thread."""

    def __init__(self, parameters: Parameters, block: ParameterBlock) -> None:
        self._plant, self._block, self.count = parameters.plant, block, len(block.names)
        self._w = parameters.workspace(block)
        closures = self._plant.closures
        self.loads = kernels.loads(self._plant.constants, 0 if closures is None else len(closures.scene))
        self._chain: Closed | None = None
        if closures is not None:
            self._chain = closures.chain("articulated")
            self._rates = kernels.chain_rates(self._w, closures.constants[1])
        self._out = kernels.dual_outputs(self._plant.observation.outputs())
        self.own = Own()

    def check(self, status: int) -> None:
        """DynamicsError unless a status code is OK."""
        if status != OK:
            self._plant.check_status(status, int(self._w.fault[0]))

    def row(self, lane: int) -> Real:
        """(width,) the derivatives of the last `observe` by the parameter of a lane."""
        parts = self._out.every, self._out.drives, self.loads.closures
        row: Real = np.concatenate([part[..., 1 + lane].ravel() for part in parts])
        return row

    @per_thread
    def slopes(self) -> Direct:
        """(t, y, dy, out)."""
        c = self._block.constants
        if self._chain is None:
            return direct(kernels.slopes, STATUS, REAL, VECTOR, MATRIX, MATRIX, c, self._w)
        tables = self._chain, c, self._block.closures, self._rates
        return direct(kernels.closed_slopes, STATUS, REAL, VECTOR, MATRIX, MATRIX, *tables)

    @per_thread
    def observe(self) -> Direct:
        """(t, y)."""
        c = self._block.constants
        if self._chain is None:
            return direct(kernels.outputs, STATUS, REAL, VECTOR, c, self._w, self._out)
        tables = self._chain, c, self._block.closures, self._rates, self._out, self.loads
        return direct(kernels.closed_outputs, STATUS, REAL, VECTOR, *tables)

    @per_thread
    def invert(self) -> Direct:
        """(t, y, rates)."""
        tables = self._block.constants, self._w, self.loads
        return direct(kernels.inverse, VOID, REAL, VECTOR, VECTOR, *tables)


def parameters(plant: Plant, names: Sequence[str]) -> Parameters:
    """The parameters of these names; PathError where the scene has no such number, ParameterError where there is no
    derivative by it, or nothing in the motion depends on it."""
    derivatives = Parameters(plant, numbers(plant.scene, names))
    for name, is_reached in zip(derivatives.names, derivatives.reached.tolist(), strict=True):
        if not is_reached:
            raise ParameterError(
                f'parameter "{name}": accelerations, loads and the initial state at given outputs of controllers do '
                "not depend on it: leave it out; by numbers of controllers, sensors and events, derivatives are those "
                "of runs: see `sensitivities`"
            )
    return derivatives


_OF_TABLES = {
    "tree.body.point_start": (
        'how many points of a beam of level "exact" there are, or in a part of the beam, depends on it; give the beam '
        "`points`, or leave it whole by cuts = []"
    ),
    "tree.body.planar": (
        'it bends a beam of level "exact", whose strains are in one plane, out of that plane; give the beam torsion '
        "and both curvatures, in `families` or `polynomials`"
    ),
    "tree.section.before": (
        'a node or tip mass of a beam of level "exact" passes the end of a piece or a station, where its strains or '
        "section jump; move it away from there, or move the end with it"
    ),
}
"""Tables whose contents change at some numbers, and what that means."""


def _or_whole(number: Number) -> str:
    """The other remedy for a place on a beam that is cut: how its modes change with a cut is known to fewer digits."""
    if number.name.endswith((".x_m", ".length_m")):
        for body in number.own_scene.bodies:
            if number.name.startswith(f"{body.name}.") and isinstance(body, BeamBody) and cuts(body):
                return f'; or leave beam "{body.name}" in one piece by cuts = []'
    return ""


class _Differentiation:
    """The tables of a scene as functions of each of its numbers."""

    def __init__(self, plant: Plant, starts: bool) -> None:
        self._plant, self._starts = plant, starts
        self._firsts: dict[str, First] = {}
        """By name of a number, what its first other value made of the tables."""
        self._widths: dict[str, float] = {}
        """Half-widths at which derivatives by these numbers were found at other values."""
        self._number: Number | None = None
        """Any of the numbers, for scenes with other values of all."""
        self.tables = _tables(plant, starts)
        self.diagonal = diagonal(self.tables)
        self._structure, own = structure(self.tables), numbers_of(self.tables)
        self.size = len(own)
        """The count of all floats of the tables; what follows them tells the errors of some of them."""
        integrals = moments(self.tables, self.tables)
        self._ends = np.cumsum([self.size, *map(len, integrals)]).tolist()
        self._middle = np.concatenate([own, *integrals])

    @kept
    def _parts(self) -> Parts:
        """The parts of all these floats."""
        sums = [slice(first, stop) for first, stop in itertools.pairwise(self._ends)]
        whole = np.r_[wholes(self.tables), np.zeros(self._ends[-1] - self.size)]
        return Parts([*parts(self.tables, self._plant.nq), *sums], whole)

    @property
    def reached(self) -> set[str]:
        """Names of the numbers with which tables were seen to differ."""
        return {name for name, first in self._firsts.items() if len(first.places)}

    def by(self, number: Number) -> Derivative:
        """Derivatives of `numbers_of` the tables and of what follows them; ParameterError where there are none."""

        def at(value: float) -> Real:
            return self._middle if value == number.value else self._with(number, {number.name: value})

        try:
            first = self._widths.get(number.name, WIDTHS[0])
            return derivative(at, number.value, number.scale, self._parts, first)
        except NotSmooth as error:
            raise ParameterError(
                f'parameter "{number.name}" = {number.value:g}: the motion has no derivative by it ({error}); take a '
                "value at which nothing appears, vanishes or changes its order, or another parameter"
                f"{_or_whole(number)}"
            ) from None

    def by_all(self, chosen: Sequence[Number], known: Mapping[str, Derivative]) -> list[Derivative]:
        """The same for many numbers, some of which are known by name."""
        asked = [number for number in chosen if number.name not in known]
        self._number = chosen[0] if chosen else None

        def tables(values: Mapping[str, float]) -> Real:
            return self._with(chosen[0], values) if values else self._middle

        found = iter(derivatives_together(tables, asked, self._parts, self.by, self._widths) if asked else ())
        return [known[number.name] if number.name in known else next(found) for number in chosen]

    def kept(self, like: Parameters, chosen: Sequence[Number]) -> Steady | None:
        """What is steady in tables of the same numbers at other values, None where they are not as predicted."""
        before = like.differentiation
        if like.names != tuple(number.name for number in chosen) or before._structure != self._structure:
            return None
        self._widths = {name: rate.width for name, rate in zip(like.names, like._rates, strict=True)}
        if not like.steady.predicts(self._middle, {number.name: number.value for number in chosen}):
            return None
        self.diagonal = np.minimum(self.diagonal, before.diagonal)
        return like.steady

    def steady(self, values: Mapping[str, float], rates: Sequence[Derivative]) -> Steady:
        """Which of these derivatives by numbers with these values are steady."""

        def tables(others: Mapping[str, float]) -> Real:
            assert self._number is not None  # of which there are values
            return self._at(self._number.scene_with(others))

        return steady(tables, self._middle, self._parts.sizes(self._middle), values, self._firsts, rates)

    def _with(self, number: Number, values: Mapping[str, float]) -> Real:
        """The tables with other values of a number and of others that belong to the same scene.

        The entries that change with the first other value of a number are kept: tables with such values of numbers that
        change no entry in common follow from them.
        """
        known = [self._firsts.get(name) for name in values]
        if all(first is not None and first.value == value for first, value in zip(known, values.values(), strict=True)):
            tables = self._middle.copy()
            for first in known:
                assert first is not None  # none is
                tables[first.places] = first.entries
            return tables
        tables = self._at(number.scene_with(values))
        if len(values) == 1 and known[0] is None:
            (name, value), places = next(iter(values.items())), np.flatnonzero(tables != self._middle)
            self._firsts[name] = First(value, places, tables[places])
        return tables

    def _at(self, scene: Scene) -> Real:
        try:
            tables = _tables(self._plant.with_numbers(scene), self._starts)
        except DynamicsError as error:  # that closures cannot be closed, or have no dynamics, at such a value
            raise ValueError(str(error)) from None
        changed = [name for name, part in structure(tables).items() if part != self._structure.get(name)]
        if changed:
            what = _OF_TABLES.get(changed[0], f"what the tables contain depends on it: {changed[0]}")
            raise ValueError(what)
        self.diagonal = np.minimum(self.diagonal, diagonal(tables))
        return np.concatenate([numbers_of(tables), *moments(tables, self.tables)])


def _tables(plant: Plant, starts: bool) -> Tables:
    start = np.zeros(plant.nq + plant.nu + 1)
    if starts:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SceneWarning)  # of values that closures change, which compiling has said
            start = plant.initial_state.y.copy()
    closures = plant.closures
    return Tables(plant.constants, None if closures is None else closures.constants[1], start)
