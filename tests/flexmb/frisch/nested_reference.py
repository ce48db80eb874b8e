"""The nested-body equations (78)-(110) and their partitions (111)-(115) as the paper writes them: explicit double sums.

To be read beside the print. Bodies are numbered from zero, so that k-1 of the paper, the hinge point of body k, has the
label k here; body 1 of the paper is whatever hangs on the ground. Corrections of docs/errata.md that concern one body
are in `labels`; those that concern nests are (79), whose sum leaves out i = k, the index sets of (107) and (108), where
the first sum leaves out i = k, and wheels that turn with their nodes, (94), (105). World axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexmb.dense.jets import skew
from tests.flexmb.frisch.labels import Body, Wheel

ONE = np.eye(3)


@dataclass(frozen=True)
class Nests:
    """A tree at one instant."""

    bodies: list[Body]
    wheels: list[Wheel]

    @cached_property
    def labels(self) -> range:
        return range(len(self.bodies))

    @cached_property
    def path(self) -> list[list[int]]:
        """S_{0,lambda-1}: labels on the path from body 1 to body lambda, both included."""
        found: list[list[int]] = []
        for k, body in enumerate(self.bodies):
            found.append([*(found[body.J] if body.J >= 0 else []), k])
        return found

    @cached_property
    def nest(self) -> list[list[int]]:
        """S_{k-1}: labels outboard of hinge point k-1, body k included."""
        return [[lam for lam in self.labels if k in self.path[lam]] for k in self.labels]

    def common(self, k: int, i: int) -> list[int]:
        """The lambda of both sums in (107): S_{k-1} for i in S_{0,k-1}, i != k, S_{i-1} for i in S_{k-1}; else none."""
        if i in self.path[k] and i != k:
            return self.nest[k]
        return self.nest[i] if i in self.nest[k] else []

    def gamma(self, k: int, lam: int) -> np.ndarray:
        """(79): from hinge point k-1 to the mass centre of body lambda."""
        between = [i for i in self.path[lam] if k in self.path[i] and i != k]
        return sum((self.bodies[i].beta for i in between), start=np.zeros(3)) + self.bodies[lam].alpha

    def Gamma(self, k: int, lam: int) -> np.ndarray:
        """(97), (99)."""
        return -skew(self.gamma(k, lam))

    def G(self, k: int, i: int, lam: int) -> np.ndarray:
        """(98)."""
        at_k, at_i = self.gamma(k, lam), self.gamma(i, lam)
        return self.bodies[lam].m * (at_i @ at_k * ONE - np.outer(at_i, at_k))

    def carried(self, lam: int) -> np.ndarray:
        """The sum in (89), (91), (100): centripetal and Coriolis acceleration of hinge point lambda-1."""
        total = np.zeros(3)
        for i in self.path[lam]:
            if (j := self.bodies[i].J) >= 0:
                w, body = self.bodies[j].omega, self.bodies[i]
                total = total + np.cross(w, np.cross(w, body.beta)) + 2.0 * np.cross(w, body.beta_rate)
        return total

    def C(self, lam: int) -> np.ndarray:
        """(100)."""
        b = self.bodies[lam]
        own = np.cross(b.omega, np.cross(b.omega, b.alpha)) + 2.0 * np.cross(b.omega, b.alpha_rate)
        return b.m * (self.carried(lam) + own)

    def H_relative(self, m: int) -> np.ndarray:
        """Relative angular momentum of wheel m, H~ of (102), (105)."""
        return self.wheels[m].I_W @ self.wheels[m].relative_rate

    def H(self, m: int) -> np.ndarray:
        """(102)."""
        return self.wheels[m].I_W @ self.bodies[self.wheels[m].carrier].omega + self.H_relative(m)

    def tensor_turning(self, m: int) -> np.ndarray:
        """What (105) and (94) leave out: the body sees I_W turn with its node, I_W' . (omega + omega~_W)."""
        return self.wheels[m].I_W_rate @ (self.bodies[self.wheels[m].carrier].omega + self.wheels[m].relative_rate)

    def wheels_in(self, lam: int) -> list[int]:
        return [m for m, wheel in enumerate(self.wheels) if wheel.carrier == lam]

    def Phi(self, lam: int) -> np.ndarray:
        """Inertia tensor of body lambda plus that of all imbedded despun wheels (figure 1)."""
        return self.bodies[lam].Phi + sum((self.wheels[m].I_W for m in self.wheels_in(lam)), start=np.zeros((3, 3)))

    def L(self, lam: int) -> np.ndarray:
        """(101)."""
        b = self.bodies[lam]
        return self.Phi(lam) @ b.omega + b.Delta_L + sum(map(self.H_relative, self.wheels_in(lam)), start=np.zeros(3))

    # Coefficients of the accelerations

    def rotation_rotation(self, k: int, i: int) -> np.ndarray:
        """(107): coefficient of omega~_i' in the rotation equation of nest k-1."""
        inertia = (self.Phi(lam) for lam in self.common(k, i) if not self.bodies[lam].point_mass)
        return sum(inertia, start=np.zeros((3, 3))) + sum(
            (self.G(k, i, lam) for lam in self.common(k, i)), start=np.zeros((3, 3))
        )

    def rotation_translation(self, k: int, i: int) -> np.ndarray:
        """(103), (107): coefficient of beta_i''."""
        terms = (-self.bodies[lam].m * self.Gamma(k, lam) for lam in self.common(k, i))
        return sum(terms, start=np.zeros((3, 3)))

    def rotation_mode(self, k: int, lam: int) -> np.ndarray:
        """(106), (107): coefficients (3,n) of a_n'' of body lambda, also (110): of omega~_k' in the modal equations."""
        b = self.bodies[lam]
        if lam not in self.nest[k]:
            return np.zeros((3, len(b.A)))
        return np.array([-b.m * self.Gamma(k, lam) @ A + Q for A, Q in zip(b.A, b.Q, strict=True)]).reshape(-1, 3).T

    def rotation_wheel(self, k: int, m: int) -> np.ndarray:
        """(107), (109)."""
        return self.wheels[m].I_W if self.wheels[m].carrier in self.nest[k] else np.zeros((3, 3))

    def translation_rotation(self, k: int, i: int) -> np.ndarray:
        """(108)."""
        return sum((self.bodies[lam].m * self.Gamma(i, lam) for lam in self.common(k, i)), start=np.zeros((3, 3)))

    def translation_translation(self, k: int, i: int) -> np.ndarray:
        """(108)."""
        return sum((self.bodies[lam].m * ONE for lam in self.common(k, i)), start=np.zeros((3, 3)))

    def translation_mode(self, k: int, lam: int) -> np.ndarray:
        """(108), (110): (3,n)."""
        b = self.bodies[lam]
        return b.m * b.A.T if lam in self.nest[k] else np.zeros((3, len(b.A)))

    # Right sides

    def rotation_right(self, k: int) -> np.ndarray:
        """(107)."""
        total = np.zeros(3)
        for lam in self.nest[k]:
            b, gamma = self.bodies[lam], self.gamma(k, lam)
            total -= b.Phi_rate @ b.omega + np.cross(b.omega, self.L(lam)) + np.cross(gamma, self.C(lam))
            total -= sum(map(self.tensor_turning, self.wheels_in(lam)), start=np.zeros(3))
            total += np.cross(gamma, b.F_e) + b.phi_e
        return total

    def translation_right(self, k: int) -> np.ndarray:
        """(108)."""
        return sum((self.bodies[lam].F_e - self.C(lam) for lam in self.nest[k]), start=np.zeros(3))

    def wheel_right(self, m: int) -> np.ndarray:
        """(109)."""
        return -np.cross(self.bodies[self.wheels[m].carrier].omega, self.H(m)) - self.tensor_turning(m)

    def modal_right(self, lam: int) -> np.ndarray:
        """(110), (186): all modes n of body lambda, with the external loads on them."""
        b = self.bodies[lam]
        w = b.omega
        inertial = -b.m * b.A @ self.carried(lam) - b.m * b.A_0 @ np.cross(w, np.cross(w, b.alpha_0))
        return inertial + np.einsum("a,nab,b->n", w, b.H, w) - 2.0 * b.K @ w + b.elastic + b.on_modes

    def acceleration(self, lam: int, x: Expansion) -> np.ndarray:
        """(91): gamma'' of body lambda."""
        b = self.bodies[lam]
        total = self.C(lam) / b.m + x.modes[lam] @ b.A
        for i in self.path[lam]:
            total = total + x.translations[i] + np.cross(x.rotations[i], self.gamma(i, lam))
        return total


