"""Choice of the bodies whose modes are condensed or eliminated in Woodbury form, and their constants of Appendix B.

Such a body is called *reduced*: the effect of its outboard bodies is expressed at its nodes (`flexmb.jain.reduced`).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Literal, get_args

import numpy as np

from flexmb.jit.strips import ROW, strip_zeros
from flexmb.levels.body import LEVELS
from flexmb.tables import arrays as a

Elimination = Literal["fastest", "explicit", "woodbury", "condensed"]

ELIMINATIONS = ("explicit", "woodbury", "condensed")  # in the order of EXPLICIT, WOODBURY, CONDENSED in tables/arrays

# Largest condition of the modal masses, scaled to a unit diagonal, with which a body is reduced. Condensing multiplies
# rounding errors by at most the square root of it, the condition of L in M_ff = L L': two digits.
WELL_CONDITIONED = 1e4
NEGLIGIBLE = 2.0**-49  # 16 unit roundoffs: pivots of Omega, scaled to a unit diagonal, below this are rounding errors

# Number of modes for each node from which condensing is faster than the explicit form: of bodies with constant tables,
# and of bodies whose tables are recomputed because they follow the deformation. Measured, see `is_faster`.
MODES_WITH_CONSTANT_TABLES, MODES_WITH_CHANGING_TABLES = 11, 18


def with_elimination(c: a.Constants, choice: Elimination = "fastest") -> a.Constants:
    """The constants with a variant of the elimination for each body; ReducedConstants if any body is reduced.

    "fastest" condenses bodies by the rule of `is_faster`. The other choices force one variant wherever it applies
    (`applies`), and the explicit one elsewhere. ValueError for any other choice.
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
    """Whether body k may be reduced: D_f must be constant, well-conditioned modal masses plus loads at its nodes.

    A free wheel subtracts a rank-one term from D_f, so that its body is not reduced. If the body's own hinge sits on a
    node that its modes move, the rigid inertia is part of D_f and must be constant too: the level must be ruthless, and
    no outboard body may be hinged to a point that does not deform. The Woodbury form of Appendix B is for ruthless
    bodies. Bodies of other levels recompute their condensed tables at each evaluation; this is cheaper than factorising
    D_f only if their modal masses are diagonal, as those of beams are.
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
    """Whether condensing body k is expected to be faster than factorising D_f.

    Measured (tests/benchmarks/test_elimination.py) on chains of clamped beams with one node each: condensing becomes
    faster between 10 and 12 modes at level ruthless, and between 16 and 20 at level full, which recomputes its tables
    at each evaluation. That the thresholds are proportional to the number of nodes is estimated from operation counts,
    not measured. A tip counts as one node: it would gain from fewer modes, but less than the compilation costs.
    """
    body = c.body[k]
    constant = LEVELS[body["level"]].at_rest
    modes = MODES_WITH_CONSTANT_TABLES if constant else MODES_WITH_CHANGING_TABLES
    return bool(body["modes"] >= modes * max(1, nodes))


def _is_regular(M: a.Real) -> bool:
    """Whether M is positive definite and well conditioned, in any units of the modes."""
    size = np.sqrt(np.abs(np.diag(M)))
    if np.any(np.diag(M) <= 0.0):
        return False
    values = np.linalg.eigvalsh(M / np.outer(size, size))
    return bool(values[0] * WELL_CONDITIONED > values[-1])


def _node_ports(c: a.Constants) -> dict[int, list[int]]:
    """For each flexible body, its deforming ports that carry hinges, in the order of the outboard bodies."""
    ports: dict[int, list[int]] = {k: [] for k in np.flatnonzero(c.body["modes"]).tolist()}
    hinged = np.flatnonzero(c.body["inboard_port"] >= 0)
    for parent, port in zip(c.body["parent"][hinged].tolist(), c.body["inboard_port"][hinged].tolist(), strict=True):
        if parent in ports:
            ports[parent].append(port)
    return ports


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
        body["orthogonal"][k] &= body["outboard_port"][k] < 0  # referred to a deforming node, M_ff couples all modes
        children = np.flatnonzero((body["parent"] == k) & (body["inboard_port"] >= 0))
        body["node"][children] = np.arange(len(children))
        _fill(c, k, row, nodes[k], variant, tables)
    base = {field.name: getattr(c, field.name) for field in fields(c)} | {"body": body}
    return a.ReducedConstants(**base, **tables)


@dataclass(frozen=True)
class _Rest:
    """A body at rest: H_f M_m H_f', modal masses (n,n) and coupling (n,6); of its C nodes Pi' (n,6C), phi' (6C,6)."""

    M_ff: a.Real
    M_fr: a.Real
    Pi_t: a.Real
    phi_t: a.Real

    @classmethod
    def of(cls, c: a.Constants, k: int, ports: list[int]) -> _Rest:
        """All of it about O. Where O sits on a node d of the body, V = X V_O - B etadot: the congruence (13), (17)."""
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
    """Fill the row of body k: at rest, the constants of (B4), and zeta = M_rf Lam M_fr and Theta, which (B4) lacks.

    Condensed bodies store L^-1, L^-1 M_fr and L^-1 Pi' with M_ff = L L', Woodbury bodies Lam = M_ff^-1, Psi and Ups.
    """
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
    """Pivoted QR factorisation of `ups` with columns scaled to unit length: scale, rows of R, order of the columns.

    R' R is the scaled Omega. Rows whose diagonal is below the root of NEGLIGIBLE are left out.
    """
    scale = np.linalg.norm(ups, axis=0)
    if not ups.shape[1]:
        return scale, np.zeros((0, 0)), np.zeros(0, int)
    from scipy.linalg import qr

    rows, order = qr(ups / np.where(scale > 0.0, scale, 1.0), mode="r", pivoting=True)
    rows = rows[: min(ups.shape)]
    return scale, rows[np.abs(np.diag(rows)) > np.sqrt(NEGLIGIBLE)], order


def _shapes(c: a.Constants, ports: list[int], n: int) -> a.Real:
    """Pi' (n, 6C) of the nodes at rest: their angular and linear velocities at unit modal speeds."""
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
    """phi' (6,6): velocity [angular; linear] at r from that at the origin."""
    x, y, z = r
    out = np.eye(6)
    out[3:, :3] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    return out


def _spatial(P: a.Real) -> a.Real:
    """A symmetric (6,6) matrix as the 21 numbers of `flexmb.spatial.inertia`."""
    six = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    A, C = [P[i, j] for i, j in six], [P[3 + i, 3 + j] for i, j in six]
    return np.array([*A, *P[:3, 3:].ravel(), *C])
