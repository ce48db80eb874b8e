"""The inertia sums of a SID file, of blocks that say the same things twice and, in many files, differently.

Where two blocks disagree, the one in the mass matrix at rest is taken (mdCM, J, Ct, Cr, Me), because motions depend on
it most, and a note says by how much the other is off.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flexmb.interchange.sid.blocks import Sid, SidError, Taylor
from flexmb.interchange.sid.from_body import COLUMNS, ROWS
from flexmb.modal.first_order import steiner, symmetric
from flexmb.scene.quaternions import cross_matrix
from flexmb.scene.rounding import ROUNDING
from flexmb.typing import Real

PRINTED = 1e-6
"""Relative difference up to which redundant blocks of a file agree, for files in single precision."""
LARGEST_SHARE = 0.999
"""Largest share of a modal mass that is left to rigid motion where a file has more than all of it, which no masses
have; short of 1, at which a free body would have a motion without inertia."""


class Scale(NamedTuple):
    """Length (m) of a body and displacement of its points by unit modal coordinates, as its masses have them.

    What rounding leaves of a zero is measured by these.
    """

    reach: float
    shape: float

    @classmethod
    def of(cls, sid: Sid) -> Scale:
        """The roots of mean squares."""
        squares = max(float(np.trace(sid.J.zero)), 0.0), float(np.max(np.diag(sid.Me.zero), initial=0.0))
        return cls(*np.sqrt(np.array(squares) / sid.mass).tolist())


class Sums:
    """Sums of masses m and fields of the modes n, k: Ct[n] = sum m phi_n (m,3), P[n] = sum m phi_n r' (m,3,3), and
    Q[n,k] = sum m phi_n phi_k' (m,m,3,3).

    `change` (m,m,3,3), symmetric: sum m r G' of the second-order field, from which geometric stiffness follows.
    `at_rest_only`: Q has the modal masses of the file and nothing else of it.
    """

    def __init__(self, sid: Sid, notes: list[str], disagreements: list[str]) -> None:
        self.m = len(sid.modes)
        self.sid, self.disagreements = sid, disagreements
        self.Ct = sid.Ct.zero
        self.P = self._first_moments()
        self.change = np.zeros((self.m, self.m, 3, 3))
        second = self._of_spin()
        self.at_rest_only = sid.Gr.first is None and second is None and self.m > 0
        if sid.Gr.first is not None:
            Gr1 = np.stack([_matrices(sid.Gr.first[:, k]) for k in range(self.m)], axis=1)
            Q = -0.5 * Gr1 + 0.25 * _trace(Gr1)[..., None, None] * np.eye(3)
            self._compare("Me", "M1 of Gr", sid.Me.zero, _trace(Q), 0.0)
            self.Q = Q + (sid.Me.zero - _trace(Q))[..., None, None] / 3.0 * np.eye(3)
            if second is not None:
                self.change = second - symmetric(Q)
        elif second is not None:
            self._separate(second, notes)
        else:
            self.leave_at_rest()

    def _first_moments(self) -> Real:
        """P, the symmetric part of which is in the slope of J and in Gr, and the other in Cr and in Gr."""
        sid, scale = self.sid, Scale.of(self.sid)
        dust = ROUNDING * sid.mass * scale.shape
        if sid.mdCM.first is not None:
            self._compare("Ct", "M1 of mdCM", self.Ct, sid.mdCM.first[:, :, 0].T, dust)
        Gr = _matrices(sid.Gr.zero)
        of_Gr = -0.5 * Gr + 0.25 * _trace(Gr)[..., None, None] * np.eye(3)
        slope = symmetric(Gr) if sid.J.first is None else np.moveaxis(sid.J.first, 1, 0)
        self._compare("M1 of J", "Gr", slope, symmetric(Gr), dust * scale.reach + PRINTED * largest(Gr))
        self._compare("Cr", "Gr", sid.Cr.zero, axial(of_Gr), dust * scale.reach + PRINTED * largest(Gr))
        return 0.25 * _trace(slope)[..., None, None] * np.eye(3) - 0.5 * slope + 0.5 * cross_matrix(sid.Cr.zero)

    def _of_spin(self) -> Real | None:
        """The second moments (m,m,3,3) in the slope of Oe, if it has one.

        The last three columns of Oe are xy, yz, zx in the standard and xy, xz, yz in some files: the order is the one
        that agrees better with the slope of J.
        """
        sid, scale = self.sid, Scale.of(self.sid)
        wanted = symmetric(self.P - _trace(self.P)[..., None, None] * np.eye(3))
        orders = ((0, 1, 2, 3, 4, 5), (0, 1, 2, 3, 5, 4))
        order = min(orders, key=lambda order: largest(_of_six(sid.Oe.zero, order) - wanted))
        dust = ROUNDING * sid.mass * scale.shape * scale.reach
        self._compare("M1 of J", "Oe", wanted, _of_six(sid.Oe.zero, order), dust)
        if sid.Oe.first is None:
            return None
        slope = _of_six(sid.Oe.first, order)
        return slope - 0.5 * _trace(slope)[..., None, None] * np.eye(3)

    def _separate(self, second: Real, notes: list[str]) -> None:
        """Q from Oe and Ge, if Gr has no M1.

        The trace of Oe that is not explained by the modal masses is taken for geometric stiffness along the longest
        axis of the body.
        """
        sid = self.sid
        extra = _trace(second) - sid.Me.zero
        if largest(extra) > PRINTED * largest(sid.Me.zero):
            axis = np.linalg.eigh(second_moment(sid.J.zero))[1][:, -1]
            self.change = extra[..., None, None] * np.outer(axis, axis)
            notes.append("Gr has no M1: the geometric stiffness in Oe is taken to act along the body's longest axis")
        gyration = sid.Ge.zero.reshape(self.m, self.m, 3)
        gyration = 0.5 * (gyration - np.swapaxes(gyration, 0, 1))  # another part would make energy
        if sid.Cr.first is not None:
            of_Cr = sid.Cr.first - np.swapaxes(sid.Cr.first, 0, 1)
            self._compare("M1 of Cr", "Ge", of_Cr, gyration, ROUNDING * largest(sid.Me.zero))
            gyration = of_Cr
        self.Q = second - self.change + 0.25 * cross_matrix(gyration)

    def leave_at_rest(self) -> None:
        """Make Q one that has the modal masses, and Ct and P such that masses can have them with these.

        The rigid-body share of a mode is what Ct and P say, if its modal mass allows that. Else the slope of J gives
        way first, then Ct, then Cr, and a note says by how much. The rest of the modal masses moves along x.
        """
        sid = self.sid
        try:
            np.linalg.cholesky(symmetric(sid.Me.zero))  # an eigenvalue of rounding may be above zero
        except np.linalg.LinAlgError:
            what = "Me is not positive definite, and no distribution of mass has such modal masses: correct it"
            raise SidError(what) from None
        moments = np.block([[np.array([[sid.mass]]), sid.mdCM.zero.T], [sid.mdCM.zero, second_moment(sid.J.zero)]])
        size = np.repeat(np.sqrt([sid.mass, max(np.trace(moments[1:, 1:]), np.finfo(float).tiny)]), (1, 3))
        inverse = np.linalg.pinv(moments / np.outer(size, size), rcond=PRINTED, hermitian=True) / np.outer(size, size)
        given = np.concatenate([self.Ct[:, :, None], self.P], axis=2)
        rows = given
        beyond = (given - given @ inverse @ moments) / size  # moves along axes in which the body has no extent
        is_beyond = largest(beyond) > PRINTED * largest(given / size)
        if self.m and (is_beyond or _share(rows, inverse, sid.Me.zero) > 1.0 + PRINTED):
            rows = self._possible(given, inverse, is_beyond)
            self.Ct, self.P = rows[:, :, 0], rows[:, :, 1:]
            for name, before, after in (
                ("Ct", given[:, :, 0], self.Ct), ("Cr", axial(given[:, :, 1:]), axial(self.P)),
                ("M1 of J", symmetric(given[:, :, 1:]), symmetric(self.P)),
            ):  # fmt: skip
                self._compare("Me", name, after, before, 0.0, "no distribution of mass has both: ")
        self.Q = np.einsum("nab,bc,kdc->nkad", rows, inverse, rows)
        self.Q += (sid.Me.zero - _trace(self.Q))[..., None, None] * np.outer([1.0, 0.0, 0.0], [1.0, 0.0, 0.0])
        self.change, self.at_rest_only = np.zeros((self.m, self.m, 3, 3)), True

    def _possible(self, given: Real, inverse: Real, is_beyond: bool) -> Real:
        """Rows [Ct P] (m,3,4) that masses can have with Me: the given ones, as far as Me allows.

        `is_beyond`: with the given ones points would move that have no mass; then they are those of rigid motions.
        """
        sid, centre = self.sid, self.sid.mdCM.zero[:, 0]
        J = symmetric(sid.J.zero)
        about_centre = J - steiner(np.outer(centre, centre)) / sid.mass

        def rigid(shift: Real, turn: Real) -> Real:
            """Rows of a rigid motion: shifts (m,3) and rotations (m,3) of the body."""
            turned = cross_matrix(turn)
            return np.concatenate(
                [
                    (sid.mass * shift + np.cross(turn, centre))[:, :, None],
                    shift[:, :, None] * centre + turned @ second_moment(J),
                ],
                axis=2,
            )

        turn = sid.Cr.zero @ np.linalg.pinv(J, rcond=PRINTED, hermitian=True)
        whole = (sid.Cr.zero - np.cross(centre / sid.mass, self.Ct)) @ np.linalg.pinv(
            about_centre, rcond=PRINTED, hermitian=True
        )
        rows = np.zeros_like(given)
        steps = [rigid(np.zeros_like(turn), turn), rigid((self.Ct - np.cross(whole, centre)) / sid.mass, whole), given]
        for better in steps[:2] if is_beyond else steps:
            if _share(better, inverse, sid.Me.zero) > LARGEST_SHARE:
                return _between(rows, better, inverse, sid.Me.zero)
            rows = better
        return rows

    def _compare(self, taken: str, other: str, a: Real, b: Real, slack: float, why: str = "") -> None:
        """Note that the `other` block, of which b follows, is not what follows from the one that is `taken`, a."""
        size, gap = max(largest(a), largest(b)), largest(a - b)
        if gap > PRINTED * size + slack:
            self.disagreements.append(
                f"{other} and {taken} contradict each other, by {gap:.3g} of {size:.3g}: {why}{taken} is taken"
            )


def planar(sid: Sid, notes: list[str]) -> Sid:
    """The file, or, of a planar program, whose J has one moment only, one of the same motions in its plane.

    Its masses are on a line through the mass centre and the origin, which has that moment, and motion out of the plane
    is not in the file. Slopes of order 1 but that of J are left out, as they are planar too.
    """
    moments = np.diag(sid.J.zero)
    normal = int(np.argmax(np.abs(moments)))
    if np.count_nonzero(sid.J.zero) != 1 or not moments[normal] > 0.0:
        return sid
    axis, line = np.eye(3)[normal], np.delete(np.eye(3), normal, axis=0)[0]
    centre = sid.mdCM.zero[:, 0] - axis * sid.mdCM.zero[normal, 0]
    line = centre / np.linalg.norm(centre) if np.any(centre) else line
    across = np.cross(axis, line)
    m = len(sid.modes)
    slope = np.zeros(m) if sid.J.first is None else sid.J.first[normal, :, normal]
    # sum m phi r' with r along the line: Cr = (sum m r phi across it) and half the slope of J along it
    P = np.einsum("n,a,b->nab", 0.5 * slope, line, line)
    P += np.einsum("n,a,b->nab", sid.Cr.zero @ axis, across, line)
    Gr = 2.0 * (_trace(P)[..., None, None] * np.eye(3) - P)
    spin = symmetric(P - _trace(P)[..., None, None] * np.eye(3))
    J1 = np.moveaxis(-2.0 * spin, 0, 1)
    notes.append(
        f"J has {'xyz'[normal] * 2} only, as in files of planar programs: motion in the plane is that of the file, out "
        "of it that of masses on a line through the mass centre; the change of inertia with the modes is left out"
    )
    side = np.concatenate(list(Gr), axis=1) if m else np.zeros((3, 0))
    return replace(
        sid,
        J=Taylor(moments[normal] * (np.eye(3) - np.outer(line, line)), J1),
        Cr=Taylor(np.outer(sid.Cr.zero @ axis, axis)),
        Gr=Taylor(side),
        Oe=Taylor(spin[..., ROWS, COLUMNS] * np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])),
    )


def second_moment(J: Real) -> Real:
    """The second moment sum m r r' that belongs to an inertia J."""
    return 0.5 * np.trace(J) * np.eye(3) - 0.5 * (J + J.T)


