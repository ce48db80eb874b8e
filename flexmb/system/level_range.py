"""Whether bodies turn faster than their level of fidelity describes.

The inertial loads of a turn at w soften a mode by w^2, and the pull that they exert along the body stiffens it: a
cantilever that turns about an axis across itself by 1.19 w^2, Southwell's coefficient. Levels without second-order
shapes leave out the pull, or both: their lowest frequency omega_1 is off by 0.6 (w / omega_1)^2, and `full` and
`linear` are unstable beyond omega_1. What turns about its own axis, as a shaft does, is not pulled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from flexmb.building.links import BodyLink
from flexmb.modal.integrals import modal_integrals
from flexmb.scene.bodies import BeamBody
from flexmb.system.system import System
from flexmb.typing import Flags, Real

UNPULLED = ("ruthless", "linear", "full")
"""Levels without geometric stiffness."""
ALLOWED = 0.2
"""(w / omega_1)^2 up to which nothing is said: there the lowest frequency is off by 11 %."""
LOOKED_AT = 32
"""States of a run that are looked at: those with the fastest turns of hinges."""


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
    firsts = _firsts(system)
    if not firsts:
        return
    fastest = {k: (0.0, 0) for k in firsts}
    for n in _suspects(system, u, _slow(firsts)):
        w = turns(n)
        for k in firsts:
            rate = _across(system.links[k], w[k])
            fastest[k] = max(fastest[k], (rate, n))
    for k, (rate, n) in fastest.items():
        if rate**2 > ALLOWED * firsts[k] ** 2:
            link = system.links[k]
            yield TooFast(link.name, link.level.name, float(t[n]), rate, firsts[k], _remedy(link))


def turns_to_watch(system: System) -> tuple[list[int], float, int] | None:
    """The entries of y = [q, u, ...] that are speeds of hinges, the sum of their sizes (rad/s) up to which no body
    turns too fast for its level, and how many states are looked at; None where no body can, or the scene waives it."""
    firsts = {} if "level_range" in system.scene.allow else _firsts(system)
    if not firsts:
        return None
    return (system.nq + np.flatnonzero(of_hinges(system))).tolist(), _slow(firsts), LOOKED_AT


def _firsts(system: System) -> dict[int, float]:
    """The lowest frequencies (rad/s) of the bodies that turns may take out of the range of their levels."""
    firsts: dict[int, float] | None = system.kept.get("level_range")
    if firsts is None:
        found = {k: _first(link) for k, link in enumerate(system.links)}
        firsts = system.kept.setdefault("level_range", {k: first for k, first in found.items() if first > 0.0})
    return firsts


def _slow(firsts: dict[int, float]) -> float:
    """The speed (rad/s) up to which nothing is said of any body."""
    return float(np.sqrt(ALLOWED)) * min(firsts.values())


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


def _suspects(system: System, u: Real, slow: float) -> list[int]:
    """The numbers of the states with the largest speeds of hinges.

    Where all speeds together are below `slow` (rad/s), nothing turns faster.
    """
    size = np.abs(u[:, of_hinges(system)]).sum(axis=1)
    order = np.argsort(-size, kind="stable")[:LOOKED_AT]
    return [int(n) for n in order if size[n] > slow]


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


def _across(link: BodyLink, w: Real) -> float:
    """The part of the angular velocity w (3,) rad/s that pulls at the points of a body along their distances."""
    r = link.model.position - link.model.nodes["origin"].position
    far = float(np.max(np.linalg.norm(r, axis=1), initial=0.0))
    return float(np.max(np.linalg.norm(np.cross(w, r), axis=1), initial=0.0)) / far if far > 0.0 else 0.0


