"""Inertia of all bodies as arrays: what each level needs of the points of a body, summed once, and what stays a sum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexmb.building.links import Link
from flexmb.modal.first_order import FirstOrder, first_order, inertia_slope
from flexmb.modal.integrals import ModalIntegrals, TurningPoints, modal_integrals, stacked, still_points
from flexmb.modal.model import FlexibleModel, SecondOrder
from flexmb.tables import arrays as a

_SIX = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class _Body:
    """Tables of one body, (m) and (m,m) modes; `summed` points are left to run time."""

    rigid: a.Real
    mode: a.Record
    pair: a.Record
    summed: TurningPoints | None = None
    product: a.Real | None = None
    slope: a.Record | None = None
    mass_slope: a.Real | None = None


def inertia_arrays(
    chain: list[Link], m: int
) -> tuple[dict[str, a.Record], dict[str, a.Record], list[SecondOrder | None]]:
    """Inertia at rest and modal integrals by body, slopes of level linear; the points left to sum at run time, and the
    second-order field of each."""
    bodies = [_tables(link) for link in chain]
    body = np.zeros(len(chain), a.BODY)
    mode, pair = np.zeros((len(chain), m), a.MODE), np.zeros((len(chain), m, m), a.PAIR)
    for k, each in enumerate(bodies):
        n = len(each.mode)
        _drop_rounding(each.pair["mff"], len(chain[k].model.mass))
        body["rigid"][k], mode[k, :n], pair[k, :n, :n] = each.rigid, each.mode, each.pair
        body["orthogonal"][k] = _is_diagonal(each.pair["mff"])
        body["uncoupled"][k] = _is_diagonal(each.pair["stiffness"]) and _is_diagonal(each.pair["damping"])
    body["product"], product = _rows([each.product for each in bodies], np.zeros((1 + m) * 9 * m))
    slopes = [each.slope for each in bodies]
    mass_slopes = [each.mass_slope for each in bodies]
    body["slope"], slope = _rows(slopes, np.zeros((m, m), a.SLOPE))
    body["mass_slope"], mass_slope = _rows(mass_slopes, np.zeros((m, m, m)))
    turning = [(p, i) for p in (each.summed for each in bodies) if p is not None for i in range(len(p.mass))]
    group(body, "point", [0 if each.summed is None else len(each.summed.mass) for each in bodies])
    point = np.zeros(len(turning), a.POINT)
    for row, (p, i) in zip(point, turning, strict=True):
        row["mass"], row["position"], row["offset"] = p.mass[i], p.position[i], p.com_offset[i]
        row["inertia"] = six(p.inertia[i])
        row["turning"] = bool(np.any(p.com_offset[i]) or np.any(p.inertia[i]))
    shapes = shape_records([(p.translation[i], p.rotation[i]) for p, i in turning], m)
    tables = {
        "body": body, "mode": mode, "pair": pair, "product": product, "slope": slope, "mass_slope": mass_slope,
    }  # fmt: skip
    seconds = [None if p.second is None else p.second.map(lambda G, i=i: G[i]) for p, i in turning]
    return tables, {"point": point, "point_mode": shapes}, seconds


def _drop_rounding(masses: a.Real, points: int) -> None:
    """Zeros for modal masses off the diagonal that are rounding of their sum over points: gamma(points) of its terms.

    Orthogonal modes then have diagonal modal masses, which is cheaper. |sum m phi_n . phi_i| of terms in magnitude is
    at most the root of both diagonal elements' product (Cauchy and Schwarz).
    """
    size = np.sqrt(np.diag(masses))
    masses[np.abs(masses) <= points * 2.0**-53 * np.outer(size, size)] = 0.0


def _is_diagonal(m: a.Real) -> bool:
    return np.array_equal(m, np.diag(np.diag(m)))


def _rows(tables: Sequence[NDArray[Any] | None], empty: NDArray[Any]) -> tuple[list[int], NDArray[Any]]:
    """By body the number of its table, -1 for none; and the tables, each enlarged to the shape of `empty`."""
    some = [table for table in tables if table is not None]
    out = np.zeros((len(some), *empty.shape), empty.dtype)
    for row, table in zip(out, some, strict=True):
        row[tuple(slice(n) for n in table.shape)] = table
    count = np.cumsum([table is not None for table in tables]) - 1
    return [-1 if table is None else int(i) for table, i in zip(tables, count, strict=True)], out


def group(body: a.Record, name: str, counts: list[int]) -> None:
    """Consecutive groups of items by body: their start and stop."""
    stop = np.cumsum(counts)
    body[f"{name}_stop"] = stop
    body[f"{name}_start"] = stop - counts


def shape_records(shapes: list[tuple[a.Real, a.Real]], m: int) -> a.Record:
    """SHAPE records (len, m) of (translation, rotation) mode shapes (3, modes)."""
    out = np.zeros((len(shapes), m), a.SHAPE)
    for i, (translation, rotation) in enumerate(shapes):
        out["translation"][i, : translation.shape[1]] = translation.T
        out["rotation"][i, : rotation.shape[1]] = rotation.T
    return out


def second_order_rows(fields: list[SecondOrder | None], first: int, m: int) -> tuple[list[int], a.Record]:
    """By field the number of its row, counted from `first`, -1 for none; and the rows, SHAPE records (...,m,m)."""
    numbers, rows = [], np.zeros((sum(field is not None for field in fields), m, m), a.SHAPE)
    for field in fields:
        numbers.append(-1 if field is None else first + sum(number >= 0 for number in numbers))
        if field is not None:
            n = field.translation.shape[-1]
            row = rows[numbers[-1] - first, :n, :n]
            row["translation"], row["rotation"] = (np.moveaxis(G, 0, -1) for G in (field.translation, field.rotation))
    return numbers, rows


def six(m: a.Real) -> list[float]:
    """xx, yy, zz, xy, xz, yz of a symmetric matrix."""
    return [float(m[i, j]) for i, j in _SIX]


def _sixes(m: a.Real) -> a.Real:
    """The same of symmetric matrices (...,3,3), (...,6)."""
    return np.stack([m[..., i, j] for i, j in _SIX], axis=-1)


def _tables(link: Link) -> _Body:
    n = link.model.mode_count
    mode, pair = np.zeros(n, a.MODE), np.zeros((n, n), a.PAIR)
    pair["stiffness"], pair["damping"] = link.model.stiffness, link.model.damping
    if link.level == a.LINEAR:
        return _linear(link, mode, pair)
    integrals = modal_integrals(link.model)
    if link.level == a.FULL:
        return _full(integrals, mode, pair)
    if link.level == a.STIFFENED:
        return _stiffened(link, integrals, mode, pair)
    return _at_rest(link, integrals, mode, pair)


def _full(i: ModalIntegrals, mode: a.Record, pair: a.Record) -> _Body:
    """The polynomial part; every point whose inertia turns is summed."""
    pair["mff"], mode["mfr"] = i.M_ff, np.hstack([i.C0.T, i.s1.T])
    P0, P1 = _from_cross_products(i.J1), _from_cross_products(i.J2)
    product = _blocks(_nine(P0), _nine(P1))
    return _Body(np.array([i.mass, *i.s0, *six(i.J0)]), mode, pair, i.turning, product)


def _stiffened(link: Link, i: ModalIntegrals, mode: a.Record, pair: a.Record) -> _Body:
    """Every mass is a point to be summed, what turns another; the tables have the masses at rest."""
    masses = np.flatnonzero((link.model.mass > 0.0) & ~np.any(link.model.com_offset != 0.0, axis=1))
    return replace(_full(i, mode, pair), product=None, summed=stacked(still_points(link.model, masses), i.turning))


def _at_rest(link: Link, i: ModalIntegrals, mode: a.Record, pair: a.Record) -> _Body:
    """Levels rigid and ruthless: the rest shape."""
    n = i.mode_count
    block = i.spatial_mass
    rr = block[n:, n:]
    pair["mff"], mode["mfr"] = block[:n, :n], block[:n, n:]
    mode["gyration"] = -0.5 * _sixes(inertia_slope(link.model))
    return _Body(np.array([rr[5, 5], rr[2, 4], rr[0, 5], rr[1, 3], *six(rr[:3, :3])]), mode, pair)


def _linear(link: Link, mode: a.Record, pair: a.Record) -> _Body:
    """First order in eta; the rotary inertia of the wheels belongs to their nodes, which turn exactly: it is summed."""
    points, wheels = _wheels_apart(link)
    i: FirstOrder = first_order(points)
    pair["mff"], mode["mfr"], mode["gyration"] = i.M0, np.hstack([i.C0, i.L0]), -0.5 * _sixes(i.E)
    slope = np.zeros(pair.shape, a.SLOPE)
    by_mode = np.swapaxes(i.C1, 0, 1)
    slope["mfr"] = np.concatenate([by_mode, np.swapaxes(i.L1, 0, 1)], axis=2)
    slope["coriolis"] = by_mode - i.C1
    slope["gyration"] = _sixes(i.G)
    mass_slope = np.moveaxis(i.M1, 0, 2) if np.any(i.M1) else None
    return _Body(np.array([i.mass, *i.s0, *six(i.J0)]), mode, pair, wheels, None, slope, mass_slope)


def _wheels_apart(link: Link) -> tuple[FlexibleModel, TurningPoints]:
    """The model with its wheels as mere masses, and their rotary inertia as points without mass."""
    model, first = link.model, len(link.model.mass) - link.wheels
    inertia = model.inertia.copy()
    inertia[first:] = 0.0
    wheels = TurningPoints(
        mass=np.zeros(link.wheels),
        position=model.position[first:],
        com_offset=model.com_offset[first:],
        inertia=model.inertia[first:],
        translation=model.translation[first:],
        rotation=model.rotation[first:],
    )
    return replace(model, inertia=inertia), wheels


def _from_cross_products(J: a.Real) -> a.Real:
    """sum m a b' from sum m a~' b~ = (a.b) 1 - b a', over the leading axes."""
    half_trace = 0.5 * np.trace(J, axis1=-2, axis2=-1)
    return np.swapaxes(half_trace[..., None, None] * np.eye(3) - J, -1, -2)


def _nine(P: a.Real) -> a.Real:
    """Matrices (...,3,3) as nine numbers (...,9): [xx yy zz xy xz yz] of the symmetric part, the axial vector."""
    axial = [P[..., 2, 1] - P[..., 1, 2], P[..., 0, 2] - P[..., 2, 0], P[..., 1, 0] - P[..., 0, 1]]
    return np.concatenate([_sixes(0.5 * (P + np.swapaxes(P, -1, -2))), np.stack(axial, axis=-1)], axis=-1)


def _blocks(at_rest: a.Real, slope: a.Real) -> a.Real:
    """Row of `product`: numbers at rest (n,numbers) and their slopes [n,i] (n,n,numbers), see `levels.integrals`."""
    return np.concatenate([at_rest[None], np.swapaxes(slope, 0, 1)]).swapaxes(1, 2).ravel()
