"""Clauses of the contract: each is a sentence that an engine promises, and a function that tries whether it holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from crosscheck.conformance.contents import to_offer
from crosscheck.conformance.scenes import simple_scenes
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import Effort, Engine, Model, Run, Snapshot, Trajectory
from flexmb.scene.schema import Scene
from flexmb.typing import Real

# Pointwise results are one linear solve away from the data. Minimal coordinates leave some 1e-14; redundant ones with
# Euler parameters some 1e-11. A wrong sign or frame is wrong in the first digit.
POINTWISE = 1e-9


class ClauseBroken(AssertionError):
    """The engine does not keep the clause; the message says what was expected and what came."""


class NotOffered(Exception):
    """The engine says that it cannot represent the clause's scene, or does not offer what the clause is about.

    `offer` is what it would have to do for the clause to be tried.
    """

    def __init__(self, reason: str, offer: str) -> None:
        super().__init__(reason)
        self.offer = offer


@dataclass(frozen=True)
class Clause:
    """One sentence of the contract, and the function that raises ClauseBroken, or any other error, if it is not kept.

    `physical`: the clause holds numbers against mechanics, not only against the form of an answer.
    """

    name: str
    sentence: str
    check: Callable[[Engine], None]
    physical: bool


class Chapter:
    """Clauses in the order in which they are written: `chapter.clause("sentence")` adds the function below it."""

    def __init__(self, physical: bool) -> None:
        self.physical = physical
        self.clauses: list[Clause] = []

    def clause(self, sentence: str) -> Callable[[Callable[[Engine], None]], Callable[[Engine], None]]:
        """A decorator; the clause has the function's name."""

        def add(check: Callable[[Engine], None]) -> Callable[[Engine], None]:
            name = check.__name__.replace("_", "-")
            self.clauses.append(Clause(name, sentence, check, self.physical))
            return check

        return add


def require(condition: bool, message: str) -> None:
    """ClauseBroken with the message where the condition does not hold."""
    if not condition:
        raise ClauseBroken(message)


def equal(what: str, found: Any, expected: Any, scale: float = 1.0) -> None:
    """Hold numbers against what they must be, to POINTWISE of each, and of `scale` (SI) where they must be small."""
    right = np.asarray(expected, dtype=float)
    value = np.asarray(found, dtype=float)
    allowed = POINTWISE * np.maximum(np.abs(right), scale)
    good = value.shape == right.shape and bool(np.all(np.abs(value - right) <= allowed))  # False with any NaN
    require(good, f"{what} must be {_shown(right)} and is {_shown(value)}")


def within(what: str, error: float, bound: float) -> None:
    """Hold an error against its bound; whatever is not a number is beyond it."""
    require(error <= bound, f"{what} is off by {error:.3g}, where {bound:.3g} can be explained by the engine's efforts")


def offered(engine: Engine, scene: Scene) -> Model:
    """The compiled scene; NotOffered with the engine's reason where it does not represent the scene exactly."""
    support = CheckedEngine(engine).supports(scene)
    if support.kind != "exact":
        raise NotOffered(support.reason, to_offer(engine, scene))
    return CheckedEngine(engine).compile(scene)


def simplest(engine: Engine, rate: float = 0.4) -> Scene:
    """The first of the simple scenes that the engine represents in some way: what an answer looks like shows in any."""
    scenes = simple_scenes(rate)
    for scene in scenes:
        if CheckedEngine(engine).supports(scene).kind != "no":
            return scene
    reason = CheckedEngine(engine).supports(scenes[0]).reason
    raise NotOffered(reason, f"{to_offer(engine, scenes[0])}, or any other simple scene")


def snapshot(engine: Engine, scene: Scene) -> Snapshot:
    """What the engine finds at the initial state of a scene."""
    found = offered(engine, scene).evaluate()
    require(isinstance(found, Snapshot), f"evaluate() returned a {type(found).__name__}, not a Snapshot")
    return found


def ladder(engine: Engine, scene: Scene, duration_s: float) -> tuple[Effort, ...]:
    """The efforts of the engine for a run of the scene, held against the contract."""
    return CheckedEngine(engine, duration_s=duration_s).efforts(scene)


def simulated(model: Model, times: Real, effort: Effort) -> Trajectory:
    """One run of a model from `offered`, whatever its status."""
    return model.simulate(Run(times), effort)


def finest_two(engine: Engine, scene: Scene, times: Real) -> tuple[Trajectory, Trajectory]:
    """The runs at the last two efforts, which must finish: their difference says how well the finest is converged."""
    model = offered(engine, scene)
    model.warm_up()
    coarser, finest = (simulated(model, times, effort) for effort in ladder(engine, scene, times[-1])[-2:])
    for run in (coarser, finest):
        require(run.status == "finished", f"the run ended as {run.status}: {run.message}")
    return coarser, finest


def given(what: str, found: Any) -> Any:
    """A part of an answer that an engine may leave out: NotOffered where it did."""
    if found is None:
        raise NotOffered(f"it does not offer {what}", f"give {what}")
    return found


def _shown(values: Real) -> str:
    return np.array2string(values, precision=9, suppress_small=False, max_line_width=1000)
