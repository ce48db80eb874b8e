"""Panels of solids with faces tied rigidly to nodes, as finite-element matrices, written out here in numpy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
E, NU, RHO = 7e10, 0.3, 2700.0
CORNERS = np.array([[x, y, z] for z in (-1.0, 1.0) for y in (-1.0, 1.0) for x in (-1.0, 1.0)])


def brick(size: Real) -> tuple[Real, Real]:
    """K and M (24,24) of a solid with eight nodes, trilinear, by 2x2x2 Gauss points; x of its corners runs first."""
    half = 0.5 * size
    volume = float(np.prod(half))
    shear = E / (2.0 * (1.0 + NU))
    C = np.diag([2.0 * shear] * 3 + [shear] * 3)
    C[:3, :3] += E * NU / ((1.0 + NU) * (1.0 - 2.0 * NU))
    K, kernel = np.zeros((24, 24)), np.zeros((8, 8))
    for point in CORNERS / np.sqrt(3.0):
        linear = 1.0 + CORNERS * point
        N = linear.prod(axis=1) / 8.0
        slope = [CORNERS[:, a] * linear[:, (a + 1) % 3] * linear[:, (a + 2) % 3] / 8.0 / half[a] for a in range(3)]
        strain = np.zeros((6, 8, 3))
        for a, (i, j) in enumerate(((0, 1), (1, 2), (2, 0))):
            strain[a, :, a] = slope[a]
            strain[3 + a, :, i], strain[3 + a, :, j] = slope[j], slope[i]
        B = strain.reshape(6, 24)
        K += volume * B.T @ C @ B
        kernel += volume * RHO * np.outer(N, N)
    return K, np.kron(kernel, np.eye(3))


def panel(cells: tuple[int, int, int] = (8, 4, 1), size: tuple[float, ...] = (1.0, 0.5, 0.02)) -> tuple[Real, ...]:
    """K, M (3n,3n) and positions (n,3) m of a plate of bricks that starts at the origin."""
    nx, ny, nz = cells
    x, y, z = (np.linspace(0.0, length, count + 1) for length, count in zip(size, cells, strict=True))
    position = np.array([[a, b, c] for c in z for b in y for a in x])
    k, m = brick(np.array(size) / cells)
    K, M = np.zeros((2, 3 * len(position), 3 * len(position)))
    number = np.arange(len(position)).reshape(nz + 1, ny + 1, nx + 1)
    for c, b, a in np.ndindex(nz, ny, nx):
        nodes = number[c : c + 2, b : b + 2, a : a + 2].ravel()
        rows = (3 * nodes[:, None] + np.arange(3)).ravel()
        K[np.ix_(rows, rows)] += k
        M[np.ix_(rows, rows)] += m
    return K, M, position


def tied(K: Real, M: Real, position: Real, faces: Sequence[NDArray[np.intp]]) -> tuple[Real, Real, Real, list[str]]:
    """K, M, positions and dofs with the nodes of each face fixed to one node with rotations at its middle.

    These nodes are the first ones, 1 and so on.
    """
    free = np.setdiff1d(np.arange(len(position)), np.concatenate(faces))
    middles = np.array([position[face].mean(axis=0) for face in faces])
    T = np.zeros((len(K), 6 * len(faces) + 3 * len(free)))
    for i, (face, middle) in enumerate(zip(faces, middles, strict=True)):
        for node in face:
            x, y, z = position[node] - middle
            turn = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
            T[3 * node : 3 * node + 3, 6 * i : 6 * i + 6] = np.hstack([np.eye(3), turn])
    for i, node in enumerate(free):
        T[range(3 * node, 3 * node + 3), range(6 * len(faces) + 3 * i, 6 * len(faces) + 3 * i + 3)] = 1.0
    stiffness = T.T @ K @ T
    stiffness[np.abs(stiffness) < 1e-14 * np.max(np.abs(stiffness))] = 0.0  # rounding errors of zeros
    return stiffness, T.T @ M @ T, np.vstack([middles, position[free]]), ["123456"] * len(faces) + ["123"] * len(free)
