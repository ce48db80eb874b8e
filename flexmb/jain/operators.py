"""Spatial operators as dense arrays, in the notation of Jain & Rodriguez, sections II to V.

    operators = system.operators(state)
    operators.H @ operators.Phi @ operators.M_m @ operators.Phi.T @ operators.H.T  # the mass matrix (43)

Names are the paper's: script E is `E_Phi`, script H is `H`, the star is the transpose. Departures: bodies are numbered
from base to tip, so that operators that are block lower triangular in the print are upper triangular here; generalised
speeds have the order of u, in which a hinge's speeds precede its body's modes; wheels are bodies, after all others.

The cost is of order n^3. The operators are for reading and for checks of the recursions: they are a third independent
route, with the kinematics of `flexmb.dense` and the paper's operator equations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexmb.dense.dense_system import DenseSystem, Instant
from flexmb.dense.jets import profile
from flexmb.jain.elements import Configuration, phi, rate, undeformed, value, with_wheels
from flexmb.kept import kept
from flexmb.scene import schema as s
from flexmb.tables import arguments
from flexmb.typing import Real

Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Operators:
    """The operators of one tree at one state; SI, World axes, accelerations are inertial rates of V_m.

    n speeds; nbar = sum of m_k + 6 over all bodies. Body k has `columns[k]` of nbar, [modes; angular; linear], the
    last six about its frame's origin, and `rows[k]` of n, [etad; beta].

    E_Phi (nbar,nbar)   Phi(parent, k) at the blocks (parent, k) (12), (18)
    H (n,nbar)          modal joint map, script-H of (13), (17)
    M_m (nbar,nbar)     modal mass matrices (23)
    a_m, b_m (nbar,)    Coriolis and centrifugal accelerations (25); gyroscopic forces (37), less all external forces,
                        gravity among them, plus modal damping
    K_m (nbar,nbar)     modal stiffness (38), to act on `deformation` (nbar,) = [eta; 0] of every body
    J (n,)              armatures of the speeds, which the paper does not have: M = H Phi M_m Phi' H' + diag(J)
    chi (n,)            generalised speeds (4), with etad = 0 at level ruthless
    V_m (nbar,)         modal spatial velocities Phi' H' chi (20)
    """

    bodies: tuple[str, ...]
    parent: tuple[int, ...]
    columns: tuple[slice, ...]
    rows: tuple[Index, ...]
    E_Phi: Real
    H: Real
    M_m: Real
    a_m: Real
    b_m: Real
    K_m: Real
    deformation: Real
    J: Real
    chi: Real
    V_m: Real

    # Newton-Euler operators, section II

    @kept
    def Phi(self) -> Real:
        """(1 - E_Phi)^-1 (nbar,nbar) (19)."""
        return self._resolvent(self.E_Phi)

    def alpha_m(self, chi_dot: Real) -> Real:
        """Modal spatial accelerations (nbar,) (26)."""
        return arguments.representable(self.Phi.T @ (self.H.T @ self._speeds("chi_dot", chi_dot) + self.a_m))

    def f_m(self, chi_dot: Real) -> Real:
        """Modal spatial forces (nbar,) between each body and its parent (40)."""
        forces = self.M_m @ self.alpha_m(chi_dot) + self.b_m + self.K_m @ self.deformation
        return arguments.representable(self.Phi @ forces)

    def inverse_dynamics(self, chi_dot: Real) -> Real:
        """T (n,) (41), with the armatures J chi_dot."""
        return arguments.representable(self.H @ self.f_m(chi_dot) + self.J * chi_dot)

    @kept
    def M(self) -> Real:
        """Mass matrix (n,n), Newton-Euler factorisation (43)."""
        H_Phi = self.H @ self.Phi
        return H_Phi @ self.M_m @ H_Phi.T + np.diag(self.J)

    @kept
    def C(self) -> Real:
        """Coriolis, centrifugal and elastic forces (n,) in M chi_dot + C = T (43)."""
        forces = self.M_m @ (self.Phi.T @ self.a_m) + self.b_m + self.K_m @ self.deformation
        return self.H @ (self.Phi @ forces)

    # Composite bodies, section IV

    @kept
    def R(self) -> Real:
        """Composite-body inertias (nbar,nbar), block diagonal (47)."""
        R = self.M_m.copy()
        for k in reversed(range(len(self.parent))):
            self._add_to_parent(R, k, R[self.columns[k], self.columns[k]])
        return R

    # Articulated bodies, section V

    @kept
    def _articulated(self) -> tuple[Real, Real, Real]:
        """P (nbar,nbar), the Cholesky factor of D (n,n) and G (nbar,n) by the recursion (51), tips to base."""
        from scipy.linalg import cho_factor, cho_solve  # slow to import, and not needed for H, M_m or M

        P, G, D_factor = self.M_m.copy(), np.zeros_like(self.H.T), np.zeros((len(self.H), len(self.H)))
        for k in reversed(range(len(self.parent))):
            rows, columns = self.rows[k], self.columns[k]
            H, P_k = self.H[rows, columns], P[columns, columns]
            factor = cho_factor(H @ P_k @ H.T + np.diag(self.J[rows]), lower=True)
            D_factor[np.ix_(rows, rows)] = np.tril(factor[0])
            G_k = cho_solve(factor, H @ P_k).T
            G[columns, rows] = G_k
            tau_bar = np.eye(len(P_k)) - G_k @ H
            self._add_to_parent(P, k, tau_bar @ P_k)
        return P, D_factor, G

    @property
    def P(self) -> Real:
        """Articulated-body inertias (nbar,nbar), block diagonal (51). LinAlgError where a D(k) is not definite."""
        return self._articulated[0]

    @kept
    def D(self) -> Real:
        """H P H' + diag(J) (n,n), block diagonal (52)."""
        return self.H @ self.P @ self.H.T + np.diag(self.J)

    @kept
    def D_inverse(self) -> Real:
        """(n,n), block diagonal."""
        return self._over_D(np.eye(len(self.H)))

    @property
    def G(self) -> Real:
        """P H' D^-1 (nbar,n), block diagonal (52)."""
        return self._articulated[2]

    @kept
    def K(self) -> Real:
        """E_Phi G (nbar,n) (52)."""
        return self.E_Phi @ self.G

    @kept
    def tau_bar(self) -> Real:
        """1 - G H (nbar,nbar), block diagonal (52)."""
        return np.eye(len(self.P)) - self.G @ self.H

    @kept
    def E_Psi(self) -> Real:
        """E_Phi tau_bar (nbar,nbar) (52)."""
        return self.E_Phi @ self.tau_bar

    @kept
    def Psi(self) -> Real:
        """(1 - E_Psi)^-1 (nbar,nbar) (53)."""
        return self._resolvent(self.E_Psi)

    @kept
    def innovations(self) -> Real:
        """1 + H Phi K (n,n), unit triangular by blocks: M = (1 + H Phi K) D (1 + H Phi K)' (54)."""
        return np.eye(len(self.H)) + self.H @ self.Phi @ self.K

    @kept
    def innovations_inverse(self) -> Real:
        """1 - H Psi K (n,n), the inverse of `innovations` (55)."""
        return np.eye(len(self.H)) - self.H @ self.Psi @ self.K

    @property
    def M_inverse(self) -> Real:
        """(1 - H Psi K)' D^-1 (1 - H Psi K) (n,n) (56)."""
        return self.innovations_inverse.T @ self.D_inverse @ self.innovations_inverse

    @property
    def log_determinant(self) -> float:
        """log det M = log det D, because the other factors of (54) are unit triangular."""
        return sum(float(np.linalg.slogdet(self.D[np.ix_(rows, rows)])[1]) for rows in self.rows)

    def accelerations(self, T: Real) -> Real:
        """chi_dot (n,) for generalised forces T (n,), with all speeds free: Lemma 5 (57)."""
        T = self._speeds("T", T)
        forces = self.K @ T + self.P @ self.a_m + self.b_m + self.K_m @ self.deformation
        innovation = T - self.H @ (self.Psi @ forces)
        chi_dot = self.innovations_inverse.T @ self._over_D(innovation)
        return arguments.representable(chi_dot - self.K.T @ (self.Psi.T @ self.a_m))

    def driven(self, prescribed: NDArray[np.bool_], rates: Real) -> Operators:
        """The same tree with the speeds marked in `prescribed` (n,) driven at `rates` (n,); other rates are ignored.

        The driven rates become part of the accelerations a_m. M, C, T and chi_dot of the result are those of the
        remaining free speeds; V_m is unchanged. ValueError for arrays of the wrong shape or type.
        """
        rates, prescribed = self._speeds("rates", rates), np.asarray(prescribed)
        if prescribed.shape != rates.shape or prescribed.dtype != bool:
            raise ValueError(f"prescribed: {len(rates)} booleans are needed, got {prescribed.dtype} {prescribed.shape}")
        place = np.cumsum(~prescribed) - 1
        return replace(
            self,
            rows=tuple(place[rows[~prescribed[rows]]] for rows in self.rows),
            H=self.H[~prescribed],
            J=self.J[~prescribed],
            chi=self.chi[~prescribed],
            a_m=self.a_m + self.H[prescribed].T @ rates[prescribed],
        )

    def _over_D(self, x: Real) -> Real:
        """D^-1 x, x (n,) or (n,m), by substitution: a product with the inverse is worse by the condition of D."""
        from scipy.linalg import cho_solve

        found, factor = np.zeros_like(x), self._articulated[1]
        for rows in self.rows:
            found[rows] = cho_solve((factor[np.ix_(rows, rows)], True), x[rows])
        return found

    def _speeds(self, name: str, values: Real) -> Real:
        """(n,) finite numbers; ValueError or TypeError for others."""
        return arguments.finite(name, arguments.vector(name, values, len(self.H)))

    def _resolvent(self, E: Real) -> Real:
        """(1 - E)^-1 = 1 + E + E^2 + ..., E nilpotent with one block in the columns of each body, at its parent."""
        resolvent = np.eye(len(E))
        for p, columns in zip(self.parent, self.columns, strict=True):
            if p >= 0:
                resolvent[:, columns] += resolvent[:, self.columns[p]] @ E[self.columns[p], columns]
        return resolvent

    def _add_to_parent(self, inertia: Real, k: int, own: Real) -> None:
        """Add Phi(p, k) own Phi'(p, k) to the parent's block, in place."""
        if self.parent[k] >= 0:
            p = self.columns[self.parent[k]]
            Phi = self.E_Phi[p, self.columns[k]]
            inertia[p, p] += Phi @ own @ Phi.T


