"""Statuses from numbers: agree, differ, unresolved, and what happens where a signal vanishes."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.judging.uncertainty import Uncertainty
from crosscheck.judging.verdict import Signal, Verdict, compare, conserve

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


def test_numbers_are_relative_to_the_range() -> None:
    finding = compare(CHANNEL, signal(20.0, 1e-6), signal(20.0 + 1e-7, 1e-6), 1e-6)
    found = (finding.scale, finding.U, finding.E)
    assert found == pytest.approx((20.0, 1e-7, 5e-9), rel=1e-6)


def test_a_stated_scale_replaces_the_range() -> None:
    finding = compare(CHANNEL, signal(1e-9, 1e-12), signal(2e-9, 1e-12), 1e-6, scale=10.0)
    assert (finding.status, finding.scale) == ("differ", 10.0)


def test_a_signal_lost_in_its_uncertainty_is_measured_by_its_family() -> None:
    a, b = signal(1e-14, 1e-12, (5.0,)), signal(-1e-14, 1e-12, (5.0,))
    finding = compare(CHANNEL, a, b, 1e-9)
    assert (finding.status, finding.scale) == ("agree", 5.0)


def test_sloppiness_cannot_hide_behind_the_family() -> None:
    a, b = signal(1e-3, 1e-2, (5.0,)), signal(-1e-3, 1e-2, (5.0,))
    assert compare(CHANNEL, a, b, 1e-6).status == "unresolved"


def test_signals_without_any_size_are_unresolved_unless_equal() -> None:
    assert compare(CHANNEL, signal(0.0, 0.0, (0.0,)), signal(0.0, 0.0, (0.0,)), 1e-6).status == "agree"
    assert compare(CHANNEL, signal(0.0, 1e-17, (0.0,)), signal(0.0, 0.0, (0.0,)), 1e-6).status == "unresolved"


def test_drift_against_its_limit() -> None:
    drift = 1e-9 * TIMES
    assert conserve(drift, 1.0, 1e-8).status == "agree"
    assert conserve(drift, 1.0, 1e-10).status == "differ"
    assert conserve(drift, 0.0, 1e-10).status == "unresolved"
    assert conserve(np.full(3, np.nan), 1.0, 1e-10).status == "failed"


@pytest.mark.parametrize("expected", ["agree", "differ", "refused", "failed", "did not run"])
def test_what_did_not_run_is_never_as_expected(expected: str) -> None:
    verdict = Verdict(
        case="a/b", comparison="c", kind="comparison", channel=CHANNEL, variant_a="v", engine_a="one", variant_b="v",
        engine_b="two", level="rigid", status="did not run", expected=expected, E=None, U=None, goal=1e-6, scale=None,
        reason="",
    )  # fmt: skip
    assert not verdict.ok
