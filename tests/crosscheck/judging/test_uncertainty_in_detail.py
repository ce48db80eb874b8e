"""The figures and words of an uncertainty, down to its edges: orders known in advance, and each fault by its name."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from crosscheck.judging.uncertainty import RungSignal, estimate, observed_order, roundoff_floor, spatial, unknown
from crosscheck.judging.verdict import conserve

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
