"""No number that is none puts a map's boundary where the theory has it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from crosscheck.stability.boundary import judge
from crosscheck.stability.map import Axis, Overlay, StabilityMap
from crosscheck.stability.map_records import CellRecord
from crosscheck.stability.refine import Cell, CellMesh
from tests.crosscheck.stability.synthetic import CIRCLE

SQUARE = replace(CIRCLE, x=Axis("x", "m", -1.0, 1.0, 2), y=Axis("y", "m", -1.0, 1.0, 2), depth=0)


def status(what: StabilityMap, value: float | None) -> str:
    """The verdict on a map of four cells, all of which were found to have that value."""
    mesh = CellMesh(what.x, what.y, 0)
    records = {cell: record(cell, value) for cell in mesh.waiting}
    mesh.settle((cell, "any") for cell in sorted(mesh.waiting))
    return judge(what, mesh, records).status


def record(cell: Cell, value: float | None) -> CellRecord:
    return CellRecord(identity="i", level=0, i=cell.i, j=cell.j, x=0.0, y=0.0, status="measured", value=value)


def predicting(number: float, bound: bool) -> StabilityMap:
    return replace(SQUARE, overlay=Overlay("flat", "none", lambda x, y: np.full(x.shape, number), bound=bound))


@pytest.mark.parametrize("bound", [False, True])
@pytest.mark.parametrize("value", [-1.0, 1.0])
def test_what_is_measured_and_predicted_alike_agrees(value: float, bound: bool) -> None:
    assert status(predicting(value, bound), value) == "agree"
    assert status(predicting(-value, bound), value) == ("agree" if bound and value < 0.0 else "differ")


@pytest.mark.parametrize("bound", [False, True])
@pytest.mark.parametrize("prediction", [-1.0, 1.0, math.nan])
@pytest.mark.parametrize("value", [None, math.nan, math.inf, -math.inf])
def test_a_measured_value_that_is_no_number_is_wrong(value: float | None, prediction: float, bound: bool) -> None:
    assert status(predicting(prediction, bound), value) == "differ"


@pytest.mark.parametrize("bound", [False, True])
@pytest.mark.parametrize("value", [-1.0, 0.0, 1.0, 1e308])
def test_a_theory_without_a_number_agrees_with_nothing(value: float, bound: bool) -> None:
    assert status(predicting(math.nan, bound), value) == "differ"
