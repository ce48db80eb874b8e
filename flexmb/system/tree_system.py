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
from typing import TYPE_CHECKING, Any

import numpy as np

from flexmb.entry import articulated
from flexmb.jain.elimination import ELIMINATIONS, Elimination
from flexmb.kept import kept
from flexmb.motion import coordinates
from flexmb.scene import schema as s
from flexmb.system import algorithms, labels
from flexmb.system.algorithm import Algorithm, Route
from flexmb.system.derivatives import DifferentiableMotion
from flexmb.system.load_axes import Axes, referred
from flexmb.system.mass_properties import MassProperties, mass_properties
from flexmb.system.observables import Evaluation
from flexmb.system.section_loads import AllLoads, SectionBalance, SectionLoads
from flexmb.tables import arguments
from flexmb.tables.features import Kernels, asking
from flexmb.tables.state import State, finite_result
from flexmb.typing import Real

if TYPE_CHECKING:
    from flexmb.closure.closures import Closures
    from flexmb.frisch.nested_system import NestedSystem, Partitions
    from flexmb.jain.operators import Operators, SpatialOperators
    from flexmb.parameters.parameters import Parameters
    from flexmb.parameters.regressor import InertiaRegressor
    from flexmb.system.batch import Batch, BatchAccelerations

_NO_CLOSURES = np.zeros((0, 6))


