"""Statuses from numbers. Judging has an answer to every input, and nothing that is no number, or no size, is agreement.

All combinations of `ODD` in every input of every judging function; and negative controls, judges as they are written
in haste, which the same conditions must refuse.
"""

import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from crosscheck.judging.uncertainty import RungSignal, Uncertainty, estimate, observed_order, spatial
from crosscheck.judging.verdict import STATUSES, Finding, Signal, Verdict, compare, conserve
from flexmb.run.channels import distance, magnitude, signal_range
from flexmb.run.rounding import roundoff_floor

TIMES = np.linspace(0.0, 1.0, 11)
CHANNEL = "load:pivot.force"


def signal(level: float, doubt: float, sizes: tuple[float, ...] = (1.0,)) -> Signal:
    values = np.column_stack([level * np.ones_like(TIMES), np.zeros_like(TIMES), np.zeros_like(TIMES)])
    return Signal(values, Uncertainty(np.full(len(TIMES), doubt), doubt, "given"), sizes)


@pytest.mark.parametrize(
    ("b", "doubt", "goal", "status"),
    [
        (1.0 + 1e-9, 1e-8, 1e-6, "agree"),
        (1.0 + 1e-6, 1e-8, 1e-6, "differ"),
        (1.0 + 1e-6, 1e-5, 1e-6, "unresolved"),
        (1.0 + 1e-3, 1e-5, 1e-6, "differ"),  # beyond U although U is above the goal: the difference is established
        (1.0, np.inf, 1e-6, "unresolved"),
        (np.nan, 1e-8, 1e-6, "failed"),
    ],
)
def test_status_from_distance_uncertainty_and_goal(b: float, doubt: float, goal: float, status: str) -> None:
    assert compare(CHANNEL, signal(1.0, 0.0), signal(b, doubt), goal).status == status


def test_sloppiness_cannot_hide_behind_the_family() -> None:
    a, b = signal(1e-3, 1e-2, (5.0,)), signal(-1e-3, 1e-2, (5.0,))
    assert compare(CHANNEL, a, b, 1e-6).status == "unresolved"


@pytest.mark.parametrize("expected", ["agree", "differ", "refused", "failed", "did not run"])
def test_what_did_not_run_is_never_as_expected(expected: str) -> None:
    verdict = Verdict(
        case="a/b", comparison="c", kind="comparison", channel=CHANNEL, variant_a="v", engine_a="one", variant_b="v",
        engine_b="two", level="rigid", status="did not run", expected=expected, E=None, U=None, goal=1e-6, scale=None,
        reason="",
    )  # fmt: skip
    assert not verdict.ok


ODD = (-math.inf, -1.0, 0.0, 5e-324, 1.0, 1e308, math.inf, math.nan)
GIVEN_OR_NOT = (None, *ODD)
CHANNELS = ("load:pivot.force", "marker:tip.position", "marker:tip.orientation", "energy.total")
WIDTH = {"marker:tip.orientation": 4, "energy.total": 1}


def odd(channel: str, level: float, doubt: float, sizes: tuple[float, ...] = (1.0,)) -> Signal:
    values = np.zeros((3, WIDTH.get(channel, 3)))
    values[1:, 0] = level
    return Signal(values, Uncertainty(np.full(3, doubt), doubt, "given"), sizes)


def finite(*numbers: float | None) -> bool:
    return all(number is None or math.isfinite(number) for number in numbers)


def complaint(found: Finding, values: tuple[float, ...], doubts: tuple[float, ...], goal: float, others: tuple) -> str:
    """What is wrong with a finding from such inputs; "" if nothing. `others`: scale (or None) and sizes."""
    if found.status not in STATUSES or not found.reason:
        return "no status, or none with a reason"
    sound = finite(*values, *doubts, goal, *others) and goal > 0.0 and min(doubts) >= 0.0
    sound = sound and all(other is None or other >= 0.0 for other in others) and others[0] != 0.0
    if not sound and found.status not in ("failed", "unresolved"):
        return "a verdict from what is no number or no size"
    if found.status in ("agree", "differ") and not (finite(found.E, found.U) and found.E >= 0.0 and found.U >= 0.0):
        return "a verdict without figures"
    if found.status == "agree" and not found.E <= max(found.U, 0.0) <= goal:
        return "agreement beyond the uncertainty or the goal"
    return ""


def haste(channel: str, a: Signal, b: Signal, goal: float, scale: float | None = None) -> Finding:
    """Judging by asking what fails: every comparison with NaN is false."""
    size = scale or max(*a.sizes, *b.sizes)
    with np.errstate(all="ignore"):
        apart = float(np.float64(np.max(np.linalg.norm(a.values - b.values, axis=1))) / size)
        doubt = float(np.float64(a.uncertainty.value + b.uncertainty.value) / size)
    if apart > doubt:
        return Finding("differ", "apart", apart, doubt)
    if doubt > goal:
        return Finding("unresolved", "uncertain", apart, doubt)
    return Finding("agree", "within", apart, doubt)


