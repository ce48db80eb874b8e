"""Craig-Bampton reduction: constraint modes of the interface, fixed-interface normal modes, and static corrections.

With the boundary "clamped-free" the first interface node is the body frame, and all others move; with "free-free" all
move, the six rigid-body motions are removed, and the body frame is at the mass centre. Both describe the same motions
of the structure. The eigenproblem of the reduced matrices makes the modes orthonormal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexmb.interchange.imported import listed
from flexmb.interchange.point_masses import FARTHEST, NoMasses, RigidBlock, points_with
from flexmb.interchange.superelement.element import ALIKE, DUST, MOTIONS, SuperElement, SuperElementError
from flexmb.interchange.superelement.interface import Interface, interface_of
from flexmb.scene.bodies import Level, ModalBody
from flexmb.scene.convert import plain, to_struct
from flexmb.scene.modal_data import inertia_points
from flexmb.scene.quaternions import cross_matrix
from flexmb.typing import Real


def carried_sums(element: SuperElement, position: Real, translation: Real, rotation: Real) -> Real:
    """Sums (4+3m, 4+3m) over the masses of products of the fields 1, r, phi_n.

    position (n,3) m of the nodes, translation and rotation modes (n,3,m).
    """
    n, _, m = translation.shape
    shares = np.column_stack([np.ones(n), position, translation.transpose(0, 2, 1).reshape(n, 3 * m)])
    arms = np.zeros((3, n, 4 + 3 * m))
    arms[:, :, 1:4] = np.eye(3)[:, None]
    arms[:, :, 4:] = np.moveaxis(cross_matrix(rotation.transpose(0, 2, 1)).reshape(n, 3 * m, 3), 2, 0)
    turns = np.any(element.place[:, 3:] >= 0, axis=1)
    fields = np.concatenate([shares, *arms[:, turns]])
    return np.asarray(fields.T @ _kernel(element, turns) @ fields)


def _kernel(element: SuperElement, turns: NDArray[np.bool_]) -> Real:
    """Sums (n+3k, n+3k) of products of the shares of all nodes and the arms along x, y and z of the k that turn."""
    padded = np.pad(element.M, ((0, 1), (0, 1)))  # index -1 selects zeros
    move, turn = element.place[:, :3].T, element.place[turns, 3:].T

    def block(rows: NDArray[np.int64], columns: NDArray[np.int64]) -> Real:
        return padded[np.ix_(rows, columns)]

    share = sum(block(rows, rows) for rows in move) / 3.0
    mixed = [0.5 * (block(move[b], turn[c]) - block(move[c], turn[b])) for b, c in ((1, 2), (2, 0), (0, 1))]
    half = 0.5 * sum(block(rows, rows) for rows in turn)
    own = [[(half if a == b else 0.0) - block(turn[b], turn[a]) for b in range(3)] for a in range(3)]
    return np.block([[share, *mixed], *([mixed[a].T, *own[a]] for a in range(3))])


LOOSE = 1e-12
"""Pivots of K below this fraction of the diagonal are zero: there is a mechanism, or an unconnected part."""
Boundary = Literal["clamped-free", "free-free"]
SPANNED = 1e-9
"""Share of a static response's energy below which modes have all of it."""
DENSE = 1000
"""Number of rows up to which the dense eigensolver is used."""
MASSLESS = 1e-13  # a mode has no mass if 1/omega^2 is below this fraction of the largest


@dataclass(frozen=True)
class ReducedBody:
    """`body` in axes of the structure, with its origin at `origin` (3,) m; frequencies (m,) Hz of its modes.

    mass kg, mass centre (3,) m and inertia (3,3) kg m² about the origin, both in the body frame, from the rigid-body
    motions of M; the body has just these, and the modal masses and coupling of M, at every level. shapes (n,6,m):
    displacements and rotations of all nodes of the structure at unit modal coordinates, to recover its motion. `notes`
    say what of the body is not determined by M.
    """

    body: ModalBody
    origin: Real
    frequencies: Real
    mass: float
    centre: Real
    inertia: Real
    shapes: Real
    notes: tuple[str, ...]
    interface: Interface


