"""What the paper says of its operators beside the lemmas: each body as two, hinges off their nodes, free-free modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexmb
from flexmb.jain.elements import phi, value
from flexmb.jain.operators import Operators
from flexmb.modal.flexible import flexible_model
from flexmb.scene.shapes import beam_section
from flexmb.typing import Real
from tests import trees
from tests.bounds import gamma

SEEDS = range(3)
RECIPE = replace(trees.EVERY_LEVEL, bodies=6, deformation=0.03, carriers=("modal", "floating"))


def random_system(seed: int) -> flexmb.System:
    return flexmb.compile(trees.random_scene(seed, RECIPE))


def as_two(o: Operators, modes_outboard: bool = True) -> Operators:
    """Every body as two (59), (60): k' at 2k and k at 2k + 1, Phi(k', k) = 1; all mass at k, the outboard one.

    `modes_outboard`: the hinge moves k' and the modes k. Otherwise the modes move k' and the hinge k, as in (61).
    """
    sizes = np.repeat([at.stop - at.start for at in o.columns], 2)
    ends = np.cumsum([0, *sizes])
    columns = tuple(slice(int(a), int(b)) for a, b in zip(ends[:-1], ends[1:], strict=True))
    nbar = int(ends[-1])
    E_Phi, M_m, K_m = np.zeros((nbar, nbar)), np.zeros((nbar, nbar)), np.zeros((nbar, nbar))
    H, a_m, b_m, deformation = np.zeros((len(o.H), nbar)), np.zeros(nbar), np.zeros(nbar), np.zeros(nbar)
    parent, rows = [], []
    for k, at in enumerate(o.columns):
        inner, outer, p = columns[2 * k], columns[2 * k + 1], o.parent[k]
        modes, hinge = np.split(o.rows[k], [at.stop - at.start - 6])
        parent += [2 * p + 1 if p >= 0 else -1, 2 * k]
        rows += [hinge, modes] if modes_outboard else [modes, hinge]
        for body, speeds in zip((inner, outer), rows[-2:], strict=True):
            H[speeds, body] = o.H[speeds, at]
        if p >= 0:
            E_Phi[columns[2 * p + 1], inner] = o.E_Phi[o.columns[p], at]
        E_Phi[inner, outer] = np.eye(at.stop - at.start)
        M_m[outer, outer], K_m[outer, outer] = o.M_m[at, at], o.K_m[at, at]
        a_m[inner], b_m[outer], deformation[outer] = o.a_m[at], o.b_m[at], o.deformation[at]
    names = tuple(name + part for name in o.bodies for part in ("'", ""))
    V_m = np.linalg.solve(np.eye(nbar) - E_Phi.T, H.T @ o.chi)
    return Operators(
        names, tuple(parent), columns, tuple(rows), E_Phi, H, M_m, a_m, b_m, K_m, deformation, o.J, o.chi, V_m
    )


def close(a: Real, b: Real, n: int, size: float) -> bool:
    return bool(np.max(np.abs(a - b), initial=0.0) <= gamma(n) * size)


@pytest.mark.parametrize("seed", SEEDS)
def test_each_body_as_two(seed):
    """(59)-(61): the same equations of motion from operators of twice the order."""
    system = random_system(seed)
    o = system.operators(system.initial_state)
    two = as_two(o)
    n = len(two.M_m)
    for k, at in enumerate(o.columns):
        assert close(two.V_m[two.columns[2 * k + 1]], o.V_m[at], n, np.max(np.abs(o.V_m)))
    assert close(two.M, o.M, n, np.max(np.abs(o.M)))
    assert close(two.C, o.C, n, np.max(np.abs(o.C)))
    assert close(two.innovations @ two.D @ two.innovations.T, o.M, n, np.max(np.abs(o.M)))
    T = np.random.default_rng(seed).normal(size=len(o.M))
    x, y = two.accelerations(T), o.accelerations(T)
    assert close(o.M @ x, o.M @ y, 7 * n, np.linalg.norm(o.M, np.inf) * np.max(np.abs(y)) + np.max(np.abs(o.C)))


@pytest.mark.parametrize("seed", SEEDS)
def test_articulated_quantities_of_modes_and_hinge(seed):
    """(62), (63): those of the two bodies; the block structure of (62) leaves P_R, D_R, G_R of the second."""
    system = random_system(seed)
    o = system.operators(system.initial_state)
    two = as_two(o)
    for k, at in enumerate(o.columns):
        m = at.stop - at.start - 6
        modes, hinge = np.split(o.rows[k], [m])
        P, H_f, H_F = o.P[at, at], o.H[modes, at], o.H[hinge, at][:, m:]
        inner, outer = two.columns[2 * k], two.columns[2 * k + 1]
        size = len(two.M_m), np.max(np.abs(P)) * (1.0 + np.max(np.abs(H_f), initial=0.0)) ** 2
        assert close(two.P[outer, outer], P, *size)
        D_f, mu = H_f @ P @ H_f.T, P[m:] @ H_f.T
        assert close(two.D[np.ix_(modes, modes)], D_f, *size)
        g = np.linalg.solve(D_f, mu.T).T
        assert close(two.G[outer, modes][m:] @ D_f, mu, *size)
        P_R = P[m:, m:] - g @ mu.T
        assert close(two.P[inner, inner][m:, m:], P_R, *size)
        D_R = H_F @ P_R @ H_F.T
        hinge_size = size[0], size[1] * (1.0 + np.max(np.abs(H_F), initial=0.0)) ** 2
        assert close(two.D[np.ix_(hinge, hinge)], D_R, *hinge_size)
        if len(hinge):
            G_R = np.linalg.solve(D_R, H_F @ P_R).T
            P_R_plus = (np.eye(6) - G_R @ H_F) @ P_R
            found = (two.tau_bar[inner, inner] @ two.P[inner, inner])[m:, m:]
            assert close(found, P_R_plus, hinge_size[0], hinge_size[1] * np.linalg.cond(D_R))


@pytest.mark.parametrize(("seed", "figure"), list(enumerate((0.266, 0.300, 0.277))))
def test_two_bodies_in_the_order_of_the_print(seed, figure):
    """(61) moves k' by the modes: the same mass matrix, but the factors of (62) are those of the other order.

    The D of a hinge then lacks by how much the modes give way: summed over all hinges it is larger by the figure.
    """
    system = random_system(seed)
    o = system.operators(system.initial_state)
    printed, two = as_two(o, modes_outboard=False), as_two(o)
    n = len(two.M_m)
    assert close(printed.M, o.M, n, np.max(np.abs(o.M)))
    assert close(printed.innovations @ printed.D @ printed.innovations.T, o.M, n, np.max(np.abs(o.M)))
    hinges = np.concatenate([rows[at.stop - at.start - 6 :] for rows, at in zip(o.rows, o.columns, strict=True)])
    larger = np.trace(printed.D[np.ix_(hinges, hinges)]) / np.trace(two.D[np.ix_(hinges, hinges)]) - 1.0
    assert larger == pytest.approx(figure, rel=0.01)


@pytest.mark.parametrize(("seed", "figure"), list(enumerate((0.203, 0.0948, 0.133))))
def test_hinge_points_off_their_nodes(seed, figure):
    """(9), below (13): phi'(O_k, k) Pi_d holds for a hinge point at its node; phi'(d_k, k) Pi_d wherever it is.

    The figure is the distance of the mass matrices, Frobenius norms; hinge points are up to 0.35 m off their nodes.
    """
    system = random_system(seed)
    state = system.initial_state
    o, now = system.operators(state), system._operators.configuration(state.t, state.q, state.u)
    H = o.H.copy()
    for k, member in enumerate(now.tree.members):
        m = member.model.mode_count
        _, Pi_d = now.node(k, member.outboard)
        columns = slice(o.columns[k].stop - 6, o.columns[k].stop)
        H[o.rows[k][:m], columns] = -value(phi(now.frame(k)[0] - now.hinge_point(k)).T @ Pi_d).T
    H_Phi = H @ o.Phi
    distance = np.linalg.norm(H_Phi @ o.M_m @ H_Phi.T - o.M) / np.linalg.norm(o.M)
    assert distance == pytest.approx(figure, rel=0.01)


@pytest.mark.parametrize("seed", SEEDS)
def test_bias_accelerations_are_those_of_the_frames(seed):
    """(25), (B1): a_m = [0; a_mR], no modal row at any level."""
    system = random_system(seed)
    o = system.operators(system.initial_state)
    for at in o.columns:
        assert not np.any(o.a_m[at][:-6])
        assert np.any(o.a_m[at][-6:])


def test_free_free_eigenmodes_decouple():
    """(23) and below: at rest their coupling M_fr to the body frame vanishes and M_ff is diagonal."""
    section = [beam_section(E=2e9, G=8e8, A=9e-4, Iy=8e-8, Iz=5e-8, rho=1500.0, x=x) for x in (0.0, 2.0)]
    scene = flexmb.SceneBuilder("free beam")
    scene.beam("beam", length=2.0, elements=4, section=section, modes=flexmb.Modes(count=5, boundary="free-free"))
    scene.free("base", "ground", "beam", quaternion=(0.5, 0.5, -0.5, 0.5))
    system = flexmb.compile(scene.scene())
    o = system.operators(system.initial_state)
    ff, fr = o.M_m[:5, :5], o.M_m[:5, 5:]
    bound = gamma(len(flexible_model(system.scene.bodies[0]).mass))
    assert np.max(np.abs(ff - np.diag(np.diag(ff)))) <= bound * np.max(np.abs(ff))
    assert np.max(np.abs(fr)) <= bound * np.sqrt(np.max(np.abs(ff)) * np.max(np.abs(o.M_m)))
