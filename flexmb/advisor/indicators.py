"""Predicted error of a rung, from a single run of the rigid scene.

The error is that of the effects which the rung omits, as a fraction of the quantity's scale. It is predicted from these
indicators, which use the modal response to the rigid motion:

    participation   contribution of omitted modes to the quantity; attachment modes include its static part
    stiffening      kappa_n = K_G,nn / omega_n^2: geometric stiffness by the axial force of spin, gravity and tip loads,
                    relative to the modal stiffness; -1 is buckling. Levels without second-order shapes omit it
    spin            (w / omega_1)^2, the softening that `ruthless` omits; at 1 and above, `full` is unstable
    deflection      the largest deflection relative to the length: each order of it is omitted by some levels, none by
                    level exact, whose polynomials converge to the strain
    equivalence     mismatch of effective inertia of the best spring hinge, (149)-(151) of Frisch

Predictions order the ladder and select the start of the search; the decisions are based on runs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from flexmb.advisor.contribution import contribution, free_share, moved
from flexmb.advisor.modal_response import FAMILIES, ModalResponse, RigidRun, eigenmodes
from flexmb.advisor.models import BodyModel, fitted_hinge
from flexmb.frisch.equivalence.appendage import appendage_of
from flexmb.frisch.equivalence.comparison import coupling_error
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.scene.bodies import BeamBody
from flexmb.scene.schema import Scene
from flexmb.typing import Real

_TINY = np.finfo(float).tiny
POLYNOMIAL_ERROR = 0.1
"""Ratio of the errors of n + 1 and n polynomials of a curvature, about that of a cantilever in motion."""
SEGMENT_ERROR = 4.5
"""Phase error of the first modes of a chain of n segments after some periods: SEGMENT_ERROR / n^2 of the response."""


STRAIGHT = 0.1
"""Distance between a straight rigid body on the best hinge and the bent body, as a fraction of the response."""


@dataclass(frozen=True)
class Indicators:
    """Predictions for one body, all dimensionless.

    `flexibility`: error of the rigid body, relative to the scale; `static`, `dynamic` (m,): largest contribution of
    each mode, and that beyond its quasi-static deflection; `stiffening`: largest |kappa| of the lowest modes;
    `compression`: most negative kappa; `spin`; `deflection`; `shortening`: second-order shortening, relative to the
    scale; `share`: see `free_share`; `mismatch` of the best spring hinge, infinite if there is none.
    """

    flexibility: float
    static: Real
    dynamic: Real
    family: NDArray[np.intp]
    stiffening: float
    compression: float
    spin: float
    deflection: float
    shortening: float
    share: float
    mismatch: float

    def families_above(self, least: float) -> frozenset[str]:
        """Families of modes that contribute more than `least`, a fraction of the scale."""
        return frozenset(name for i, name in enumerate(FAMILIES) if np.any(self.static[self.family == i] > least))

    def reason(self) -> str:
        """The relevant indicators in words."""
        parts = [f"bends by {self.deflection:.2g} of its length, {self.flexibility:.2g} of the quantity"]
        if self.spin > 1e-6:
            parts.append(f"(spin / first frequency)^2 = {self.spin:.2g}")
        if self.stiffening > 1e-6:
            parts.append(f"axial force / modal stiffness = {self.stiffening:.2g}")
        if self.compression < -1e-3:
            parts.append(f"compressed to {-self.compression:.2g} of buckling")
        return "; ".join(parts)


def indicators(rigid: RigidRun, scene: Scene, response: ModalResponse, scale: dict[str, float]) -> Indicators:
    """All indicators of one body for the channels of `scale`, which maps them to the scales of their errors."""
    part = moved(rigid, response)
    modes = response.model.mode_count
    static, dynamic, whole, shortening = np.zeros(modes), np.zeros(modes), 0.0, 0.0
    lagging = response.force / np.maximum(response.frequencies**2, _TINY)
    beyond = np.abs(response.eta - lagging).max(axis=0) / np.maximum(np.abs(response.eta).max(axis=0), _TINY)
    curve = _shortening(response)
    for channel, size in scale.items():
        added = contribution(channel, rigid, scene, part) / size
        largest = np.linalg.norm(added, axis=1).max(axis=0)
        static, dynamic = np.maximum(static, largest), np.maximum(dynamic, largest * np.minimum(beyond, 1.0))
        whole = max(whole, float(np.linalg.norm(added.sum(axis=2), axis=1).max()))
        if channel.endswith(".position"):
            shortening = max(shortening, curve / size)
    kappa = _geometric(response)
    lowest = max(float(response.frequencies.min(initial=np.inf)), _TINY)
    return Indicators(
        flexibility=whole, static=static, dynamic=dynamic, family=response.family,
        stiffening=float(np.abs(kappa).max(initial=0.0)), compression=float(kappa.min(initial=0.0)),
        spin=float((np.linalg.norm(response.w, axis=1).max() / lowest) ** 2),
        deflection=_deflection(response), shortening=shortening,
        share=free_share(rigid, scene, response.body.name), mismatch=_mismatch(scene, response.body.name),
    )  # fmt: skip


def predicted(rung: BodyModel, body: Indicators) -> float:
    """Predicted error of a rung, relative to the scale; infinite if it would be unstable."""
    whole = body.flexibility
    if rung.kind == "rigid":
        return whole
    if rung.kind == "sprung":
        if not np.isfinite(body.mismatch):
            return np.inf
        return whole * min(body.mismatch + STRAIGHT, 1.0) + float(body.dynamic[2:].sum())
    if rung.kind == "segments":
        return whole * min(SEGMENT_ERROR / rung.pieces**2, 1.0)
    if rung.kind == "pieces":
        held = len(set(body.family.tolist())) * (rung.pieces + rung.modes)
        return of_level(rung.level, body) / rung.pieces**2 + float(body.dynamic[held:].sum())
    if rung.kind == "strains":
        held = len(set(body.family.tolist())) * rung.pieces * rung.polynomials
        return whole * POLYNOMIAL_ERROR**rung.polynomials / rung.pieces**2 + float(body.dynamic[held:].sum())
    chosen = np.isin(body.family, [FAMILIES.index(name) for name in rung.families if name in FAMILIES])
    among = chosen if rung.families else np.ones(len(body.static), dtype=bool)
    kept = among & (np.cumsum(among) <= rung.modes)
    if rung.static:  # the attachment modes of a family replace two more modes, but only quasi-statically
        kept = among & (np.cumsum(among) <= rung.modes + 2 * len(set(body.family[among].tolist())))
    left = np.where(among & rung.static, body.dynamic, body.static)
    return float(left[~kept].sum()) + of_level(rung.level, body)


def of_level(level: str, body: Indicators) -> float:
    """Predicted error of a level, relative to the scale."""
    whole, bent = body.flexibility, body.deflection
    if level == "exact":
        return 0.0
    third_order = whole * bent**2
    if level == "stiffened":
        return third_order
    if level == "ruthless":
        return whole * (abs(body.stiffening - body.spin) + bent) + 2.0 * bent * body.share + body.shortening
    if body.spin >= 1.0 + body.stiffening or body.spin >= 1.0:
        return np.inf
    second_order = whole * body.stiffening / (1.0 - body.spin) + body.shortening + third_order
    return second_order + (whole * bent if level == "linear" else 0.0)


def _axis(body: BeamBody) -> tuple[Real, Real, Real]:
    """x (n,), mass (n,) along the axis and slopes (n,3,m) of the eigenmodes there."""
    model = eigenmodes(body if body.level == "exact" else replace(body, points="line"))
    root, tip = model.nodes["root"], model.nodes["tip"]
    x = np.concatenate([model.position[:, 0], [root.position[0], tip.position[0]]])
    slopes = np.concatenate([model.rotation, [root.rotation_modes, tip.rotation_modes]])
    order = np.argsort(x, kind="stable")
    return x[order], np.concatenate([model.mass, [0.0, 0.0]])[order], slopes[order]


def _geometric(response: ModalResponse) -> Real:
    """kappa (T,m') of the two lowest modes of a beam."""
    body = response.body
    if not isinstance(body, BeamBody):
        return _like_a_cantilever(response)
    x, mass, slopes = _axis(body)
    squares = np.sum(slopes[:, 1:] ** 2, axis=1)[:, :2]  # rotation about y and z
    before = np.vstack([np.zeros((1, squares.shape[1])), squares[:-1]])
    g = np.cumsum((squares + before) / 2.0 * np.diff(x, prepend=0.0)[:, None], axis=0)
    w, a = response.w, response.acceleration
    along = a[:, :1] + np.outer(-(w[:, 1] ** 2 + w[:, 2] ** 2), x)  # axial acceleration of the points, less gravity
    stiffness = (-along * mass) @ g
    for node, _, force in response.loads:
        at = response.model.nodes[node].position[0]
        stiffness += force[:, :1] * np.array([np.interp(at, x, column) for column in g.T])
    return stiffness / response.frequencies[: g.shape[1]] ** 2


def _like_a_cantilever(response: ModalResponse) -> Real:
    """|kappa| (T,1) of a raw body, whose slopes are unknown: that of a uniform cantilever of the same length.

    For its first mode with all loads along it: 1.1933 w^2 by spin, 1.5709 a / L by acceleration and 4.6478 P / (m L) by
    a force at the tip.
    """
    model = response.model
    length, mass = _length(model), float(model.mass.sum())
    pulls = np.sum([np.linalg.norm(force, axis=1) for _, _, force in response.loads], axis=0)
    w, a = np.linalg.norm(response.w, axis=1), np.linalg.norm(response.acceleration, axis=1)
    stiffness = 1.1933 * w**2 + 1.5709 * a / length + 4.6478 * pulls / (mass * length)
    return np.atleast_2d(stiffness / max(response.frequencies.min() ** 2, _TINY)).T


def _shortening(response: ModalResponse) -> float:
    """Half the integral of the squared slope (m); for a raw body that of a cantilever's first mode, 0.58 times the
    squared deflection over the length."""
    if not isinstance(response.body, BeamBody):
        return 0.58 * _deflection(response) ** 2 * _length(response.model)
    x, _, slopes = _axis(response.body)
    m = response.eta.shape[1]
    angle = np.einsum("pim,tm->tpi", slopes[:, 1:, :m], response.eta)
    return float(np.max(0.5 * np.trapezoid(np.sum(angle**2, axis=2), x, axis=1)))


def _deflection(response: ModalResponse) -> float:
    model = response.model
    size = _length(model)
    far = int(np.argmax(np.sum(model.translation[:, :, 0] ** 2, axis=1)))
    bent = np.linalg.norm(response.eta @ model.translation[far].T, axis=1)
    return float(bent.max() / max(size, _TINY))


def _length(model: FlexibleModel) -> float:
    return float(np.linalg.norm(model.position, axis=1).max())


def _mismatch(scene: Scene, body: str) -> float:
    try:
        return coupling_error(appendage_of(scene, body), fitted_hinge(scene, body))
    except ValueError:  # the body is not an appendage, or no mode turns it
        return np.inf
