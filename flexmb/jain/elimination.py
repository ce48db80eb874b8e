"""Which bodies are reduced, by rule or by force, and the constants of Appendix B for them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Literal, get_args

import numpy as np

from flexmb.jit.strips import ROW, strip_zeros
from flexmb.levels.body import LEVELS
from flexmb.tables import arrays as a

Elimination = Literal["fastest", "explicit", "woodbury", "condensed"]

ELIMINATIONS = ("explicit", "woodbury", "condensed")  # by the numbers of flexmb.tables.arrays

WELL_CONDITIONED = 1e4  # modal masses scaled to a unit diagonal; condensing loses the square root of it
NEGLIGIBLE = 2.0**-49  # rows of a scaled root of Omega below it are rounding: 16 units

# Modes for each node from which condensing is faster, of bodies whose inertia is that of the undeformed shape and of
# those whose tables follow the deformation: measured, see `is_faster`.
AT_REST, FOLLOWING = 11, 18


def with_elimination(c: a.Constants, choice: Elimination = "fastest") -> a.Constants:
    """The constants with the variant that eliminates the modes of each body; ReducedConstants where any is reduced.

    "fastest" follows the rule of `is_faster`; the others force one variant wherever it applies (`applies`), the
    explicit one elsewhere. ValueError for a choice that does not exist.
    """
    if choice not in get_args(Elimination):
        raise ValueError(f"elimination is {choice!r}: use one of {', '.join(map(repr, get_args(Elimination)))}")
    if choice == "explicit":
        return c
    variant = a.WOODBURY if choice == "woodbury" else a.CONDENSED
    nodes = _node_ports(c)
    forced = choice != "fastest"
    reduced = [k for k in nodes if applies(c, k, variant) and (forced or is_faster(c, k, len(nodes[k])))]
    return _reduced_constants(c, reduced, nodes, variant) if reduced else c


def applies(c: a.Constants, k: int, variant: int) -> bool:
    """Whether body k may be reduced: modal masses constant and regular, nothing but its nodes adding to them.

    Not with a free wheel, which takes a rank-one part out of D_f. A hinge on a node that its own modes move adds the
    rigid inertia to D_f: it must be constant too, so that level ruthless is needed and no outboard body may sit on a
    point that does not deform. The Woodbury form is Appendix B's: of ruthless bodies. Condensed tables that are made
    anew at each evaluation are worth their cost only where modal masses are diagonal, as those of beams are.
    """
    body = c.body[k]
    free_wheel = any(
        c.speed["prescribed"][c.wheel["u_index"][i]] < 0 for i in range(body["wheel_start"], body["wheel_stop"])
    )
    if body["modes"] == 0 or free_wheel:
        return False
    at_rest = LEVELS[body["level"]].at_rest
    if body["outboard_port"] >= 0 and not (at_rest and np.all(c.body["inboard_port"][c.body["parent"] == k] >= 0)):
        return False
    constant = LEVELS[body["level"]].at_rest or (
        variant == a.CONDENSED
        and body["orthogonal"]
        and body["point_start"] == body["point_stop"]
        and body["mass_slope"] < 0
    )
    return bool(constant) and _is_regular(_Rest.of(c, k, []).M_ff)


def is_faster(c: a.Constants, k: int, nodes: int) -> bool:
    """Whether condensing body k is taken to be faster than a Cholesky factor of D_f.

    Measured (tests/benchmarks/test_elimination.py) on chains of clamped beams, one node each: ruthless ones gain from
    10 to 12 modes on, those of level full, whose tables are made anew at each evaluation, from 16 to 20. Estimated from
    operation counts, not measured: the growth of the thresholds with the nodes. A tip counts as one node: it would
    gain earlier, but not what compiling costs.
    """
    body = c.body[k]
    return bool(body["modes"] >= (AT_REST if LEVELS[body["level"]].at_rest else FOLLOWING) * max(1, nodes))


def _is_regular(M: a.Real) -> bool:
    """Positive definite and well conditioned, whatever the units of the modes."""
    size = np.sqrt(np.abs(np.diag(M)))
    if np.any(np.diag(M) <= 0.0):
        return False
    values = np.linalg.eigvalsh(M / np.outer(size, size))
    return bool(values[0] * WELL_CONDITIONED > values[-1])


def _node_ports(c: a.Constants) -> dict[int, list[int]]:
    """By flexible body, its ports that deform and carry hinges, in the order of the outboard bodies."""
    found: dict[int, list[int]] = {k: [] for k in np.flatnonzero(c.body["modes"]).tolist()}
    hinged = np.flatnonzero(c.body["inboard_port"] >= 0)
    for parent, port in zip(c.body["parent"][hinged].tolist(), c.body["inboard_port"][hinged].tolist(), strict=True):
        if parent in found:
            found[parent].append(port)
    return found


def _reduced_constants(
    c: a.Constants, reduced: list[int], nodes: dict[int, list[int]], variant: int
) -> a.ReducedConstants:
    most, m = max(len(nodes[k]) for k in reduced), c.mff.shape[2]
    size = 6 * max(most, 1)
    tables: dict[str, Any] = {
        "compliance": np.zeros((len(reduced), m, m)),
        "gain": strip_zeros((len(reduced), 1 + most, m, ROW)),
        "node": np.zeros((len(reduced), most), a.REDUCED_NODE),
        "root": np.zeros((len(reduced), size, size)),
        "rank": np.zeros(len(reduced), np.int64),
        "zeta": np.zeros((len(reduced), 21)),
    }
    body = c.body.copy()
    body["reduced"] = body["node"] = -1
    for row, k in enumerate(reduced):
        body["elimination"][k], body["reduced"][k], body["nodes"][k] = variant, row, len(nodes[k])
        body["orthogonal"][k] &= body["outboard_port"][k] < 0  # about a node that deforms, masses couple all modes
        children = np.flatnonzero((body["parent"] == k) & (body["inboard_port"] >= 0))
        body["node"][children] = np.arange(len(children))
        _fill(c, k, row, nodes[k], variant, tables)
    base = {field.name: getattr(c, field.name) for field in fields(c)} | {"body": body}
    return a.ReducedConstants(**base, **tables)


@dataclass(frozen=True)
class _Rest:
    """H_f M_m H_f' of a body at rest: modal masses (n,n), coupling (n,6); and of its nodes Pi' (n,6C), phi' (6C,6)."""

    M_ff: a.Real
    M_fr: a.Real
    Pi_t: a.Real
    phi_t: a.Real

    @classmethod
    def of(cls, c: a.Constants, k: int, ports: list[int]) -> _Rest:
        """About O. Where O sits on a node d of the body: with V = X V_O - B etadot, the congruence of (13), (17)."""
        n, hinge = c.body["modes"][k], int(c.body["outboard_port"][k])
        M_ff, M_fr, Pi_t = c.mff[k, :n, :n], c.mfr[k, :, :n].T, _shapes(c, ports, n)
        phi_t = np.vstack([np.zeros((0, 6)), *(_shift(_place(c, port)) for port in ports)])
        if hinge < 0:
            return cls(M_ff, M_fr, Pi_t, phi_t)
        X = _shift(-_place(c, hinge))
        B_t = _shapes(c, [hinge], n) @ X.T
        momentum = B_t @ _rigid_block(c.body["rigid"][k])
        across = B_t @ M_fr.T
        M_ff = M_ff - across - across.T + momentum @ B_t.T
        return cls(M_ff, (M_fr - momentum) @ X, Pi_t - B_t @ phi_t.T, phi_t @ X)


