"""The estimated U must bound the true error, on problems whose solution is known, and must not be idle caution; its
figures and words, down to its edges.
"""

import warnings
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk

from crosscheck.judging.results import collect
from crosscheck.judging.uncertainty import RungSignal, estimate, observed_order, spatial, unknown
from crosscheck.judging.verdict import Signal, compare, conserve
from crosscheck.records.kinds import CaseRecord
from flexmb.run.rounding import Sizes, roundoff_floor
from flexmb.typing import Real
from tests.crosscheck.made_records import ONE_PAIR, ladder, run_file

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


def signal(size: float) -> Real:
    return size * np.ones((5, 3)) * np.linspace(0.0, 1.0, 5)[:, None]


@pytest.mark.parametrize("joints", [2, 10, 100, 1000])
def test_arithmetic_past_joints_rounds_within_its_bound(joints: int) -> None:
    """Places at the end of random chains, summed from the base and from the tip: both are off by their rounding."""
    worst, rng = 0.0, np.random.default_rng(joints)
    for _ in range(10):
        turns = Rotation.random(joints, random_state=rng).as_matrix()
        arms = rng.normal(size=(joints, 3)) / np.sqrt(joints)
        place, R = np.zeros(3), np.eye(3)
        for turn, arm in zip(turns, arms, strict=True):
            R = R @ turn
            place = place + R @ arm
        seen = np.zeros(3)
        for turn, arm in zip(turns[::-1], arms[::-1], strict=True):
            seen = turn @ (seen + arm)
        size = max(np.linalg.norm(place), 1.0)
        worst = max(worst, np.linalg.norm(place - seen) / (2.0 * roundoff_floor(size, 0, joints)))
    assert 0.01 <= worst <= 1.0  # it is neither exceeded nor idle


def test_rounding_of_a_channel_is_none_of_its_differences() -> None:
    """Two engines of 121 evaluations whose runs are equal to the last digit at all tolerances, each its own way."""
    wave = 0.5 * np.sin(np.linspace(0.0, 6.0, 101))[:, None] * np.ones(3)
    size = float(np.max(np.linalg.norm(wave, axis=1)))

    def status(apart: float, joints: int) -> str:
        sides = []
        for values in (wave, wave * (1.0 + apart)):
            rungs = [RungSignal(10.0**-n, values, count) for n, count in ((6, 101), (8, 111), (10, 121))]
            doubt = estimate("load:a.force", "tolerance", rungs, size, joints)
            sides.append(Signal(values, doubt, (2.0 * size, 0.0)))
        return compare("load:a.force", *sides, goal=1e-5).status

    eps = np.finfo(float).eps
    assert status(31.0 * eps, 3) == "agree"
    assert status(31.0 * eps, 0) == "differ"  # what rounding in the steps alone excuses
    assert status(1e-9, 3) == status(1e-12, 3) == "differ"


def test_a_result_counts_the_joints_that_it_has_loads_of() -> None:
    names = [f"load:{name}.{part}" for name in ("a", "b.c", "d") for part in ("force", "torque")]
    few, more = ({name: np.ones((11, 3)) for name in kept} for kept in (names[:2], [*names, CHANNEL]))
    counted = [Sizes(tuple(each), each.__getitem__).joints for each in (few, more, {CHANNEL: np.ones((11, 3))})]
    assert counted == [1, 3, 1]
    runs = [ladder("one", each, spread=0.0) for each in (few, more)]
    for at, run in enumerate(runs):  # evaluations differ between the efforts, so that equal results say something
        (result,) = collect(
            [CaseRecord(case="made/made", run=run_file(ONE_PAIR), provenance=None, readme="", variants={}), *run]
        ).cases[0].results.values()
        expected = roundoff_floor(np.sqrt(3.0), 300, counted[at])
        assert result.uncertainty(names[0]).value == pytest.approx(expected, rel=1e-12)


FORCE = "load:pivot.force"


def rungs(efforts: tuple[float, ...], order: float) -> list[RungSignal]:
    return [RungSignal(h, np.array([[0.0], [h**order]])) for h in efforts]


@pytest.mark.parametrize("efforts", [(0.4, 0.2, 0.1), (0.9, 0.3, 0.1), (0.6, 0.2, 0.1)])
@pytest.mark.parametrize("order", [0.95, 1.0, 1.05, 2.0, 3.0, 4.0])
def test_a_whole_order_is_extrapolated(efforts: tuple[float, ...], order: float) -> None:
    """Richardson: U is 1.25 times the error that is there."""
    found = estimate(FORCE, "step", rungs(efforts, order), 0.0)
    assert np.isclose(found.value, 1.25 * efforts[2] ** order, rtol=1e-9)
    assert np.isclose(found.order or 0.0, order)
    assert found.how == f"Richardson, observed order {order:.2f}"


