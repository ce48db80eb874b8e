"""Which loops are dynamically coupled, which speeds their loads change, and which bodies carry several loops.

With M = F F', the loads of a closure cause the accelerations F'^-1 x, where x is zero except for the speeds of bodies
between its ports and the ground. Therefore J M^-1 J' of two closures vanishes unless a body on both paths has a free
speed. The cost of loops that hang side by side from the ground, or from a welded or driven base, is the sum of the
costs of the single loops and does not grow with the cube of their number.

A moving base couples all its loops, but its motion neither opens nor closes a loop whose two ports are carried by one
rigid body, the junction. J is nonzero only in the columns of bodies outboard of the junction, so that the
independence, singularity and reversal of rows depend on these columns alone. Closures that share such a body are one
group. Groups that share only carrying bodies are a cluster and are coupled by the few speeds of those bodies
(`flexmb.closure.clusters`). A flexible body that deforms between the ports of a loop does open it: then its speeds
belong to the loop, and the junction is the body that carries it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from flexmb.closure import tables as t
from flexmb.tables.arrays import Constants
from flexmb.typing import Index, Record


class LoadPath(NamedTuple):
    """Bodies between a closure and the ground: its own ones outboard of the junction, and those that carry these."""

    own: frozenset[int]
    carriers: frozenset[int]

    @property
    def bodies(self) -> list[int]:
        """All bodies, outermost first."""
        return sorted(self.own | self.carriers, reverse=True)


UNLOADED = LoadPath(frozenset(), frozenset())
"""The path of a closure without loads: it is open."""


def path(c: Constants, parent: Sequence[int], bodies: Sequence[int]) -> LoadPath:
    """The load path of a closure between two bodies, -1 for the ground."""
    one, other = (_ancestors(parent, k) for k in bodies)
    carriers = one & other
    if carriers and c.body["modes"][max(carriers)] > 0:
        carriers = carriers - {max(carriers)}
    return LoadPath(frozenset((one | other) - carriers), frozenset(carriers))


def path_of_coupling(parent: Sequence[int], bodies: Sequence[int]) -> LoadPath:
    """The load path of a coupling of coordinates of the hinges that hold these bodies.

    Carriers are the bodies that carry all of these hinges: their motion does not change the coordinates.
    """
    held = [_ancestors(parent, k) for k in bodies]
    carriers = frozenset.intersection(*(frozenset(path - {k}) for path, k in zip(held, bodies, strict=True)))
    return LoadPath(frozenset(_union(held)) - carriers, carriers)


def _ancestors(parent: Sequence[int], k: int) -> set[int]:
    """A body and all bodies that carry it; bodies are numbered from the ground outward."""
    ancestors = set()
    while k >= 0:
        ancestors.add(k)
        k = parent[k]
    return ancestors


def clusters(c: Constants, paths: Sequence[LoadPath]) -> list[list[list[int]]]:
    """Closures by group, groups by cluster; clusters, and groups in each, in the order of their first closure."""
    moves = _moves(c)
    mine = [{k for k in path.own if moves[k]} for path in paths]
    owned = set().union(*mine)
    felt = [own | (body.carriers & owned) for own, body in zip(mine, paths, strict=True)]
    grouped = _joined(felt)
    carriers = [{k for i in group for k in paths[i].carriers if moves[k]} - owned for group in grouped]
    return [[grouped[g] for g in cluster] for cluster in _joined(carriers)]


def _joined(bodies: Sequence[Iterable[int]]) -> list[list[int]]:
    """Connected components of a list of sets, as indices: sets with a common body are connected."""
    first: dict[int, int] = {}  # by body, the index of the first set that has it
    leader = list(range(len(bodies)))

    def leader_of(i: int) -> int:
        while leader[i] != i:
            leader[i] = i = leader[leader[i]]
        return i

    for i, own in enumerate(bodies):
        for k in own:
            one, other = sorted((leader_of(first.setdefault(k, i)), leader_of(i)))
            leader[other] = one
    groups: dict[int, list[int]] = {}
    for i in range(len(bodies)):
        groups.setdefault(leader_of(i), []).append(i)
    return list(groups.values())


class GroupTables(NamedTuple):
    """GROUP and CLUSTER records, and the columns of all groups."""

    groups: Record
    clusters: Record
    columns: Index


def group_tables(
    c: Constants, members: Sequence[Sequence[Sequence[int]]], paths: Sequence[LoadPath], rows: Sequence[int]
) -> GroupTables:
    """The tables of closures sorted by group and cluster; `rows`: number of rows of each closure."""
    moves = _moves(c)
    groups, columns = np.zeros(sum(map(len, members)), t.GROUP), list[int]()
    clusters = np.zeros(len(members), t.CLUSTER)
    row = half = factor = place = shared_factor = 0
    for cluster, its_groups in zip(clusters, members, strict=True):
        own = [_union(paths[i].own for i in group) for group in its_groups]
        carriers = _union(paths[i].carriers for group in its_groups for i in group) - _union(own)
        if len(its_groups) == 1:  # a single group shares no speeds
            own, carriers = [own[0] | carriers], set()
        shared = _speeds(c, sorted(k for k in carriers if moves[k]))
        cluster["group_start"], cluster["group_stop"] = place, place + len(its_groups)
        cluster["shared"], cluster["factor"] = len(shared), shared_factor
        shared_factor += len(shared) ** 2
        for group, closures, bodies in zip(groups[place:], its_groups, own, strict=False):
            mine = _speeds(c, sorted(bodies))
            count, width = sum(rows[i] for i in closures), len(mine) + len(shared)
            group["row_start"], group["column_start"], group["half"], group["factor"] = row, len(columns), half, factor
            columns += mine + shared
            row, half, factor = row + count, half + count * width, factor + count * count
            group["row_stop"], group["own_stop"], group["column_stop"] = row, len(columns) - len(shared), len(columns)
        place += len(its_groups)
    return GroupTables(groups, clusters, np.array(columns, np.int64))


def _union(sets: Iterable[Iterable[int]]) -> set[int]:
    return set().union(*sets)


def _moves(c: Constants) -> list[bool]:
    """Whether each body has a free speed: an unprescribed one of its hinge, or that of a mode."""
    free = np.append(0, np.cumsum(c.speed["prescribed"] < 0))
    first = c.body["u_index"]
    flags: list[bool] = ((free[first + c.body["nv"]] > free[first]) | (c.body["modes"] > 0)).tolist()
    return flags


def _speeds(c: Constants, bodies: Sequence[int]) -> list[int]:
    """Indices of all speeds of these bodies: of hinge, modes and wheels."""
    speeds = list[int]()
    for body in c.body[list(bodies)]:
        for first, count in (("u_index", "nv"), ("etad_index", "modes")):
            speeds += range(body[first], body[first] + body[count])
        speeds += c.wheel["u_index"][body["wheel_start"] : body["wheel_stop"]].tolist()
    return speeds