def reduced(
    element: SuperElement, interface: Sequence[int] | Interface, modes: int, *, name: str = "body",
    boundary: Boundary = "clamped-free", damping_ratio: float = 0.0, level: Level = "full",
    attached: Sequence[int] = (),
) -> ReducedBody:  # fmt: skip
    """A flexible body whose nodes are the `interface` nodes, named by their numbers, and those of `attached`.

    `modes`: the number of fixed-interface modes, in addition to the 6 constraint modes of each interface node, less the
    six rigid-body motions. `interface_of` makes an interface with nodes to which surfaces are tied. `attached` nodes of
    the structure get static modes for a force along each axis, and torques if they turn, while the interface is held:
    loads there have their exact static response. `damping_ratio` applies to every mode. Raises SuperElementError for
    interface nodes without rotations, an impossible number of modes, mechanisms, and a mass matrix that is not positive
    semidefinite.
    """
    if not 0.0 <= damping_ratio < 1.0:
        raise SuperElementError(f"the damping ratio is {damping_ratio:g}: give a number from 0 to 1, such as 0.005")
    face = interface if isinstance(interface, Interface) else interface_of(element, interface)
    extra = [element.node(number) for number in dict.fromkeys(attached) if number not in face.ids]
    held = len(face.motion.indptr) - 1
    _refuse_loose(element, np.unique(face.T[:, :held].nonzero()[0]))
    loads = _loads(element, face, extra)
    if held + modes + loads.shape[1] <= 6:
        raise SuperElementError("one interface node without modes is a rigid body: give modes, or more nodes")
    T = face.T @ _shapes(face.by_coordinates(element.K), face.by_coordinates(element.M), held, modes, loads)
    clamped = boundary == "clamped-free"
    whole = element.rigid(np.zeros(3))
    centre = RigidBlock.of(whole.T @ element.M @ whole).centre
    origin = face.position[0] if clamped else centre
    R = None if clamped else _unit_rigid(element)
    frequencies, V = _modes(element.K, element.M, T[:, 6:] if clamped else T, R)
    shapes = _at_nodes(element, V)
    translation, rotation = shapes[:, :3], shapes[:, 3:]
    omega = 2.0 * np.pi * frequencies
    motions = np.column_stack([element.rigid(origin), V])
    spatial = motions.T @ element.M @ motions
    try:
        sums = carried_sums(element, element.position - origin, translation, rotation)
        points, distance = points_with(spatial, sums, omega)
    except NoMasses as error:
        raise SuperElementError(f"M is not a mass matrix ({error}): its eigenvalues have to be zero or more") from None
    body = {
        "name": name,
        "points": inertia_points(*points),
        "stiffness": np.diag(omega**2),
        "damping": np.diag(2.0 * damping_ratio * omega) if damping_ratio else (),
        "boundary": boundary,
        "level": level,
        "nodes": [
            _node(number, position - origin, *np.split(motion, 2))
            for number, position, motion in zip(
                (*face.ids, *element.ids[extra]), (*face.position, *element.position[extra]),
                (*(face.motion @ V).reshape(-1, 6, len(omega)), *shapes[extra]), strict=True,
            )
        ],
    }  # fmt: skip
    mass, mass_centre, J = RigidBlock.of(spatial)
    notes = (*_notes(distance), *_without_rotations(element, extra))
    made = to_struct(plain(body), ModalBody)
    return ReducedBody(made, origin, frequencies, mass, mass_centre, J, shapes, notes, face)


def _node(number: int, position: Real, translation: Real, rotation: Real) -> dict[str, object]:
    return {
        "name": str(number), "position_m": position, "translation_modes": translation.T, "rotation_modes": rotation.T,
    }  # fmt: skip


def _without_rotations(element: SuperElement, nodes: list[int]) -> tuple[str, ...]:
    still = [str(element.ids[i]) for i in nodes if np.any(element.place[i, 3:] < 0)]
    return (f"nodes without rotations keep theirs in the body frame: {listed(still)}",) if still else ()


def _loads(element: SuperElement, face: Interface, nodes: list[int]) -> Real:
    """Unit loads along the displacements of these nodes, by coordinates (N', loads)."""
    rows = element.place[nodes]
    return np.asarray(face.T[rows[rows >= 0]].toarray().T)


def _notes(distance: float) -> tuple[str, ...]:
    """What to say about masses that have M at rest only. SuperElementError above FARTHEST."""
    if not distance <= FARTHEST:
        raise SuperElementError(
            f"M is far from that of masses which its nodes carry: with the nearest ones, frequencies are off by "
            f"{distance:.2g}, and the limit is {FARTHEST:g}: write a lumped M, or with the same shape functions in all "
            "directions, or divide the structure into more elements"
        )
    if distance <= ALIKE:
        return ()
    return (
        "M is not that of masses which its nodes carry: frequencies, mass and inertia at rest are those of M, and "
        "inertia changes with the deformation as that of near masses, which have frequencies that are off by "
        f"{distance:.2g}",
    )


def _refuse_loose(element: SuperElement, held: NDArray[np.int64]) -> None:
    """SuperElementError for a displacement inside whose stiffness is zero, or what programs write in place of it."""
    lever = element.lever()
    own = np.diag(element.K) / lever**2
    own[held] = np.inf
    if np.min(own) <= DUST * np.max(np.abs(element.K) / np.outer(lever, lever)):
        node, motion = np.argwhere(element.place == np.argmin(own))[0]
        raise SuperElementError(
            f"K lets a part move without force while the interface is held: node {element.ids[node]} has no stiffness "
            f"in {MOTIONS[motion]}; join the part, or remove displacements without stiffness from K and M"
        )


