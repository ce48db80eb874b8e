"""Modes of a beam: eigenmodes of the chosen families and attachment modes, in deterministic order and sign."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexmb.modal.beam import BeamElements
from flexmb.modal.eigenproblem import eigenpairs, forward, solve_definite
from flexmb.scene.bodies import Modes
from flexmb.typing import Real

# Relative size below which a modal mass, and the coupling of two families by mass or stiffness, are taken for rounding
# errors. A motion without mass has an infinite frequency and is never among the lowest modes.
_ROUND_OFF = 64 * np.finfo(float).eps


@dataclass(frozen=True)
class BeamModes:
    """Coordinate columns (size, m) with unit modal mass and angular frequencies (m,) rad/s, ascending.

    `turn` (m,m), orthogonal: the columns are those of the eigenmodes times `turn`; None for the eigenmodes themselves.
    """

    columns: Real
    frequencies: Real
    turn: Real | None = None

    @property
    def stiffness(self) -> Real:
        """Modal stiffness (m,m), N/m for unit modal mass."""
        return self._turned(self.frequencies**2)

    @property
    def roots(self) -> Real:
        """The square root (m,m) of the modal stiffness, rad/s."""
        return self._turned(self.frequencies)

    def _turned(self, values: Real) -> Real:
        if self.turn is None:
            return np.diag(values)
        return self.turn.T @ (values[:, None] * self.turn)


@dataclass(frozen=True)
class _Coupled:
    """A set of families that mass or stiffness couple: stiffness K and mass M over their free coordinates `index`.

    `rigid` (n, r): M-orthonormal rigid motions (none for a clamped beam). `A` is K, made positive definite on the rigid
    motions; `M_elastic` is M, deflated by them. (A, M_elastic) has the elastic eigenpairs of (K, M), and the rigid
    motions have no mass in it.
    """

    index: NDArray[np.intp]
    rigid: Real
    A: Real
    M: Real
    M_elastic: Real


def beam_modes(elements: BeamElements, K: Real, M: Real, modes: Modes) -> BeamModes:
    """The `modes.count` lowest eigenmodes of the chosen families, with attachment modes if `modes.static`.

    Uncoupled families are solved separately, so that degenerate bending modes each lie in one plane; their modes are
    merged by frequency, then in the order axial, torsion, bending_y, bending_z. Families that a section or a lump
    couples are solved together; families that are not chosen are held fixed.
    Free-free modes are orthogonal to the rigid motions of the chosen families, which makes the body frame a mean-axis
    (Buckens) frame. Raises ValueError if the finite-element model has fewer modes than requested.
    """
    found: list[tuple[float, int, Real]] = []
    parts = _parts(elements, K, M, modes.boundary == "clamped-free")
    for rank, part in enumerate(parts):
        found += [(omega, rank, column) for omega, column in _eigenmodes(part, modes.count)]
    found.sort(key=_order)
    if len(found) < modes.count:
        raise ValueError(
            f"{modes.count} modes wanted, but the finite-element model has only {len(found)}; use more "
            "elements, more families, or fewer modes"
        )
    chosen = found[: modes.count]
    if modes.static:
        chosen = [
            (omega, rank, column)
            for rank, part in enumerate(parts)
            for omega, column in _with_attachment(elements, part, [(w, c) for w, r, c in chosen if r == rank])
        ]
        chosen.sort(key=_order)
    columns = np.zeros((elements.size, len(chosen)))
    for n, (_, rank, column) in enumerate(chosen):
        columns[parts[rank].index, n] = column
    return BeamModes(columns * _tip_signs(elements, columns), np.array([omega for omega, _, _ in chosen]))


def damping_matrix(roots: Real, ratio: float | tuple[float, ...]) -> Real:
    """Modal damping diag(2 zeta_n omega_n) (m,m) in N s/m for unit modal mass; one ratio for all modes or one each.

    roots (m,m): `BeamModes.roots`. Where these are not diagonal, the ratios Z act as Z roots + roots Z.
    """
    if isinstance(ratio, tuple) and len(ratio) != len(roots):
        raise ValueError(f"damping_ratio has {len(ratio)} entries for {len(roots)} modes")
    zeta = np.broadcast_to(np.asarray(ratio, dtype=float), len(roots))
    return (zeta[:, None] + zeta) * roots


def _order(mode: tuple[float, int, Real]) -> tuple[float, int]:
    """Sort key: frequencies that agree to nine digits count as equal, so that their families decide the order."""
    return float(f"{mode[0]:.8e}"), mode[1]


def _parts(elements: BeamElements, K: Real, M: Real, clamped: bool) -> list[_Coupled]:
    """Sets of families that M or K couples, in order."""
    names = list(elements.fields)
    blocks = [elements.coordinates(name) for name in names]
    coupled = np.array(
        [[any(_coupled(A[a, b], A[a, a], A[b, b]) for A in (M, K)) for b in blocks] for a in blocks]
    )
    label = groups(coupled)
    free = np.ones(elements.size, dtype=bool)
    if clamped:
        free[elements.clamped_coordinates()] = False
    parts = []
    for group in dict.fromkeys(label):
        member = np.zeros(elements.size, dtype=bool)
        for block, its in zip(blocks, label, strict=True):
            member[block] = its == group
        index = np.flatnonzero(member & free)
        k, m = K[np.ix_(index, index)], M[np.ix_(index, index)]
        rigid = np.zeros((len(index), 0)) if clamped else elements.rigid()[index]
        parts.append(_part(index, k, m, rigid[:, np.any(rigid, axis=0)]))
    return parts


def groups(coupled: NDArray[np.bool_]) -> list[int]:
    """For each family the first one that it is coupled with, directly or through others."""
    label = list(range(len(coupled)))
    for a, b in np.argwhere(coupled):
        label = [min(label[a], label[b]) if its in (label[a], label[b]) else its for its in label]
    return label


def _coupled(ab: Real, aa: Real, bb: Real) -> bool:
    """Whether blocks of mass or stiffness couple two families by more than the rounding error of a lump's position."""
    return bool(np.abs(ab).max() > _ROUND_OFF * np.sqrt(np.abs(aa).max() * np.abs(bb).max()))


