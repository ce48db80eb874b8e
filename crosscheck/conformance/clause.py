"""Clauses of the contract: each is a sentence, and a function that tests whether it holds."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from crosscheck.conformance.contents import to_offer
from crosscheck.engines.answers import checked_precision
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import UNIT_ROUNDOFF, Effort, Engine, Model, Run, Snapshot, Trajectory
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene
from flexmb.scene.shapes import beam_section
from flexmb.typing import Real

# The small scenes of the clauses: one body with its mass centre off its origin, with the items of the clause.

G = 9.81
DOWN = (0.0, 0.0, -G)
NONE = (0.0, 0.0, 0.0)
MASS, ARM, INERTIA = 2.0, 0.6, (0.2, 0.3, 0.35)  # kg, m, kg m^2 about the mass centre
SECOND = INERTIA[1] + MASS * ARM**2  # about a transverse hinge axis y
THIRD = INERTIA[2] + MASS * ARM**2  # about z
QUARTER = (0.5**0.5, 0.0, 0.0, 0.5**0.5)  # a quarter turn about z


def arm(
    gravity: tuple[float, float, float] = DOWN, com: tuple[float, float, float] = (ARM, 0.0, 0.0)
) -> SceneBuilder:
    """A body with its mass centre at `com` (m), a marker at its origin and one at its mass centre; no hinge yet."""
    return (
        SceneBuilder("arm", gravity=gravity)
        .rigid_body("arm", mass=MASS, com=com, inertia=INERTIA)
        .marker("origin", "arm")
        .marker("com", "arm", offset=com)
    )


def pendulum(rate: float = 0.4) -> Scene:
    """The simplest scene: one body on a hinge about World z, its mass centre on its x, gravity along -y, a marker."""
    return (
        SceneBuilder("pendulum", gravity=(0.0, -G, 0.0))
        .rigid_body("rod", mass=MASS, com=(ARM, 0.0, 0.0), inertia=INERTIA, nodes={"tip": (1.0, 0.0, 0.0)})
        .revolute("pivot", "ground", "rod", axis=(0.0, 0.0, 1.0), angle=-0.3, rate=rate)
        .marker("tip", "rod", node="tip")
        .scene()
    )


def simple_scenes(rate: float = 0.4) -> tuple[Scene, ...]:
    """Scenes of one body with a marker "tip", from which every engine can represent one: what is about the form of an
    answer is tried on the first that it does. None moves so simply that efforts would not matter. `rate` in rad/s."""
    rod = SceneBuilder("tumbling").rigid_body("rod", mass=MASS, inertia=INERTIA, nodes={"tip": (1.0, 0.0, 0.0)})
    tumbling = rod.free("flight", "ground", "rod", angular_velocity=(rate, 2.0, 1.0)).marker("tip", "rod", node="tip")
    rod = SceneBuilder("sprung").rigid_body("rod", mass=MASS, inertia=INERTIA, nodes={"tip": (1.0, 0.0, 0.0)})
    sprung = rod.prismatic("rail", "ground", "rod", position=0.3, rate=rate, stiffness=40.0)
    return pendulum(rate), tumbling.scene(), sprung.marker("tip", "rod", node="tip").scene(), flexible(rate)


def flexible(rate: float = 0.0) -> Scene:
    """A flexible beam on a hinge, which many codes refuse."""
    section = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700.0)
    return (
        SceneBuilder("flexible pendulum", gravity=DOWN)
        .beam("rod", length=1.0, elements=4, section=section, modes=2)
        .revolute("pivot", "ground", "rod", axis=(0.0, 1.0, 0.0), rate=rate)
        .marker("tip", "rod", node="tip")
        .scene()
    )


def hub() -> SceneBuilder:
    """A body for wheels; no hinge yet."""
    return SceneBuilder("wheel").rigid_body("hub", mass=5.0, inertia=(1.0, 1.2, 1.5)).marker("hub", "hub")


LEAST, MOST = 3, 17  # significant digits; 17 tell any two floating-point numbers apart


def told_apart(first: ArrayLike, second: ArrayLike, allowed: ArrayLike = 0.0) -> tuple[str, str]:
    """Both in the same number of significant digits, from three: the least that shows every difference of components
    by more than `allowed`.

    Of arrays of different shapes each has three.
    """
    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    if a.shape != b.shape:
        return _shown(a, LEAST), _shown(b, LEAST)
    differ = ~(np.abs(a - b) <= allowed) & ~(np.isnan(a) & np.isnan(b))
    pairs = [(float(x), float(y)) for x, y in zip(a[differ].flat, b[differ].flat, strict=True)]
    digits = next((n for n in range(LEAST, MOST) if all(f"{x:.{n}g}" != f"{y:.{n}g}" for x, y in pairs)), MOST)
    return _shown(a, digits), _shown(b, digits)


def _shown(values: np.ndarray, digits: int) -> str:
    text = [f"{float(number):.{digits}g}" for number in values.flat]
    return f"[{' '.join(text)}]" if values.ndim else text[0]


# Pointwise results need one linear solve. Minimal coordinates have errors of about 1e-14, redundant ones with
# Euler parameters of about 1e-11. A wrong sign or frame changes the first digit.
POINTWISE = 1e-9
ROUNDINGS = 2**10
"""How many unit roundoffs a correct result may be off, relative to its size: minimal coordinates have some hundred, and
sums over a tree or over the steps of a run a few times that. In double precision this is 1e-13, and the bounds of the
clauses, which allow for redundant coordinates and for integrators, are wider; in single precision it is 6e-5."""
CONVERGED = 1e-2  # of a signal: largest distance of the last two efforts for which a clause on runs can be tested


_roundoff: ContextVar[float] = ContextVar("roundoff", default=UNIT_ROUNDOFF["double"])  # of the engine on trial


class ClauseBroken(AssertionError):
    """The clause does not hold; the message says what was expected and what was found."""


class NotOffered(Exception):
    """The engine cannot represent the clause's scene, by its own statement, or does not offer the tested output.

    `offer` is what it would have to offer for the clause to be tried.
    """

    def __init__(self, reason: str, offer: str) -> None:
        super().__init__(reason)
        self.offer = offer


@dataclass(frozen=True)
class Clause:
    """One sentence of the contract, and the function that raises ClauseBroken, or any other error, if it does not hold.

    `physical`: the clause tests numbers against mechanics, not only the form of an answer.
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

            def bounded(engine: Engine) -> None:
                before = _roundoff.set(UNIT_ROUNDOFF[checked_precision(engine)])
                try:
                    check(engine)
                finally:
                    _roundoff.reset(before)

            self.clauses.append(Clause(name, sentence, bounded, self.physical))
            return check

        return add