class SpatialOperators:
    """The operators of one scene, at any state; trees of rigid and flexible bodies, point masses and wheels."""

    def __init__(self, scene: s.Scene) -> None:
        self._dense = DenseSystem(scene)
        self._bodies = with_wheels(self._dense.tree)

    def configuration(self, t: float, q: Real, u: Real) -> Configuration:
        """The configuration of the inertia terms: prescribed coordinates as given, ruthless bodies undeformed."""
        return Configuration(self._bodies, *undeformed(self._bodies, *self._dense.on_profile(q, u, t)))

    def at(self, t: float, q: Real, u: Real) -> Operators:
        """The operators at time t, coordinates q (nq,) and speeds u (nu,), all speeds free."""
        now, members = self.configuration(t, q, u), self._bodies.members
        modes = [member.model.mode_count for member in members]
        ends = np.cumsum([0, *(m + 6 for m in modes)])
        columns = tuple(slice(int(a), int(b)) for a, b in zip(ends[:-1], ends[1:], strict=True))
        place = np.arange(self._bodies.nu)
        rows = tuple(np.concatenate([place[member.u_modes], place[member.u_hinge]]) for member in members)
        E_Phi, H = np.zeros((ends[-1], ends[-1]), complex), np.zeros((self._bodies.nu, ends[-1]), complex)
        for k, member in enumerate(members):
            H[rows[k], columns[k]] = now.joint_map(k)
            if member.parent >= 0:
                E_Phi[columns[member.parent], columns[k]] = now.interbody(k)
        none, nbar = np.zeros(ends[-1]), np.zeros((ends[-1], ends[-1]))
        kinematics = Operators(
            tuple(member.name for member in members), tuple(member.parent for member in members), columns, rows,
            value(E_Phi), value(H), nbar, none, none, nbar, none, self._dense.armature, now.u, none,
        )  # fmt: skip
        V_m = kinematics.Phi.T @ (kinematics.H.T @ now.u)
        M_m, b_m = self._inertia(now, columns, V_m)
        deformation, damping, K_m = none.copy(), none.copy(), nbar.copy()
        for m, member, at in zip(modes, members, columns, strict=True):
            K_m[at, at][:m, :m] = member.model.stiffness
            deformation[at][:m] = q[member.q_modes]
            damping[at][:m] = member.model.damping @ u[member.u_modes]
        return replace(
            kinematics,
            M_m=M_m,
            a_m=rate(E_Phi).T @ V_m + rate(H).T @ now.u,
            b_m=b_m + damping - self._external(now, t, columns, M_m),
            K_m=K_m,
            deformation=deformation,
            V_m=V_m,
        )

    def _inertia(self, now: Configuration, columns: tuple[slice, ...], V_m: Real) -> tuple[Real, Real]:
        """M_m (nbar,nbar) and b_m (nbar,); at level linear truncated after the first order, in the body's frame."""
        M_m, b_m = np.zeros((len(V_m), len(V_m))), np.zeros(len(V_m))
        tree = self._dense.tree
        linear = Instant(tree, now.q, now.u, np.zeros(tree.nu)).first_order if tree.linear else {}
        for k, at in enumerate(columns):
            if k in linear:
                to_world = np.eye(at.stop - at.start)
                to_world[-6:-3, -6:-3] = to_world[-3:, -3:] = linear[k].rotation
                M_m[at, at], b_m[at] = to_world @ linear[k].M @ to_world.T, to_world @ linear[k].bias
            else:
                body = now.nodal_body(k)
                M_m[at, at], b_m[at] = body.M_m, body.b_m(V_m[at])
        return M_m, b_m

    def _external(self, now: Configuration, t: float, columns: tuple[slice, ...], M_m: Real) -> Real:
        """Modal forces (nbar,) of gravity, of loads at nodes and of connectors between them."""
        fall = np.zeros(len(M_m))
        for at in columns:
            fall[at][-3:] = self._dense.scene.gravity_m_s2
        forces = M_m @ fall
        for load in self._dense.scene.loads:
            k, seat = self._bodies.sites[f"load:{load.name}"]
            direction = np.array(load.direction)
            if load.frame == "node":
                direction = value(now.seat(k, seat)[1]) @ direction
            F = np.zeros(6)
            F[slice(0, 3) if load.type == "torque" else slice(3, 6)] = profile(load.function, t).value * direction
            forces[columns[k]] += value(now.transmission(k, seat)[1]) @ F
        for name, gripped in self._dense.grips(now.q, now.u, t).items():
            for side, F in (("a", gripped.on_a), ("b", gripped.on_b)):
                k, seat = self._bodies.sites[f"connector {side}:{name}"]
                if k >= 0:
                    node, A = now.transmission(k, seat)
                    forces[columns[k]] += value(A @ phi(now.seat(k, seat)[0] - node)) @ F
        return forces
