"""Derivatives of impulses along speeds, which give some speeds new values: see `flexmb.run.impulses`.

With A = [E; J] of the speeds that get values and of closures' rows, and impulses p,

    M (u+ - u-) = A' p,    A u+ = [given; 0],

the change of u+ along directions of the state and the parameters follows from

    M du+ - A' dp = M du- - dM (u+ - u-) + dJ' p,    A du+ = [d given; -dJ u+].

dM times a vector is that of inverse dynamics in dual numbers, and so are dJ' p and dJ u+ those of the closures.
"""

from __future__ import annotations

import numpy as np

from flexmb.closure.factor import DEPENDENT
from flexmb.closure.operators import RowMotion
from flexmb.run.impulses import struck
from flexmb.scene.tree import rate_name, scalar_paths
from flexmb.sensitivity.leg import Course, Variation
from flexmb.tables.state import State, pack
from flexmb.typing import Real


class Striking:
    """The impulses of one instant, one after the other.

    The speeds that drives keep are those of prescribed coordinates, also of those that were latched at this instant.
    """

    def __init__(self, variation: Variation, y: Real, held: dict[str, Real]) -> None:
        """y (n,) = [q, u, x, work] before the first of them."""
        self._variation, self._y = variation, y.copy()
        system = variation.blocks.system
        self._paths = scalar_paths(system.scene)
        self._names = [name for names in system.state_names for name, _ in names]
        self._kept = set(np.flatnonzero(system.constants.speed["prescribed"] >= 0).tolist())

    def place(self, coordinate: str) -> int:
        """Index of a coordinate in y."""
        return self._names.index(coordinate)

    def free(self, coordinate: str) -> None:
        """From now on no drive keeps the speed of a coordinate."""
        self._kept.discard(self._speed(coordinate))

    def struck(self, D: Real, coordinate: str, factor: float, change: Real) -> Real:
        """The change (n,P) of the state after an impulse that multiplies the speed of a coordinate by a factor, from
        that before it, D (n,P), and the change (P,) of the factor. Afterwards the speed is kept if the factor is 0."""
        blocks, t = self._variation.blocks, self._variation.leg.raw.t
        system, y = blocks.system, self._y
        nq, nu = system.nq, system.nu
        state = State(y[:nq].copy(), y[nq : nq + nu].copy(), t, system.layout)
        j = self._speed(coordinate)
        given = {place: state.u[place] for place in self._kept} | {j: factor * state.u[j]}
        found = struck(system, state, given)
        after, gained = found.u, found.energy
        speeds = sorted(given)
        wanted = D[nq + np.array(speeds)].copy()
        wanted[speeds.index(j)] = change * state.u[j] + factor * D[nq + j]
        p, du, dp = self._changed(state, after - state.u, D, speeds, wanted)
        sums = (after + state.u)[speeds]
        out = D.copy()
        out[nq : nq + nu] = du
        out[-1] += 0.5 * (sums @ dp + p @ (du + D[nq : nq + nu])[speeds])
        y[nq : nq + nu], y[-1] = after, y[-1] + gained
        if factor == 0.0:
            self._kept.add(j)
        return out

    def _changed(self, state: State, gain: Real, D: Real, speeds: list[int], wanted: Real) -> tuple[Real, Real, Real]:
        """Impulses (k,) along `speeds`, the changes of all speeds (nu,P) after them, and those of the impulses (k,P);
        gain (nu,): u+ - u-; wanted (k,P): changes of `speeds`. Of impulses that redundant closures leave undetermined
        the least ones are taken, which does not affect the speeds."""
        blocks, t = self._variation.blocks, state.t
        system = blocks.system
        nq, nu, k, P = system.nq, system.nu, len(speeds), D.shape[1]
        M, along = system.mass_matrix(state), np.eye(nu)[speeds]
        by_rows, of_drives, opening = np.zeros((nu, P)), np.zeros((nu, P)), np.zeros((0, P))
        by_closures = np.zeros(nu)
        impulses = (M @ gain)[speeds]
        if system.closures is not None:
            J = RowMotion(system.closures, t, pack(state)).jacobian
            along = np.vstack([along, J])
            impulses, rows = np.split(np.linalg.lstsq(along.T, M @ gain, rcond=DEPENDENT)[0], [k])
            self._put(state.u + gain, D, with_speeds=False)
            response = blocks.response(t, rows)
            by_closures, of_drives, opening = response.gain, -response.drive_rates, -response.row_rates
            by_rows = M @ response.gain_rates
        self._put(state.u, D)
        _, turned = blocks.inertia_forces(t, gain - by_closures)  # dM M^-1 E'p, by the change of the coordinates
        right = M @ D[nq : nq + nu] - turned + by_rows
        right[speeds] += of_drives[speeds]
        whole = np.block([[M, -along.T], [along, np.zeros((len(along), len(along)))]])
        change = np.linalg.lstsq(whole, np.vstack([right, wanted, opening]), rcond=None)[0]
        return impulses, change[:nu], change[nu : nu + k]

    def _put(self, u: Real, D: Real, with_speeds: bool = True) -> None:
        """Set the states of the blocks to the coordinates and these speeds (nu,), and their changes along D."""
        nq, nu = self._variation.blocks.system.nq, self._variation.blocks.system.nu
        y, along = self._y.copy(), D.copy()
        y[nq : nq + nu] = u
        if not with_speeds:
            along[nq : nq + nu] = 0.0
        self._variation.take(Course(y, along))

    def _speed(self, coordinate: str) -> int:
        """Index in u of the rate of a coordinate."""
        rate = rate_name(coordinate, self._paths[coordinate])
        return self._names.index(rate) - self._variation.blocks.system.nq