def _fill(c: a.Constants, k: int, row: int, ports: list[int], variant: int, tables: dict[str, Any]) -> None:
    """Row of body k: the constants of (B4), with the zeta = M_rf Lam M_fr and Theta they leave out; at rest."""
    from scipy.linalg import solve_triangular  # slow to import, and only bodies that are reduced need it

    n = c.body["modes"][k]
    rest = _Rest.of(c, k, ports)
    inverse = solve_triangular(np.linalg.cholesky(rest.M_ff), np.eye(n), lower=True)
    psi, ups = inverse @ rest.M_fr, inverse @ rest.Pi_t
    scale, pivoted, order = _scaled_root(ups)
    rank = len(pivoted)
    tables["root"][row, :rank, order] = (pivoted * scale[order]).T
    tables["rank"][row] = rank
    tables["zeta"][row] = _spatial(psi.T @ psi)
    theta = rest.phi_t - ups.T @ psi
    tables["node"]["port"][row, : len(ports)] = ports
    tables["node"]["theta"][row, : len(ports)] = theta.reshape(len(ports), 6, 6)
    if variant == a.WOODBURY:
        inverse, psi, ups = inverse.T @ inverse, inverse.T @ psi, inverse.T @ ups
    tables["compliance"][row, :n, :n] = inverse
    tables["gain"][row, 0, :n, :6] = psi
    tables["gain"][row, 1 : 1 + len(ports), :n, :6] = ups.reshape(n, len(ports), 6).swapaxes(0, 1)


def _scaled_root(ups: a.Real) -> tuple[a.Real, a.Real, a.Real]:
    """Rows of the triangular factor of the columns of `ups`, scaled to unit length and pivoted: scale, rows, order."""
    scale = np.linalg.norm(ups, axis=0)
    if not ups.shape[1]:
        return scale, np.zeros((0, 0)), np.zeros(0, int)
    from scipy.linalg import qr

    rows, order = qr(ups / np.where(scale > 0.0, scale, 1.0), mode="r", pivoting=True)
    rows = rows[: min(ups.shape)]
    return scale, rows[np.abs(np.diag(rows)) > np.sqrt(NEGLIGIBLE)], order


def _shapes(c: a.Constants, ports: list[int], n: int) -> a.Real:
    """Pi' (n, 6C) of the nodes at rest: angular and linear velocity by modal speed."""
    rotation, translation = np.split(c.port_mode[ports, :, :n].swapaxes(1, 2), 2, axis=2)
    linear = translation + np.cross(rotation, c.port["offset"][ports][:, None])
    return np.concatenate([rotation, linear], axis=2).swapaxes(0, 1).reshape(n, 6 * len(ports))


def _place(c: a.Constants, port: int) -> a.Real:
    return c.port["position"][port] + c.port["offset"][port]


def _rigid_block(rigid: a.Real) -> a.Real:
    """M_rr (6,6) of a body from its mass, first moment and inertia."""
    xx, yy, zz, xy, xz, yz = rigid[4:]
    skew = _shift(rigid[1:4])[:3, 3:] - _shift(rigid[1:4])[3:, :3]
    return np.block([[np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), skew], [skew.T, rigid[0] * np.eye(3)]])


def _shift(r: a.Real) -> a.Real:
    """phi' (6,6): velocity at r from the origin by that of the origin."""
    x, y, z = r
    out = np.eye(6)
    out[3:, :3] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    return out


def _spatial(P: a.Real) -> a.Real:
    """The 21 numbers of a symmetric (6,6) matrix, as in flexmb.spatial.inertia."""
    six = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    A, C = [P[i, j] for i, j in six], [P[3 + i, 3 + j] for i, j in six]
    return np.array([*A, *P[:3, 3:].ravel(), *C])
