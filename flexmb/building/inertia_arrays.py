"""Inertia of all bodies as arrays: sums over points that are constant in a run, and the points left to sum in it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexmb.building.links import BodyLink
from flexmb.building.rigid_arrays import outboard_frames, rigid_inertia_rows
from flexmb.jit.strips import ROW, strip_zeros
from flexmb.levels.affine_integrals import NUMBERS, moving_columns
from flexmb.levels.level import FidelityLevel, InertiaTables, six
from flexmb.modal.flexible_model import FlexibleModel, SecondOrder
from flexmb.tables import arrays as a


def inertia_arrays(chain: list[BodyLink], m: int) -> tuple[dict[str, Any], dict[str, Any], list[SecondOrder | None]]:
    """The tables of inertia, those of the points that are left to sum at run time, and the second-order field of each
    of these points."""
    body = np.zeros(len(chain), a.BODY)
    rigid = [k for k, link in enumerate(chain) if link.is_rigid and link.wheels == 0]
    alone = [chain[k] for k in rigid]
    body["rigid"][rigid] = rigid_inertia_rows(alone, outboard_frames(alone))
    summed = sorted(set(range(len(chain))).difference(rigid))
    bodies = {k: _tables(chain[k].level, chain[k].model, chain[k].wheels) for k in summed}
    modes = _modal_arrays(chain, bodies, body, m)
    integrals = _integrals(bodies, body, m)
    points, seconds = _points(bodies, body, m)
    return {"body": body, **modes, **integrals}, points, seconds


def _modal_arrays(
    chain: list[BodyLink], bodies: dict[int, InertiaTables], body: a.Record, m: int
) -> dict[str, NDArray[Any]]:
    """Inertia at rest, stiffness and damping; writes to `body` which of the matrices are diagonal."""
    pairs = {name: strip_zeros((len(chain), m, m)) for name in ("mff", "stiffness", "damping")}
    modes = {name: strip_zeros((len(chain), 6, m)) for name in ("mfr", "gyration")}
    body["orthogonal"] = body["uncoupled"] = True
    for k, body_of_link in bodies.items():
        model, n = chain[k].model, len(body_of_link.mff)
        body["rigid"][k], pairs["mff"][k, :n, :n] = body_of_link.rigid, body_of_link.mff
        pairs["stiffness"][k, :n, :n], pairs["damping"][k, :n, :n] = model.stiffness, model.damping
        modes["mfr"][k, :, :n], modes["gyration"][k, :, :n] = body_of_link.mfr, body_of_link.gyration
        body["orthogonal"][k] = _is_diagonal(body_of_link.mff)
        body["uncoupled"][k] = _is_diagonal(model.stiffness) and _is_diagonal(model.damping)
    return pairs | modes


def _integrals(bodies: dict[int, InertiaTables], body: a.Record, m: int) -> dict[str, NDArray[Any]]:
    """Modal integrals of the bodies that have some; writes the row of each to `body`."""
    most = max((len(body.mff) for body in bodies.values()), default=0)  # not whole strips: the size is its cube
    empty = {
        "product": strip_zeros((m // ROW, 1 + m, NUMBERS * ROW)),
        "slope": np.zeros((most, most), a.SLOPE),
        "mass_slope": np.zeros((most, most, most)),
    }
    integrals = {}
    for name, one in empty.items():
        body[name] = -1
        body[name][list(bodies)], integrals[name] = _rows([getattr(body, name) for body in bodies.values()], one)
    return integrals | {"moves": moving_columns(integrals["product"])}


def _points(
    bodies: dict[int, InertiaTables], body: a.Record, m: int
) -> tuple[dict[str, NDArray[Any]], list[SecondOrder | None]]:
    """The points left to sum at run time, and the second-order field of each; writes each body's range to `body`."""
    counts = np.zeros(len(body), int)
    counts[list(bodies)] = [0 if body.summed is None else len(body.summed.mass) for body in bodies.values()]
    group(body, "point", counts)
    turning = [(p, i) for p in (body.summed for body in bodies.values()) if p is not None for i in range(len(p.mass))]
    point = np.zeros(len(turning), a.POINT)
    for row, (p, i) in zip(point, turning, strict=True):
        row["section"] = -1 if p.section is None else p.section[i]
        row["mass"], row["position"], row["offset"] = p.mass[i], p.position[i], p.com_offset[i]
        row["inertia"] = six(p.inertia[i])
        row["turning"] = bool(np.any(p.com_offset[i]) or np.any(p.inertia[i]))
    shapes = shape_rows([(p.rotation[i], p.translation[i]) for p, i in turning], m)
    seconds = [None if p.second is None else p.second.map(lambda G, i=i: G[i]) for p, i in turning]
    return {"point": point, "point_mode": shapes}, seconds