def _shapes(K: Real, M: Real, held: int, modes: int, loads: Real) -> Real:
    """Constraint modes of the first `held` coordinates, the lowest fixed-interface modes, and what static responses to
    `loads` (N,l) there have beyond these: columns (N, held + modes + at most l)."""
    from scipy.linalg import cho_solve

    inside = len(K) - held
    if not 0 <= modes <= inside:
        raise SuperElementError(f"{modes} modes are requested, and the structure held at its interface has {inside}")
    if inside == 0:
        return np.eye(held)
    K_ii, M_ii = K[held:, held:], M[held:, held:]
    L = _factor(K_ii, "K lets a part move without force while the interface is held")
    columns = np.zeros((inside, 0))
    if modes:
        compliance, columns = _highest(M_ii, L, modes)
        if compliance[0] <= MASSLESS * compliance[-1]:
            there = int(np.count_nonzero(compliance > MASSLESS * compliance[-1]))
            raise SuperElementError(f"{modes} modes are asked for, and M gives mass to {there} of them: ask for fewer")
    static = _beyond(columns, cho_solve((L, True), loads[held:]), loads[held:])
    constraint = -cho_solve((L, True), K[held:, :held])
    return np.block([
        [np.eye(held), np.zeros((held, modes + static.shape[1]))], [constraint, columns[:, ::-1], static],
    ])  # fmt: skip


def _beyond(modes: Real, responses: Real, loads: Real) -> Real:
    """What of the responses to loads is orthogonal to the modes, which have unit stiffness, as orthonormal columns."""
    energy = np.einsum("il,il->l", responses, loads)
    size = np.sqrt(np.where(energy > 0.0, energy, 1.0))
    responses, loads = responses[:, energy > 0.0] / size[energy > 0.0], loads[:, energy > 0.0] / size[energy > 0.0]
    share = modes.T @ loads
    values, vectors = np.linalg.eigh(responses.T @ loads - share.T @ share)
    kept = values > SPANNED
    return (responses - modes @ share) @ (vectors[:, kept] / np.sqrt(values[kept]))


def all_modes(element: SuperElement, face: Interface, boundary: Boundary, count: int) -> tuple[Real, Real]:
    """Frequencies (m,) Hz, ascending, and modes (N,m) of the whole structure, at most `count`: with the first node of
    the interface held, or free."""
    T = face.T[:, 6:] if boundary == "clamped-free" else face.T
    K, M = (np.asarray(T.T @ (T.T @ matrix).T) for matrix in (element.K, element.M))
    if boundary == "free-free":
        K, M = _without_rigid(K, M, T.T @ (element.M @ _unit_rigid(element)))
    L = _factor(K, "K lets the structure move without force beyond its six rigid-body motions")
    compliance, columns = _highest(M, L, min(count, len(K)))
    there = np.flatnonzero(compliance > MASSLESS * compliance[-1])[::-1]
    return 1.0 / (2.0 * np.pi * np.sqrt(compliance[there])), np.asarray(T @ columns[:, there])


def _unit_rigid(element: SuperElement) -> Real:
    """The rigid-body motions (N,6), orthonormal by M. SuperElementError if one has no inertia."""
    from scipy.linalg import solve_triangular

    rigid = element.rigid(np.zeros(3))
    try:
        return np.asarray(solve_triangular(np.linalg.cholesky(rigid.T @ element.M @ rigid), rigid.T, lower=True).T)
    except np.linalg.LinAlgError:
        raise SuperElementError(
            "M gives a rigid-body motion no inertia, so that there is no mean frame: clamp the first interface node"
        ) from None


def _without_rigid(k: Real, m: Real, held: Real) -> tuple[Real, Real]:
    """k that holds the rigid-body motions, and m without their inertia; held = T' M R with orthonormal R."""
    return k + np.trace(k) / np.trace(held @ held.T) * held @ held.T, m - held @ held.T


