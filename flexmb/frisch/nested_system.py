"""Accelerations and loads of a system by Frisch's equations, and their matrices by the names of the paper."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flexmb.building.assemble import assemble
from flexmb.building.links import BodyLink, links
from flexmb.building.numbering import Numbering
from flexmb.frisch import evaluation
from flexmb.frisch.constants import nested_constants
from flexmb.frisch.errata import CORRECTED, Erratum
from flexmb.frisch.tables import NestedWorkspace, workspace
from flexmb.scene.schema import Scene
from flexmb.tables.arrays import Constants
from flexmb.tables.per_thread import per_thread
from flexmb.tables.state import Layout, finite_result
from flexmb.typing import Index, Real


@dataclass(frozen=True)
class Partitions:
    """The equations of motion (111), partition by partition, all vectors in World axes.

    First rows: rotation of the nests of all bodies, then translation of those nests whose hinges translate (in the
    paper point masses and the base, here also prismatic hinges, for example). Second: wheels. Third: modes. Last:
    translation of the remaining nests, which their hinges suppress.

    X, I_c, F, Gamma, I_s, M1, A, M2   as in (111)
    eta                                right-hand sides eta_1 .. eta_4 with external loads, without those of hinges
    S                                  (126) times (133), rows as above, a column for each speed
    bias                               expanded accelerations at udot = 0: second terms of (127), (134)
    """

    X: Real
    I_c: Real
    F: Real
    Gamma: Real
    I_s: Real
    M1: Real
    A: Real
    M2: Real
    eta: tuple[Real, Real, Real, Real]
    S: Real
    bias: Real

    @property
    def matrix(self) -> Real:
        """The coefficient matrix of (111)."""
        wheels, modes, last = len(self.I_s), len(self.M1), len(self.M2)
        return np.block([
            [self.X, self.I_c, self.F, self.Gamma],
            [self.I_c.T, self.I_s, np.zeros((wheels, modes)), np.zeros((wheels, last))],
            [self.F.T, np.zeros((modes, wheels)), self.M1, self.A],
            [self.Gamma.T, np.zeros((last, wheels)), self.A.T, self.M2],
        ])


class RelativeMotion(NamedTuple):
    """Bodies and wheels relative to the bodies that carry them, World axes.

    beta (N,3)   m   from the parent's hinge point to the body's (2)
    alpha (N,3)  m   from the body's hinge point to its mass centre (47)
    S (nx,nu)        expanded velocities S u (126): angular rates of the N bodies, of the W wheels, modal rates,
                     rates of beta as the parent sees them
    bias (nx,)       rates of the expanded velocities are S udot + bias (127): inertial rates of the bodies' angular
                     rates, all others as the inboard body sees them
    """

    beta: Real
    alpha: Real
    S: Real
    bias: Real


class NestedMotion(NamedTuple):
    """Accelerations (nu,), drive loads (nu,) of prescribed speeds, loads (N,6) of hinges, torques (W,3) of wheels."""

    accelerations: Real
    drives: Real
    loads: Real
    wheel_torques: Real


def nested_system(scene: Scene, errata: Set[Erratum] = CORRECTED, null_partitions: bool = False) -> NestedSystem:
    """Frisch's equations of a checked scene; `errata` are the defects of the print to keep.

    `null_partitions` also computes those partitions of (126) that vanish. The difference in time is what the paper's
    logic flags save.
    """
    chain = links(scene)
    numbering = Numbering(chain, scene)
    constants = assemble(scene, chain, numbering, null_partitions=null_partitions).constants
    return NestedSystem(constants, chain, numbering.layout, errata, null_partitions)


class NestedSystem:
    """The equations of one scene. Threads may share them: each has a workspace of its own.

    All methods take y = [q, u, work]. They raise ValueError or TypeError for arrays that do not fit, DynamicsError
    where numbers overflow.
    """

    def __init__(
        self,
        constants: Constants,
        chain: list[BodyLink],
        layout: Layout,
        errata: Set[Erratum] = CORRECTED,
        null_partitions: bool = False,
    ) -> None:
        """`errata` of the print are kept; `null_partitions`: see `flexmb.frisch.constants.nested_constants`."""
        self.constants = nested_constants(constants, chain, errata, null_partitions)
        self._layout = layout

    @per_thread
    def own_workspace(self) -> NestedWorkspace:
        """The workspace of the calling thread, overwritten by every method."""
        return self.workspace()

    def workspace(self) -> NestedWorkspace:
        """A fresh workspace for the right-hand side; one per thread."""
        return workspace(self.constants, self._layout.nq)

    def accelerations(self, t: float, y: Real) -> tuple[int, Real]:
        """Status code and udot (nu,) at y = [q, u, work]."""
        status = evaluation.accelerations(*self._layout.whole(t, y), self.constants, self.own_workspace)
        return status, self.own_workspace.speed["acceleration"].copy()

    def motion(self, t: float, y: Real) -> tuple[int, NestedMotion]:
        """Status code, accelerations, and the loads from the suppressed rows."""
        w = self.own_workspace
        status = evaluation.loads(*self._layout.whole(t, y), self.constants, w)
        drives = np.where(self.constants.speed["prescribed"] >= 0, w.speed["drive"], 0.0)
        rates, loads, torques = w.speed["acceleration"].copy(), w.nest["load"].copy(), w.wheel["torque"].copy()
        return status, NestedMotion(rates, drives, loads, torques)

    @property
    def doubt(self) -> Index:
        """(1,) whether the last evaluation met a pivot that may consist of rounding errors."""
        return self.own_workspace.doubt

    @property
    def fault(self) -> int:
        """Body at which the last evaluation failed."""
        return int(self.own_workspace.fault[0])

    def reduced(self, t: float, y: Real) -> tuple[Real, Real]:
        """Matrix (nu,nu) and right-hand side (nu,) of (136)."""
        t, y = self._layout.whole(t, y)
        evaluation.assemble(t, y, self.constants, self.own_workspace)
        return finite_result(self.own_workspace.M.copy(), t), finite_result(self.own_workspace.right.copy(), t)

    def partitions(self, t: float, y: Real) -> Partitions:
        """The named blocks of (111) at y."""
        motion = self.relative_motion(t, y)
        finite_result(self.own_workspace.Z, t), finite_result(self.own_workspace.eta, t)
        first, wheels, modes, last = self._rows()
        rows = np.concatenate([first, wheels, modes, last])
        Z, eta = self.own_workspace.Z, self.own_workspace.eta
        return Partitions(
            X=Z[np.ix_(first, first)],
            I_c=Z[np.ix_(first, wheels)],
            F=Z[np.ix_(first, modes)],
            Gamma=Z[np.ix_(first, last)],
            I_s=Z[np.ix_(wheels, wheels)],
            M1=Z[np.ix_(modes, modes)],
            A=Z[np.ix_(modes, last)],
            M2=Z[np.ix_(last, last)],
            eta=(eta[first], eta[wheels], eta[modes], eta[last]),
            S=motion.S[rows],
            bias=motion.bias[rows],
        )

    def relative_motion(self, t: float, y: Real) -> RelativeMotion:
        """NestedMotion of contiguous bodies at y, every row of it, those without inertia of their own too (117)."""
        w, c = self.own_workspace, self.constants
        t, y = self._layout.whole(t, y)
        evaluation.assemble(t, y, c, w)
        finite_result(w.x, t)
        S = np.zeros((len(w.x), len(c.column)))
        for j, column in enumerate(c.column):
            entries = slice(column["start"], column["stop"])
            S[c.entry_row[entries], j] = w.S[entries]
        return RelativeMotion(w.nest["beta"].copy(), w.nest["alpha"].copy(), S, w.x.copy())

    def _rows(self) -> tuple[Index, Index, Index, Index]:
        """Expanded rows of the four partitions."""
        c, w = self.constants, self.own_workspace
        bodies, nx = len(c.body), len(w.x)
        rows = np.arange(nx)
        rotation = rows[: 3 * bodies].reshape(-1, 3)[np.any(c.element["Phi"], axis=1)]
        translation = rows[nx - 3 * bodies :].reshape(-1, 3)
        free = np.any(w.nest["hinge_map"][:, 3:, :], axis=(1, 2))
        first = np.concatenate([rotation.ravel(), translation[free].ravel()])
        wheels = rows[3 * bodies : 3 * bodies + 3 * len(c.wheel)]
        modes = rows[3 * bodies + 3 * len(c.wheel) : nx - 3 * bodies]
        return first, wheels, modes, translation[~free].ravel()