class System(DifferentiableMotion):
    """A checked scene turned into arrays; made by `compile`. Threads may share it: each has workspaces of its own."""

    def __init__(self, scene: s.Scene, elimination: Elimination = "fastest", like: s.Scene | None = None) -> None:
        """like: see `SceneArrays`."""
        super().__init__(scene, elimination, like)
        self._asked: Elimination = elimination
        self.rhs, self.project = articulated.rhs, coordinates.project
        self.kept: dict[Any, Any] = {}
        """Results and tables that runs keep for later runs."""
        self._operators: SpatialOperators | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles hold the scene only: addresses belong to one process, and arrays share memory."""
        return copied, (System, self.kernels, self.scene, self._asked)

    @property
    def closures(self) -> Closures | None:
        """The closure equations with workspaces of this thread; None for a tree."""
        return None

    def with_numbers(self, scene: s.Scene) -> System:
        """The system of the same scene with slightly other numbers, whose tables are smooth functions of these.

        Modes follow those of this scene, and equal functions of time are kept apart. The scene is not checked.
        """
        with asking(self.kernels):
            return System(scene, self._asked, self.scene)

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
        errata = algorithms.chosen(algorithm, algorithms.NESTED).errata
        assert errata is not None  # of those that are nested
        return self.nested_system(errata)

    def partitions(self, state: State, algorithm: Algorithm = "frisch") -> Partitions:
        """The partitioned equations of motion, Frisch (111), by the names of the paper."""
        t, y = self.layout.entering(state)
        return self.nested(algorithm).partitions(t, y)

    def operators(self, state: State) -> Operators:
        """The spatial operators of Jain & Rodriguez, sections II to V, as dense arrays, World axes; all speeds free."""
        t, y = self.layout.entering(state)
        from flexmb.jain.operators import SpatialOperators  # imported here, because it imports SciPy, which is slow

        if self._operators is None:
            self._operators = SpatialOperators(self.scene)
        found = self._operators.at(t, y[: self.nq], y[self.nq : -1])
        for part in (found.M_m, found.a_m, found.b_m, found.V_m):
            finite_result(part, t)
        return found

    def accelerations_batch(self, q: Any, u: Any, t: Any = 0.0, *, threads: int | None = None) -> BatchAccelerations:
        """udot (n,nu) of many states at once, and a status (n,) for each: see `flexmb.system.batch.Batch`.

            udot, status = system.accelerations_batch(q, u)     q (n,nq), u (n,nu), t (s) one or (n,)

        The row of a state that has no accelerations is NaN. Raises ValueError or TypeError for arrays that do not fit.
        """
        return self.batch.accelerations(q, u, t, threads=threads)

    @property
    def batch(self) -> Batch:
        """Any number of copies of this system."""
        found: Batch | None = self.kept.get("batch")
        if found is None:
            from flexmb.system.batch import Batch  # imported here, because only batches need lanes

            found = self.kept.setdefault("batch", Batch([self]))
        return found

    @kept
    def state_names(self) -> tuple[labels.Names, labels.Names]:
        """((name, unit) of every entry of q, the same of u)."""
        return labels.names_of_states(self)

    def route(self, algorithm: Algorithm = "articulated", stabilise: float = 0.0) -> Route:
        """What a run needs of the algorithm; `stabilise` is for closed chains.

        ValueError for an algorithm that is for single states, or does not apply to the scene.
        """
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
    ) -> dict[str, Real]:
        """Total load (6,) [torque; force] across each hinge on the outboard body.

        Of the free motion, or of the motion with given `accelerations` (nu,), Jain & Rodriguez (44). axes: "world", or
        those of each hinge's own frame "inboard" or "outboard". about: (body, node), a point that moves with the
        deformation, or ("ground", "origin"); by default each hinge's outboard point. ValueError for unknown axes or an
        unknown node.
        """
        t, y = self.layout.entering(state)
        if accelerations is None:
            loads, w = np.zeros((len(self.links), 6)), self.own_recursion_workspace
            self._follow_recursion(t, y)
            self._transmit(loads)
        else:
            rates = self.layout.rates("accelerations", accelerations)
            loads, w = self._inverse(t, y, rates)[1], self.own_workspace
        return referred(self, w, self._by_hinge(finite_result(loads, t)), axes, about)

    def referred_loads(
        self, state: State, loads: dict[str, Real], axes: Axes = "world", about: tuple[str, str] | None = None
    ) -> dict[str, Real]:
        """Loads of hinges and closures that were found at a state, World axes, in other axes about a node."""
        t, y = self.layout.entering(state)
        self._inverse(t, y, np.zeros(self.nu))  # for the poses in the workspace, those of the equations of motion
        return referred(self, self.own_workspace, loads, axes, about)

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
        """The loads of hinges, closures, wheels and connectors, with the motion of all bodies."""
        t, y = self.layout.entering(state)
        found = self._evaluate(t, y, "articulated")
        self._inverse(t, y, found.accelerations)
        return AllLoads(t, found, self.own_workspace)

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
            self._inverse(t, y, rates)  # for the poses in the workspace, which have ruthless bodies undeformed
        return mass_properties(self, self.own_workspace, inertias, body)

    def _by_hinge(self, loads: Real) -> dict[str, Real]:
        return {link.hinge.name: loads[k] for k, link in enumerate(self.links)}

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
        self._observe(t, y, algorithm)
        observation = self.observation
        return observation.evaluation(observation.row(t, _NO_CLOSURES))

    def _observe(self, t: float, y: Real, algorithm: Algorithm) -> None:
        """Fills the outputs."""
        chosen = algorithms.chosen(algorithm)
        if chosen.observe is not None:
            chosen.observe(self, t, y)
        else:
            self.observe_rates(t, y, self._evaluator(chosen)(t, y[: self.nq], y[self.nq : -1]))

    def observe_row(self, t: float, y: Real, algorithm: Algorithm, row: Real) -> None:
        """Everything observable at y = [q, u, work] into a row as `Observation.columns` has it.

        The numbers of y are not checked, its length is. Raises DynamicsError as `evaluate` does.
        """
        self._observe(arguments.number("t", t), self._fitting(y), algorithm)
        row[:] = self.observation.row(t, _NO_CLOSURES)

def copied(kind: type[System], kernels: Kernels, *given: Any) -> System:
    """A pickled system again, with the same kind of kernels."""
    with asking(kernels):
        return kind(*given)
