"""The model of a beam of level "exact": its strain modes, inertia points and nodes, and how its sections move.

The space of the strains is that of the polynomials; the modes are those of the linear beam in it, clamped at the root,
so that they have frequencies. Inertia sits at the Gauss points.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import msgspec
import numpy as np

from flexmb.modal.eigenproblem import eigenpairs, refined
from flexmb.modal.flexible_model import FlexibleModel, FlexibleNode, undeforming_node
from flexmb.modal.following import followed
from flexmb.modal.reduce import BeamModes, damping_matrix, groups, tip_signs
from flexmb.modal.section import section_table
from flexmb.modal.stations import Lump, lumps, section_masses
from flexmb.modal.strain_field import Hung, StrainField, gauss_weights, hung, strain_field, strain_stiffness
from flexmb.scene.bodies import IDENTITY, BeamBody, Quaternion
from flexmb.scene.collocation import gauss_rule
from flexmb.scene.pieces import edges as piece_edges
from flexmb.scene.pieces import piece_count
from flexmb.scene.quaternions import cross_matrix, rotation_matrix
from flexmb.scene.rest_curve import rest_sections
from flexmb.scene.strains import Strain, points_of_piece, polynomials
from flexmb.typing import Index, Real

# Of modal masses that are scaled to a unit diagonal: below it an eigenvalue is zero but for rounding.
_MASSLESS = 1e-13
# Compliances below this share of the largest have lost digits to it, and are found by themselves.
_GRADE = 1e-8
# Of scalar products of modes of unit mass: below it they are good whatever they were before.
_GOOD = 1e-12
# Elements of stiffness and masses that are scaled to a unit diagonal: below it they are rounding errors of their sums.
_UNCOUPLED = 1e-12


def exact_model(body: BeamBody, like: BeamBody | None = None) -> FlexibleModel:
    """The model in the frame of the root; unit modal masses at rest, stiffness diag(omega^2).

    `like`: see `flexmb.modal.flexible.flexible_model`. Raises ValueError for modes without inertia.
    """
    if like is not None:  # whose points it has: default ones depend on lengths and curvatures
        body = msgspec.structs.replace(body, modes=msgspec.structs.replace(body.modes, points=points_of_piece(like)))
    try:
        field, points, M = _polynomial_beam(body, _nodes_at(body), None if like is None else _hung(like))
        modes = _modes(body, field, _stiffness(body), M)
        if like is not None:
            modes = followed(modes, M, _reference(like))
        damping = damping_matrix(modes.roots, body.modes.damping_ratio) + body.modes.viscosity_s * modes.stiffness
    except ValueError as error:
        raise ValueError(f"beam '{body.name}': {error}") from error
    field = field.with_modes(modes.columns)
    turn, shift = field.shapes()
    at = points.section
    return FlexibleModel(
        mass=points.mass,
        position=field.position[at],
        com_offset=points.com_offset,
        inertia=points.inertia,
        translation=shift[at],
        rotation=turn[at],
        stiffness=modes.stiffness,
        damping=damping,
        nodes=_nodes(body, field, turn, shift),
        clamped=True,
        field=field,
        section=at,
    )


def cut_beam(body: BeamBody, x: Real) -> tuple[StrainField, BeamPoints]:
    """The sections of the beam, of which those at x (n,) m are the last, with the strain modes of `exact_model`; its
    inertia points."""
    field, points, M = _polynomial_beam(body, x)
    return field.with_modes(_modes(body, field, _stiffness(body), M).columns), points


def field_of_points(body: BeamBody, points: int, x: Real) -> StrainField:
    """The sections of the beam with another number of points along each of its pieces, of which those at x (n,) m are
    the last, with the strain modes of `exact_model`."""
    modes = msgspec.structs.replace(body.modes, points=points)
    return strain_field(msgspec.structs.replace(body, modes=modes), x).with_modes(_reference(body).columns)


class BeamPoints:
    """Inertia points: mass (n,), com_offset (n,3) and inertia (n,3,3) about it in the axes of the root, at rest; the
    number of the section that each is fixed to (n,). The first are those at the Gauss points."""

    def __init__(self, mass: Real, com_offset: Real, inertia: Real, section: Index) -> None:
        self.mass, self.com_offset, self.inertia, self.section = mass, com_offset, inertia, section


@lru_cache(maxsize=8)
def _reference(body: BeamBody) -> BeamModes:
    field, _, M = _polynomial_beam(body, np.zeros(0))
    return _modes(body, field, _stiffness(body), M)


def _hung(body: BeamBody) -> Hung:
    """How the sections at lumps and nodes turn."""
    return hung(body, np.concatenate([_lumps_at(lumps(body)), _nodes_at(body)]))


def _lumps_at(found: tuple[Lump, ...]) -> Real:
    return np.array([lump.x for lump in found])


def _polynomial_beam(body: BeamBody, others: Real, like: Hung | None = None) -> tuple[StrainField, BeamPoints, Real]:
    """Sections at Gauss points, lumps, then at `others` (n,) m; inertia points; modal masses (m,m) of the polynomials
    at rest. like: how the lumps and others of a beam with slightly other numbers turn."""
    rigid_lumps = lumps(body)
    most, points = max(polynomials(body).values(), default=0), points_of_piece(body)
    if points <= most:
        raise ValueError(
            f"{points} points for {most} polynomials of one strain along a piece leave motions without inertia: use "
            f"{most + 1} points at least, or fewer polynomials"
        )
    places = np.concatenate([_lumps_at(rigid_lumps), others])
    field = strain_field(body, places, None if like is None else hung(body, places).following(like))
    x, weight = gauss_weights(body)
    table = section_table(body)
    twist = weight * table.at(table.twist, x)
    own = section_masses(x, weight[:, None, None] * table.at(table.inertia, x), twist, body, table.plain)
    inertia = own.inertia.copy()
    inertia[:, 0, 0] += own.twist  # here the sections themselves have it, and turn with it
    _, rotation = rest_sections(body, x)
    at_lumps = len(field.x) - len(places) + np.arange(len(rigid_lumps))
    _, turned = rest_sections(body, _lumps_at(rigid_lumps))
    found = BeamPoints(
        np.concatenate([own.mass, [lump.mass for lump in rigid_lumps]]),
        np.concatenate(
            [
                np.einsum("pab,pb->pa", rotation, own.com),
                *((R @ lump.com)[None] for R, lump in zip(turned, rigid_lumps, strict=True)),
            ]
        ),
        np.concatenate(
            [
                rotation @ inertia @ np.swapaxes(rotation, 1, 2),
                *((R @ lump.inertia @ R.T)[None] for R, lump in zip(turned, rigid_lumps, strict=True)),
            ]
        ),
        np.concatenate([field.gauss, at_lumps]),
    )
    return field, found, _modal_masses(field, found)


def _modal_masses(field: StrainField, points: BeamPoints) -> Real:
    """(m,m) at rest: the sum of m U'U + W' J W, with U of the mass centres and W of the points."""
    turn, shift = field.shapes()
    W = turn[points.section]
    U = shift[points.section] - cross_matrix(points.com_offset) @ W
    masses = np.einsum("p,pam,pan->mn", points.mass, U, U)
    return np.asarray(masses + np.einsum("pam,pab,pbn->mn", W, points.inertia, W))


def _stiffness(body: BeamBody) -> Real:
    """K (m,m) of the polynomials, by Gauss points that are exact for sections that vary linearly."""
    table = section_table(body)
    edges = np.unique(np.concatenate([piece_edges(body), table.x]))
    edges = edges[edges <= body.length_m]
    xi, w = gauss_rule(max(polynomials(body).values()) + 1)
    half = np.diff(edges) / 2.0
    x = (edges[:-1, None] + half[:, None] * (1.0 + xi)).ravel()
    return strain_stiffness(body, table.at(table.stiffness, x), x, (half[:, None] * w).ravel())


def _modes(body: BeamBody, field: StrainField, K: Real, M: Real) -> BeamModes:
    """The modes of K and M, ascending, with unit modal masses; signs by the last Gauss point (`tip_signs`).

    Strains that neither matrix couples are solved separately, so that modes of one frequency each have their own.
    """
    strain = np.repeat(*np.array([(i, n * piece_count(body)) for i, n in enumerate(polynomials(body).values())]).T)
    columns, compliance = np.zeros_like(K), np.zeros(len(K))
    sets = [np.ix_(own, own) for own in _uncoupled(strain, K, M)]
    for own in sets:
        _refuse_massless(M[own], strain[own[1][0]], list(polynomials(body)))
        compliance[own[1][0]], columns[own] = _graded(M[own], K[own])
    columns /= np.sqrt(compliance)
    squares = np.zeros(len(K))
    for own in sets:
        squares[own[1][0]], columns[own] = _polished(K[own], M[own], columns[own])
    # Frequencies that agree to nine digits count as equal, so that the order of the strains decides.
    order = np.lexsort((strain, [float(f"{square:.8e}") for square in squares]))
    columns, frequencies = columns[:, order], np.sqrt(squares[order])
    turn, shift = (shape @ columns for shape in (shape[field.gauss[-1]] for shape in field.shapes()))
    return BeamModes(columns * tip_signs(shift, body.length_m * turn), frequencies)


def _refuse_massless(M: Real, strain: Index, names: list[Strain]) -> None:
    """ValueError for modal masses M (m,m) of coupled polynomials, each of one `strain` (m,), that are singular.

    The masses are scaled first, so that soft strains and stiff ones, short and long ones, count alike.
    """
    size = np.sqrt(np.diag(M))
    lowest, still = np.linalg.eigh(M / np.where(size > 0.0, size, 1.0) / np.where(size > 0.0, size, 1.0)[:, None])
    if not lowest[0] > _MASSLESS * lowest[-1]:
        found = " and ".join(names[i] for i in np.unique(strain[np.abs(still[:, 0]) > 0.1]))
        raise ValueError(
            f"its {found} can be combined so that no inertia moves: use fewer polynomials of one of them, or give the "
            'sections their rotary inertia and points = "section"'
        )


def _graded(M: Real, K: Real) -> tuple[Real, Real]:
    """Values (m,) and columns (m,m) of M x = value K x, X'K X = 1, each with digits of its own: a slender beam is
    softer in bending than in shear by the fourth power of its slenderness."""
    values, columns = eigenpairs(M, K)
    lost = values < _GRADE * values.max()
    if not np.any(lost):
        return values, columns
    rest = columns[:, lost]
    own, turn = _graded(rest.T @ M @ rest, rest.T @ K @ rest)
    return np.concatenate([own, values[~lost]]), np.hstack([rest @ turn, columns[:, ~lost]])


def _polished(K: Real, M: Real, X: Real) -> tuple[Real, Real]:
    """`refined` eigenpairs, unless the columns are further from X'M X = 1 then: where masses are all but singular,
    rounding errors of modes of nearly one frequency would turn them into each other."""
    values, better = refined(K, M, X)
    lack, then = (float(np.max(np.abs(np.eye(len(M)) - transform.T @ M @ transform))) for transform in (X, better))
    return (values, better) if then <= max(lack, _GOOD) else (np.diag(X.T @ K @ X) / np.diag(X.T @ M @ X), X)


def _uncoupled(strain: Index, K: Real, M: Real) -> list[Index]:
    """The coordinates of each set of strains that K and M couple by more than rounding; `strain` (m,): that of each."""
    sizes = [np.sqrt(np.outer(np.diag(matrix), np.diag(matrix))) for matrix in (K, M)]
    scaled = [np.abs(matrix) / np.where(size > 0.0, size, 1.0) for matrix, size in zip((K, M), sizes, strict=True)]
    names = np.unique(strain)
    coupled = [
        [max(np.max(matrix[np.ix_(strain == a, strain == b)]) for matrix in scaled) for b in names] for a in names
    ]
    label = groups(np.array(coupled) > _UNCOUPLED)
    return [np.flatnonzero(np.isin(strain, names[np.array(label) == part])) for part in dict.fromkeys(label)]


def _nodes_at(body: BeamBody) -> Real:
    """The places (n,) m of `_listed`."""
    return np.array([x for _, x, _ in _listed(body)])


def _listed(body: BeamBody) -> list[tuple[str, float, Quaternion]]:
    """Tip and listed nodes, which the modes move: name, place, quaternion in the section."""
    nodes = [("tip", body.length_m, IDENTITY), *((node.name, node.x_m, node.quaternion) for node in body.nodes)]
    for name, x, _ in nodes:
        if not 0.0 <= x <= body.length_m:
            raise ValueError(f"node '{name}' at x = {x:g} m is not on [0, {body.length_m:g}] m")
    return nodes


def _nodes(body: BeamBody, field: StrainField, turn: Real, shift: Real) -> dict[str, FlexibleNode]:
    """Nodes by name: origin and root, which do not deform, tip and the listed ones, which are the last sections."""
    rigid = undeforming_node(field.mode_count)
    nodes = {"origin": rigid, "root": replace(rigid)}
    listed = _listed(body)
    first = len(field.x) - len(listed)
    _, rotation = rest_sections(body, field.x[first:])
    for i, (name, _, quaternion) in enumerate(listed):
        j = first + i
        nodes[name] = FlexibleNode(
            field.position[j], rotation[i] @ rotation_matrix(quaternion), shift[j], turn[j], section=j
        )
    return nodes
