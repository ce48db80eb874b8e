"""A compiled scene: its arrays, its state vectors, and pointwise mechanics.

    system = compile(scene)
    state = system.initial_state
    acc = system.accelerations(state)

q holds, body by body (depth-first, point masses last), hinge coordinates, modal coordinates and wheel angles; u the
speeds in the same order. `system.coordinate(name)` and `system.speed(name)` give the places of a hinge, "<body>.hinge",
"<body>.modes", a wheel or a point mass.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from flexmb.building.assemble import assemble
from flexmb.building.connector_arrays import between_nodes
from flexmb.building.links import links
from flexmb.building.numbering import Numbering, wheels_by_body
from flexmb.entry import articulated
from flexmb.entry.observation import Outputs
from flexmb.jain.elimination import ELIMINATIONS, Elimination, with_elimination
from flexmb.motion import coordinates
from flexmb.scene import schema as s
from flexmb.scene.connectors import AlongHinge, HingeSpring
from flexmb.system import algorithms, labels
from flexmb.system.algorithm import Algorithm, Route
from flexmb.system.evaluator import Evaluator
from flexmb.system.load_axes import Axes, referred
from flexmb.system.mass_properties import MassProperties, mass_properties
from flexmb.system.mechanics import Mechanics, Precision
from flexmb.system.observables import Evaluation, Names, Observation
from flexmb.system.section_loads import AllLoads, SectionBalance, SectionLoads
from flexmb.tables import arguments
from flexmb.tables.arrays import Workspace
from flexmb.tables.features import GENERAL, Kernels, asking
from flexmb.tables.per_thread import per_thread
from flexmb.tables.state import State, finite_result
from flexmb.tables.status import OK, Status
from flexmb.typing import Index, Real

if TYPE_CHECKING:
    from flexmb.frisch.nested_system import NestedSystem, Partitions
    from flexmb.jain.operators import Operators, SpatialOperators
    from flexmb.system.batch import Batch, BatchAccelerations

Given = Literal["guess", "scene", "state"] | NDArray[np.bool_]
"""What of a state is asked for: nothing, what a scene gives, all of it, or the values (nq+nu+1,) that are named."""

_NO_CLOSURES = np.zeros((0, 6))


class System(Mechanics):
    """A checked scene turned into arrays; made by `compile`. Threads may share it: each has workspaces of its own."""

    def __init__(self, scene: s.Scene, elimination: Elimination = "fastest") -> None:
        super().__init__()
        self.scene = scene
        self._asked: Elimination = elimination
        self._links = links(scene)
        self._wheels = wheels_by_body(scene)
        self._numbering = Numbering(self._links, self._wheels)
        assembled = assemble(scene, self._links, self._numbering)
        self.constants, markers, self._closure_ports = assembled.constants, assembled.markers, assembled.closures
        self.signals = assembled.signals
        """By number among the functions of time, those that controllers drive in a run; zero outside of one."""
        self.layout = self._numbering.layout
        self.nq, self.nu = self.layout.nq, self.layout.nu
        self._markers, self.recursion_constants = markers, with_elimination(self.constants, elimination)
        self.rhs, self.project = articulated.rhs, coordinates.project
        self._nested: dict[str, NestedSystem] = {}
        self.kept: dict[Any, Any] = {}
        """What runs find once and keep for the next one."""
        self._operators: SpatialOperators | None = None

    def _anew(self) -> System:
        """The same scene turned into other arrays."""
        with asking(self.kernels):
            return System(self.scene, self._asked)

    @property
    def kernels(self) -> Literal["general", "special"]:
        """Which kernels run it: those that take every scene, or those compiled for its kind; see `compile`."""
        return "general" if GENERAL in self.constants.features() else "special"

    @per_thread
    def _w(self) -> Workspace:
        return self.workspace()

    @per_thread
    def _recursion_w(self) -> Workspace:
        return self.recursion_workspace()

    @per_thread
    def _observation(self) -> Observation:
        hinges, wheels = [link.hinge.name for link in self._links], [*self._wheel_names()]
        closures, driven = [closure.name for closure in self.scene.closures], self._driven([*hinges, *wheels])
        connectors = [each.name for each in between_nodes(self.scene)], [*_along_hinges(self.scene)]
        return Observation(Names(self._markers, hinges, wheels, closures, driven, *connectors), self.nu)

    @property
    def _out(self) -> Outputs:  # type: ignore[override]
        return self._observation.out

    @per_thread
    def _evaluators(self) -> dict[str, Evaluator]:
        """By algorithm."""
        return {}

    def __reduce__(self) -> tuple[Any, ...]:
        """Copied and pickled as its scene: addresses are of one process, and arrays are parts of each other."""
        return copied, (System, self.kernels, self.scene, self._asked)

    @property
    def body_names(self) -> tuple[str, ...]:
        """Bodies in the order of the dynamics, point masses last."""
        return tuple(link.name for link in self._links)

    def coordinate(self, name: str) -> slice:
        """Place in q of a hinge, "<body>.hinge", "<body>.modes", wheel or point mass."""
        return _find(self._numbering.q, name)

    def speed(self, name: str) -> slice:
        """Place in u of a hinge, "<body>.hinge", "<body>.modes", wheel or point mass."""
        return _find(self._numbering.u, name)

    def state(self, q: Real, u: Real, t: float = 0.0) -> State:
        """State from q (nq,), u (nu,) and t (s), copies; quaternions need not have unit length, they are scaled.

        Raises ValueError where lengths do not fit, numbers are not finite or a quaternion is zero, and TypeError for
        anything but real numbers.
        """
        return self.layout.state(q, u, t)

    @property
    def initial_state(self) -> State:
        """The scene's state at t = 0; prescribed coordinates have their functions' values."""
        return self.layout.known(0.0, self._at_start.copy())

    def _admissible(self, t: float, y: Real, given: Given = "guess") -> State:
        """The state at time t (s) that y (nq+nu+1,) = [q, u, work] stands for; prescribed motions are as they are then.

        Of closed chains the nearest one that closes all closures; ClosureError where that is far. It keeps what is
        given where it can, and warns where not.
        """
        y = np.r_[y[:-1], 0.0]
        self.project(t, y, self.constants)
        return self.layout.known(t, y)

    def _scene_state(self, t: float) -> Real:
        """(nq+nu+1,) [q, u, 0] of the scene's initial values, with prescribed motions as they are at time t (s)."""
        y: Real = self._at_start.copy()
        self.project(t, y, self.constants)
        return y

    @cached_property
    def _at_start(self) -> Real:
        """(nq+nu+1,) [q, u, 0] of the scene at t = 0."""
        q, u = np.zeros(self.nq), np.zeros(self.nu)
        for link in self._links:
            name = link.hinge.name
            q[self.coordinate(name)], u[self.speed(name)] = link.kind.state(link.hinge)
        for wheel in self.scene.wheels:
            q[self.coordinate(wheel.name)], u[self.speed(wheel.name)] = wheel.angle_rad, wheel.speed_rad_s
        for modal in self.scene.modal_states:
            name = f"{modal.body}.modes"
            if self.coordinate(name).stop > self.coordinate(name).start:
                q[self.coordinate(name)] = modal.coordinates
                u[self.speed(name)] = modal.rates or 0.0
        y = np.concatenate([q, u, [0.0]])
        self.project(0.0, y, self.constants)
        return y

    @property
    def elimination(self) -> dict[str, str]:
        """By flexible body, how the recursion eliminates its modes: "explicit", "woodbury" or "condensed"."""
        body = self.recursion_constants.body
        return {
            name: ELIMINATIONS[body["elimination"][k]] for k, name in enumerate(self.body_names) if body["modes"][k]
        }

    def nested(self, algorithm: Algorithm = "frisch") -> NestedSystem:
        """Frisch's equations of this scene, corrected or as printed, built at the first call.

        ValueError where the print does not apply: a body whose modes are not clamped at its hinge point.
        """
        from flexmb.frisch.nested_system import NestedSystem  # who uses the recursion waits for none of it

        errata = algorithms.chosen(algorithm, algorithms.NESTED).errata
        if algorithm not in self._nested:
            made = NestedSystem(self.constants, self._links, self.layout, errata or frozenset())
            return self._nested.setdefault(algorithm, made)
        return self._nested[algorithm]

    def partitions(self, state: State, algorithm: Algorithm = "frisch") -> Partitions:
        """The partitioned equations of motion, Frisch (111), by the names of the paper."""
        t, y = self.layout.entering(state)
        return self.nested(algorithm).partitions(t, y)

    def operators(self, state: State) -> Operators:
        """The spatial operators of Jain & Rodriguez, sections II to V, as dense arrays, World axes; all speeds free."""
        t, y = self.layout.entering(state)
        from flexmb.jain.operators import SpatialOperators  # with SciPy slow to import: only who asks for them waits

        if self._operators is None:
            self._operators = SpatialOperators(self.scene)
        found = self._operators.at(t, y[: self.nq], y[self.nq : -1])
        for part in (found.M_m, found.a_m, found.b_m, found.V_m):
            finite_result(part, t)
        return found

    def accelerations(self, state: State, algorithm: Algorithm = "articulated") -> Real:
        """udot (nu,) of the free motion under all loads; prescribed speeds have their functions' rates.

        "articulated": the O(N) recursion; "unsplit": the same with modes and hinge of a body eliminated together;
        "composite": mass matrix by composite bodies, bias by inverse dynamics, Cholesky's factors, partitioned for
        prescribed speeds; "frisch": the nested-body equations of 1975, corrected, "frisch_as_printed": to the letter.
        Frisch's equations are of first order in the deformation: they take bodies of level `full` as `linear`.
        Raises DynamicsError where an inertia is not positive definite, or numbers are so large that they overflow.
        """
        if type(state) is not State or state.layout is not self.layout:
            state = self.layout.owning(state)
        try:
            evaluator = self._own._evaluators[algorithm]  # not by way of the property, which costs as much as the call
        except (AttributeError, KeyError):
            evaluator = self._evaluator(algorithm)
        return evaluator(state.t, state._q, state._u).copy()

    def accelerations_batch(self, q: Any, u: Any, t: Any = 0.0, *, threads: int | None = None) -> BatchAccelerations:
        """udot (n,nu) of many states at once, and a status (n,) for each: see `flexmb.system.batch.Batch`.

            udot, status = system.accelerations_batch(q, u)     q (n,nq), u (n,nu), t (s) one or (n,)

        A state that has no accelerations fails no other one: its row is NaN. Raises ValueError or TypeError for arrays
        that do not fit.
        """
        return self.batch.accelerations(q, u, t, threads=threads)

    @property
    def batch(self) -> Batch:
        """Any number of copies of this system."""
        found: Batch | None = self.kept.get("batch")
        if found is None:
            from flexmb.system.batch import Batch  # lanes are for those who ask for many states

            found = self.kept.setdefault("batch", Batch([self]))
        return found

    def evaluator(self, algorithm: Algorithm = "articulated") -> Evaluator:
        """`accelerations` for a loop: `udot = evaluator(t, q, u)` writes into one array, by a workspace of its own.

        A call costs a tenth of a microsecond besides the kernel, of the thread that calls it first; others may call it
        too, each with an array and a workspace of its own, and wait half a microsecond longer. Compiled here, not at
        its first call. NotImplementedError for closed chains.
        """
        chosen = algorithms.chosen(algorithm)
        return Evaluator(self, chosen, chosen.fresh(self))

    def _evaluator(self, algorithm: Any) -> Evaluator:
        chosen = algorithms.chosen(algorithm)
        if chosen.name not in self._evaluators:
            self._evaluators[chosen.name] = Evaluator(self, chosen, chosen.own(self))
        return self._evaluators[chosen.name]

    @per_thread  # not `cached_property`: before Python 3.12 it holds a lock meanwhile, and this may have to compile
    def start_precision(self) -> Precision | None:
        """`_precision_if_doubtful` of the initial state, found once."""
        return self._precision_if_doubtful(self.initial_state)

    def _precision_if_doubtful(self, state: State) -> Precision | None:
        """`precision` of a state, None where no pivot there is so small that it may be rounding.

        Asked of the right-hand side, which a run needs compiled anyway; kernels of the precision few runs need.
        """
        w = self._recursion_w
        t, y = self.layout.entering(state)
        status = self._recur(t, y, np.empty_like(y))
        return None if status == OK and not w.doubt[0] else self.precision(state)

    @cached_property
    def state_names(self) -> tuple[labels.Names, labels.Names]:
        """((name, unit) of every entry of q, the same of u)."""
        return labels.names_of_states(self)

    def route(self, algorithm: Algorithm = "articulated", stabilise: float = 0.0) -> Route:
        """The algorithm as runs see it; `stabilise` is for closed chains.

        ValueError for an algorithm that is for single states, or does not apply to the scene.
        """
        if arguments.number("stabilise", stabilise) != 0.0:
            raise ValueError(f"stabilise is {stabilise:g}, but the scene has no closures: leave it out")
        made = algorithms.chosen(algorithm, algorithms.RUNNING).route
        assert made is not None  # of those that run
        return made(self)

    def hinge_loads(
        self,
        state: State,
        accelerations: Real | None = None,
        *,
        axes: Axes = "world",
        about: tuple[str, str] | None = None,
    ) -> dict[str, Real]:
        """Total load (6,) [torque; force] across each hinge on the outboard body.

        Of the free motion; with `accelerations` (nu,) what hinges transmit if these are forced, Jain & Rodriguez (44).
        axes: "world", or those of each hinge's own frame "inboard" or "outboard". about: (body, node), a point that
        moves with the deformation, "ground" with "origin"; by default each hinge's outboard point. ValueError for axes
        or a node that there are not.
        """
        t, y = self.layout.entering(state)
        if accelerations is None:
            loads, w = finite_result(self._free_loads(t, y), t), self._recursion_w
        else:
            rates = self.layout.rates("accelerations", accelerations)
            loads, w = finite_result(self._inverse(t, y, rates)[1], t), self._w
        return referred(self, w, self._by_hinge(loads), axes, about)

    def _loads_in(
        self, t: float, y: Real, loads: dict[str, Real], axes: Axes, about: tuple[str, str] | None
    ) -> dict[str, Real]:
        """Loads of hinges and closures that were found at this state, World axes, in other axes about a node."""
        self._inverse(t, y, np.zeros(self.nu))  # leaves poses as the equations of motion see them
        return referred(self, self._w, loads, axes, about)

    def section_loads(self, state: State, body: str, x: Any) -> SectionLoads:
        """Axial force, shear, bending and torsion across the sections of a beam at x (X,) m, of the free motion.

        By the momentum balance of the part beyond each section, not by the modes' curvature. A body of level `linear`
        is taken as `full`; at level `stiffened` the balance differs from the dynamics in the fourth order of the
        deformation. Warns (`SceneWarning`) where the mass is lumped, which steps at nodes. NaN what redundant closures
        leave open. ValueError for anything but a beam, and positions off it.
        """
        t, y = self.layout.entering(state)
        balance = SectionBalance(self, body, x)
        return balance.loads(balance.at(t, y))

    def _all_loads(self, t: float, y: Real) -> AllLoads:
        """Of hinges, closures, wheels and connectors; leaves the motion that the equations see in `_w`."""
        found = self._evaluate(t, y, "articulated")
        self._inverse(t, y, found.accelerations)
        return AllLoads(found)

    def mass_properties(self, state: State, body: str | None = None) -> MassProperties:
        """Mass, mass centre and inertia of a body with all that it carries, or of the whole scene, at a state.

        Everything counts as if it were rigid where it is; a ruthless body, and where it holds others, at its rest
        shape, as momentum has it. ValueError for a body that there is not.
        """
        t, y = self.layout.entering(state)
        self._out.rates[:] = 0.0
        self._observe_motion(t, y)
        inertias = self._w.body["inertia"].copy()
        if any(link.level.at_rest for link in self._links):
            self._inverse(t, y, self._out.rates)  # leaves poses by rest shapes
        return mass_properties(self, self._w, inertias, body)

    def _free_loads(self, t: float, y: Real) -> Real:
        """(N,6) of the free motion, World axes."""
        loads, w = np.zeros((len(self._links), 6)), self._recursion_w
        self._check(self._recur(t, y, np.empty_like(y)), int(w.fault[0]))
        self._trust(t, y, w)
        self._transmit(loads)
        return loads

    def _by_hinge(self, loads: Real) -> dict[str, Real]:
        return {link.hinge.name: loads[k] for k, link in enumerate(self._links)}

    def energy(self, state: State) -> dict[str, float]:
        """Kinetic, strain, spring and gravity energy (J)."""
        return self._evaluate(*self.layout.entering(state), "articulated").energy

    def momentum(self, state: State) -> Real:
        """(6,) [angular about the World origin; linear], World axes."""
        return self._evaluate(*self.layout.entering(state), "articulated").momentum

    def evaluate(self, t: float, q: Real, u: Real, algorithm: Algorithm = "articulated") -> Evaluation:
        """Everything observable at time t (s) of q (nq,) and u (nu,).

        Quaternions need not have unit length, they are scaled; prescribed coordinates and speeds are taken from their
        functions. ValueError or TypeError for arrays that do not fit, as of `state`; DynamicsError where the
        accelerations do not exist, or numbers are so large that they overflow.
        With "frisch" or "frisch_as_printed", accelerations, hinge loads, drive loads and wheel torques are those of
        these equations; a wheel's force follows from its acceleration (the paper counts its mass as the body's).
        """
        return self._evaluate(*self.layout.packed(t, q, u), algorithm)

    def _evaluate(self, t: float, y: Real, algorithm: Algorithm) -> Evaluation:
        algorithms.chosen(algorithm).observe(self, t, y)
        return self._observation.evaluation(t)

    def _observe_row(self, t: float, y: Real, algorithm: Algorithm, row: Real) -> None:
        """Everything observable at y = [q, u, work], which is not checked, into a row as `Observation.columns` has it.

        Raises DynamicsError as `evaluate` does.
        """
        algorithms.chosen(algorithm).observe(self, t, y)
        self._observation.fill(row, t, _NO_CLOSURES)

    def fault_name(self, status: int, fault: int) -> str:
        """Name of the body or connector that the number of a failure stands for."""
        if status == Status.CONNECTOR_OVERTURNED:
            return between_nodes(self.scene)[fault].name
        return super().fault_name(status, fault)

    def _wheel_names(self) -> Iterator[str]:
        yield from (wheel.name for link in self._links for wheel in self._wheels.get(link.name, ()))

    def _driven(self, names: Iterable[str]) -> dict[str, Index]:
        """Places in u of the prescribed coordinates, by hinge or wheel."""
        driven = self.constants.speed["prescribed"] >= 0
        if not np.any(driven):
            return {}
        places = ((name, self.speed(name)) for name in names)
        return {name: at.start + np.flatnonzero(driven[at]) for name, at in places if np.any(driven[at])}


def copied(kind: type[System], kernels: Kernels, *given: Any) -> System:
    """What a pickled system becomes again, run by the same kind of kernels."""
    with asking(kernels):
        return kind(*given)


def _along_hinges(scene: s.Scene) -> Iterator[str]:
    """Springs along hinges, then other laws, as the tables have them."""
    along = [each for each in scene.connectors if isinstance(each, AlongHinge)]
    yield from (each.name for each in along if isinstance(each, HingeSpring))
    yield from (each.name for each in along if not isinstance(each, HingeSpring))


def _find(places: dict[str, slice], name: str) -> slice:
    if name not in places:
        raise KeyError(f"no coordinates of that name: {name!r}; there are {', '.join(sorted(places))}")
    return places[name]