def comparisons(judge: Callable[..., Finding], channel: str) -> Iterator[str]:
    """Complaints about all combinations of values, uncertainties, goal and scale; then of sizes."""
    for x, y, doubt, goal, scale in itertools.product(ODD, ODD, ODD, ODD, GIVEN_OR_NOT):
        found = judge(channel, odd(channel, x, 0.0), odd(channel, y, doubt), goal, scale)
        yield complaint(found, (x, y), (doubt,), goal, (scale, 1.0))
    for one, other, goal, scale, size in itertools.product(ODD, ODD, ODD, (None, 1.0, math.nan), ODD):
        found = judge(channel, odd(channel, 1.0, one, (size,)), odd(channel, 1.0, other, (1.0,)), goal, scale)
        yield complaint(found, (), (one, other), goal, (scale, size))


@pytest.mark.parametrize("channel", ["load:pivot.force", "marker:tip.orientation"])
def test_comparing_is_total(channel: str) -> None:
    assert set(comparisons(compare, channel)) == {""}


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_the_conditions_notice_a_judge_written_in_haste() -> None:
    assert next(filter(None, comparisons(haste, CHANNELS[0]))) == "a verdict from what is no number or no size"


@pytest.mark.parametrize("channel", CHANNELS)
@pytest.mark.parametrize(("one", "other"), [((3, 3), (2, 3)), ((3, 3), (3, 2)), ((0, 3), (0, 3)), ((3,), (3,))])
def test_what_has_no_common_samples_fails(channel: str, one: tuple[int, ...], other: tuple[int, ...]) -> None:
    doubt = Uncertainty(np.zeros(1), 0.0, "given")
    found = compare(channel, Signal(np.ones(one), doubt, ()), Signal(np.ones(other), doubt, (1.0, 2.0)), 1e-6)
    assert found.status == "failed"


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_one_bad_number_anywhere_fails(place: int, bad: float) -> None:
    for component in range(3):
        good, broken = odd(CHANNELS[0], 1.0, 0.1), odd(CHANNELS[0], 1.0, 0.1)
        broken.values[place, component] = bad
        assert compare(CHANNELS[0], good, broken, 1e-1).status == "failed"
        assert compare(CHANNELS[0], broken, good, 1e-1).status == "failed"


@pytest.mark.parametrize("expected", ["agree", "differ"])
def test_sizes_without_a_partner_and_none_at_all(expected: str) -> None:
    far = 1.0 if expected == "agree" else 2.0
    a, b = odd("energy.total", 1.0, 0.0, (5.0, 7.0)), odd("energy.total", far, 0.0, ())
    assert compare("energy.total", a, b, 1e-6).status == expected
    nothing = compare("energy.total", odd("energy.total", 1.0, 0.0, ()), odd("energy.total", far, 0.0, ()), 1e-6)
    assert nothing.status == ("agree" if expected == "agree" else "unresolved")


def test_what_is_apart_below_the_range_of_squares_differs() -> None:
    """Squares of 1e-200 are zero: a norm by squares would find these equal to the last digit."""
    a, b = odd(CHANNELS[0], 1e-200, 0.0, ()), odd(CHANNELS[0], 2e-200, 0.0, ())
    found = compare(CHANNELS[0], a, b, 1e-6)
    assert (found.status, found.E) == ("differ", 0.5)


def test_conserving_is_total() -> None:
    for drift, scale, limit in itertools.product(ODD, ODD, ODD):
        found = conserve(np.array([0.0, drift, 0.0]), scale, limit)
        assert found.status in ("agree", "differ", "failed", "unresolved") and found.reason
        if not (finite(drift, scale, limit) and scale > 0.0 and limit > 0.0):
            assert found.status in ("failed", "unresolved")
        if found.status == "agree":
            assert abs(drift) <= limit * scale
    assert conserve(np.zeros(0), 1.0, 1e-6).status == "failed"


def ladder(efforts: tuple[float, ...], levels: tuple[float, ...], evaluations: int = 0) -> list[RungSignal]:
    pairs = zip(efforts, levels, strict=True)
    return [RungSignal(effort, np.full((2, 3), level), evaluations) for effort, level in pairs]