@pytest.mark.parametrize("efforts", [(0.4, 0.2, 0.1), (0.9, 0.3, 0.1)])
def test_other_orders_get_less_credit_or_none(efforts: tuple[float, ...]) -> None:
    ratio = efforts[1] / efforts[2]

    def found(order: float) -> tuple[float, float | None, str]:
        given = rungs(efforts, order)
        gap = abs(given[1].values[1, 0] - given[2].values[1, 0])
        doubt = estimate(FORCE, "step", given, 0.0)
        return doubt.value / gap, doubt.order, doubt.how

    factor, order, how = found(1.5)
    assert np.isclose(factor, 1.25 / (ratio - 1.0)) and np.isclose(order or 0.0, 1.5)
    assert how == "difference of the two finest steps, as order 1.50 is not whole"
    assert np.isclose(found(6.0)[0], 1.25 / (ratio**4 - 1.0))
    factor, order, how = found(0.5)
    assert np.isclose(factor, 3.0 * ratio**0.5) and order is None
    assert how == "3 x the larger difference: the runs do not converge yet"


def tolerances(differences: tuple[float, ...], work: tuple[int, ...], ratio: float) -> list[RungSignal]:
    """A ladder of tolerances `ratio` apart with these differences, coarse to fine, and evaluations."""
    levels = np.append(np.cumsum(differences[::-1])[::-1], 0.0)
    pairs = enumerate(zip(levels, work, strict=True))
    return [RungSignal(ratio**-n, np.array([[level]]), count) for n, (level, count) in pairs]


UNCOUNTED = (0, 0, 0)
EIGHTH = (1000, 1778, 3162)  # of a method of order 8, a hundredth apart


@pytest.mark.parametrize(
    ("differences", "work", "ratio", "factor"),
    [
        ((2.0, 1.0), UNCOUNTED, 10.0, 3.0),
        ((12.0, 1.0), UNCOUNTED, 100.0, 3.0),  # 10/(12 - 10) is more
        ((15.0, 1.0), UNCOUNTED, 100.0, 2.0),
        ((15.0, 1.0), UNCOUNTED, 10.0, 3.0),  # errors that fall faster than the tolerance earn no credit
        ((20.0, 1.0), UNCOUNTED, 100.0, 1.0),
        ((90.0, 1.0), UNCOUNTED, 100.0, 1.0),
        ((1.0, 0.0), UNCOUNTED, 100.0, 0.0),
        ((100.0, 1.0), EIGHTH, 100.0, 1.0),  # an order that is seen once may be chance
        ((100.0, 1.0), (1000, 1778, 0), 100.0, 15.0),  # a finer tolerance for nothing
        ((100.0, 1.0), (1000, 1030, 2000), 100.0, 15.0),
        ((100.0, 1.0), (1000, 1031, 2000), 100.0, 1.0),
        ((100.0, 1.0), (1000, 2000, 2050), 100.0, 15.0),
        ((100.0, 1.0), (0, 1000, 1778), 100.0, 1.0),
        ((8000.0, 100.0, 1.0), (562, *EIGHTH), 100.0, 10.0 / 90.0),
        ((3600.0, 60.0, 1.0), (562, *EIGHTH), 100.0, 10.0 / 50.0),  # no more credit than for the fall that was seen
        ((16000.0, 200.0, 1.0), (562, *EIGHTH), 100.0, 10.0 / 190.0),
        ((500.0, 100.0, 1.0), (562, *EIGHTH), 100.0, 1.0),  # not so evenly before
        ((1e5, 100.0, 1.0), (562, *EIGHTH), 100.0, 1.0),
        ((10000.0, 100.0, 1.0), (714, 1000, 1400, 2500), 100.0, 1.0),  # order 13.7: no method has it
        ((10000.0, 100.0, 1.0), (500, 1000, 2000, 3000), 100.0, 1.0),  # evaluations foretell a fall by 15: too little
        ((8000.0, 100.0, 1.0), (562, 1000, 1778, 4200), 100.0, 10.0 / 90.0),
        ((8000.0, 100.0, 1.0), (562, 1000, 1778, 4220), 100.0, 1.0),  # round-off is fought: 2.373 = 1.778^1.5
        ((1e9, 8000.0, 100.0, 1.0), (9, 562, *EIGHTH), 100.0, 10.0 / 90.0),  # only the last four count
    ],
)
def test_tolerances_bound_the_error_by_how_far_it_falls(
    differences: tuple[float, ...], work: tuple[int, ...], ratio: float, factor: float
) -> None:
    found = estimate(FORCE, "tolerance", tolerances(differences, work, ratio), 0.0)
    assert np.isclose(found.value, factor * differences[-1], rtol=1e-9, atol=1e-12) and found.order is None
    assert "x the difference of the two finest tolerances" in found.how


