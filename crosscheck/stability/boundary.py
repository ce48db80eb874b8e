"""The verdict on a map: its boundary must be within one cell of the finest size of the overlay's."""

from __future__ import annotations

import math

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_cdt

from crosscheck.stability.map import NO_PREDICTION, StabilityMap
from crosscheck.stability.map_records import CellRecord
from crosscheck.stability.refine import Cell, CellMesh

ALLOWED = 1  # cells of the finest size
UNREACHABLE = 10**6
WRONG, NO_EVIDENCE = -1, -2  # in place of the number of a class


class MapVerdict(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The judgement of a map.

    `status`: "agree", "differ", or "did not run" if some cells did not run or none is evidence. `distance`, in cells
    of the finest size, is the largest distance between a place and the nearest place to which the overlay gives the
    same class, in both directions (-1: there is none); `worst` is its place. `cells` counts cells by class or
    status.
    """

    map: str
    title: str
    status: str
    distance: int
    worst: str
    cells: dict[str, int]
    depth: int
    seconds: float
    overlay: str
    source: str

    @property
    def ok(self) -> bool:
        return self.status == "agree"


def judge(what: StabilityMap, mesh: CellMesh, records: dict[Cell, CellRecord]) -> MapVerdict:
    """Compare the finished cells of a map with its overlay."""
    number, cells = mesh.painted()
    measured = np.array([measured_class(what, records[cell]) for cell in cells])[number]
    x, y = np.meshgrid(what.x.centres(mesh.depth), what.y.centres(mesh.depth), indexing="ij")
    expected = what.overlay.classes(x, y)
    distance = _distances(what, measured, expected)
    place = np.unravel_index(int(np.argmax(distance)), distance.shape)
    farthest = int(distance[place])
    results = [records[cell] for cell in cells]
    if any(record.status == "did not run" for record in results) or bool(np.all(measured == NO_EVIDENCE)):
        status = "did not run"
    else:
        status = "agree" if farthest <= ALLOWED else "differ"
    return MapVerdict(
        map=what.name,
        title=what.title,
        status=status,
        distance=farthest if farthest < UNREACHABLE else -1,
        worst="" if farthest == 0 else _place(what, x[place], y[place], results[number[place]], int(expected[place])),
        cells=_counts(what, results),
        depth=mesh.depth,
        seconds=round(sum(record.cpu_s for record in records.values()), 1),
        overlay=what.overlay.name,
        source=what.overlay.source,
    )


def measured_class(what: StabilityMap, record: CellRecord) -> int:
    """Number of a cell's class; `WRONG` if it has none, `NO_EVIDENCE` if the cell is to be ignored."""
    if record.status == "measured":
        return what.kind(record.value) if record.value is not None and math.isfinite(record.value) else WRONG
    if record.status == "did not finish" and what.skips:
        return NO_EVIDENCE
    return WRONG if what.failure is None or record.status == "did not run" else what.failure


def label(what: StabilityMap, record: CellRecord) -> str:
    """The name by which a cell is coloured: its class, or its status where there is no value."""
    if record.status == "measured" and record.value is not None and math.isfinite(record.value):
        return what.kinds[what.kind(record.value)].name
    return record.status


def _distances(what: StabilityMap, measured: NDArray[np.intp], expected: NDArray[np.intp]) -> NDArray[np.intp]:
    """For each place the larger of two distances in cells: to the nearest place where its class is expected, and from
    its expected class to the nearest place where that was measured. With a bound, only the distance to the nearest
    place where so high a class is allowed.
    """
    worst = np.zeros(measured.shape, np.intp)
    if what.overlay.bound:
        for kind in range(len(what.kinds)):
            worst = np.maximum(worst, np.where(measured == kind, _to(expected >= kind, what), 0))
        return np.where(measured == WRONG, UNREACHABLE, worst)
    expected = np.where(measured == NO_EVIDENCE, NO_EVIDENCE, expected)
    for kind in {*measured.ravel().tolist(), *expected.ravel().tolist()}:
        worst = np.maximum(worst, np.where(measured == kind, _to(expected == kind, what), 0))
        worst = np.maximum(worst, np.where(expected == kind, _to(measured == kind, what), 0))
    return worst


def _to(wanted: NDArray[np.bool_], what: StabilityMap) -> NDArray[np.intp]:
    """Chessboard distance of every place from the nearest wanted one, not across categories."""
    if what.y.categories or what.x.categories:
        lines = wanted.T if what.y.categories else wanted
        signs = np.array([_chessboard(line[None])[0] for line in lines])
        return signs.T if what.y.categories else signs
    return _chessboard(wanted)


def _chessboard(wanted: NDArray[np.bool_]) -> NDArray[np.intp]:
    if not wanted.any():
        return np.full(wanted.shape, UNREACHABLE, np.intp)
    return np.asarray(distance_transform_cdt(~wanted, metric="chessboard"), np.intp)


def _place(what: StabilityMap, x: float, y: float, record: CellRecord, expected: int) -> str:
    named = f"{what.y.name} {what.y.categories[round(y)]}" if what.y.categories else f"{what.y.name} {y:.4g}"
    place = label(what, record) + (f" ({record.message})" if record.message else "")
    awaited = "that the theory says something" if expected == NO_PREDICTION else what.kinds[expected].name
    return f"at {what.x.name} {x:.4g}, {named}: {place}, expected {awaited}"


def _counts(what: StabilityMap, found: list[CellRecord]) -> dict[str, int]:
    counts: dict[str, int] = {}
    for record in found:
        name = label(what, record)
        counts[name] = counts.get(name, 0) + 1
    return dict(sorted(counts.items()))
