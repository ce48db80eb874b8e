"""The elements of the spatial operators, block by block as section II writes them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexmb
from flexmb.jain.elements import Configuration, phi, rate, value
from flexmb.jain.operators import SpatialOperators
from tests import trees
from tests.bounds import algebra, gamma

Array = np.ndarray
TREE = replace(trees.CONSERVATIVE, bodies=5, carriers=("floating", "modal"), wheels=0, point_masses=0)


def found(seed: int, **changes: object) -> tuple[flexmb.System, Configuration]:
    """A random tree, and its elements at its own random state."""
    system = flexmb.compile(trees.random_scene(seed, replace(TREE, **changes)))
    state = system.initial_state
    return system, SpatialOperators(system.scene).configuration(state.t, state.q, state.u)


def close(a: Array, b: Array, bound: float) -> bool:
    return bool(np.max(np.abs(a - b), initial=0.0) <= bound * max(1.0, float(np.max(np.abs(b), initial=0.0))))


def test_phi_is_a_group():
    """(6): phi(x, y) phi(y, z) = phi(x, z), and what it does to a load and to a velocity."""
    rng = np.random.default_rng(0)
    a, b, f, tau, w, v = rng.normal(size=(6, 3))
    assert close(phi(a) @ phi(b), phi(a + b), gamma(6))
    assert close(phi(a) @ np.concatenate([tau, f]), np.concatenate([tau + np.cross(a, f), f]), gamma(6))
    assert close(phi(a).T @ np.concatenate([w, v]), np.concatenate([w, v + np.cross(w, a)]), gamma(6))


@pytest.mark.parametrize("seed", range(3))
def test_nodes_move_by_their_shapes(seed):
    """(2): in the axes of the body, translation shapes times modal coordinates."""
    system, now = found(seed)
    for k, member in enumerate(now.tree.members):
        node = member.outboard.node
        origin, R = (value(x) for x in now.frame(k))
        moved = R.T @ (value(now.node(k, member.outboard)[0]) - origin) - node.position
        eta = system.initial_state.q[system.coordinate(f"{member.name}.modes")]
        assert close(moved, node.translation @ eta, algebra(system.nu, 5))


@pytest.mark.parametrize("seed", range(3))
def test_velocities_across_a_hinge(seed):
    """(5), (7)-(11), step by step from frame to frame, and at once with (12), (13); (3), (4) number the speeds."""
    system, now = found(seed)
    u, bound = now.u, algebra(system.nu, 5)
    state = system.initial_state
    o = system.operators(state)
    for k, member in enumerate(now.tree.members):
        chi = np.concatenate([u[member.u_modes], u[member.u_hinge]])
        names = f"{member.name}.modes", member.hinge.name
        assert np.array_equal(chi, np.concatenate([state.u[system.speed(name)] for name in names]))
        assert np.array_equal(chi, o.chi[o.rows[k]])
        m = len(u[member.u_modes])
        F, O, d = (value(x) for x in (now.frame(k)[0], now.hinge_point(k), now.node(k, member.outboard)[0]))
        p = member.parent
        V_m = np.concatenate([u[now.tree.members[p].u_modes], body_velocity(now, p)]) if p >= 0 else np.zeros(6)
        t, Pi_t = (value(x) for x in now.node(p, member.inboard))
        V_t = phi(t - value(now.frame(p)[0])).T @ V_m[-6:] + Pi_t @ V_m[:-6]  # (5)
        V_inboard = phi(O - t).T @ V_t  # (7)
        V_outboard = V_inboard + value(now.H(k)).T @ u[member.u_hinge]  # (8)
        V_d = phi(O - d).T @ value(now.node(k, member.outboard)[1]) @ u[member.u_modes]
        V = phi(F - O).T @ (V_outboard - V_d)  # (9), (10)
        assert close(V, body_velocity(now, k), bound)
        at_once = value(now.joint_map(k)).T @ chi
        if p >= 0:
            at_once = at_once + value(now.interbody(k)).T @ V_m
        assert close(at_once, np.concatenate([u[member.u_modes], V]), bound)  # (11)
        assert len(at_once) == m + 6


def body_velocity(now: Configuration, k: int) -> Array:
    """[w; v] of the body frame from the rates of its pose."""
    origin, R = now.frame(k)
    spin = rate(R) @ value(R).T
    return np.concatenate([[spin[2, 1], spin[0, 2], spin[1, 0]], rate(origin)])


@pytest.mark.parametrize("seed", range(3))
def test_interbody_transformation(seed):
    """(12) in blocks is A B of (14), (15)."""
    system, now = found(seed)
    for k, member in enumerate(now.tree.members):
        if member.parent < 0:
            continue
        p = member.parent
        (t, Pi_t), F, parent = now.node(p, member.inboard), now.frame(k)[0], now.frame(p)[0]
        onto_body = phi(F - parent)
        onto_modes = Pi_t.T @ phi(F - t)
        left = np.zeros((len(onto_modes) + 6, member.model.mode_count))
        blocks = np.hstack([left, np.vstack([onto_modes, onto_body])])
        assert close(value(now.interbody(k)), value(blocks), algebra(system.nu, 5))
        A, B = now.transmission(p, member.inboard)[1], phi(F - t)
        assert close(value(A @ B), value(blocks)[:, -6:], algebra(system.nu, 5))


@pytest.mark.parametrize("seed", range(3))
def test_joint_map(seed):
    """(16), (17): modes on [1, -Pi'], hinge on [0, H]; modes clamped at their hinge have no Pi there (1)."""
    _, now = found(seed)
    for k, member in enumerate(now.tree.members):
        m, H = member.model.mode_count, value(now.joint_map(k))
        d, Pi_d = (value(x) for x in now.node(k, member.outboard))
        assert np.array_equal(H[:m, :m], np.eye(m))
        assert not np.any(H[m:, :m])
        assert close(H[:m, m:], -(phi(value(now.frame(k)[0]) - d).T @ Pi_d).T, gamma(100))
        if member.model.clamped and np.array_equal(member.outboard.node.position, np.zeros(3)):
            assert not np.any(H[:m, m:])


@pytest.mark.parametrize("seed", range(3))
def test_velocities_of_nodes(seed):
    """(21), (22): [Pi, B'] V_m are the rates of the nodes' positions."""
    system, now = found(seed)
    o = system.operators(system.initial_state)
    for k in range(len(now.tree.members)):
        body, m = now.nodal_body(k), now.tree.members[k].model.mode_count
        velocities = value(body.A) @ o.V_m[o.columns[k]]
        skew = body.A[:, 3:, m : m + 3]  # -l~
        positions = now.frame(k)[0] - np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
        assert close(velocities[:, 3:], rate(positions), algebra(system.nu, 5))