@pytest.mark.parametrize("kind", ["step", "tolerance", ""])
@pytest.mark.parametrize("count", [2, 3])
def test_estimating_is_total(kind: str, count: int) -> None:
    """U is a number above its round-off, or infinite with the reason; never a NaN, never an exception."""
    sound = (0.4, 0.2, 0.1)[-count:]
    for odd in itertools.product(ODD, repeat=count):
        check(estimate(CHANNELS[0], kind, ladder(odd, (1.0, 1.1, 1.12)[-count:]), 1.0), finite(*odd))
        check(estimate(CHANNELS[0], kind, ladder(sound, odd), 1.0), finite(*odd))
    for evaluations, size in itertools.product((-1, 0, 10, 10**18), ODD):
        found = estimate(CHANNELS[0], kind, ladder(sound, (1.0, 1.1, 1.12)[-count:], evaluations), size)
        check(found, finite(size) and size >= 0.0 and evaluations >= 0)


@pytest.mark.parametrize("efforts", [3, 4])
def test_estimating_is_total_in_the_evaluations(efforts: int) -> None:
    """Tolerances that took as many evaluations as there are, none, or one less than before."""
    levels = (2.0, 1.0, 0.9, 0.899)[-efforts:]
    for counts in itertools.product((0, 1, 10, 11, 10**18), repeat=efforts):
        rungs = [RungSignal(0.1**n, np.full((2, 3), levels[n]), count) for n, count in enumerate(counts)]
        found = estimate(CHANNELS[0], "tolerance", rungs, 1.0)
        check(found, True)
        assert found.value >= 0.1 * np.max(np.abs(rungs[-2].values - rungs[-1].values))


def check(found: Uncertainty, sound: bool) -> None:
    assert found.value >= 0.0 and found.how
    assert found.envelope.shape == (2,) and np.all(found.envelope >= 0.0) and found.envelope[-1] == found.value
    assert found.value == math.inf or sound
    assert (found.value == math.inf) == found.how.startswith("unknown: ")


def test_rungs_that_are_no_ladder_leave_the_uncertainty_unknown() -> None:
    assert estimate(CHANNELS[0], "step", [], 1.0).value == math.inf
    shapes = [RungSignal(0.2, np.ones((3, 3))), RungSignal(0.1, np.ones((2, 3)))]
    assert estimate(CHANNELS[0], "step", shapes, 1.0).value == math.inf
    empty = [RungSignal(0.2, np.ones((0, 3))), RungSignal(0.1, np.ones((0, 3)))]
    assert estimate(CHANNELS[0], "step", empty, 1.0).value == math.inf
    rising = ladder((0.1, 0.2, 0.4), (1.0, 1.1, 1.12))
    assert estimate(CHANNELS[0], "step", rising, 1.0).value == math.inf
    assert estimate(CHANNELS[0], "step", ladder((0.1, 0.1), (1.0, 1.0)), 1.0).value == math.inf


def test_an_observed_order_is_a_number_or_none() -> None:
    for wider, gap in itertools.product(ODD, ODD):
        for steps in itertools.product(ODD, repeat=3):
            order = observed_order(steps, wider, gap)
            assert order is None or 0.0 < order <= 16.0
        for near in (1.0 + 2.3e-16, 1.0 + 1e-9, 2.0, 1e7):
            order = observed_order((near * near, near, 1.0), wider, gap)
            assert order is None or 0.0 < order <= 16.0


def test_a_spatial_uncertainty_is_a_number_or_infinite() -> None:
    for level, ratio, order in itertools.product(ODD, (*ODD, 2.0), ODD):
        found = spatial(CHANNELS[0], np.ones((2, 3)), np.full((2, 3), level), ratio, order)
        assert found.shape == (2,) and np.all(found >= 0.0)
        if not (finite(level, ratio, order) and ratio > 1.0 and order > 0.0):
            assert np.all(found == math.inf)
    assert np.all(spatial(CHANNELS[0], np.ones((2, 3)), np.ones((3, 3)), 2.0, 2.0) == math.inf)
    assert spatial(CHANNELS[0], np.ones((0, 3)), np.ones((0, 3)), 2.0, 2.0).shape == (0,)


def test_roundoff_grows_with_the_root_of_the_evaluations() -> None:
    assert roundoff_floor(3.0, 400) == pytest.approx(60.0 * np.finfo(float).eps)
    assert np.isfinite(roundoff_floor(3.0, 10**400))  # a record may hold any whole number


@pytest.mark.parametrize("size", [1e-320, 1e-200, 1.0, 1e200])
@pytest.mark.parametrize("channel", CHANNELS[:2])
def test_distances_are_neither_lost_nor_overflow(channel: str, size: float) -> None:
    values = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]]) * size
    assert distance(channel, values, np.zeros((2, 3)))[1] == pytest.approx(5.0 * size, rel=1e-3)
    assert magnitude(channel, values) == signal_range(channel, values) == pytest.approx(5.0 * size, rel=1e-3)
