"""The ladder of a body: all rungs that are tried, with predicted error and cost; and the references."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from msgspec.structs import replace
from scipy.linalg import eigvalsh

from flexmb.advisor.models import (
    COUNTS,
    EXACT,
    LEVELS,
    PIECES,
    SEGMENTS,
    STRAINS,
    BodyModel,
    Model,
    built,
    flexible_bodies,
    levels,
)
from flexmb.advisor.modes import all_families, all_strains
from flexmb.jain.cost import articulated
from flexmb.levels.body import BY_NAME
from flexmb.modal import flexible_model
from flexmb.modal.integrals import modal_integrals
from flexmb.scene.bodies import BeamBody, Body, ModalBody
from flexmb.scene.rest_curve import is_curved
from flexmb.scene.schema import Scene
from flexmb.scene.sections import ABOUT_Y, ABOUT_Z, mass_per_length, stiffness_on_axis
from flexmb.scene.strains import CURVATURES, polynomials

EXACT_REFERENCES = ((1, 4), (1, 6), (1, 8), (2, 6), (4, 6), (8, 6))
"""Pieces, and polynomials of each curvature along one, of references for beams that bend far."""
FINER_PIECES = (32, 64)
"""Pieces of references beyond those of the ladder: what waves that jump demand, where they cost little."""
SOFT = 0.05  # of the largest compliance
STEP_AT_HIGHEST = 3.4
"""Step of DOP853 times the highest frequency when that frequency limits the step (measured)."""
STAGES = 12
ZIGZAG = 6.93
"""Highest frequency of a chain of n rigid segments, in which neighbours turn in opposite directions: ZIGZAG n^2
sqrt(EI / (m L^4)), ZIGZAG = sqrt(48)."""


@dataclass(frozen=True)
class Step:
    """A rung with its predictions: error relative to the scale, operations that the body adds to one evaluation,
    highest frequency (rad/s), or fastest decay (1/s) where damping makes that the faster."""

    rung: BodyModel
    error: float
    operations: float
    fastest: float


@dataclass(frozen=True)
class Cost:
    """Prediction of the operations of a run to `t_end` (s). `rigid`: operations of the bodies that are rigid in the
    scene, for one evaluation; `slow`: evaluations of the run of the rigid scene, the least of any run.
    """

    t_end: float
    rigid: float
    slow: int

    def of(self, steps: Iterable[Step]) -> float:
        """Predicted operations of the scene with these rungs for its flexible bodies."""
        cost, fastest = self.rigid, 0.0
        for step in steps:
            cost, fastest = cost + step.operations, max(fastest, step.fastest)
        return cost * max(self.slow, STAGES * self.t_end * fastest / STEP_AT_HIGHEST)


def rungs(
    scene: Scene, body: BeamBody | ModalBody, moving: frozenset[str], bends_far: bool = True
) -> tuple[BodyModel, ...]:
    """All rungs of one body, in no particular order. `moving`: families of a beam that are predicted to be excited;
    `bends_far`: whether level exact may make a difference to it."""
    if isinstance(body, ModalBody):
        every = flexible_model(body).mode_count
        counts = sorted({n for n in COUNTS if n < every} | {every})
        by_modes = (BodyModel("modes", n, level) for level in levels(body) for n in counts)
        return (BodyModel("rigid"), BodyModel("sprung"), *by_modes)
    sets: list[tuple[str, ...]] = [_named(body)]
    some = tuple(family for family in all_families(body) if family in moving)
    if some and some != all_families(body):
        sets.append(some)
    carries = body.modes.static or any(hinge.parent == body.name for hinge in scene.hinges)
    sets_of_strains = (False, True) if _stretches(body) else (False,)
    models = [BodyModel("rigid"), BodyModel("sprung")]
    for families in sets:
        for level in LEVELS:
            models += [BodyModel("modes", n, level, False, families) for n in COUNTS]
            if carries:
                models += [BodyModel("modes", n, level, True, families) for n in (0, 1, 2, 4)]
        if bends_far:
            models += [_strains(n, pieces, more, families) for pieces, n in STRAINS for more in sets_of_strains]
    models += [BodyModel("segments", pieces=n) for n in SEGMENTS]
    models += [BodyModel("pieces", pieces=n, level=level) for n in PIECES for level in LEVELS[-2:]]
    return tuple(models)


def _stretches(body: BeamBody) -> bool:
    """Whether the beam has stretch or shear beside curvatures."""
    own, curvatures = set(all_strains(body)), set(CURVATURES)
    return not own <= curvatures and not own.isdisjoint(curvatures)


def _named(body: BeamBody) -> tuple[str, ...]:
    """The families of a beam without curvatures; none, which stands for its own, if it has one."""
    return all_families(body) if set(all_strains(body)).isdisjoint(CURVATURES) else ()


def _strains(polynomials: int, pieces: int, stretching: bool, families: tuple[str, ...] = ()) -> BodyModel:
    return BodyModel(
        "strains", level=EXACT, families=families, pieces=pieces, polynomials=polynomials, stretching=stretching
    )


def references(scene: Scene, bend_far: frozenset[str] = frozenset()) -> tuple[tuple[str, Model], ...]:
    """Models against which candidates are measured, from coarse to fine; successive ones show their uncertainty.

    First all bodies with the modes that the scene gives them, and four more if it has no attachment modes; then beams
    in pieces, which converge to the geometrically exact beam. If some of them `bend_far` (names), these are of level
    exact instead, with more and more polynomials, then in pieces of six, and the others get more modes. A raw body has
    no other modes than its own. A beam that starts bent cannot be divided; it gets four more modes, or two more
    polynomials, then as many again.
    """
    bodies = flexible_bodies(scene)
    bent = {state.body for state in scene.modal_states}
    splits = {b.name for b in bodies if isinstance(b, BeamBody) and b.name not in bent}
    far = splits & (bend_far | {b.name for b in bodies if isinstance(b, BeamBody) and is_curved(b)})

    def rung(body: BeamBody | ModalBody, more: int, pieces: int) -> BodyModel:
        if isinstance(body, ModalBody):
            return BodyModel("modes", flexible_model(body).mode_count, levels(body)[-1])
        if pieces and body.name in splits:
            return BodyModel("pieces", 0, LEVELS[-1], pieces=pieces)
        if body.level == EXACT:
            return strains(body, max(polynomials(body).values()) + more // 2, body.modes.pieces)
        return BodyModel("modes", body.modes.count + more, LEVELS[-1], body.modes.static)

    def strains(body: BeamBody, count: int, pieces: int) -> BodyModel:
        return _strains(count, pieces, _stretches(body), _named(body))

    def exact(body: BeamBody | ModalBody, count: int, pieces: int) -> BodyModel:
        if isinstance(body, BeamBody) and body.name in far:
            return strains(body, count, pieces)
        return rung(body, count - 4 if pieces == 1 else count, 0)

    if far:
        sizes = [(f"{p} pieces of {n}" if p > 1 else f"{n}", n, p) for p, n in EXACT_REFERENCES]
        return tuple((f"{size} polynomials", tuple((b.name, exact(b, n, p)) for b in bodies)) for size, n, p in sizes)
    first = tuple((b.name, rung(b, 0 if isinstance(b, BeamBody) and b.modes.static else 4, 0)) for b in bodies)
    finer = [(f"{n} pieces", tuple((b.name, rung(b, 4, n)) for b in bodies)) for n in (*PIECES, *FINER_PIECES)]
    if not splits:
        sizes_of_modes = (("more modes", 4), ("still more modes", 8))
        finer = [(name, tuple((b.name, rung(b, more, 0)) for b in bodies)) for name, more in sizes_of_modes]
    return (("modes" if bodies else "the scene", first), *((name, model) for name, model in finer if model != first))


def softest(scene: Scene) -> frozenset[str]:
    """The beam that bends most under a force at its tip, and those that bend nearly as much: at least `SOFT` of it."""
    bends = {b.name: _compliance(b) for b in flexible_bodies(scene) if isinstance(b, BeamBody)}
    return frozenset(name for name, value in bends.items() if value >= SOFT * max(bends.values()))


def _compliance(beam: BeamBody) -> float:
    """L^3 / (3 EI) (m/N) in its weak plane, of the stiffest section."""
    sections = [stiffness_on_axis(station) for station in beam.stations]
    return beam.length_m**3 / (3.0 * float(max(min(K[ABOUT_Y, ABOUT_Y], K[ABOUT_Z, ABOUT_Z]) for K in sections)))


def step(scene: Scene, name: str, rung: BodyModel, error: float) -> Step | None:
    """The predictions for one rung, operations by the polynomials of Jain & Rodriguez' section VII; None if the rung is
    not possible for the body."""
    try:
        whole = built(scene, ((name, rung),))
        before = {b.name for b in scene.bodies if b.name != name}
        parts = [b for b in whole.bodies if b.name not in before]
        counts = [(len(_squares(b)[0]), b.level) for b in parts]
        fastest = _fastest(next(b for b in scene.bodies if b.name == name), rung, parts)
    except ValueError:
        return None
    cost = sum(BY_NAME[level].cost * articulated([n]).total for n, level in counts)
    return Step(rung, error, float(cost), fastest)


def cost(scene: Scene, t_end: float, slow: int) -> Cost:
    """The part of the cost that does not depend on the rungs."""
    rigid = len(scene.bodies) + len(scene.point_masses) - len(flexible_bodies(scene))
    return Cost(t_end, float(articulated([0] * rigid).total), slow)


def model_cost(scene: Scene, model: Model, known: Cost) -> float:
    """Predicted operations of a run of that model, infinite if a rung is not possible for its body."""
    steps = [step(scene, name, rung, 0.0) for name, rung in model]
    return np.inf if None in steps else known.of(step for step in steps if step)


def highest_frequency(scene: Scene, model: Model) -> float:
    """Highest frequency (rad/s) or fastest decay (1/s) of any body with its base fixed; 0 if all are rigid."""
    steps = [step(scene, name, rung, 0.0) for name, rung in model]
    return max((step.fastest for step in steps if step), default=0.0)


def _fastest(body: Body, rung: BodyModel, parts: list[Body]) -> float:
    """Highest frequency (rad/s), or fastest decay, of the bodies that replace one body in a rung."""
    if rung.kind == "segments" and isinstance(body, BeamBody):
        frequency = ZIGZAG * rung.pieces**2 * _beam_rate(body)
        return _rate(frequency, body.modes.viscosity_s * frequency**2)
    return max(_rate(float(np.sqrt(max(squares, default=0.0))), decay) for squares, decay in map(_squares, parts))


def _rate(frequency: float, decay: float) -> float:
    """The larger root (1/s, magnitude) of x² - decay x + frequency² = 0, a mode that creeps back, or the frequency
    (rad/s) of one that swings."""
    half = 0.5 * decay
    return frequency if half <= frequency else half + float(np.sqrt(half**2 - frequency**2))


def _squares(body: Body) -> tuple[tuple[float, ...], float]:
    """Squares of the frequencies of a body with its base fixed, and the largest damping over mass (1/s); none and 0 if
    it is rigid. Cached for any name."""
    if not isinstance(body, BeamBody | ModalBody) or body.level == "rigid":
        return (), 0.0
    return _squares_of(replace(body, name="body", level=EXACT if body.level == EXACT else "full"))


@lru_cache(maxsize=4096)
def _squares_of(body: BeamBody | ModalBody) -> tuple[tuple[float, ...], float]:
    model = flexible_model(body)
    m = model.mode_count
    if m == 0:
        return (), 0.0
    mass = modal_integrals(model).spatial_mass[:m, :m]
    decay = float(eigvalsh(model.damping, mass).max()) if np.any(model.damping) else 0.0
    return tuple(eigvalsh(model.stiffness, mass).tolist()), decay


def _beam_rate(beam: BeamBody) -> float:
    """sqrt(EI / (m L^4)) (rad/s) of the stiffest section."""
    sections = ((stiffness_on_axis(station), mass_per_length(station)) for station in beam.stations)
    stiffest = max(max(K[ABOUT_Y, ABOUT_Y], K[ABOUT_Z, ABOUT_Z]) / mass for K, mass in sections)
    return float(np.sqrt(stiffest / beam.length_m**4))
