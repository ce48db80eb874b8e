"""A mesh of cells that are halved where neighbours differ, like a quadtree, down to a stated depth."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from crosscheck.stability.map import Axis

Index = NDArray[np.intp]


class Cell(NamedTuple):
    """Column i and row j after `level` halvings."""

    level: int
    i: int
    j: int


class CellMesh:
    """Cells over two axes, each with a label (class or status) once it is known; axes of categories are not halved."""

    def __init__(self, x: Axis, y: Axis, depth: int) -> None:
        self.x, self.y, self.depth = x, y, depth
        self.labels: dict[Cell, str] = {}
        self.waiting = {Cell(0, i, j) for i in range(x.cells) for j in range(y.cells)}

    def centre(self, cell: Cell) -> tuple[float, float]:
        """Parameters at the middle of a cell."""
        return float(self.x.centres(cell.level)[cell.i]), float(self.y.centres(cell.level)[cell.j])

    def settle(self, found: Iterable[tuple[Cell, str]]) -> list[Cell]:
        """Give labels to waiting cells; once none waits, halve cells whose neighbours differ. Returns the new cells."""
        for cell, label in found:
            self.waiting.remove(cell)
            self.labels[cell] = label
        if self.waiting:
            return []
        divided = self._at_changes()
        for cell in divided:
            del self.labels[cell]
        new = [child for cell in divided for child in self._children(cell)]
        self.waiting = set(new)
        return new

    def painted(self) -> tuple[Index, list[Cell]]:
        """Number, in the list of cells, of the cell that covers each place of the finest grid (columns, rows)."""
        cells = list(self.labels)
        number = np.full((self.x.count(self.depth), self.y.count(self.depth)), -1, dtype=np.intp)
        for k, cell in enumerate(cells):
            width, height = self._size(cell)
            number[cell.i * width : (cell.i + 1) * width, cell.j * height : (cell.j + 1) * height] = k
        return number, cells

    def _size(self, cell: Cell) -> tuple[int, int]:
        """Columns and rows of the finest grid that a cell covers."""
        factor = 2 ** (self.depth - cell.level)
        return 1 if self.x.categories else factor, 1 if self.y.categories else factor

    def _at_changes(self) -> list[Cell]:
        """Cells above the finest size with a neighbour of another label; neighbours across categories do not count."""
        number, cells = self.painted()
        names = {label: n for n, label in enumerate(set(self.labels.values()))}
        kind = np.array([names[self.labels[cell]] for cell in cells])[number]
        marked: set[int] = set()
        for axis, along in enumerate((self.x, self.y)):
            if not along.categories:
                low, high = (np.take(number, _shifted(number.shape[axis], part), axis) for part in (0, 1))
                a, b = (np.take(kind, _shifted(kind.shape[axis], part), axis) for part in (0, 1))
                marked |= {*low[a != b].tolist(), *high[a != b].tolist()}
        return [cells[k] for k in sorted(marked) if cells[k].level < self.depth]

    def _children(self, cell: Cell) -> list[Cell]:
        columns = (cell.i,) if self.x.categories else (2 * cell.i, 2 * cell.i + 1)
        rows = (cell.j,) if self.y.categories else (2 * cell.j, 2 * cell.j + 1)
        return [Cell(cell.level + 1, i, j) for i in columns for j in rows]


def _shifted(count: int, part: int) -> Index:
    return np.arange(count - 1) + part
