"""The declaration of an algorithm. Each is declared at the end of its own file; `algorithms` lists all of them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence, Set
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from flexmb.frisch.errata import Erratum
from flexmb.integrate.problem import Leaping, Linear
from flexmb.system.mechanics import Mechanics
from flexmb.typing import Index, Real, Record

if TYPE_CHECKING:
    from flexmb.closure.closures import ClosedMotion, Closures

Algorithm = Literal["articulated", "unsplit", "composite", "frisch", "frisch_as_printed"]
"""Names of the algorithms, for type checkers: a test holds them to the list."""


class Route(NamedTuple):
    """What a run needs of an algorithm.

    tables: makes constants and a workspace. rhs, project: the kernels of the equations of motion and of the projection
    onto the manifold of the states. leaping: how a run continues where a step fails at a singular position, None if it
    cannot. linear: the linearisation that implicit methods need, from these tables. remembered: the arrays of used
    tables that hold the history of a motion, which a new run must reset. beginning: what the tables depend on and may
    change between runs; tables are shared between runs in which it is equal. explicit: other tables for methods that
    take the right-hand side only, None if they are the same.
    """

    tables: Callable[[], tuple[Any, Any]]
    rhs: Any
    project: Any
    leaping: Leaping | None = None
    linear: Callable[[Any, Any], Linear] | None = None
    remembered: Callable[[Any], Sequence[Real | Index | Record]] = lambda _: ()
    beginning: Hashable = None
    explicit: Callable[[], tuple[Any, Any]] | None = None


@dataclass(frozen=True)
class DynamicsAlgorithm:
    """An algorithm for the accelerations of a state, and its further abilities."""

    name: Algorithm
    summary: str
    """What it is, in one line."""
    kernel: Callable[[], Any]
    """Returns the kernel of a tree's accelerations: of t, y and tables, the second of which is a workspace. It leaves
    udot in w.speed.acceleration and returns a status code."""
    own: Callable[[Mechanics], tuple[Any, ...]]
    """The tables, with the workspace that this thread has in the system."""
    fresh: Callable[[Mechanics], tuple[Any, ...]]
    """The tables, with a new workspace."""
    observe: Callable[[Mechanics, float, Real], None] | None = None
    """Fills the system's `Outputs`, everything observable of a tree, at y = [q, u, work]; DynamicsError where there
    are no accelerations. None where inverse dynamics of the accelerations suffices."""
    route: Callable[[Mechanics], Route] | None = None
    """For runs of trees; None if the algorithm is for single states only."""
    observing: Any = None
    """The kernel that fills `Outputs` where the right-hand side of `route` was just evaluated, of its tables and
    `Outputs`. None where this takes several kernels, called from Python."""
    closed_motion: Callable[[Closures, float, Real], ClosedMotion] | None = None
    """For closed chains; None if the algorithm is for trees only."""
    jacobian: bool = False
    """Whether it has the Jacobians that stiff integrators need."""
    matrices: int = 0
    """How many matrices over all speeds its tables hold."""
    errata: Set[Erratum] | None = None
    """The defects of Frisch's print that it reproduces; None if its equations are not Frisch's."""

    @property
    def is_first_order(self) -> bool:
        """Whether it takes bodies of level `full` as `linear`."""
        return self.errata is not None
