"""A compiled scene: its arrays, its states, and the mechanics at one state.

    system = compile(scene)
    state = system.initial_state
    acc = system.accelerations(state)

q holds, body by body (depth-first, point masses last), hinge coordinates, modal coordinates and wheel angles; u the
speeds in the same order. `system.coordinate(name)` and `system.speed(name)` give the places of a hinge, "<body>.hinge",
"<body>.modes", a wheel or a point mass.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, get_args, overload

import numpy as np
from numpy.typing import NDArray

from flexmb.entry import articulated
from flexmb.jain.elimination import ELIMINATIONS, Elimination
from flexmb.kept import kept
from flexmb.motion import coordinates
from flexmb.scene import schema as s
from flexmb.scene.garbage import collector_paused
from flexmb.system import algorithms, given_values
from flexmb.system.algorithm import Algorithm, DynamicsAlgorithm, Route
from flexmb.system.derivative_evaluator import DerivativeEvaluator
from flexmb.system.derivative_records import (
    AccelerationDerivatives,
    EvaluationDerivatives,
    InverseDynamicsDerivatives,
    OfFreeMotion,
    OfGivenMotion,
)
from flexmb.system.evaluator import Evaluator, fresh_evaluator
from flexmb.system.linearisation import Linearisation
from flexmb.system.load_axes import Axes, Redundant, held_by, referred
from flexmb.system.mass_properties import MassProperties, mass_properties
from flexmb.system.mechanics import Mechanics, Precision
from flexmb.system.observables import Evaluation
from flexmb.system.scene_arrays import kernels_of
from flexmb.system.section_loads import AllLoads, SectionBalance, SectionLoads
from flexmb.tables import arguments
from flexmb.tables.features import Choice, asking
from flexmb.tables.per_thread import per_thread
from flexmb.tables.state import State, finite_result
from flexmb.typing import Real

if TYPE_CHECKING:
    from flexmb.closure.closures import Closures
    from flexmb.closure.operators import ClosureOperators
    from flexmb.frisch.nested_system import NestedSystem, Partitions
    from flexmb.jain.operators import Operators, SpatialOperators
    from flexmb.parameters.parameters import Parameters
    from flexmb.parameters.regressor import InertiaRegressor
    from flexmb.system.batch import Batch, BatchAccelerations
    from flexmb.system.constraints import Constraints
    from flexmb.system.given_values import Given

_NO_CLOSURES = np.zeros((0, 6))


class System(Mechanics):
    """A checked scene turned into arrays; made by `compile`. Threads may share it: each has workspaces of its own.

    constraints: the closures and couplings of a closed chain, None of a tree. Mass matrix, bias and inverse dynamics of
    a chain are those of its tree alone; `closure_operators` gives the terms that closures add. What belongs to the
    accelerations of a tree, such as operators, partitions and evaluators, raises NotImplementedError for a chain.
    """

    def __init__(
        self, scene: s.Scene, elimination: Elimination = "fastest", like: s.Scene | None = None, *, closed: bool = False
    ) -> None:
        """like: see `SceneArrays`. closed: with the closures of the scene, which is its tree alone otherwise."""
        super().__init__(scene, elimination, like)
        self._asked: Elimination = elimination
        self.rhs, self.project = articulated.rhs, coordinates.project
        self.kept: dict[Any, Any] = {}
        """Results and tables that runs keep for later runs."""
        self._operators: SpatialOperators | None = None
        self.constraints: Constraints | None = None
        if closed:
            from flexmb.system.constraints import Constraints  # imported here, because trees do not need it

            self.constraints = Constraints(self, like)
        self.linearisation = Linearisation(self, self.constraints)

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles hold the scene only: addresses belong to one process, and arrays share memory."""
        return copied, (kernels_of(self), self.scene, self._asked, self.constraints is not None)

    def with_numbers(self, scene: s.Scene) -> System:
        """The system of the same scene with slightly other numbers, whose tables are smooth functions of these.

        Modes follow those of this scene, and equal functions of time are kept apart. The scene is not checked. Closures
        close the initial values of that scene, as those of a run of it do.
        """
        with asking(kernels_of(self)), collector_paused():
            return System(scene, self._asked, self.scene, closed=self.constraints is not None)

    # Closures

    @property
    def closures(self) -> Closures | None:
        """The closure equations with workspaces of this thread; None for a tree."""
        return None if self.constraints is None else self.constraints.closures

    @property
    def rank(self) -> int:
        """Number of independent constraints at the initial state; 0 for a tree."""
        return 0 if self.constraints is None else self.constraints.rank

    def determined_loads(self, state: State) -> dict[str, NDArray[np.bool_]]:
        """Which components (6,) of the loads of hinges and closures are determined by the motion; World axes.

        The others, in overconstrained mechanisms of rigid bodies, are NaN wherever loads are given (`evaluate`).
        """
        if self.constraints is None:
            self.layout.entering(state)
            return {link.hinge.name: np.ones(6, bool) for link in self.links}
        return self.constraints.determined_loads(state)

    def closure_operators(self, state: State) -> ClosureOperators:
        """J, the inertia of the tree reflected at the closures J M^-1 J' (its inverse), and the loads that follow.

        Jain & Rodriguez, section VIII. Raises DynamicsError where the closures are singular, NotImplementedError for a
        tree.
        """
        return self._chain("closure operators").operators(state)

    def closure_gaps(self, state: State) -> dict[str, tuple[float, float]]:
        """Gap of each closure along its constrained directions: distance (m) and sine of the angle."""
        t, y = self.layout.entering(state)
        return {} if self.constraints is None else self.constraints.closures.gaps(t, y)

    def _chain(self, what: str) -> Constraints:
        if self.constraints is None:
            raise NotImplementedError(f'scene "{self.scene.name}" has no closures or couplings, which {what} are of')
        return self.constraints

    def _refuse_chain(self, what: str) -> None:
        """NotImplementedError for a closed chain."""
        if self.constraints is not None:
            raise NotImplementedError(
                f'scene "{self.scene.name}" has closures or couplings, and {what} are for trees only: '
                "closure_operators(state) gives the terms that closures add, and flexmb.System(scene) is the tree "
                "alone, which moves differently"
            )

    # States and accelerations

    @property
    def initial_state(self) -> State:
        """The scene's state at t = 0; prescribed coordinates have their functions' values.

        Of a closed chain the closest one that closes all closures, in the metric of kinetic energy, first for the
        coordinates, then for the speeds; bodies deform only where hinges cannot close a loop. Values that the scene
        gives are kept exactly where the others can adapt (see `flexmb.scene.hinges.AngularCoordinate`). Otherwise a
        `SceneWarning` lists the changes, or a ClosureError is raised for values that are marked as given, and where no
        state closes all closures.
        """
        return super().initial_state if self.constraints is None else self.constraints.initial_state

    def admissible(self, state: State, given: Given = "guess") -> State:
        """The state with prescribed motions at their values for its time, and for closed chains with closed closures.

        The latter is the nearest such state; ClosureError where a closure is open by more than `LARGEST_INITIAL_GAP`.
        Values that are `given` are kept if possible; otherwise a warning names them.
        """
        t, y = self.layout.entering(state)
        nearest = self.layout.known(t, self._projected(t, y))
        return nearest if self.constraints is None else self.constraints.admissible(nearest, given)

    def accelerations(self, state: State, algorithm: Algorithm = "articulated") -> Real:
        """udot (nu,) of the free motion under all loads; prescribed speeds have their functions' rates.

        "articulated": the O(N) recursion; "unsplit": the same with modes and hinge of a body eliminated together;
        "composite": mass matrix by composite bodies, bias by inverse dynamics, Cholesky's factors, partitioned for
        prescribed speeds; "frisch": the nested-body equations of 1975, corrected, "frisch_as_printed": to the letter.
        Frisch's equations are of first order in the deformation: they take bodies of level `full` as `linear`.
        Raises DynamicsError where an inertia is not positive definite, closures are singular, or numbers are so large
        that they overflow. States of a closed chain must close its closures.
        """
        if self.constraints is not None:
            return self.constraints.accelerations(state, algorithm)
        if type(state) is not State or state.layout is not self.layout:
            state = self.layout.owning(state)
        try:
            evaluator = self.own._evaluators[algorithm]  # without the property, which costs as much as the evaluation
        except (AttributeError, KeyError):
            evaluator = self._evaluator(algorithms.chosen(algorithm))
        return evaluator(state.t, state.kernel_q, state.kernel_u).copy()

    def evaluator(self, algorithm: Algorithm = "articulated") -> Evaluator:
        """`accelerations` for a loop: `udot = evaluator(t, q, u)` writes into one array, with a workspace of its own.

        A call costs 0.1 us in addition to the kernel in the thread that makes the first call, and 0.5 us more in other
        threads, each of which has an array and a workspace of its own. The kernel is compiled here, not at the first
        call. NotImplementedError for closed chains.
        """
        if self.constraints is not None:
            raise NotImplementedError(
                f'scene "{self.scene.name}" has closures or couplings, and evaluators are for trees only: '
                "use accelerations(state)"
            )
        return fresh_evaluator(self, algorithm)

    def _evaluator(self, chosen: DynamicsAlgorithm) -> Evaluator:
        """The evaluator that uses the workspace of this thread in the system."""
        if chosen.name not in self._evaluators:
            self._evaluators[chosen.name] = Evaluator(self, chosen, chosen.own(self))
        return self._evaluators[chosen.name]

    @per_thread
    def _evaluators(self) -> dict[str, Evaluator]:
        """By name of the algorithm."""
        return {}

    @per_thread
    def start_precision(self) -> Precision | None:
        """`precision_if_doubtful` of the initial state, found once."""
        return self.precision_if_doubtful(self.initial_state)

    # Derivatives, exact: `linearisation` has them. All raise NotImplementedError for scenes with controllers,
    # `NotDifferentiableError` (a DynamicsError) where a law has a corner, and what the methods for the values raise

    def acceleration_derivatives(self, state: State, forces: Real | None = None) -> AccelerationDerivatives:
        """Derivatives of `accelerations` by displacements along the speeds, coordinates, speeds, forces and time.

        `forces` (nu,): generalised forces along the speeds (N m, N) that act in addition to those of the scene.
        Closed chains: of the accelerations under constraint loads that keep the row accelerations zero, as a function
        of all coordinates and speeds; they mean something along changes that the closures allow.
        """
        return self.linearisation.of_accelerations(state, forces)

    def derivative_evaluator(self) -> DerivativeEvaluator:
        """`acceleration_derivatives` for a loop: `udot = evaluator(t, q, u)` writes derivatives into its arrays.

        A call costs 0.1 us in addition to the kernel. The kernel is compiled here, not at the first call. States of
        closed chains must fulfil the closures. NotImplementedError for scenes with controllers, and closures on bodies
        of level `ruthless`.
        """
        return self.linearisation.evaluator()

    def inverse_dynamics_derivatives(self, state: State, accelerations: Real) -> InverseDynamicsDerivatives:
        """Derivatives of `inverse_dynamics` at these accelerations (nu,); of closed chains those of the tree alone."""
        return self.linearisation.of_inverse_dynamics(state, accelerations)

    @overload
    def evaluation_derivatives(self, state: State) -> EvaluationDerivatives[OfFreeMotion]: ...
    @overload
    def evaluation_derivatives(self, state: State, accelerations: Real) -> EvaluationDerivatives[OfGivenMotion]: ...
    def evaluation_derivatives(self, state: State, accelerations: Real | None = None) -> Any:
        """Derivatives of everything observable: accelerations, markers, loads, energies, momentum.

            d = system.evaluation_derivatives(state)
            d.loads["pivot"].by_speed               (6,nu)
            d.energy["kinetic"].by_displacement     (nu,)
            d.markers["tip"].acceleration.by_force  (6,nu)

        Of the free motion, or of the motion with given `accelerations` (nu,), for trees only, whose loads are those of
        inverse dynamics.
        """
        return self.linearisation.of_evaluation(state, accelerations)

    def hinge_load_derivatives(
        self, state: State, *, axes: Axes = "world", about: tuple[str, str] | None = None
    ) -> dict[str, OfFreeMotion]:
        """Derivatives (6,nu) of `hinge_loads(state, axes=axes, about=about)` of the free motion, by hinge and closure.

        In axes that turn, or about a node that moves, these turn and move with the state.
        """
        return self.linearisation.of_hinge_loads(state, axes, about)

    def section_load_derivatives(self, state: State, body: str, x: Any) -> OfFreeMotion:
        """Derivatives (X,6,nu) of `section_loads(state, body, x).load`, of the free motion."""
        return self.linearisation.of_section_loads(state, body, x)

    def refuse_corners(self, t: float, y: Real) -> None:
        """NotDifferentiableError where a law has a corner at y = [q, u, work]: the one check of all derivatives."""
        self.linearisation.refuse_corners(t, y)

    # Algorithms and numbers

    def parameters(self, names: Sequence[str]) -> Parameters:
        """Derivatives by numbers of the scene, which are named as in `Scene.with_values`.

            p = system.parameters(["rod.mass_kg", "pivot.rotation.stiffness_Nm_rad"])
            p.accelerations(state)      (nu,2)

        PathError (a ValueError) where the scene has no such number, or where it is whole, a name or a switch;
        ParameterError (a ValueError) where motions have no derivative by it, or do not depend on it.
        """
        from flexmb.parameters.parameters import parameters  # imported here, because few programs differentiate

        return parameters(self, names)

    def inertia_regressor(self, bodies: Sequence[str] | None = None) -> InertiaRegressor:
        """Y in tau = M udot + c = Y(q, u, udot) pi + rest of the tree, for the inertia parameters pi of its bodies.

        bodies: those whose parameters are taken, by default all. ValueError for unknown ones, NotImplementedError for
        bodies of level `stiffened`.
        """
        from flexmb.parameters.regressor import InertiaRegressor  # imported here, because few programs identify

        return InertiaRegressor(self, self.links, bodies)

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
        self._refuse_chain("Frisch's partitioned equations")
        errata = algorithms.chosen(algorithm, algorithms.NESTED).errata
        assert errata is not None  # of those that are nested
        return self.nested_system(errata)

    def partitions(self, state: State, algorithm: Algorithm = "frisch") -> Partitions:
        """The partitioned equations of motion, Frisch (111), by the names of the paper."""
        t, y = self.layout.entering(state)
        return self.nested(algorithm).partitions(t, y)

    def operators(self, state: State) -> Operators:
        """The spatial operators of Jain & Rodriguez, sections II to V, as dense arrays, World axes; all speeds free."""
        self._refuse_chain("the spatial operators")
        t, y = self.layout.entering(state)
        from flexmb.jain.operators import SpatialOperators  # imported here, because it imports SciPy, which is slow

        if self._operators is None:
            self._operators = SpatialOperators(self.scene)
        operators = self._operators.at(t, y[: self.nq], y[self.nq : -1])
        for part in (operators.M_m, operators.a_m, operators.b_m, operators.V_m):
            finite_result(part, t)
        return operators

    def accelerations_batch(self, q: Any, u: Any, t: Any = 0.0, *, threads: int | None = None) -> BatchAccelerations:
        """udot (n,nu) of many states at once, and a status (n,) for each: see `flexmb.system.batch.Batch`.

            udot, status = system.accelerations_batch(q, u)     q (n,nq), u (n,nu), t (s) one or (n,)

        The row of a state that has no accelerations is NaN. Raises ValueError or TypeError for arrays that do not fit.
        """
        return self.batch.accelerations(q, u, t, threads=threads)

    @property
    def batch(self) -> Batch:
        """Any number of copies of this system."""
        batch: Batch | None = self.kept.get("batch")
        if batch is None:
            from flexmb.system.batch import Batch  # imported here, because only batches need lanes

            batch = self.kept.setdefault("batch", Batch([self]))
        return batch

    @kept
    def state_names(self) -> tuple[given_values.Names, given_values.Names]:
        """((name, unit) of every entry of q, the same of u)."""
        return given_values.names_of_states(self)

    def route(self, algorithm: Algorithm = "articulated", stabilise: float = 0.0) -> Route:
        """What a run needs of the algorithm; `stabilise` is for closed chains.

        ValueError for an algorithm that is for single states, or does not apply to the scene; for closed chains
        NotImplementedError for an algorithm of trees only, ClosureError for a mechanism that cannot move.
        """
        if self.constraints is not None:
            return self.constraints.route(algorithm, stabilise)
        if arguments.number("stabilise", stabilise) != 0.0:
            raise ValueError(f"stabilise is {stabilise:g}, but the scene has no closures or couplings: leave it out")
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
        redundant: Redundant = "open",
    ) -> dict[str, Real]:
        """Total load (6,) [torque; force] across each hinge, and closure, on the outboard body (body_b).

        Of the free motion, or of the motion with given `accelerations` (nu,), Jain & Rodriguez (44). axes: "world", or
        those of each hinge's own frame "inboard" or "outboard" (of a closure A and B). about: (body, node), a point
        that moves with the deformation, or ("ground", "origin"); by default each hinge's outboard point. redundant:
        components that the motion does not determine are "open", which is NaN, or those of the closures' loads of
        "least_norm", one choice of infinitely many; see `total_load` for sums. ValueError for unknown words or an
        unknown node.
        """
        arguments.one_of("redundant", redundant, get_args(Redundant))
        if self.constraints is not None:
            return self.constraints.hinge_loads(state, accelerations, axes, about, redundant)
        t, y = self.layout.entering(state)
        if accelerations is None:
            loads, w = np.zeros((len(self.links), 6)), self.own_recursion_workspace
            self._follow_recursion(t, y)
            self._transmit(loads)
        else:
            rates = self.layout.rates("accelerations", accelerations)
            loads, w = self.inverse_at(t, y, rates)[1], self.own_workspace
        return referred(self, w, self.by_hinge(finite_result(loads, t)), axes, about)

    def total_load(self, state: State, joints: Sequence[str], on: str, *, about: tuple[str, str] | None = None) -> Real:
        """Sum (6,) [torque; force] of the loads that some hinges and closures exert on a body, World axes.

        NaN only where the motion leaves the sum itself open: how two parallel pins share a force follows from
        flexibility alone, but not their sum. about: as of `hinge_loads`, by default the origin of the body. ValueError
        for joints that are not there, are named twice or do not hold the body, and for an unknown node.
        """
        signs, about = held_by(self.scene, joints, on), about or (on, "origin")
        if self.constraints is not None:
            return self.constraints.total_load(state, signs, about)
        loads = self.hinge_loads(state, about=about)
        return np.sum([sign * loads[name] for name, sign in signs.items()], axis=0)

    def referred_loads(
        self, state: State, loads: dict[str, Real], axes: Axes = "world", about: tuple[str, str] | None = None
    ) -> dict[str, Real]:
        """Loads of hinges and closures that were found at a state, World axes, in other axes about a node.

        Where loads are not determined by the motion, they are computed again to find which components in the new axes
        are determined; not so in scenes with controllers.
        """
        is_known = self.scene.controllers or all(np.all(np.isfinite(load)) for load in loads.values())
        if self.constraints is not None and not is_known:
            return self.constraints.loads_across(state, axes, about)
        return self.in_axes(state, loads, axes, about)

    def section_loads(self, state: State, body: str, x: Any) -> SectionLoads:
        """Axial force, shear, bending and torsion across the sections of a beam at x (X,) m, of the free motion.

        By the momentum balance of the part beyond each section, not by the modes' curvature. A body of level `linear`
        is taken as `full`; at level `stiffened` the balance differs from the dynamics in the fourth order of the
        deformation. Warns (`SceneWarning`) where the mass is lumped, because the loads then jump at nodes. NaN where
        redundant closures leave loads undetermined. ValueError for anything but a beam, and positions off it.
        """
        balance = SectionBalance(self, body, x)
        return balance.loads(balance.at(self.all_loads(state)))

    def all_loads(self, state: State) -> AllLoads:
        """The loads of hinges, closures, wheels and connectors, with the motion of all bodies.

        Of closed chains with the changes by null loads of redundant closures; `exerted` has the minimum-norm loads.
        """
        t, y = self.layout.entering(state)
        if self.constraints is not None:
            return self.constraints.all_loads(t, y)
        evaluation = self._evaluate(t, y, "articulated")
        self.inverse_at(t, y, evaluation.accelerations)
        return AllLoads(t, evaluation, self.own_workspace)

    def mass_properties(self, state: State, body: str | None = None) -> MassProperties:
        """Mass, mass centre and inertia of a body with all that it carries, or of the whole scene, at a state.

        All bodies are taken as rigid in their present shape, ruthless bodies in their undeformed shape, as in the
        momentum. ValueError for an unknown body.
        """
        t, y = self.layout.entering(state)
        rates = self.observation.out.rates
        rates[:] = 0.0
        self._observe_motion(t, y)
        inertias = self.own_workspace.body["inertia"].copy()
        if any(link.level.at_rest for link in self.links):
            self.inverse_at(t, y, rates)  # for the poses in the workspace, which have ruthless bodies undeformed
        return mass_properties(self, self.own_workspace, inertias, body)

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
        if self.has_friction_that_sticks:
            self.refuse_undecided(t, y)
        if self.constraints is not None:
            return self.constraints.evaluation(t, y, algorithm)
        self._observe(t, y, algorithm)
        return self.observation.evaluation(self.observation.row(t, _NO_CLOSURES))

    def _observe(self, t: float, y: Real, algorithm: Algorithm) -> None:
        """Fills the outputs."""
        chosen = algorithms.chosen(algorithm)
        if chosen.observe is not None:
            chosen.observe(self, t, y)
        else:
            self.observe_rates(t, y, self._evaluator(chosen)(t, y[: self.nq], y[self.nq : -1]))

    def observe_row(self, t: float, y: Real, algorithm: Algorithm, row: Real) -> None:
        """Everything observable at y = [q, u, work] into a row as `Observation.columns` has it.

        The numbers of y are not checked, its length is. Raises DynamicsError as `evaluate` does; a closed chain is also
        observed at a singular position in a run.
        """
        t, y = arguments.number("t", t), self._fitting(y)
        if self.constraints is not None:
            row[:] = self.constraints.row_across(t, y, algorithm)
            return
        self._observe(t, y, algorithm)
        row[:] = self.observation.row(t, _NO_CLOSURES)


def copied(kernels: Choice, scene: s.Scene, elimination: Elimination, closed: bool) -> System:
    """A pickled system again, with the same kind of kernels."""
    with asking(kernels):
        return System(scene, elimination, closed=closed)
