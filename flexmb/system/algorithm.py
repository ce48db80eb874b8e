"""The declaration of an algorithm, which stands in the last lines of its file. `algorithms` lists all of them."""

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
    """An algorithm as runs see it: a maker of constants and workspace, kernels of the motion and of its manifold.

    leaping: how runs go on where a step fails, if they can. linear: for these tables, what methods need that linearise.
    remembered: of tables that have seen a motion, what the next would go on from, and must not. beginning: what tables
    are made from that may change.
    """

    tables: Callable[[], tuple[Any, Any]]
    rhs: Any
    project: Any
    leaping: Leaping | None = None
    linear: Callable[[Any, Any], Linear] | None = None
    remembered: Callable[[Any], Sequence[Real | Index | Record]] = lambda _: ()
    beginning: Hashable = None


@dataclass(frozen=True)
class DynamicsAlgorithm:
    """A way from a state to its accelerations, and what it can do besides."""

    name: Algorithm
    summary: str
    """What it is, in one line."""
    kernel: Callable[[], Any]
    """Gives the kernel of a tree's accelerations: of t, y and tables, the second of which is a workspace. It leaves
    udot in w.speed.acceleration and returns a status code."""
    own: Callable[[Mechanics], tuple[Any, ...]]
    """These tables with the system's workspace."""
    fresh: Callable[[Mechanics], tuple[Any, ...]]
    """The same with a workspace of their own."""
    observe: Callable[[Mechanics, float, Real], None] | None = None
    """Fills everything observable of a tree, the system's `Outputs`, at y = [q, u, work]; DynamicsError where there
    are no accelerations. None where inverse dynamics of the accelerations is all that it takes."""
    route: Callable[[Mechanics], Route] | None = None
    """For runs of trees; None where it is for single states."""
    observing: Any = None
    """The kernel that observes a tree where the right-hand side of `route` was just evaluated, of its tables and
    `Outputs`. None where Python stands between several."""
    closed_motion: Callable[[Closures, float, Real], ClosedMotion] | None = None
    """For closed chains; None where it knows trees only."""
    jacobian: bool = False
    """It has the Jacobians that stiff integrators need."""
    errata: Set[Erratum] | None = None
    """Defects of Frisch's print that it keeps; None where its equations are not his."""

    @property
    def is_first_order(self) -> bool:
        """Whether it takes bodies of level `full` as `linear`."""
        return self.errata is not None
