"""Whether bodies turn faster than their level of fidelity describes.

The inertial loads of a turn at w soften a mode by w^2, and the pull that they exert along the body stiffens it: a
cantilever that turns about an axis across itself by 1.19 w^2, Southwell's coefficient. Levels without second-order
shapes leave out the pull, or both: their lowest frequency omega_1 is off by 0.6 (w / omega_1)^2, and `full` and
`linear` are unstable beyond omega_1. What turns about its own axis, as a shaft does, is not pulled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from flexmb.building.links import BodyLink
from flexmb.hinges.catalogue import KINDS
from flexmb.modal.integrals import modal_integrals
from flexmb.scene.bodies import BeamBody
from flexmb.system.moved_sections import cross
from flexmb.system.system import System
from flexmb.tables.arrays import ANGULAR_Z
from flexmb.typing import Flags, Real

UNPULLED = ("ruthless", "linear", "full")
"""Levels without geometric stiffness."""
ALLOWED = 0.2
"""(w / omega_1)^2 up to which nothing is said: there the lowest frequency is off by 11 %."""
LOOKED_AT = 32
"""States of a run that are looked at: those with the fastest turns of hinges."""
ROUNDING = 1e-6
"""What faster turns must be faster by to be looked at."""


class TooFast(NamedTuple):
    """At t (s) a body turns at `rate` (rad/s) across itself, at its level; `first` (rad/s) is its lowest frequency."""

    body: str
    level: str
    t: float
    rate: float
    first: float
    remedy: str

    @property
    def size(self) -> float:
        """(w / omega_1)^2."""
        return (self.rate / self.first) ** 2

    @property
    def what(self) -> str:
        beyond = f'; level "{self.level}" is unstable there' if self.size >= 1.0 and self.level != "ruthless" else ""
        return (
            f'body "{self.body}" turns at {self.rate:.3g} rad/s at t = {self.t:g} s, {self.rate / self.first:.2g} of '
            f'its first frequency of {self.first:.3g} rad/s, and level "{self.level}" leaves out that this pulls it '
            f"straight, an effect of (spin / first frequency)^2 = {self.size:.2g}{beyond}"
        )


def too_fast(system: System, t: Real, u: Real, turns: Callable[[int], Real]) -> Iterator[TooFast]:
    """The bodies that turn beyond their level's range in states at t (T,) s with speeds u (T,nu): once each.

    turns: angular velocities (N,3) rad/s of the bodies in a state, by its number, as `System.turns`.
    """
    if _firsts(system):
        size = np.abs(u) @ weights(system)
        order = np.argsort(-size, kind="stable")[:LOOKED_AT]
        yield from of_runs([system], t[None, order], size[None, order], lambda n: turns(int(order[n]))[None])[0]


def of_runs(systems: Sequence[System], t: Real, size: Real, turns: Callable[[int], Real]) -> list[list[TooFast]]:
    """The same of R runs of one structure each, from states at t (R,K) s, in descending order of `size` (R,K): what no
    body's turn exceeds in parts of what it is allowed, see `weights`.

    turns: angular velocities (R,N,3) rad/s of the bodies in the n-th state of each run.
    """
    watched = sorted({k for system in systems for k in _firsts(system)})
    firsts = np.array([[_firsts(system).get(k, np.inf) for k in watched] for system in systems])
    allowed = np.sqrt(ALLOWED) * firsts
    arms = _all_arms(systems, watched)
    fastest, at = np.zeros(firsts.shape), np.zeros(firsts.shape, np.int64)
    for n in range(size.shape[1]):
        if not np.any(size[:, n, None] > (1.0 + ROUNDING) * np.maximum(fastest, 1.0)):
            break
        rate = _across(turns(n)[:, watched], arms) / allowed
        faster = rate > fastest
        fastest[faster], at[faster] = rate[faster], n
    found: list[list[TooFast]] = [[] for _ in systems]
    for run, j in zip(*np.nonzero(fastest > 1.0), strict=True):
        link, when, first = systems[run].links[watched[j]], float(t[run, at[run, j]]), float(firsts[run, j])
        turn = float(fastest[run, j] * allowed[run, j])
        found[run].append(TooFast(link.name, link.level.name, when, turn, first, _remedy(link)))
    return found


def weights(system: System) -> Real:
    """(nu,) Of the sizes of speeds in a sum that no body's turn exceeds in parts of what it is allowed, but by what
    modes turn: the largest over the bodies that a speed turns; kept.

    A single axis of a body's own hinge counts by its part across the body, so that shafts may turn as they like.
    """
    found: Real | None = system.kept.get("level_range weights")
    if found is None:
        found, body = np.zeros(system.nu), system.constants.body
        for k, first in _firsts(system).items():
            at = k
            while at >= 0:
                place, kind = int(body["u_index"][at]), KINDS[body["hinge_kind"][at]]
                is_own_axis = at == k and body["axis"][at] == ANGULAR_Z
                part = float(_across(np.eye(3)[2], _arms(system, k))) if is_own_axis else 1.0
                for n in set(range(body["nv"][at])) - set(kind.displacements):
                    found[place + n] = max(found[place + n], part / (np.sqrt(ALLOWED) * first))
                at = int(body["parent"][at])
        found = system.kept.setdefault("level_range weights", found)
    return found


def _firsts(system: System) -> dict[int, float]:
    """The lowest frequencies (rad/s) of the bodies that turns may take out of the range of their levels."""
    firsts: dict[int, float] | None = system.kept.get("level_range")
    if firsts is None:
        found = {k: _first(link) for k, link in enumerate(system.links)}
        firsts = system.kept.setdefault("level_range", {k: first for k, first in found.items() if first > 0.0})
    return firsts


def of_hinges(system: System) -> Flags:
    """Which speeds (nu,) are those of hinges; those of modes turn no body as a whole."""
    hinges = np.ones(system.nu, bool)
    for body in system.constants.body:
        hinges[int(body["etad_index"]) : int(body["etad_index"] + body["modes"])] = False
    return hinges


def _remedy(link: BodyLink) -> str:
    if isinstance(link.body, BeamBody):
        return 'take level "stiffened" or "exact"'
    return 'take level "stiffened", which needs a second-order field or geometric stiffness'


def _first(link: BodyLink) -> float:
    """The lowest frequency (rad/s) of the modes that displace the body's axis; 0 for bodies that none can pull."""
    if link.is_rigid or link.level.name not in UNPULLED:
        return 0.0
    model = link.model
    m = model.mode_count
    mass = modal_integrals(model).spatial_mass[:m, :m]
    L = np.linalg.cholesky(mass)
    values, vectors = np.linalg.eigh(np.linalg.solve(L, np.linalg.solve(L, model.stiffness).T))
    shapes = np.linalg.solve(L.T, vectors)
    moved = np.linalg.norm(model.nodes["tip"].translation @ shapes, axis=0) if "tip" in model.nodes else np.ones(m)
    chosen = values[moved > 1e-3 * moved.max(initial=0.0)]
    return float(np.sqrt(max(chosen.min(initial=np.inf), 0.0))) if len(chosen) else 0.0


