"""The blocks of a Standard Input Data file (Wallrapp 1994; Schwertassek and Wallrapp 1999, chapter 6) as arrays.

With shape functions phi of the points, q the m modal coordinates, w the angular velocity, rho = r + phi q, and
w_q = (w_x^2, w_y^2, w_z^2, w_x w_y, w_y w_z, w_z w_x):

    mdCM  3 x 1    sum m rho             M1 is Ct0, transposed
    J     3 x 3    inertia about the origin
    Ct    m x 3    sum m phi_n'          force of the modes' accelerations, Ct' q''
    Cr    m x 3    sum m (rho x phi_n)'  torque of the modes' accelerations, Cr' q''
    Me    m x m    modal masses
    Gr    3 x 3m   torque sum_n Gr_n w q'_n,          Gr_n = -2 sum m rho~ phi_n~
    Ge    m x 3m   modal force sum_k Ge_nk . w q'_k,  Ge_nk = 2 sum m phi_k x phi_n
    Oe    m x 6    modal force Oe w_q of spin
    ksigma m x 1   modal force of initial stress, M1 its slope
    Ke, De m x m   stiffness and damping

M1 contains derivatives with respect to the modal coordinates, including geometric stiffness if the file has it: in Ct
(unit accelerations), Cr (unit angular accelerations), Oe (products of angular velocities), and phi and psi of the nodes
(unit loads at the nodes).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexmb.typing import Real


class SidError(ValueError):
    """A SID file that cannot be used: file, line or block, defect and remedy."""


@dataclass(frozen=True, eq=False)
class Taylor:
    """A matrix to first order in the modal coordinates: zero (rows, columns) + sum_k q_k first[:, k, :].

    `first` (rows, m, columns), or None if the file has order 0 only.
    """

    zero: Real
    first: Real | None = None

    @property
    def slope(self) -> Real | None:
        """`first`, or None if it is missing or zero."""
        return None if self.first is None or not np.any(self.first) else self.first


@dataclass(frozen=True, eq=False)
class SidNode:
    """A node: origin (3,1) m, shapes phi and psi (3,m), rotation AP (3,3) node to body, stresses sigma (6,1)."""

    name: str
    origin: Taylor
    phi: Taylor
    psi: Taylor
    AP: Taylor
    sigma: Taylor


@dataclass(frozen=True, eq=False)
class Sid:
    """One flexible body, in SI units and its reference frame; `modes` are the names of the modal coordinates.

    `file` is where it was read from, for messages; "" if it was made here.
    """

    mass: float
    modes: tuple[str, ...]
    nodes: tuple[SidNode, ...]
    mdCM: Taylor
    J: Taylor
    Ct: Taylor
    Cr: Taylor
    Me: Taylor
    Gr: Taylor
    Ge: Taylor
    Oe: Taylor
    ksigma: Taylor
    Ke: Taylor
    De: Taylor
    file: str = ""


def shapes(m: int) -> dict[str, tuple[int, int]]:
    """Rows and columns of all blocks of a body with m modes, in the order of the file."""
    return {
        "mdCM": (3, 1), "J": (3, 3), "Ct": (m, 3), "Cr": (m, 3), "Me": (m, m), "Gr": (3, 3 * m), "Ge": (m, 3 * m),
        "Oe": (m, 6), "ksigma": (m, 1), "Ke": (m, m), "De": (m, m),
    }  # fmt: skip


def node_shapes(m: int) -> dict[str, tuple[int, int]]:
    """Rows and columns of the blocks of a node."""
    return {"origin": (3, 1), "phi": (3, m), "psi": (3, m), "AP": (3, 3), "sigma": (6, 1)}