def largest(a: Real) -> float:
    """The largest magnitude of an array, 0 of an empty one."""
    return float(np.max(np.abs(a), initial=0.0))


def _share(rows: Real, inverse: Real, Me: Real) -> float:
    """The largest share of rigid and uniform motion, rows [Ct P] (m,3,4), in the modal masses Me (m,m)."""
    L = np.linalg.cholesky(symmetric(Me))
    with np.errstate(over="ignore", invalid="ignore"):
        share = np.linalg.solve(L, np.linalg.solve(L, np.einsum("nab,bc,kac->nk", rows, inverse, rows)).T)
    return float(np.linalg.eigvalsh(symmetric(share))[-1]) if np.all(np.isfinite(share)) else np.inf


def _between(good: Real, bad: Real, inverse: Real, Me: Real) -> Real:
    """The rows on the way from `good` to `bad` ones at which their share reaches its bound, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if _share(good + middle * (bad - good), inverse, Me) > LARGEST_SHARE:
            high = middle
        else:
            low = middle
    return good + low * (bad - good)


def _of_six(six: Real, order: tuple[int, ...]) -> Real:
    """Symmetric matrices (...,3,3) A with w' A w = six . w_q."""
    found = np.zeros((*six.shape[:-1], 3, 3))
    for i, j, column in zip(ROWS, COLUMNS, order, strict=True):
        found[..., i, j] += 0.5 * six[..., column]
        found[..., j, i] += 0.5 * six[..., column]
    return found


def _matrices(side_by_side: Real) -> Real:
    """Matrices side by side (3,3m) as an array (m,3,3)."""
    return side_by_side.reshape(3, -1, 3).swapaxes(0, 1)


def axial(P: Real) -> Real:
    """sum m r x phi from P = sum m phi r' (...,3,3)."""
    return np.stack([P[..., 2, 1] - P[..., 1, 2], P[..., 0, 2] - P[..., 2, 0], P[..., 1, 0] - P[..., 0, 1]], axis=-1)


def _trace(A: Real) -> Real:
    return np.trace(A, axis1=-2, axis2=-1)