def _across(w: Real, arms: Real) -> Real:
    """The parts (...) of angular velocities w (...,3) rad/s that pull at points along their distances (...,P,3)."""
    return np.asarray(np.max(np.linalg.norm(cross(w[..., None, :], arms), axis=-1), axis=-1, initial=0.0))


def _all_arms(systems: Sequence[System], watched: Sequence[int]) -> Real:
    """The arms (R,K,P,3) of these bodies, with zeros behind those that have fewer points; one row where all share
    them."""
    rows = [[_arms(system, k) for k in watched] for system in systems]
    if all(one is other for row in rows for one, other in zip(row, rows[0], strict=True)):
        rows = rows[:1]
    arms = np.zeros((len(rows), len(watched), max((len(each) for row in rows for each in row), default=0), 3))
    for place, row in zip(arms, rows, strict=True):
        for own, each in zip(place, row, strict=True):
            own[: len(each)] = each
    return arms


def _arms(system: System, k: int) -> Real:
    """Vectors (P,3) from the origin of a body to its points, in parts of the largest distance; kept."""
    arms: dict[int, Real] = system.kept.setdefault("level_range arms", {})
    if k not in arms:
        model = system.links[k].model
        r = model.position - model.nodes["origin"].position
        far = float(np.max(np.linalg.norm(r, axis=1), initial=0.0))
        arms[k] = r / far if far > 0.0 else np.zeros((0, 3))
    return arms[k]
