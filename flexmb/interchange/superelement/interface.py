"""The interface of a structure: nodes of its own, and nodes that surfaces are tied to, as by an RBE2 or an RBE3."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, assert_never

import numpy as np
from numpy.typing import NDArray

from flexmb.interchange.superelement.element import LARGEST, MOTIONS, SuperElement, SuperElementError
from flexmb.typing import Index, Real

if TYPE_CHECKING:
    from scipy.sparse import csr_array

FLAT = 1e-9
"""Singular value of a surface's rigid motions, relative to the largest, below which one of them cannot be seen."""


@dataclass(frozen=True)
class Tie:
    """A new `node` that the `nodes` of a surface are tied to, at `position` (3,) m or in the mean of theirs.

    kind "rigid" (RBE2): the surface follows the node as a rigid body, with its rotations if it has them. "mean" (RBE3):
    the node has the mean motion of the surface, of all motions the one whose displacements are nearest to the surface's
    in the least-squares sense; a load on it is spread over the surface, which stays as flexible as it is.
    """

    node: int
    nodes: tuple[int, ...]
    kind: Literal["rigid", "mean"] = "rigid"
    position: tuple[float, float, float] | None = None


@dataclass(frozen=True, eq=False)
class Interface:
    """k nodes: ids (k,), position (k,3) m.

    T (N,N'): displacements of the structure by coordinates, the first 6k of which are the motions of the nodes. motion
    (6k,N): these motions by displacements; motion T = [1 0].
    """

    ids: NDArray[np.int64]
    position: Real
    T: csr_array
    motion: csr_array

    def by_coordinates(self, matrix: Real) -> Real:
        """T' matrix T of a symmetric matrix (N,N)."""
        return np.asarray(self.T.T @ (self.T.T @ matrix).T)


def interface_of(element: SuperElement, numbers: Sequence[int], ties: Sequence[Tie] = ()) -> Interface:
    """The nodes with these numbers, in this order. SuperElementError for nodes that cannot be an interface."""
    from scipy.sparse import coo_array

    if not numbers:
        raise SuperElementError("there is no interface node: name those that hinges, loads or markers use")
    numbers = list(dict.fromkeys(numbers))
    by_number = {tie.node: tie for tie in ties}
    _refuse_ties(element, numbers, ties)
    taken = np.zeros(len(element.K), dtype=bool)
    columns, beyond, motions, positions = list[_Block](), list[_Block](), list[_Block](), list[Real]()
    for number in numbers:
        if number in by_number:
            position, rows, T, motion, rest = _tied(element, by_number[number])
        else:
            position, rows, T, motion, rest = _own(element, number)
        if np.any(taken[rows]):
            raise SuperElementError(f"node {number} shares displacements with another interface node or tied surface")
        taken[rows] = True
        positions.append(position)
        columns.append(_Block(rows, T))
        motions.append(_Block(rows, motion.T))
        beyond.append(_Block(rows, rest))
    others = np.flatnonzero(~taken)
    beyond.append(_Block(others, None))
    count = len(element.K)
    whole, by_motion = _side_by_side([*columns, *beyond], count), _side_by_side(motions, count)
    return Interface(
        np.array(numbers, dtype=np.int64), np.array(positions), coo_array(whole[0], shape=whole[1]).tocsr(),
        coo_array(by_motion[0], shape=by_motion[1]).tocsr().T.tocsr(),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Block:
    """Columns with entries in these rows; None: one column with 1 for each row."""

    rows: NDArray[np.int64]
    entries: Real | None


def _side_by_side(blocks: list[_Block], rows: int) -> tuple[tuple[Real, tuple[Index, Index]], tuple[int, int]]:
    """Entries with their rows and columns, and the shape, as sparse arrays of SciPy are made from."""
    values, i, j, at = list[Real](), list[Index](), list[Index](), 0
    for block in blocks:
        if block.entries is None:
            values.append(np.ones(len(block.rows)))
            i.append(block.rows)
            j.append(at + np.arange(len(block.rows)))
            at += len(block.rows)
            continue
        place, column = np.nonzero(block.entries)
        values.append(block.entries[place, column])
        i.append(block.rows[place])
        j.append(at + column)
        at += block.entries.shape[1]
    return (np.concatenate(values), (np.concatenate(i), np.concatenate(j))), (rows, at)


def _own(element: SuperElement, number: int) -> tuple[Real, NDArray[np.int64], Real, Real, Real]:
    i = element.node(number)
    missing = [motion for motion, row in zip(MOTIONS, element.place[i], strict=True) if row < 0]
    if missing:
        raise SuperElementError(
            f"interface node {number} has no {missing[0]}: an interface needs all six motions; tie its surface to a "
            "new node (--rigid, --mean)"
        )
    return element.position[i], element.place[i], np.eye(6), np.eye(6), np.zeros((6, 0))


def _tied(element: SuperElement, tie: Tie) -> tuple[Real, NDArray[np.int64], Real, Real, Real]:
    """Position, rows of the surface, their rigid motions, the mean motion by them, and their other motions."""
    surface = [element.node(number) for number in tie.nodes]
    position = element.position[surface].mean(axis=0) if tie.position is None else np.array(tie.position, float)
    places = element.place[surface]
    match tie.kind:
        case "rigid":
            rows = places[places >= 0]
        case "mean":
            rows = places[:, :3][places[:, :3] >= 0]
        case _:
            assert_never(tie.kind)
    rigid = element.rigid(position)[rows]
    arms = np.linalg.norm(element.position[surface] - position, axis=1)
    lever = float(np.max(arms)) or 1.0
    left, size, right = np.linalg.svd(rigid / np.repeat((1.0, lever), 3), full_matrices=True)
    if len(rows) < 6 or size[-1] <= FLAT * size[0]:
        raise SuperElementError(
            f"the surface of node {tie.node} does not show all six motions: tie it to three or more nodes that are not "
            "on a line"
        )
    motion = (right.T / size) @ left[:, :6].T / np.repeat((1.0, lever), 3)[:, None]
    match tie.kind:
        case "rigid":
            rest = np.zeros((len(rows), 0))
        case "mean":
            rest = left[:, 6:]
        case _:
            assert_never(tie.kind)
    return position, rows, rigid, motion, rest


def _refuse_ties(element: SuperElement, numbers: Sequence[int], ties: Sequence[Tie]) -> None:
    own = set(element.ids.tolist())
    for i, tie in enumerate(ties):
        if tie.node in own or any(tie.node == other.node for other in ties[:i]):
            raise SuperElementError(f"node {tie.node} is there already: give the node of a tied surface a new number")
        if tie.node not in numbers:
            raise SuperElementError(f"a surface is tied to node {tie.node}, which is no interface node: list it there")
        if len(set(tie.nodes)) < len(tie.nodes):
            raise SuperElementError(f"the surface of node {tie.node} lists a node twice")
        if tie.position is not None and not np.all(np.abs(np.array(tie.position)) <= LARGEST):
            raise SuperElementError(f"the position of node {tie.node} is not finite: give three coordinates in m")
