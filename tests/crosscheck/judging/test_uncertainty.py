"""The estimated U must bound the true error, on problems whose solution is known, and must not be idle caution."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from crosscheck.judging.uncertainty import RungSignal, estimate, observed_order, spatial
from flexmb.typing import Real

CHANNEL = "marker:tip.velocity"
SAMPLES = 100
COVERAGE = 0.95  # the share of problems whose error U must bound
METHODS: dict[str, tuple[int, Callable[..., Real]]] = {}


def method(order: int) -> Callable[[Callable[..., Real]], Callable[..., Real]]:
    def register(step: Callable[..., Real]) -> Callable[..., Real]:
        METHODS[step.__name__] = (order, step)
        return step

    return register


@method(1)
def euler(rate: Callable[[Real], Real], y: Real, h: float) -> Real:
    return y + h * rate(y)


@method(2)
def midpoint(rate: Callable[[Real], Real], y: Real, h: float) -> Real:
    return y + h * rate(y + 0.5 * h * rate(y))


@method(3)
def kutta(rate: Callable[[Real], Real], y: Real, h: float) -> Real:
    k1 = rate(y)
    k2 = rate(y + 0.5 * h * k1)
    return y + h / 6.0 * (k1 + 4.0 * k2 + rate(y + h * (2.0 * k2 - k1)))


@method(4)
def runge_kutta(rate: Callable[[Real], Real], y: Real, h: float) -> Real:
    k1 = rate(y)
    k2 = rate(y + 0.5 * h * k1)
    k3 = rate(y + 0.5 * h * k2)
    return y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rate(y + h * k3))


class Oscillator:
    """Damped linear oscillator; solution by the matrix exponential's closed form."""

    def __init__(self, random: np.random.Generator) -> None:
        self.frequency, self.damping = random.uniform(0.5, 4.0), random.uniform(0.0, 0.3)
        self.start = random.normal(size=2)

    def rate(self, y: Real) -> Real:
        return np.array([y[1], -(self.frequency**2) * y[0] - 2.0 * self.damping * self.frequency * y[1]])

    def solution(self, t: Real) -> Real:
        decay, turn = self.damping * self.frequency, self.frequency * np.sqrt(1.0 - self.damping**2)
        x, v = self.start
        sine = (v + decay * x) / turn
        envelope = np.exp(-decay * t)
        position = envelope * (x * np.cos(turn * t) + sine * np.sin(turn * t))
        along = envelope * turn * (-x * np.sin(turn * t) + sine * np.cos(turn * t))
        return np.column_stack([position, along - decay * position])


class Logistic:
    """Logistic growth."""

    def __init__(self, random: np.random.Generator) -> None:
        self.growth, self.start = random.uniform(0.5, 3.0), random.uniform(0.01, 0.9, size=1)

    def rate(self, y: Real) -> Real:
        return self.growth * y * (1.0 - y)

    def solution(self, t: Real) -> Real:
        return (1.0 / (1.0 + (1.0 / self.start - 1.0) * np.exp(-self.growth * t)))[:, None]


class Pendulum:
    """Mathematical pendulum swung from rest at an angle; solution by Jacobi's elliptic functions."""

    def __init__(self, random: np.random.Generator) -> None:
        self.frequency, self.angle = random.uniform(0.7, 3.0), random.uniform(0.3, 2.9)
        self.start = np.array([self.angle, 0.0])

    def rate(self, y: Real) -> Real:
        return np.array([y[1], -(self.frequency**2) * np.sin(y[0])])

    def solution(self, t: Real) -> Real:
        modulus = np.sin(self.angle / 2.0) ** 2
        sn, cn, dn, _ = ellipj(ellipk(modulus) - self.frequency * t, modulus)
        half = np.sqrt(modulus) * sn
        return np.column_stack([2.0 * np.arcsin(half), -2.0 * self.frequency * np.sqrt(modulus) * cn])


PROBLEMS = (Oscillator, Logistic, Pendulum)
TIMES = np.linspace(0.0, 6.0, 61)


def march(problem: Oscillator | Logistic | Pendulum, step: Callable[..., Real], per_sample: int) -> Real:
    h, y = (TIMES[1] - TIMES[0]) / per_sample, np.array(problem.start)
    states = [y]
    for _ in TIMES[1:]:
        for _ in range(per_sample):
            y = step(problem.rate, y, h)
        states.append(y)
    return np.array(states)


def fixed_step_ratio(problem: Oscillator | Logistic | Pendulum, name: str, coarsest: int) -> float:
    """U / true error of the finest of three halved steps."""
    _, step = METHODS[name]
    counts = [coarsest * 2**n for n in range(3)]
    h = TIMES[1] - TIMES[0]
    rungs = [RungSignal(h / count, march(problem, step, count), 4 * count * len(TIMES)) for count in counts]
    return ratio("step", rungs, problem)