def _part(index: NDArray[np.intp], K: Real, M: Real, rigid: Real) -> _Coupled:
    """Deflate the rigid motions (n, r): with M-orthonormal R, A = K + s M R R' M and M_elastic = M - M R R' M."""
    if rigid.shape[1] == 0:
        return _Coupled(index, rigid, K, M, M)
    MR = M @ rigid
    R = forward(np.linalg.cholesky(rigid.T @ MR), rigid.T).T
    deflation = M @ R @ R.T @ M
    # The ratio of the traces gives rigid motions a stiffness of the size of the elastic ones: A is well conditioned.
    return _Coupled(index, R, K + np.trace(K) / np.trace(deflation) * deflation, M, M - deflation)


def _eigenmodes(part: _Coupled, count: int) -> list[tuple[float, Real]]:
    """Lowest eigenpairs from M phi = omega^-2 K phi.

    The low modes are the largest eigenvalues of this form, which are the accurate ones, and coordinates without mass
    have the eigenvalue zero in place of infinity.
    """
    size = len(part.index)
    wanted = min(count, size)
    if wanted == 0:
        return []
    compliance, columns = eigenpairs(part.M_elastic, part.A)  # ascending: the low frequencies are at the end
    highest = slice(None, size - wanted - 1 if wanted < size else None, -1)
    return _mass_normalised(compliance[highest], columns[:, highest], part.M)


def _with_attachment(
    elements: BeamElements, part: _Coupled, eigenmodes: list[tuple[float, Real]]
) -> list[tuple[float, Real]]:
    """The eigenmodes, and attachment modes: the deflections under unit tip forces and moments.

    The attachment modes are orthonormalised by a reduced eigenproblem. For free-free beams the load is balanced by the
    inertia of the rigid motion that it causes (inertia relief).
    """
    tip = np.array([elements.mesh.nodes[-1]])
    load = elements.motion(tip, np.eye(elements.size))[0][:, part.index].T
    load = load[:, np.any(load, axis=0)]
    static = solve_definite(part.A, load)
    # The static deflections are made M-orthogonal to the eigenmodes; the eigenproblem is then that of the remainders.
    known = np.column_stack([part.rigid, *(column for _, column in eigenmodes)])
    for _ in range(2):  # "twice is enough" (Parlett): the second pass removes the rounding errors of the first
        static = static - known @ (known.T @ part.M @ static)
    # Unit strain energy, so that deflections under forces and moments weigh alike whatever the units.
    static = static / np.sqrt(np.einsum("im,ij,jm->m", static, part.A, static))
    compliance, mix = eigenpairs(static.T @ part.M_elastic @ static, static.T @ part.A @ static)
    return eigenmodes + _mass_normalised(compliance[::-1], static @ mix[:, ::-1], part.M)


def _mass_normalised(compliance: Real, columns: Real, M: Real) -> list[tuple[float, Real]]:
    """(omega, column with unit modal mass) for each compliance 1/omega^2 above rounding errors."""
    kept = compliance > _ROUND_OFF * max(compliance.max(), 0.0)
    columns = columns[:, kept]
    columns = columns / np.sqrt(np.einsum("im,ij,jm->m", columns, M, columns))
    # The eigenvectors are orthogonal only to some 1000 eps; one Newton step for (X' M X)^(-1/2) reduces that to eps.
    columns = columns @ (1.5 * np.eye(columns.shape[1]) - 0.5 * columns.T @ M @ columns)
    return [(float(1.0 / np.sqrt(c)), column) for c, column in zip(compliance[kept], columns.T, strict=True)]


def _tip_signs(elements: BeamElements, columns: Real) -> Real:
    """`tip_signs` of coordinate columns (size,m)."""
    length = elements.mesh.nodes[-1]
    tip = elements.motion(np.array([length]), columns)[0]
    return tip_signs(tip[:3], length * tip[3:])


def tip_signs(displacement: Real, turn: Real) -> Real:
    """Signs (m,) that make the tip's largest displacement (3,m) positive, or its largest turn (3,m), times the length,
    if it is not displaced."""
    moves = np.abs(displacement).max(axis=0) > 1e-6 * np.abs(turn).max(axis=0)
    rows = np.where(moves, displacement, turn)
    largest = np.argmax(np.abs(rows), axis=0)
    return np.where(rows[largest, np.arange(rows.shape[1])] < 0.0, -1.0, 1.0)
