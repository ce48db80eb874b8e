"""What the print of Jain & Rodriguez gets wrong, with the figures of docs/errata.md: trees of free-free bodies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexmb
from flexmb.jain.elements import NodalBody, phi, rate, spatial_inertia, value
from flexmb.jain.operators import Operators, SpatialOperators
from tests import trees
from tests.bounds import gamma, relative

Array = np.ndarray
SEEDS = range(3)
RECIPE = replace(
    trees.CONSERVATIVE, bodies=4, carriers=("floating",), hinges=("revolute", "spherical", "universal", "cylindrical"),
    wheels=0, point_masses=0,
)  # fmt: skip


def system(seed: int, **changes: object) -> flexmb.System:
    return flexmb.compile(trees.random_scene(seed, replace(RECIPE, **changes)))


def configuration(found: flexmb.System):
    state = found.initial_state
    return SpatialOperators(found.scene).configuration(state.t, state.q, state.u)


def operators(found: flexmb.System) -> Operators:
    return found.operators(found.initial_state)


def distance_of_mass_matrix(o: Operators, H: Array) -> float:
    """Of H Phi M_m Phi' H' from the true one, Frobenius norms."""
    M = H @ o.Phi @ o.M_m @ o.Phi.T @ H.T
    return float(np.linalg.norm(M - o.M) / np.linalg.norm(o.M))


@pytest.mark.parametrize(("seed", "figure"), list(enumerate((1.846, 1.328, 2.255))))
def test_plus_in_the_joint_map(seed, figure):
    """(13) as scanned, +[Pi_F]' in the upper right block, against the minus of (17)."""
    o = operators(system(seed))
    H = o.H.copy()
    for rows, columns in zip(o.rows, o.columns, strict=True):
        modes = rows[: columns.stop - columns.start - 6]
        H[modes, columns.stop - 6 : columns.stop] *= -1.0
    assert distance_of_mass_matrix(o, H) == pytest.approx(figure, rel=0.01)


@pytest.mark.parametrize(("seed", "figure"), list(enumerate((0.178, 0.170, 0.169))))
def test_joint_map_shifted_twice(seed, figure):
    """(17): H_F phi(O_k, k), where H_F is H phi(O_k, k) already."""
    found = system(seed)
    o, now = operators(found), configuration(found)
    H = o.H.copy()
    for k, (rows, columns) in enumerate(zip(o.rows, o.columns, strict=True)):
        hinge, rigid = rows[columns.stop - columns.start - 6 :], slice(columns.stop - 6, columns.stop)
        H[hinge, rigid] = H[hinge, rigid] @ phi(value(now.frame(k)[0] - now.hinge_point(k)))
    assert distance_of_mass_matrix(o, H) == pytest.approx(figure, rel=0.01)


def test_elastic_forces_belong_into_the_generalised_forces():
    """(42), (43): at rest and without weight C is K eta, which the line for T leaves out."""
    found = system(0, grounded=False)
    state = found.state(found.initial_state.q, np.zeros(found.nu))
    o = found.operators(state)
    elastic = o.H @ (o.K_m @ o.deformation)
    assert np.max(np.abs(o.C - elastic)) <= gamma(len(o.M_m)) * np.max(np.abs(elastic))
    assert np.max(np.abs(elastic)) > 0.0
    # K_m acts on [eta; 0]: on modes and body frames, of which theta counts none
    assert len(o.deformation) == len(o.K_m) != len(o.M)


@pytest.mark.parametrize("seed", SEEDS)
def test_which_block_does_not_depend_on_the_deformation(seed):
    """Below (23): of particles it is the ff block, not the fr block; where inertias turn it is none."""
    found = system(seed)
    now = configuration(found)
    state = found.initial_state
    bodies = SpatialOperators(found.scene)
    q = state.q.copy()
    q[found.coordinate("b0.modes")] = 0.0
    rest = bodies.configuration(state.t, q, state.u)
    m = 3

    def change(particles: bool) -> tuple[float, float]:
        """Of the ff block and of the fr block in body axes, relative, by the deformation."""
        blocks = []
        for configuration in (now, rest):
            body, R = configuration.nodal_body(0), value(configuration.frame(0)[1])
            if particles:
                body = as_particles(body)
            M = body.M_m
            blocks.append((M[:m, :m], np.hstack([M[:m, m : m + 3] @ R, M[:m, m + 3 :] @ R])))
        (ff, fr), (ff0, fr0) = blocks
        return relative(ff, ff0), relative(fr, fr0)

    ff, fr = change(particles=True)
    assert ff <= gamma(100)
    assert fr > 0.01
    assert min(change(particles=False)) > 1e-3