def tolerance_ratio(problem: Oscillator | Logistic | Pendulum, name: str, tolerances: tuple[float, ...]) -> float:
    rungs = []
    for tolerance in tolerances:
        run = solve_ivp(
            lambda t, y: problem.rate(y), (0.0, TIMES[-1]), problem.start, name, TIMES, rtol=tolerance, atol=tolerance
        )
        rungs.append(RungSignal(tolerance, run.y.T, run.nfev))
    return ratio("tolerance", rungs, problem)


def ratio(kind: str, rungs: list[RungSignal], problem: Oscillator | Logistic | Pendulum) -> float:
    exact = problem.solution(TIMES)
    size = float(np.max(np.linalg.norm(exact, axis=1)))
    error = float(np.max(np.linalg.norm(rungs[-1].values - exact, axis=1)))
    return estimate(CHANNEL, kind, rungs, size).value / error


@pytest.fixture(scope="module")
def ratios() -> dict[str, Real]:
    """U / error of random problems by kind of ladder."""
    random = np.random.default_rng(20240607)
    fixed, tolerances = [], []
    for _ in range(SAMPLES):
        problem = PROBLEMS[random.integers(len(PROBLEMS))](random)
        fixed.append(fixed_step_ratio(problem, random.choice(list(METHODS)), int(random.integers(1, 5))))
        finest = random.integers(5, 11)
        ladder = tuple(10.0 ** -float(finest - step) for step in (2, 1, 0))
        tolerances.append(tolerance_ratio(problem, random.choice(["RK45", "DOP853"]), ladder))
    return {"step": np.array(fixed), "tolerance": np.array(tolerances)}


@pytest.mark.parametrize("kind", ["step", "tolerance"])
def test_uncertainty_bounds_the_true_error(ratios: dict[str, Real], kind: str) -> None:
    assert np.mean(ratios[kind] >= 1.0) >= COVERAGE


@pytest.mark.parametrize(("kind", "idle"), [("step", 4.0), ("tolerance", 100.0)])
def test_uncertainty_is_not_idle_caution(ratios: dict[str, Real], kind: str, idle: float) -> None:
    """Half of the estimates are within a factor: for steps the safety factors' own range, for tolerances two ladders'.

    Steps: 1.25 where Richardson holds, 3 where it does not. Tolerances: the difference measures the error one effort
    back, a factor of ten in tolerance and, with local extrapolation, at most two such factors in error.
    """
    assert np.median(ratios[kind]) <= idle


@pytest.mark.parametrize("name", METHODS)
def test_observed_order_of_known_methods(name: str) -> None:
    order, step = METHODS[name]
    problem = Logistic(np.random.default_rng(5))
    runs = [march(problem, step, 16 * 2**n) for n in range(3)]
    wider, gap = (float(np.max(np.abs(a - b))) for a, b in zip(runs, runs[1:], strict=False))
    assert observed_order([4.0, 2.0, 1.0], wider, gap) == pytest.approx(order, abs=0.1)


def test_order_with_unequal_ratios() -> None:
    """f(h) = C h^3 with ratios 3 and 1.5 gives back the order 3."""
    values = [h**3 for h in (0.9, 0.3, 0.2)]
    order = observed_order((0.9, 0.3, 0.2), values[0] - values[1], values[1] - values[2])
    assert order == pytest.approx(3.0, abs=1e-9)


def signal(size: float) -> Real:
    return size * np.ones((5, 3)) * np.linspace(0.0, 1.0, 5)[:, None]


def test_one_effort_leaves_the_uncertainty_unknown() -> None:
    assert estimate(CHANNEL, "step", [RungSignal(0.1, signal(1.0), 10)], 1.0).value == np.inf


def test_runs_that_do_not_converge_get_the_larger_difference() -> None:
    rungs = [RungSignal(0.4, signal(1.0)), RungSignal(0.2, signal(1.5)), RungSignal(0.1, signal(0.9))]
    assert estimate(CHANNEL, "step", rungs, 0.0).value == pytest.approx(3.0 * 0.6 * np.sqrt(3.0))


def test_equal_runs_keep_the_roundoff_floor() -> None:
    rungs = [RungSignal(10.0**-n, signal(1.0), 400) for n in (8, 9, 10)]
    eps = np.finfo(float).eps
    assert estimate(CHANNEL, "tolerance", rungs, 2.0).value == pytest.approx(2.0 * 20.0 * eps)


def test_envelope_never_falls() -> None:
    wave = np.sin(np.linspace(0.0, 20.0, 81))[:, None]
    rungs = [RungSignal(h, wave * (1.0 + h**2)) for h in (0.4, 0.2, 0.1)]
    envelope = estimate(CHANNEL, "step", rungs, 1.0).envelope
    assert np.all(np.diff(envelope) >= 0.0)


def test_spatial_uncertainty_bounds_a_second_order_error() -> None:
    """f_n = f + C/n^2: U of n = 16 from n = 32 is 1.25 times its error."""
    exact = signal(1.0)
    coarse, fine = (exact * (1.0 + 0.9 / n**2) for n in (16, 32))
    bound = spatial(CHANNEL, coarse, fine, 2.0, 2.0)[-1]
    assert bound == pytest.approx(1.25 * np.max(np.linalg.norm(coarse - exact, axis=1)), rel=1e-10)
