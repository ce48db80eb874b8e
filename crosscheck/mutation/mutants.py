"""The mutants of a subject: mutations at targets, and those that are passed over with the reason."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np

from crosscheck.library.case import TAKES_APART, ComparisonSide, Control, MutationKind
from crosscheck.library.find import Case
from crosscheck.library.mutations import CATALOGUE, applicable, mutate
from crosscheck.mutation.subject import JudgedVariant, reduced
from crosscheck.running.plan import altered_scene, at_level, variant_scene
from flexmb.scene.bodies import BeamBody, ModalBody
from flexmb.scene.check import check_scene
from flexmb.scene.schema import Scene
from flexmb.system.compile import compile
from flexmb.tables.features import asking

OF_THE_START: tuple[MutationKind, ...] = ("initial_place", "initial_unit", "initial_rate", "initial_speed_sign")
SAME = 1e-12  # of the largest coordinate or speed: rounding of projections
ROUNDING = 1e-9  # of an eigenproblem and of sums over its modes; the smallest mutation changes 3e-4


class PassedOver(msgspec.Struct, frozen=True, kw_only=True):
    """A mutation of a target that gives no mutant, and the reason."""

    mutation: str
    target: str
    reason: str


@dataclass(frozen=True)
class CaseMutants:
    """The mutants of a subject, as negative controls of its case by name, and what was passed over."""

    case: Case
    mutants: dict[str, Control]
    passed_over: tuple[PassedOver, ...]


def mutants_of(what: JudgedVariant, all_targets: bool = False) -> CaseMutants:
    """Every applicable mutation at one target of each kind, or at all targets.

    Passed over are mutations that physically change nothing, that the variant's transformation does not model, or that
    make no valid scene."""
    scene = at_level(what.case.scene(what.variant), what.variant)
    true = variant_scene(scene, what.variant)
    mutants: dict[str, Control] = {}
    passed: list[PassedOver] = []
    for kind, mutation in CATALOGUE.items():
        done: set[str] = set()
        for target in applicable(scene, mutation):
            if target.kind in done and not all_targets:
                continue
            reason = mutation.idle(scene, target.name) or _no_mutant(scene, kind, target.name, true, what)
            if reason:
                passed.append(PassedOver(mutation=kind, target=target.name, reason=reason))
                continue
            done.add(target.kind)
            control = _control(what, kind, target.name)
            mutants[control.name] = control
    small = reduced(what)
    run = msgspec.structs.replace(small.run, controls=tuple(mutants.values()))
    return CaseMutants(replace(small, run=run), mutants, tuple(passed))


def _no_mutant(scene: Scene, kind: MutationKind, target: str, true: Scene, what: JudgedVariant) -> str:
    """Why the mutated scene cannot be run or distinguished from the true one; "" if it can."""
    variant = msgspec.structs.replace(what.variant, level=None)
    try:
        faulty = mutate(scene, kind, target)
        if _takes_apart(what, scene, faulty, target):
            return f'variant "{variant.name}" takes the body apart: it has no modes of the whole'
        mutant = altered_scene(faulty, variant)
        check_scene(mutant, t_end=variant.duration_s or what.case.run.duration_s)
    except (ValueError, NotImplementedError, OSError) as error:
        return f"it makes no scene: {' '.join(str(error).split())}"
    if same_to_rounding(mutant, true):
        return f'variant "{variant.name}" does not model what it changes'
    if kind in OF_THE_START and true.constraints and _begin_alike(mutant, true):
        return "the closures say where it begins: the scene's value is where the search for it starts"
    return ""


def _begin_alike(one: Scene, other: Scene) -> bool:
    """Whether two closed chains with different initial values begin in the same state."""
    with asking("general"):
        try:
            a, b = (compile(scene).initial_state for scene in (one, other))
        except (ValueError, NotImplementedError):  # the engine reports it
            return False
    return all(np.max(np.abs(p - q)) <= SAME * np.max(np.abs(q)) for p, q in ((a.q, b.q), (a.u, b.u)) if len(q))


def _takes_apart(what: JudgedVariant, scene: Scene, faulty: Scene, target: str) -> bool:
    """Whether a mutation concerns modes of a whole beam that the variant divides."""
    in_parts = what.variant.transform in TAKES_APART and what.variant.split_body in (None, target)
    pairs = zip(scene.bodies, faulty.bodies, strict=True)
    return in_parts and any(isinstance(a, BeamBody) and isinstance(b, ModalBody) for a, b in pairs)


def same_to_rounding(one: Any, other: Any) -> bool:
    """Whether two scenes, or parts of them, differ by rounding at most, as modes computed in another way do.

    Numbers of a vector, or of a row, are compared relative to the largest of them: zeros may become small numbers.
    """
    if isinstance(one, msgspec.Struct):
        keys = one.__struct_fields__
        return type(one) is type(other) and all(same_to_rounding(getattr(one, k), getattr(other, k)) for k in keys)
    if not (isinstance(one, tuple) and isinstance(other, tuple) and len(one) == len(other)):
        return _near(one, other, 0.0)
    if all(isinstance(component, float) for component in (*one, *other)):
        largest = max(map(abs, one), default=0.0)
        return all(_near(a, b, largest) for a, b in zip(one, other, strict=True))
    return all(map(same_to_rounding, one, other))


def _near(one: Any, other: Any, size: float) -> bool:
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=ROUNDING, abs_tol=ROUNDING * size)
    return bool(one == other)


def _control(what: JudgedVariant, kind: MutationKind, target: str) -> Control:
    side = ComparisonSide(variant=what.variant.name, engine=what.engine)
    name = f"{kind} of {target}" if target else kind
    return Control(name=name, mutation=kind, target=target, a=side, b=side, goals=what.goals, scales=what.scales)
