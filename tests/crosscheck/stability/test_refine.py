"""Refinement finds a known boundary to one of the finest cells, at the cost of the boundary's length."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.stability.map import Axis
from crosscheck.stability.refine import Cell, CellMesh
from tests.crosscheck.stability.synthetic import RADIUS

X, Y = Axis("x", "", -1.0, 1.0, 8), Axis("y", "", -1.0, 1.0, 8)


def refined(depth: int, label, x: Axis = X, y: Axis = Y) -> tuple[CellMesh, int]:
    """The mesh of a labelling of places, and how many cells were asked for."""
    mesh, asked = CellMesh(x, y, depth), 0
    cells = sorted(mesh.waiting)
    while cells:
        asked += len(cells)
        cells = mesh.settle((cell, label(*mesh.centre(cell))) for cell in cells)
    return mesh, asked


def inside(x: float, y: float) -> str:
    return "in" if np.hypot(x, y) < RADIUS else "out"


@pytest.mark.parametrize("depth", [0, 2, 4])
def test_every_place_has_the_class_of_its_finest_cell(depth: int) -> None:
    """So that the boundary is where a mesh of finest cells everywhere has it: within half a cell of the circle."""
    mesh, _ = refined(depth, inside)
    number, cells = mesh.painted()
    assert np.all(number >= 0)
    for (i, j), k in np.ndenumerate(number):
        assert mesh.labels[cells[k]] == inside(X.centres(depth)[i], Y.centres(depth)[j])


def test_the_cost_is_that_of_the_boundary_not_of_the_area() -> None:
    """A level visits the cells on both sides of the circle, four children each: at most 4 x 2 x (4 x 2 R / h)."""
    for depth in (3, 4, 5):
        _, asked = refined(depth, inside)
        finest = (X.high - X.low) / X.count(depth)
        sizes = finest * 2.0 ** np.arange(1, depth + 1)  # of the cells that were divided
        assert asked <= X.cells * Y.cells + np.sum(4 * 2 * (8.0 * RADIUS / sizes + 4))
        assert asked < 0.5 * X.count(depth) * Y.count(depth)
    costs = [refined(depth, inside)[1] for depth in (4, 5, 6)]
    assert np.diff(np.log2(np.diff(costs))) == pytest.approx(1.0, abs=0.1)  # twice the cells for half the size


def test_rows_of_categories_are_neither_divided_nor_compared() -> None:
    rows = Axis.of("method", "one", "two")
    mesh, asked = refined(3, lambda x, y: "in" if x < (0.1 if y < 0.5 else -0.3) else "out", y=rows)
    assert asked == 16 + 2 * 3 * 4
    assert {cell.j for cell in mesh.labels} == {0, 1}
    _, asked = refined(3, lambda x, y: "in" if y < 0.5 else "out", y=rows)
    assert asked == 16


def test_a_change_of_status_is_a_boundary_like_any_other() -> None:
    mesh, _ = refined(3, lambda x, y: "failed" if x > 0.1 else "in")
    at = [cell for cell in mesh.labels if abs(mesh.centre(cell)[0] - 0.1) < 0.02]
    assert at and all(cell.level == 3 for cell in at)


def test_logarithmic_axes_have_cells_of_equal_ratio() -> None:
    axis = Axis("step", "s", 1e-3, 1e-1, 4, log=True)
    assert axis.edges(0) == pytest.approx(10.0 ** np.linspace(-3, -1, 5))
    assert axis.centres(1) == pytest.approx(np.sqrt(axis.edges(1)[1:] * axis.edges(1)[:-1]))
    assert CellMesh(axis, axis, 0).centre(Cell(0, 3, 0)) == pytest.approx((10**-1.25, 10**-2.75))
