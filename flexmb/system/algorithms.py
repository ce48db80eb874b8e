"""All algorithms, each declared in its own file, and the names of those with a certain ability."""

from __future__ import annotations

from collections.abc import Collection

from flexmb.system.algorithm import DynamicsAlgorithm
from flexmb.system.by_composite_bodies import ALGORITHM as COMPOSITE
from flexmb.system.by_nested_bodies import FRISCH, FRISCH_AS_PRINTED
from flexmb.system.by_recursion import ALGORITHM as ARTICULATED
from flexmb.system.by_unsplit_recursion import ALGORITHM as UNSPLIT
from flexmb.tables import arguments

ALGORITHMS: dict[str, DynamicsAlgorithm] = {
    algorithm.name: algorithm for algorithm in (ARTICULATED, UNSPLIT, COMPOSITE, FRISCH, FRISCH_AS_PRINTED)
}
"""By name."""

RUNNING = tuple(algorithm.name for algorithm in ALGORITHMS.values() if algorithm.route is not None)
ON_CHAINS = tuple(algorithm.name for algorithm in ALGORITHMS.values() if algorithm.closed_motion is not None)
WITH_JACOBIAN = tuple(algorithm.name for algorithm in ALGORITHMS.values() if algorithm.jacobian)
NESTED = tuple(algorithm.name for algorithm in ALGORITHMS.values() if algorithm.errata is not None)


def chosen(name: str, among: Collection[str] = ALGORITHMS) -> DynamicsAlgorithm:
    """The algorithm of that name; ValueError for a name that is not `among` those."""
    if not (isinstance(name, str) and name in among):  # at every evaluation, so the message is composed only if needed
        arguments.one_of("algorithm", name, among)
    return ALGORITHMS[name]