@lru_cache(maxsize=64)
def _tables(level: FidelityLevel, model: FlexibleModel, wheels: int) -> InertiaTables:
    """The tables of a level. Equal bodies, also in copies of a scene, share their tables, which must not be changed."""
    tables = level.tables(model, wheels)
    _drop_rounding(tables.mff, len(model.mass))
    return tables


def _drop_rounding(masses: a.Real, points: int) -> None:
    """Set modal masses off the diagonal to zero where they are rounding errors of their sum over points.

    Orthogonal modes then have diagonal modal masses, which cost less in a run. The error is at most gamma(points) times
    the sum of the magnitudes |m phi_n . phi_i|, and that sum is at most the square root of the product of the two
    diagonal elements (Cauchy and Schwarz).
    """
    size = np.sqrt(np.diag(masses))
    masses[np.abs(masses) <= points * 2.0**-53 * np.outer(size, size)] = 0.0


def _is_diagonal(m: a.Real) -> bool:
    return np.array_equal(m, np.diag(np.diag(m)))


def _rows(tables: Sequence[NDArray[Any] | None], empty: NDArray[Any]) -> tuple[list[int], NDArray[Any]]:
    """For each body the row of its table, -1 for none; and the tables, each enlarged to the shape of `empty`."""
    some = [table for table in tables if table is not None]
    shape = len(some), *empty.shape
    out = strip_zeros(shape) if empty.dtype == np.float64 else np.zeros(shape, empty.dtype)
    for row, table in zip(out, some, strict=True):
        row[tuple(slice(n) for n in table.shape)] = table
    count = np.cumsum([table is not None for table in tables]) - 1
    return [-1 if table is None else int(i) for table, i in zip(tables, count, strict=True)], out


def group(body: a.Record, name: str, counts: ArrayLike) -> None:
    """Write to each body the range of its items, which are stored body by body."""
    stop = np.cumsum(counts)
    body[f"{name}_stop"] = stop
    body[f"{name}_start"] = stop - counts


def shape_rows(shapes: list[tuple[a.Real, a.Real]], m: int) -> a.Real:
    """[rotation; translation] (len,6,m) of mode shapes (3,modes)."""
    out = strip_zeros((len(shapes), 6, m))
    for i, (rotation, translation) in enumerate(shapes):
        out[i, :3, : rotation.shape[1]], out[i, 3:, : translation.shape[1]] = rotation, translation
    return out


def second_order_rows(fields: list[SecondOrder | None], first: int, m: int) -> tuple[list[int], a.Record]:
    """For each field the number of its row, counted from `first`, -1 for none; and the rows, SHAPE (...,m,m)."""
    rows = np.zeros((sum(field is not None for field in fields), m, m), a.SHAPE)
    numbers, last = [], -1
    for field in fields:
        last += field is not None
        numbers.append(-1 if field is None else first + last)
        if field is not None:
            n = field.translation.shape[-1]
            row = rows[last, :n, :n]
            row["translation"], row["rotation"] = (np.moveaxis(G, 0, -1) for G in (field.translation, field.rotation))
    return numbers, rows