def _modes(K: Real, M: Real, T: Real, R: Real | None) -> tuple[Real, Real]:
    """Frequencies (m,) Hz, ascending, and orthonormal modes (N,m) of the motions T without the rigid ones R (N,6).

    With M-orthonormal R, K + s M R R' M holds the rigid-body motions and M - M R R' M takes their inertia away.
    """
    from scipy.linalg import eigh

    energy, terms = np.einsum("im,ij,jm->m", T, K, T, optimize=True), np.diag(K) @ T**2
    T = T / np.sqrt(np.where(energy > LOOSE * terms, energy, terms))  # rigid-body motions have no energy
    k, m = T.T @ K @ T, T.T @ M @ T
    elastic = m
    if R is not None:
        k, elastic = _without_rigid(k, m, T.T @ (M @ R))
    _factor(k, "K lets the structure move without force beyond its six rigid-body motions")
    compliance, columns = eigh(0.5 * (elastic + elastic.T), 0.5 * (k + k.T))
    kept = np.flatnonzero(compliance > MASSLESS * compliance[-1])[::-1]
    kept = kept if R is None else kept[: len(compliance) - 6]
    V = T @ (columns[:, kept] / np.sqrt(np.einsum("im,ij,jm->m", columns[:, kept], m, columns[:, kept], optimize=True)))
    if R is not None:  # their share in the columns is rounding
        V = V - R @ (R.T @ (M @ V))
    largest = V[np.argmax(np.abs(V), axis=0), np.arange(V.shape[1])]
    return 1.0 / (2.0 * np.pi * np.sqrt(compliance[kept])), V * np.sign(largest)


def _factor(K: Real, what: str) -> Real:
    """Cholesky's lower factor; SuperElementError if a pivot of K, scaled to unit diagonal, is zero to round-off."""
    size = np.sqrt(np.maximum(np.diag(K), np.finfo(float).tiny))
    try:
        L = np.linalg.cholesky(K / np.outer(size, size))
    except np.linalg.LinAlgError:
        L = np.zeros((1, 1))
    if np.min(np.diag(L)) ** 2 < LOOSE:
        raise SuperElementError(f"{what}: join the part, or remove displacements without stiffness from K and M")
    return size[:, None] * L


def _highest(M: Real, L: Real, count: int) -> tuple[Real, Real]:
    """The `count` largest eigenvalues, ascending, and eigenvectors of M x = value L L' x.

    By the Lanczos method if the matrix is large and `count` small, otherwise by a dense solver.
    """
    from scipy.linalg import eigh, solve_triangular
    from scipy.sparse.linalg import LinearOperator, eigsh

    n = len(M)
    if n <= DENSE or 4 * count > n:
        reduced_mass = solve_triangular(L, solve_triangular(L, M, lower=True).T, lower=True)
        values, columns = eigh(0.5 * (reduced_mass + reduced_mass.T), subset_by_index=[n - count, n - 1])
    else:

        def product(x: Real) -> Real:
            return solve_triangular(L, M @ solve_triangular(L, x, lower=True, trans=1), lower=True)

        start = np.random.default_rng(0).normal(size=n)  # fixed, so that results are reproducible
        values, columns = eigsh(LinearOperator((n, n), product), k=count, which="LA", v0=start, tol=1e-13)
        order = np.argsort(values)
        values, columns = values[order], columns[:, order]
    return values, solve_triangular(L, columns, lower=True, trans=1)


def _at_nodes(element: SuperElement, V: Real) -> Real:
    """Translations and rotations (n,6,m) of the nodes, zero for those without a row."""
    padded = np.concatenate([V, np.zeros((1, V.shape[1]))])  # index -1 selects the row of zeros
    return padded[element.place]


def displacements(element: SuperElement, shapes: Real) -> Real:
    """The inverse: displacements (N,m) of the structure from those of its nodes."""
    V = np.zeros((len(element.K), shapes.shape[2]))
    V[element.place[element.place >= 0]] = shapes[element.place >= 0]
    return V


ONE_GROUP = 1e-6
"""Relative difference of frequencies up to which modes of the structure are taken as a group, whose shapes can be any
of their combinations."""
BEYOND = 6  # modes of the structure above those that are asked for, in case a reduced one is in another order


class SideBySide(NamedTuple):
    """By mode of the body: its frequency, that of the structure's mode like it (Hz), and their MAC, from 0 to 1.

    The modal assurance criterion (a' M b)² / (a' M a · b' M b) says how alike two shapes are.
    """

    reduced: Real
    given: Real
    mac: Real


def compared(element: SuperElement, made: ReducedBody, count: int) -> SideBySide:
    """The lowest `count` modes of a body beside those of the structure with the same ties and boundary."""
    frequencies, modes = all_modes(element, made.interface, made.body.boundary, count + BEYOND)
    V = displacements(element, made.shapes)[:, :count]
    share = (V.T @ element.M @ modes) ** 2
    share /= np.outer(np.einsum("im,ij,jm->m", V, element.M, V), np.einsum("im,ij,jm->m", modes, element.M, modes))
    groups = np.abs(frequencies[:, None] - frequencies) <= ONE_GROUP * frequencies
    share = share @ groups
    best = np.argmax(share, axis=1)
    return SideBySide(made.frequencies[:count], frequencies[best], share[np.arange(len(best)), best])
