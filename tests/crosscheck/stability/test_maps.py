"""Every map meets its overlay on coarse cells, and would not meet a wrong one; what is called stable stays bounded.

Refinement finds a known boundary to one of the finest cells; no number that is none puts one where the theory has it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from crosscheck.stability.boundary import judge
from crosscheck.stability.catalogue import stability_maps
from crosscheck.stability.flow import flow
from crosscheck.stability.map import Axis, Overlay, StabilityMap
from crosscheck.stability.map_records import CellRecord
from crosscheck.stability.maps import free_spin, integrators, spinning_beam, vibrating_hinge
from crosscheck.stability.refine import Cell, CellMesh
from crosscheck.stability.run import Finished, run_map
from flexmb.system.compile import compile
from flexmb.tables.state import pack
from tests.crosscheck.sessions import here
from tests.crosscheck.stability.synthetic import CIRCLE, RADIUS

PROVIDER = "tests.crosscheck.stability.test_maps:coarse_maps"
DECADES = {"gimbal_lock": 1.0}  # of a cell, where classes are narrower than two
LARGEST = {"many_bodies": 150.0}  # largest value of x in these tests, where cells beyond it take long
COSTLY = {  # a second and more: by default one map for each scene and measure
    "integrator_flexmb_radau5", "integrator_exudyn_expliciteuler", "integrator_exudyn_trapezoidalindex2",
    "integrator_exudyn_generalizedalpha", "integrator_mujoco_rk4", "mass_ratio_frisch", "follower_force",
}  # fmt: skip
NAMES = tuple(stability_maps())
WITHOUT_BOUNDARY = {name for name in NAMES if stability_maps()[name].overlay.name.startswith(("every", "no "))}


def marked(names: Iterable[str]) -> list:
    """Parameters, the costly ones marked slow."""
    return [pytest.param(name, marks=[pytest.mark.slow] if name in COSTLY else []) for name in names]


def coarse(axis: Axis, high: float | None = None, decades: float = 2.0) -> Axis:
    """An axis of five cells, or of cells of so many decades; categories as they are."""
    if axis.categories:
        return axis
    count = round(np.log10(axis.high / axis.low) / decades) if axis.log else 0
    return msgspec.structs.replace(axis, cells=min(axis.cells, max(5, count)), high=high or axis.high)


def coarse_maps() -> dict[str, StabilityMap]:
    """All maps, coarser and not refined."""
    return {
        name: replace(what, x=coarse(what.x, LARGEST.get(name), DECADES.get(name, 2.0)), y=coarse(what.y), depth=0)
        for name, what in stability_maps().items()
    }


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory):
    """Maps that were run, each once."""
    folder: Path = tmp_path_factory.mktemp("maps")
    known: dict[str, Finished] = {}

    def run(name: str) -> Finished:
        if name not in known:
            known[name] = run_map(name, folder / f"{name}.jsonl", provider=PROVIDER, scheduler=here)
        if known[name].verdict.status == "did not run":
            pytest.skip(known[name].verdict.worst)
        return known[name]

    return run


@pytest.mark.parametrize("name", marked(NAMES))
@pytest.mark.filterwarnings("ignore:.*digits of the accelerations are left")
@pytest.mark.filterwarnings("ignore:.*was too long")
def test_the_map_agrees_with_its_overlay(name: str, finished) -> None:
    verdict = finished(name).verdict
    assert verdict.status == "agree", verdict.worst


@pytest.mark.parametrize("name", marked(name for name in NAMES if name not in WITHOUT_BOUNDARY))
def test_an_overlay_somewhere_else_is_noticed(name: str, finished) -> None:
    """Moved by three cells along x, to the side where a bound forbids what it allowed."""
    done = finished(name)
    what, overlay = done.map, done.map.overlay
    part = 3.2 / what.x.cells * (-1.0 if overlay.bound else 1.0)

    def moved(x, y):
        if what.x.log:
            return overlay.predict(x * (what.x.high / what.x.low) ** part, y)
        return overlay.predict(x + part * (what.x.high - what.x.low), y)

    wrong = replace(what, overlay=replace(overlay, predict=moved))
    if overlay.bound:  # far from what is measured: a wrong bound is one that is too small by far
        wrong = replace(what, overlay=replace(overlay, predict=lambda x, y: overlay.predict(x, y) - 3.0))
    assert judge(wrong, done.mesh, done.records).status == "differ"


@pytest.mark.parametrize("name", marked(sorted(WITHOUT_BOUNDARY)))
def test_a_map_without_boundary_could_show_one(name: str, finished) -> None:
    """What is stable, or unstable, everywhere is not what the opposite prediction says."""
    done = finished(name)
    overlay = replace(done.map.overlay, predict=lambda x, y: -done.map.overlay.predict(x, y))
    assert judge(replace(done.map, overlay=overlay), done.mesh, done.records).status == "differ"


# ---- 1000 periods

STEPPING = [method for method in integrators.METHODS if method.limit > 0.0]


@pytest.mark.slow
@pytest.mark.parametrize("method", STEPPING, ids=lambda method: method.key)
def test_a_method_called_stable_stays_bounded_for_a_thousand_periods(method: integrators.Method) -> None:
    """Up to nine tenths of its limit: a symplectic method's invariant is an ellipse of axes (1 + 0.9)/(1 - 0.9)."""
    limit = min(method.limit, 50.0)
    for product in (0.3 * min(limit, 3.0), 0.9 * limit):
        step, frequency = 0.01, product / 0.01
        steps = int(np.ceil(1000.0 * 2.0 * np.pi / product / integrators.PARTS)) * integrators.PARTS
        try:
            x, v, why = method.run(method.scene(step, frequency), step, steps)
        except RuntimeError as error:
            pytest.skip(str(error))
        assert not why
        assert np.max(np.hypot(x, v / frequency)) <= 1.01 * integrators.START * np.sqrt(1.9 / 0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "place", "period"),
    [
        (vibrating_hinge.scene(20.0, 0.09), "pivot", 2.0 * np.pi / (20.0 * vibrating_hinge.OMEGA_0)),
        (spinning_beam.scene(2.4, 3.0), "beam.modes", 2.0 * np.pi / spinning_beam.OMEGA_1),
        (spinning_beam.scene(0.98, 2.0), "beam.modes", 2.0 * np.pi / spinning_beam.OMEGA_1),
        (free_spin.scene(0.97, 0.9), "base", 2.0 * np.pi / free_spin.SPIN),
    ],
    ids=["vibrating hinge", "stiffened", "full", "free spin"],
)
def test_a_motion_called_stable_stays_bounded_for_a_thousand_periods(scene, place: str, period: float) -> None:
    """Near the boundary: a disturbance of 1e-6 grows by no more than stiffness lets it, a factor of 30."""
    system = compile(scene)
    start = pack(system.initial_state)
    at = slice(system.nq + system.speed(place).start, system.nq + system.speed(place).start + 1)
    moved = start.copy()
    moved[at] += 1e-6
    speeds = slice(system.nq, system.nq + system.speed(place).stop)
    reference, y = start, moved
    largest = 0.0
    for _ in range(50):
        reference, y = flow(system, reference, 20.0 * period), flow(system, y, 20.0 * period)
        largest = max(largest, float(np.max(np.abs(y[speeds] - reference[speeds]))))
    assert 1e-8 < largest < 3e-5


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