@pytest.mark.parametrize("work", [(1000, 1778, 0), (1000, 1030, 2000), (562, 1000, 1778, 1800)])
def test_efforts_that_another_limit_determines_say_so(work: tuple[int, ...]) -> None:
    differences = (8000.0, 100.0, 1.0)[-len(work) + 1 :]
    found = estimate(FORCE, "tolerance", tolerances(differences, work, 100.0), 0.0)
    assert found.how == (
        "15 x the difference of the two finest tolerances, as a finer one took hardly more evaluations"
    )
    assert np.isclose(found.value, 15.0) and found.order is None


def test_only_the_growth_of_the_last_two_efforts_shows_another_limit() -> None:
    """A coarse pair of efforts that took the same steps is no limit of the fine ones."""
    found = estimate(FORCE, "tolerance", tolerances((8000.0, 100.0, 1.0), (1000, 1000, 1778, 3162), 100.0), 0.0)
    assert np.isclose(found.value, 1.0)


def test_the_larger_difference_is_one_of_the_last_two() -> None:
    """Also where one before them was larger still, and where the later of them is the larger."""
    for differences, larger in (((50.0, 1.5, 1.0), 1.5), ((50.0, 1.0, 1.5), 1.5)):
        found = estimate(FORCE, "tolerance", tolerances(differences, (0, 0, 0, 0), 100.0), 0.0)
        assert np.isclose(found.value, 3.0 * larger)


def test_a_fall_without_growth_is_no_order() -> None:
    """Differences that grow, or a first pair of efforts with fewer evaluations, give no order: U is at least d_23."""
    for differences, work in (
        ((50.0, 100.0, 1.0), (562, *EIGHTH)),
        ((100.0, 100.0, 1.0), (562, *EIGHTH)),
        ((150.0, 100.0, 1.0), (562, *EIGHTH)),
        ((8000.0, 100.0, 1.0), (1778, 1000, 1778, 3162)),
        ((8000.0, 100.0, 1.0), (1000, 1000, 1778, 3162)),
    ):
        assert np.isclose(estimate(FORCE, "tolerance", tolerances(differences, work, 100.0), 0.0).value, 1.0)


def test_evaluations_foretell_how_far_errors_fall() -> None:
    """Order 6.64 of the fall by 100 at twice the evaluations leaves one by 64 at 1.87 times as many."""
    found = estimate(FORCE, "tolerance", tolerances((10000.0, 100.0, 1.0), (500, 1000, 2000, 3740), 100.0), 0.0)
    fall = 1.87 ** (np.log(100.0) / np.log(2.0))
    assert fall == pytest.approx(64.0, rel=1e-2)
    assert found.value == pytest.approx(10.0 / (fall - 10.0), rel=1e-9)


@pytest.mark.parametrize("differences", [(100.0, 1.0), (30.0, 1.0), (12.0, 1.0), (8000.0, 100.0, 1.0), (9.0, 8.0, 1.0)])
def test_evaluations_never_widen_what_grows(differences: tuple[float, ...]) -> None:
    """Counting may tell that the steps follow the tolerance; where it does not, U is as if nobody had counted."""
    efforts = len(differences) + 1
    blind = estimate(FORCE, "tolerance", tolerances(differences, (0,) * efforts, 100.0), 0.0).value
    for growth in (1.05, 1.2, 1.778, 3.0, 50.0):
        work = tuple(round(1000 * growth**n) for n in range(efforts))
        assert estimate(FORCE, "tolerance", tolerances(differences, work, 100.0), 0.0).value <= blind


def test_tolerances_that_do_not_halve_the_error_prove_nothing() -> None:
    given = [RungSignal(10.0**-n, np.array([[each]])) for n, each in enumerate((2.9, 1.0, 0.0))]
    found = estimate(FORCE, "tolerance", given, 0.0)
    assert np.isclose(found.value, 5.7) and found.order is None
    assert found.how == "3 x the larger difference: the runs do not converge yet"


