"""Least and greatest values of quantities that are known at points of panels, within which they are smooth.

Between the points of a panel a quantity is the polynomial through them. How far that may be wrong is how far the
polynomial of one degree less, without the middle point, is from it; a hundred times too much where both resolve it. Of
two points it is half of their difference.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexmb.run.envelope import Extremes, PartialEnvelope, columns_of, magnitudes_of, merged, part_of_extremes
from flexmb.run.run_arrays import RunArrays, arrays_of
from flexmb.typing import Index, Real

INSIDE = 0.5 - 0.5 * np.array([np.sqrt(3.0 / 7.0), 0.0, -np.sqrt(3.0 / 7.0)])
"""Lobatto's points within a panel, as fractions of its length: with its ends, five."""
_GRID = np.linspace(0.0, 1.0, 9)
_FINE = np.linspace(-1.0, 1.0, 33)
ROUNDING = 2.0**-50  # of polynomials, relative
REFINED = 2
"""How often the place of a peak is looked for between points that lie 16 times closer."""
_NUMBERS = 2**22  # numbers that are held at once


def part_of(run: RunArrays, panels: Index, steps: int = 0, left_out: int = 0) -> PartialEnvelope:
    """Extremes of results of a run at its output times, and between those of each of the panels (P,k), which are the
    numbers of its output times."""
    columns = columns_of(arrays_of(run))
    magnitudes = magnitudes_of(columns)
    values = np.hstack([*columns.values(), *magnitudes.values()])
    found = at_points(run.t, values)
    each = max(1, _NUMBERS // (len(_GRID) * max(1, values.shape[1])))
    for start in range(0, len(panels), each):
        places = panels[start : start + each]
        found = merged(found, between(run.t[places], values[places]))
    part, at = PartialEnvelope(steps, left_out), 0
    for key, array in columns.items():
        part.columns[key] = part_of_extremes(found, slice(at, at + array.shape[1]))
        at += array.shape[1]
    for channel in magnitudes:
        size = part_of_extremes(found, slice(at, at + 1))
        part.magnitudes[channel] = replace(size, least=np.maximum(size.least, 0.0))  # a polynomial may pass below zero
        at += 1
    return part


def at_points(t: Real, values: Real) -> Extremes:
    """Of values (T,C) at times (T,) alone."""
    C = values.shape[1]
    if not len(t):
        return Extremes(*(np.full(C, np.nan) for _ in range(4)), np.zeros(C))
    known, each = np.isfinite(values), np.arange(C)
    low = np.argmin(np.where(known, values, np.inf), axis=0)
    high = np.argmax(np.where(known, values, -np.inf), axis=0)
    none = ~known.any(axis=0)
    chosen = values[low, each], t[low], values[high, each], t[high]
    return Extremes(*(np.where(none, np.nan, part) for part in chosen), np.zeros(C))


@np.errstate(invalid="ignore", over="ignore", divide="ignore")  # where nothing is known; and at nodes, see `_basis`
def between(t: Real, values: Real) -> Extremes:
    """Of values (P,k,C) at times (P,k) of panels, by polynomials."""
    k = t.shape[1]
    length = t[:, -1:] - t[:, :1]
    s = (t - t[:, :1]) / length
    basis = _basis(s, np.broadcast_to(_GRID, (len(s), len(_GRID))))
    fine = basis @ values
    gap = 0.5 * np.abs(values[:, -1] - values[:, 0])
    if k > 2:
        some = [i for i in range(k) if i != k // 2]
        gap = np.max(np.abs(fine - _basis(s[:, some], _GRID[None]) @ values[:, some]), axis=1)
    greatest, t_greatest, above = _highest(t, s, values, fine, gap)
    least, t_least, below = _highest(t, s, -values, -fine, gap)
    return Extremes(-least, t_least, greatest, t_greatest, np.maximum(above, below))


def _highest(t: Real, s: Real, values: Real, fine: Real, gap: Real) -> tuple[Real, Real, Real]:
    """The greatest values (C,), their times, and by how much they may be exceeded; NaN where none is known."""
    F, C = fine.shape[1:]
    each, known = np.arange(C), np.where(np.isfinite(fine), fine, -np.inf)
    place, peaks = _vertices(known)
    panel = np.argmax(peaks, axis=0)
    nodes, middle, height = s[panel], place[panel, each] / (F - 1), np.max(known, axis=(0, 1))
    step = 1.0 / (F - 1)
    for _ in range(REFINED):
        near = np.clip(middle[:, None] + step * _FINE, 0.0, 1.0)
        heights = np.einsum("cfk,ck->cf", _basis(nodes, near), values[panel, :, each])
        heights = np.where(np.isfinite(heights), heights, -np.inf)
        top = np.argmax(heights, axis=1)
        step, middle, height = step / (len(_FINE) // 2), near[each, top], np.maximum(height, heights[each, top])
    height = height - ROUNDING * np.abs(height)  # not above the nodes where it is constant
    at = t[panel, 0] + middle * (t[panel, -1] - t[panel, 0])
    beyond = np.max(np.where(np.isfinite(peaks), peaks + np.where(np.isfinite(gap), gap, 0.0), -np.inf), axis=0)
    none = ~np.isfinite(height)
    return tuple(np.where(none, np.nan, part) for part in (height, at, np.maximum(beyond - height, 0.0)))  # type: ignore[return-value]


def _vertices(known: Real) -> tuple[Real, Real]:
    """Place, counted in points, and height (P,C) of the peak of each panel from points (P,F,C) on it, by the parabola
    through the highest and its neighbours."""
    highest = np.argmax(known, axis=1)[:, None]
    place = np.clip(highest, 1, known.shape[1] - 2)
    left, middle, right = (np.take_along_axis(known, place + i, axis=1)[:, 0] for i in (-1, 0, 1))
    bend, slope = left - 2.0 * middle + right, 0.5 * (right - left)
    offset = np.where(bend < 0.0, -slope / np.where(bend < 0.0, bend, -1.0), 0.0)
    is_peak = np.abs(offset) <= 1.0
    offset = np.where(is_peak, offset, 0.0)
    top = np.take_along_axis(known, highest, axis=1)[:, 0]
    height = np.fmax(top, middle + 0.5 * slope * offset)
    return np.where(height > top, place[:, 0] + offset, highest[:, 0]), height


def _basis(s: Real, at: Real) -> Real:
    """Lagrange's polynomials of the nodes s (P,k) at points (P,F) or (1,F): (P,F,k), by the barycentric formula."""
    k = s.shape[1]
    apart = s[:, :, None] - s[:, None, :] + np.eye(k)
    weight = 1.0 / np.prod(apart, axis=2)
    ahead = at[:, :, None] - s[:, None, :]
    on = ahead == 0.0
    terms = weight[:, None, :] / np.where(on, 1.0, ahead)
    basis = terms / np.sum(terms, axis=2, keepdims=True)
    at_node = on.any(axis=2, keepdims=True)
    result: Real = np.where(at_node, on.astype(float), basis)
    return result