def as_particles(body: NodalBody) -> NodalBody:
    """The same masses at their nodes, without inertia of their own."""
    mass = value(body.M_s)[:, 5, 5]
    none = np.zeros_like(body.p)
    return replace(body, M_s=spatial_inertia(mass, np.zeros((len(mass), 3, 3)), none), p=none)


def power_from_nowhere(body: NodalBody, V_m: Array) -> float:
    """V_m' b_m - 1/2 V_m' (dM_m/dt) V_m in units of the power of the forces at the nodes."""
    M_rate = rate(np.einsum("pai,pab,pbj->ij", body.A, body.M_s, body.A))
    b = body.b_m(V_m)
    return float((V_m @ b - 0.5 * V_m @ M_rate @ V_m) / (np.abs(V_m) @ np.abs(b)))


@pytest.mark.parametrize(("seed", "figure"), list(enumerate((0.0365, 0.0192, 0.0211))))
def test_inertia_that_does_not_turn_with_its_node(seed, figure):
    """(31): tensors that are constant in the body's axes, with w of the node in w x J w, make power from nowhere."""
    found = system(seed)
    o, now = operators(found), configuration(found)
    body, V_m = now.nodal_body(0), o.V_m[o.columns[0]]
    assert abs(power_from_nowhere(body, V_m)) <= gamma(100)
    member = now.tree.members[0]
    R = now.frame(0)[1]
    p = member.model.com_offset @ R.T
    constant = spatial_inertia(member.model.mass, R @ member.model.inertia @ R.T, p)
    defect = power_from_nowhere(replace(body, M_s=constant, p=p), V_m)
    assert abs(defect) == pytest.approx(figure, rel=0.01)


@pytest.mark.parametrize("seed", SEEDS)
def test_gamma_has_no_inverse(seed):
    """(B3): Gamma(k) has rank 6 - n_r(k-1) at most, and is 0 at a tip; the inverse of D_f exists without its own."""
    found = system(seed, levels=("ruthless",), branching=False)
    o, now = operators(found), configuration(found)
    tip = len(o.bodies) - 1
    for k in range(len(o.bodies)):
        columns, m = o.columns[k], 3
        M_m = o.M_m[columns, columns]
        H_f = o.H[o.rows[k][:m], columns]
        if k == tip:
            gamma_k, A = np.zeros((6, 6)), np.zeros((m + 6, 6))
        else:
            child = o.columns[k + 1]
            P_plus = (o.tau_bar @ o.P)[child, child][-6:, -6:]
            t, A = (value(x) for x in now.transmission(k, now.tree.members[k + 1].inboard))
            shift = phi(value(now.frame(k + 1)[0]) - t)
            gamma_k = shift @ P_plus @ shift.T
        n_r = len(o.rows[k + 1]) - m if k < tip else 6
        singular = np.linalg.svd(gamma_k, compute_uv=False)
        assert np.all(singular[6 - n_r :] <= gamma(1000) * max(singular[0], 1.0))
        Lambda = np.linalg.inv(H_f @ M_m @ H_f.T)
        zeta = H_f @ A
        Upsilon = Lambda @ zeta
        Omega = zeta.T @ Upsilon
        inverse = Lambda - Upsilon @ np.linalg.solve(np.eye(6) + gamma_k @ Omega, gamma_k @ Upsilon.T)
        D_f = H_f @ o.P[columns, columns] @ H_f.T
        assert np.max(np.abs(inverse @ D_f - np.eye(m))) <= gamma(1000) * np.linalg.cond(D_f)