def test_judging_warns_of_nothing() -> None:
    """What overflows is told in words, once."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert conserve(np.full(1, 1e300), 1e-300, 0.5).status == "unresolved"
        for level in (1e200, 1e308):
            huge = np.full((2, 3), level)
            assert np.all(np.isinf(spatial(FORCE, huge, -huge, 1.0 + 1e-15, 1e-300)))
        for level in (1e308, 0.0):
            apart = [RungSignal(0.1, np.full((3, 1), -1e308)), RungSignal(0.01, np.full((3, 1), level))]
            found = estimate(FORCE, "step", apart, 0.0)
            assert np.array_equal(found.envelope, np.full(3, np.inf))
            assert found.how == "unknown: the runs are so far apart that their distance is not finite"
        assert observed_order((4.0, 1.0, 1.0), 2.0, 1.0) is None
        assert observed_order((4.0, 4.0, 1.0), 2.0, 1.0) is None
    assert np.all(np.isinf(spatial(FORCE, np.zeros((3, 0)), np.zeros((3, 0)), 2.0, 1.0)))


def test_orders_are_looked_for_between_nothing_and_sixteen() -> None:
    assert observed_order((4.0, 2.0, 1.0), 2.0**15, 1.0) == pytest.approx(15.0)
    assert observed_order((4.0, 2.0, 1.0), 2.0**17, 1.0) is None
    assert observed_order((4.0, 2.0, 1.0), 1.0, 1.0) is None
    assert observed_order((1e12, 1e6, 1.0), 1e6, 1.0) == pytest.approx(1.0)
    assert observed_order((1.1e12, 1e6, 1.0), 1e6, 1.0) is None
    assert observed_order((1e12, 0.9e6, 0.8), 1e6, 1.0) is None
    assert roundoff_floor(2.0, 9) == 6.0 * np.finfo(float).eps
    assert (unknown(3, "so").how, unknown(3, "so").envelope.shape) == ("unknown: so", (3,))


def level(effort: float, *values: float) -> RungSignal:
    return RungSignal(effort, np.array(values)[:, None])


def counted(*evaluations: float) -> list[RungSignal]:
    return [RungSignal(0.1**n, np.ones((1, 1)), count) for n, count in enumerate(evaluations)]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("kind", "given", "size", "why"),
    [
        ("step", [], 0.0, "fewer than two efforts finished with different results"),
        ("step", [level(0.1, 1.0)], 0.0, "fewer than two efforts finished with different results"),
        ("speed", [level(0.2, 1.0), level(0.1, 1.0)], 0.0, 'efforts of kind "speed" have no order'),
        ("step", [level(0.1, 1.0), level(0.0, 1.0)], 0.0, "the efforts 0.1, 0 do not fall to a positive number"),
        ("step", [level(0.1, 1.0), level(0.1, 1.0)], 0.0, "the efforts 0.1, 0.1 do not fall to a positive number"),
        (
            "step", [level(0.2, 1.0, 2.0), level(0.1, 1.0)], 0.0,
            "the efforts have results of different shapes, or empty ones",
        ),
        ("step", [level(0.2), level(0.1)], 0.0, "the efforts have results of different shapes, or empty ones"),
        ("step", [level(0.2, np.nan), level(0.1, 1.0)], 0.0, "an effort has values that are not numbers"),
        ("step", counted(1, -1), 2.0, "-1 evaluations of a signal of size 2 leave no round-off"),
        ("tolerance", counted(-1, 1), 2.0, "-1 evaluations of a signal of size 2 leave no round-off"),
        ("step", counted(1, np.inf), 2.0, "inf evaluations of a signal of size 2 leave no"),
        ("step", counted(1, 1), np.inf, "1 evaluations of a signal of size inf leave no"),
        ("step", counted(0, -3), 2.0, "-3 evaluations of a signal of size 2 leave no"),
        ("step", counted(np.inf, 7), 2.0, "inf evaluations of a signal of size 2 leave no"),
        ("step", counted(3, 2, 1), np.inf, "1 evaluations of a signal of size inf leave no"),
    ],
)
def test_each_fault_of_a_ladder_is_named(kind: str, given: list[RungSignal], size: float, why: str) -> None:
    found = estimate(FORCE, kind, given, size)
    assert found.how.startswith(f"unknown: {why}") and (found.value, found.order) == (np.inf, None)
    assert found.how.removeprefix(f"unknown: {why}") in ("", " to be told", " round-off to be told")
    assert found.envelope.shape == (len(given[-1].values) if given else 0,)


def test_two_efforts_bound_by_three_times_their_difference() -> None:
    found = estimate(FORCE, "step", [level(0.2, 0.0, 3.0, 1.0), level(0.1, 0.0, 1.0, 1.0)], 0.0)
    assert np.array_equal(found.envelope, (0.0, 6.0, 6.0))
    assert (found.value, found.order, found.how) == (6.0, None, "3 x the difference of the only two efforts")


def test_only_the_last_three_efforts_count() -> None:
    found = estimate(FORCE, "step", rungs((2.0, 0.8, 0.2, 0.1), 2.0), 0.0)
    assert np.isclose(found.value, 0.0125) and found.how == "Richardson, observed order 2.00"