def allowance(double: float, roundings: float = ROUNDINGS) -> float:
    """A bound that is `double` in double precision, and never below what rounding does to the engine on trial."""
    return max(double, roundings * _roundoff.get())


def require(condition: bool, message: str) -> None:
    """Raise ClauseBroken with the message unless the condition holds."""
    if not condition:
        raise ClauseBroken(message)


def equal(what: str, answer: Any, expected: Any, scale: float = 1.0) -> None:
    """Compare numbers, within POINTWISE (or its allowance) of each expected one, of `scale` (SI) for small ones."""
    right = np.asarray(expected, dtype=float)
    value = np.asarray(answer, dtype=float)
    allowed = allowance(POINTWISE) * np.maximum(np.abs(right), scale)
    good = value.shape == right.shape and bool(np.all(np.abs(value - right) <= allowed))  # False with any NaN
    expected_digits, found_digits = told_apart(right, value, allowed)
    require(good, f"{what} must be {expected_digits} and is {found_digits}")


def within(what: str, error: float, bound: float) -> None:
    """Compare an error with its bound; NaN exceeds it."""
    off, most = told_apart(error, bound)
    require(error <= bound, f"{what} is off by {off}, where {most} can be explained by the engine's efforts")


def hold_at_samples(what: str, answer: Iterable[Real], expected: Real, times: Real) -> None:
    """Compare the last of two runs (T, k) with the expected values, within their distance from each other."""
    rough, fine = answer
    size = float(np.abs(expected).max())
    refinement = float(np.abs(rough - fine).max())
    require(refinement <= CONVERGED * size, f"{what}: the last two efforts are {refinement:.3g} apart, of {size:.3g}")
    error = np.abs(fine - expected).max(axis=1)
    worst = int(np.argmax(error))
    within(f"{what} at t = {times[worst]:g} s", float(error[worst]), 3.0 * refinement + allowance(1e-7) * size)


def offered(engine: Engine, scene: Scene) -> Model:
    """The compiled scene; NotOffered with the engine's reason unless it represents the scene exactly."""
    support = CheckedEngine(engine).supports(scene)
    if support.kind != "exact":
        raise NotOffered(support.reason, to_offer(engine, scene))
    return CheckedEngine(engine).compile(scene)


def simplest(engine: Engine, rate: float = 0.4) -> Scene:
    """The first of the simple scenes that the engine represents, for clauses on the form of an answer."""
    scenes = simple_scenes(rate)
    for scene in scenes:
        if CheckedEngine(engine).supports(scene).kind != "no":
            return scene
    reason = CheckedEngine(engine).supports(scenes[0]).reason
    raise NotOffered(reason, f"{to_offer(engine, scenes[0])}, or any other simple scene")


def snapshot(engine: Engine, scene: Scene) -> Snapshot:
    answer = offered(engine, scene).evaluate()
    require(isinstance(answer, Snapshot), f"evaluate() returned a {type(answer).__name__}, not a Snapshot")
    return answer


def ladder(engine: Engine, scene: Scene, duration_s: float) -> tuple[Effort, ...]:
    return CheckedEngine(engine, duration_s=duration_s).efforts(scene)


def simulated(model: Model, times: Real, effort: Effort) -> Trajectory:
    """One run of a model from `offered`, whatever its status."""
    return model.simulate(Run(times), effort)


def finest_two(engine: Engine, scene: Scene, times: Real) -> tuple[Trajectory, Trajectory]:
    """The runs at the last two efforts, which must finish: their difference bounds the error of the finest."""
    model = offered(engine, scene)
    model.warm_up()
    coarser, finest = (simulated(model, times, effort) for effort in ladder(engine, scene, times[-1])[-2:])
    for run in (coarser, finest):
        require(run.status == "finished", f"the run ended as {run.status}: {run.message}")
    return coarser, finest


def acceleration(answer: Snapshot, marker: str) -> Real:
    """[angular; linear] of a marker, which an engine may leave out."""
    return np.asarray(given("accelerations of markers in evaluate()", answer.markers[marker].acceleration))


def given(what: str, answer: Any) -> Any:
    """An optional part of an answer; NotOffered if the engine left it out."""
    if answer is None:
        raise NotOffered(f"it does not offer {what}", f"give {what}")
    return answer