@dataclass(frozen=True)
class Expansion:
    """Expanded accelerations: omega~' (N,3), omega~_W' (W,3), a'' by body, beta'' (N,3)."""

    rotations: np.ndarray
    wheels: np.ndarray
    modes: list[np.ndarray]
    translations: np.ndarray


@dataclass(frozen=True)
class Blocks:
    """The partitions of (111), rows as in `flexmb.frisch.nested_system.Partitions`."""

    X: np.ndarray
    I_c: np.ndarray
    F: np.ndarray
    Gamma: np.ndarray
    I_s: np.ndarray
    M1: np.ndarray
    A: np.ndarray
    M2: np.ndarray
    Gamma_T: np.ndarray  # the translation equations' own coefficients, (108), not those of (107)
    eta: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def partitions(n: Nests) -> Blocks:
    """(112)-(115): rotation of nests of bodies and translation of nests that translate, wheels, modes, the rest."""
    turning = [k for k in n.labels if not n.bodies[k].point_mass]
    moving = [k for k in n.labels if n.bodies[k].translates]
    held = [k for k in n.labels if not n.bodies[k].translates]
    wheels = range(len(n.wheels))
    modal = sum(len(b.A) for b in n.bodies)
    F_turning = _grid(n.rotation_mode, turning, n.labels)
    F_moving = _grid(n.translation_mode, moving, n.labels)
    last_turning = _grid(n.translation_rotation, held, turning)
    first = [n.rotation_right(k) for k in turning] + [n.translation_right(k) for k in moving]
    return Blocks(
        X=np.block([
            [_grid(n.rotation_rotation, turning, turning), _grid(n.rotation_translation, turning, moving)],
            [_grid(n.translation_rotation, moving, turning), _grid(n.translation_translation, moving, moving)],
        ]),
        I_c=np.vstack([_grid(n.rotation_wheel, turning, wheels), np.zeros((3 * len(moving), 3 * len(wheels)))]),
        F=np.vstack([F_turning, F_moving]),
        Gamma=np.vstack([_grid(n.rotation_translation, turning, held), _grid(n.translation_translation, moving, held)]),
        I_s=_diagonal([wheel.I_W for wheel in n.wheels]),
        M1=_diagonal([b.M1 for b in n.bodies]),
        A=_grid(n.translation_mode, held, n.labels).T.reshape(modal, 3 * len(held)),
        M2=_grid(n.translation_translation, held, held),
        Gamma_T=np.hstack([last_turning, _grid(n.translation_translation, held, moving)]),
        eta=(
            np.concatenate(first),
            np.concatenate([np.zeros(0), *map(n.wheel_right, wheels)]),
            np.concatenate([n.modal_right(lam) for lam in n.labels]),
            np.concatenate([np.zeros(0), *map(n.translation_right, held)]),
        ),
    )


def _grid(block, rows, columns) -> np.ndarray:
    """block(row, column) (3,n) for all rows and columns, as one matrix."""
    lines = [np.hstack([np.zeros((3, 0)), *(block(k, i) for i in columns)]) for k in rows]
    return np.vstack(lines) if lines else np.zeros((0, 3 * len(columns)))


def _diagonal(blocks: list[np.ndarray]) -> np.ndarray:
    """Square blocks along the diagonal."""
    size = sum(len(b) for b in blocks)
    found, start = np.zeros((size, size)), 0
    for b in blocks:
        found[start : start + len(b), start : start + len(b)] = b
        start += len(b)
    return found
