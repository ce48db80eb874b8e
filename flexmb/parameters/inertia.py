"""The parameters of a body in which inverse dynamics is linear: ten of a rigid body, and those of its modes.

All are about the origin of the body's own frame, in its axes; the tables of the kernels are in the frame of the link,
and follow by a linear map. With r the position of a mass at rest and phi_n its displacement by mode n,

    mass, first moment s = sum m r, inertia J about the origin                              every body
    modal mass, stiffness and damping, of each pair of modes that are coupled               every flexible body
    coupling L_n = sum m phi_n; with C_n = sum m r x phi_n also that of rotations           levels ruthless and linear
    inertia slope E_n = dJ/deta_n                                                           levels ruthless and linear
    moment P_n = sum m phi_n r'                                                             level full

What a level has beyond the first order of the deformation is not among them, nor are wheels, armatures, loads and
connectors: inverse dynamics is Y pi plus a rest that has these.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flexmb.building.links import BodyLink
from flexmb.jit.bundle import bundle
from flexmb.jit.strips import ROW, strip_zeros
from flexmb.scene.quaternions import cross_matrix
from flexmb.tables.arrays import Constants
from flexmb.typing import Index, Real

RIGID, MASS, STIFFNESS, DAMPING, COUPLING, GYRATION, MOMENT = range(7)
_AXES = "xyz"
_PAIRS = ("xx", "yy", "zz", "xy", "xz", "yz")


class Entry(NamedTuple):
    """A place in the tables: which, its body, and up to two indices more."""

    table: int
    body: int
    first: int
    second: int


class BodyParameters(NamedTuple):
    """Names (k,) of a body's parameters, places (k,) of the table's numbers, and the map (k,k) to these numbers."""

    names: list[str]
    entries: list[Entry]
    to_tables: Real


def body_parameters(link: BodyLink, c: Constants, k: int) -> BodyParameters:
    """The parameters of body k; NotImplementedError for levels stiffened and exact, which sum over points."""
    if link.level.second_order or link.level.by_strain:
        raise NotImplementedError(
            f'body "{link.name}" has level "{link.level.name}", whose inertia is a sum over points and has no '
            'parameters of its own: use level "full"'
        )
    modes = int(c.body["modes"][k])
    slots = _Slots(link.name, k)
    slots.add_rigid()
    for n in range(modes):
        slots.add_mode(n, link.level.name == "full")
    slots.add_pairs(MASS, "mass", _coupled(c.mff[k], modes))
    slots.add_pairs(STIFFNESS, "stiffness", _coupled(c.stiffness[k], modes))
    slots.add_pairs(DAMPING, "damping", _coupled(c.damping[k], modes))
    at = link.outboard
    inside = at.deforms  # the frame of the link is then the body's own
    origin, axes = (np.zeros(3), np.eye(3)) if inside else (at.origin, at.frame)
    map_ = np.column_stack([slots.seen_from(unit, origin, axes) for unit in np.eye(len(slots.names))])
    return BodyParameters(slots.names, slots.entries, map_)


def table_numbers(entries: list[Entry], c: Constants) -> Real:
    """The numbers at these places."""
    return np.array([_number(entry, c) for entry in entries])


def without(entries: list[Entry], c: Constants) -> dict[str, Real]:
    """The tables that have these places, with zeros there."""
    copies = {name: _copied(getattr(c, name)) for name in _ARRAYS.values()} | {"body": c.body.copy()}
    for table, k, i, j in entries:
        if table == RIGID:
            copies["body"]["rigid"][k, i] = 0.0
        elif table == MOMENT:
            copies["product"][c.body["product"][k], j // ROW, 0, i * ROW + j % ROW] = 0.0
        else:
            copies[_ARRAYS[table]][k, i, j] = 0.0
            if table in (MASS, STIFFNESS, DAMPING):
                copies[_ARRAYS[table]][k, j, i] = 0.0
    return copies


_ARRAYS = {
    MASS: "mff", STIFFNESS: "stiffness", DAMPING: "damping", COUPLING: "mfr", GYRATION: "gyration", MOMENT: "product",
}  # fmt: skip


def _copied(table: Real) -> Real:
    out = strip_zeros(table.shape)  # kernels read these tables in strips
    out[:] = table
    return out


def _number(entry: Entry, c: Constants) -> float:
    table, k, i, j = entry
    if table == RIGID:
        return float(c.body["rigid"][k, i])
    if table == MOMENT:
        return float(c.product[c.body["product"][k], j // ROW, 0, i * ROW + j % ROW])
    return float(getattr(c, _ARRAYS[table])[k, i, j])


def _coupled(matrix: Real, modes: int) -> Iterator[tuple[int, int]]:
    """Pairs of modes on and above the diagonal with an element that is not zero; the diagonal in any case."""
    for n in range(modes):
        for i in range(n, modes):
            if n == i or matrix[n, i] != 0.0:
                yield n, i


class _Slots:
    """The parameters of one body in their order."""

    def __init__(self, name: str, body: int) -> None:
        self.names, self.entries = list[str](), list[Entry]()
        self._name, self._body = name, body
        self._modes = list[tuple[int, bool]]()  # where the numbers of a mode begin, and whether it has a moment

    def _add(self, what: str, table: int, first: int, second: int) -> None:
        self.names.append(f"{self._name}.{what}")
        self.entries.append(Entry(table, self._body, first, second))

    def add_rigid(self) -> None:
        names = ["mass", *(f"first_moment.{x}" for x in _AXES), *(f"inertia.{pair}" for pair in _PAIRS)]
        for i, name in enumerate(names):
            self._add(name, RIGID, i, 0)

    def add_mode(self, n: int, has_moment: bool) -> None:
        self._modes.append((len(self.names), has_moment))
        if not has_moment:
            for i, x in enumerate(_AXES):
                self._add(f"coupling.{n}.r{x}", COUPLING, i, n)
        for i, x in enumerate(_AXES):
            self._add(f"coupling.{n}.{x}", COUPLING, 3 + i, n)
        if has_moment:
            for j, y in enumerate(_AXES):
                for i, x in enumerate(_AXES):
                    self._add(f"moment.{n}.{x}{y}", MOMENT, 3 * j + i, n)
        else:
            for i, pair in enumerate(_PAIRS):
                self._add(f"inertia_slope.{n}.{pair}", GYRATION, i, n)

    def add_pairs(self, table: int, name: str, pairs: Iterator[tuple[int, int]]) -> None:
        for n, i in pairs:
            self._add(f"modal_{name}.{n}.{i}", table, n, i)

    def seen_from(self, numbers: Real, p: Real, R: Real) -> Real:
        """The numbers of the tables, in a frame at p (3,) with axes R (3,3), from those in the body's own frame."""
        out = numbers.copy()
        m, s, J = numbers[0], numbers[1:4], _matrix(numbers[4:10])
        out[1:4] = R.T @ (s - m * p)
        out[4:10] = _six(R.T @ (J + m * (p @ p * np.eye(3) - np.outer(p, p)) - _shifted(s, p)) @ R)
        for start, has_moment in self._modes:
            if has_moment:
                L, P = numbers[start : start + 3], numbers[start + 3 : start + 12].reshape(3, 3).T
                out[start : start + 3] = R.T @ L
                out[start + 3 : start + 12] = (R.T @ (P - np.outer(L, p)) @ R).T.ravel()
            else:
                C, L = numbers[start : start + 3], numbers[start + 3 : start + 6]
                E = _matrix(numbers[start + 6 : start + 12])
                out[start : start + 3] = R.T @ (C - cross_matrix(p) @ L)
                out[start + 3 : start + 6] = R.T @ L
                out[start + 6 : start + 12] = -0.5 * _six(R.T @ (E - _shifted(L, p)) @ R)
        return out


def _shifted(s: Real, p: Real) -> Real:
    """What sum m (r.r 1 - r r') loses in the first order of p when r becomes r - p, with s = sum m r."""
    return np.asarray(2.0 * (s @ p) * np.eye(3) - np.outer(s, p) - np.outer(p, s))


def _matrix(six: Real) -> Real:
    xx, yy, zz, xy, xz, yz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _six(m: Real) -> Real:
    return np.array([m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2]])


@bundle
class Places:
    """Where the numbers of parameters are in the tables, for kernels."""

    place: Index  # (P,5) table, body, its row of `product`, first and second index


def places(entries: list[Entry], c: Constants) -> Places:
    """The places of these entries."""
    rows = [
        (entry.table, entry.body, int(c.body["product"][entry.body]), entry.first, entry.second) for entry in entries
    ]
    return Places(np.array(rows, np.int64).reshape(-1, 5))
