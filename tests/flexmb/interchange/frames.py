"""Frames of Euler-Bernoulli beams as finite-element matrices, written out here in numpy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
E, G, A, IY, IZ, J, RHO = 7e10, 2.7e10, 1e-4, 8e-10, 5e-10, 1.3e-9, 2700.0


def frame(position: Real, members: Sequence[tuple[int, int]]) -> Real:
    """K (6n,6n) of straight members between nodes at `position` (n,3) m, six displacements a node."""
    K = np.zeros((6 * len(position), 6 * len(position)))
    for i, j in members:
        rows = np.r_[6 * i : 6 * i + 6, 6 * j : 6 * j + 6]
        along = position[j] - position[i]
        length = float(np.linalg.norm(along))
        turn = np.kron(np.eye(4), _axes(along / length))
        K[np.ix_(rows, rows)] += turn.T @ _member(length) @ turn
    return K


def lumped(position: Real, members: Sequence[tuple[int, int]], rotary: float = 0.0) -> Real:
    """M (6n,6n): half of each member's mass at either end; `rotary` (kg m²) about each axis of every node."""
    M = np.zeros((6 * len(position), 6 * len(position)))
    for i, j in members:
        half = 0.5 * RHO * A * float(np.linalg.norm(position[j] - position[i]))
        for node in (i, j):
            M[range(6 * node, 6 * node + 3), range(6 * node, 6 * node + 3)] += half
    diagonal = np.arange(len(M)).reshape(-1, 6)[:, 3:].ravel()
    M[diagonal, diagonal] += rotary
    return M


def linear(position: Real, members: Sequence[tuple[int, int]]) -> Real:
    """M (6n,6n) of members whose displacements vary linearly between their ends: one kernel for all directions."""
    kernel = np.zeros((len(position), len(position)))
    for i, j in members:
        mass = RHO * A * float(np.linalg.norm(position[j] - position[i]))
        kernel[np.ix_([i, j], [i, j])] += mass / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
    return np.kron(kernel, np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))


def consistent(position: Real, members: Sequence[tuple[int, int]]) -> Real:
    """M (6n,6n) of cubic deflections, with polar inertia in torsion: rotations of both ends are coupled."""
    M = np.zeros((6 * len(position), 6 * len(position)))
    for i, j in members:
        rows = np.r_[6 * i : 6 * i + 6, 6 * j : 6 * j + 6]
        along = position[j] - position[i]
        L = float(np.linalg.norm(along))
        m = np.zeros((12, 12))
        m[np.ix_([0, 6], [0, 6])] = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0
        m[np.ix_([3, 9], [3, 9])] = (IY + IZ) / A * np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0
        bending = np.array([
            [156.0, 22 * L, 54.0, -13 * L], [22 * L, 4 * L * L, 13 * L, -3 * L * L],
            [54.0, 13 * L, 156.0, -22 * L], [-13 * L, -3 * L * L, -22 * L, 4 * L * L],
        ]) / 420.0  # fmt: skip
        for places, sign in (([1, 5, 7, 11], 1.0), ([2, 4, 8, 10], -1.0)):
            turn = np.diag([1.0, sign, 1.0, sign])
            m[np.ix_(places, places)] = turn @ bending @ turn
        turn = np.kron(np.eye(4), _axes(along / L))
        M[np.ix_(rows, rows)] += turn.T @ (RHO * A * L * m) @ turn
    return M


def straight(elements: int, length: float = 1.0) -> tuple[Real, list[tuple[int, int]]]:
    """Nodes and members of a beam along x."""
    position = np.zeros((elements + 1, 3))
    position[:, 0] = np.linspace(0.0, length, elements + 1)
    return position, [(i, i + 1) for i in range(elements)]


def panel(across: int = 3, along: int = 4, size: float = 0.5) -> tuple[Real, list[tuple[int, int]]]:
    """Nodes and members of a grid in the plane x-y that starts at x = 0.1 m; the first node is its corner."""
    x, y = np.meshgrid(0.1 + size * np.arange(along) / (along - 1), size * np.arange(across) / (across - 1))
    position = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    members = [(r * along + c, r * along + c + 1) for r in range(across) for c in range(along - 1)]
    members += [(r * along + c, (r + 1) * along + c) for r in range(across - 1) for c in range(along)]
    return position, members


def _axes(x: Real) -> Real:
    """Rows: the member's axes, its z as upright as can be."""
    helper = np.array([0.0, 0.0, 1.0]) if abs(x[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    y = np.cross(helper, x)
    y /= np.linalg.norm(y)
    return np.array([x, y, np.cross(x, y)])


def _member(L: float) -> Real:
    k = np.zeros((12, 12))
    pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
    k[np.ix_([0, 6], [0, 6])] = E * A / L * pair
    k[np.ix_([3, 9], [3, 9])] = G * J / L * pair
    bending = np.array([
        [12.0, 6 * L, -12.0, 6 * L], [6 * L, 4 * L * L, -6 * L, 2 * L * L],
        [-12.0, -6 * L, 12.0, -6 * L], [6 * L, 2 * L * L, -6 * L, 4 * L * L],
    ]) / L**3  # fmt: skip
    for places, EI, sign in (([1, 5, 7, 11], E * IZ, 1.0), ([2, 4, 8, 10], E * IY, -1.0)):
        turn = np.diag([1.0, sign, 1.0, sign])
        k[np.ix_(places, places)] = EI * turn @ bending @ turn
    return k
