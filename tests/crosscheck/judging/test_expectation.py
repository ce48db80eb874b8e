"""An expectation has bounds: a difference that grew, a divergence at another time, a failure for another reason."""

from __future__ import annotations

import itertools
import math

import msgspec
import pytest

from crosscheck.judging.expectation import outside
from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.verdict import Ending, Finding
from crosscheck.library.case import Comparison, Conservation
from crosscheck.records.packing import pack
from tests.crosscheck.made_records import ONE_PAIR, TIMES, TIP, ended, judged, ladder, single, way

ODD = (None, -math.inf, -1.0, 0.0, 5e-324, 1e308, math.inf, math.nan)


def expecting(expect: str, **bounds: object) -> Comparison:
    return Comparison(name="c", goals={TIP: 1e-3}, expect=expect, reason="so", **bounds)


def differing(by: float, band: str) -> SessionOutcome:
    """Two engines, the second off by that part of the range, and an expected difference."""
    text = ONE_PAIR + f'expect = "differ"\nband = {{ {band} }}\nreason = "so"\n'
    return judged(text, [*ladder("one", {TIP: way()}), *ladder("two", {TIP: way(1.0 + by)})])


@pytest.mark.parametrize(("by", "ok"), [(0.1, True), (0.2, True), (0.02, False), (0.6, False), (10.0, False)])
def test_a_difference_beyond_its_band_is_not_as_expected(by: float, ok: bool) -> None:
    verdict = single(differing(by, f'"{TIP}" = [0.05, 0.3]'))
    assert (verdict.status, verdict.ok, bool(verdict.outside)) == ("differ", ok, not ok)
    assert ok or "is outside the expected 0.05 to 0.3" in verdict.reason


def test_the_most_specific_band_counts() -> None:
    assert single(differing(0.1, f'"marker" = [1e-6, 1e-5], "{TIP}" = [0.05, 0.3]')).ok
    assert not single(differing(0.1, f'"marker" = [0.05, 0.3], "{TIP}" = [1e-6, 1e-5]')).ok


@pytest.mark.parametrize(("reached", "ok"), [(6, True), (3, False), (9, False)])
def test_a_divergence_at_another_time_is_not_as_expected(reached: int, ok: bool) -> None:
    text = ONE_PAIR + 'expect = "diverged"\ndiverged_s = [0.35, 0.55]\nreason = "so"\n'
    two = ladder("two", {TIP: way()})
    cut = {"times": pack(TIMES[:reached]), "channels": {TIP: pack(way()[:reached])}}
    two[-1] = ended(two[-1], "diverged", **cut)
    verdict = single(judged(text, [*ladder("one", {TIP: way()}), *two]))
    assert (verdict.status, verdict.ok) == ("diverged", ok)
    assert f"diverged at t = {TIMES[reached - 1]:.4g} s" in verdict.reason


def test_of_two_that_diverge_both_must_do_so_in_time() -> None:
    text = ONE_PAIR + 'expect = "diverged"\ndiverged_s = [0.35, 0.55]\nreason = "so"\n'
    runs = {}
    for engine, reached in (("one", 6), ("two", 6), ("early", 3)):
        cut = {"times": pack(TIMES[:reached]), "channels": {TIP: pack(way()[:reached])}}
        runs[engine] = [ended(run, "diverged", **cut) for run in ladder(engine, {TIP: way()})]
    assert single(judged(text, runs["one"] + runs["two"])).ok
    early = [msgspec.structs.replace(run, engine="two") for run in runs["early"]]
    assert not single(judged(text, runs["one"] + early)).ok


@pytest.mark.parametrize("status", ["failed", "refused"])
@pytest.mark.parametrize(("message", "ok"), [("revolute hinges are beyond it", True), ("no license", False)])
def test_another_reason_is_not_as_expected(status: str, message: str, ok: bool) -> None:
    text = ONE_PAIR + f'expect = "{status}"\nbecause = "beyond it"\nreason = "so"\n'
    blank = ended(ladder("two", {TIP: way()})[-1], status, message, effort="", times=None, channels={})
    verdict = single(judged(text, [*ladder("one", {TIP: way()}), blank]))
    assert (verdict.status, verdict.ok) == (status, ok)


@pytest.mark.parametrize("status", ["crashed", "did not finish", "diverged"])
def test_a_crash_is_no_expected_failure(status: str) -> None:
    text = ONE_PAIR + 'expect = "failed"\nbecause = "for a reason"\nreason = "so"\n'
    blank = ended(ladder("two", {TIP: way()})[-1], status, effort="", times=None, channels={})
    verdict = single(judged(text, [*ladder("one", {TIP: way()}), blank]))
    assert (verdict.status, verdict.ok) == (status, False)


def test_an_expected_lack_of_resolution_is_bounded_too() -> None:
    text = ONE_PAIR.replace("1e-3", "1e-6") + f'expect = "unresolved"\nband = {{ "{TIP}" = [BAND] }}\nreason = "so"\n'
    runs = [*ladder("one", {TIP: way()}), *ladder("two", {TIP: way()})]
    for band, ok in (("1e-5, 1e-4", True), ("1e-7, 1e-6", False), ("1e-3, 1e-2", False)):
        verdict = single(judged(text.replace("BAND", band), runs))
        assert (verdict.status, verdict.ok) == ("unresolved", ok)


def test_a_drift_has_its_band() -> None:
    item = Conservation(variant="v", quantity="energy", limit=1e-9, expect="differ", band=(1e-7, 1e-6), reason="so")
    assert outside(item, "energy.total", Finding("differ", "drifts", 2e-7)) == ""
    assert outside(item, "energy.total", Finding("differ", "drifts", 2e-5))
    assert outside(msgspec.structs.replace(item, band=None), "energy.total", Finding("differ", "drifts", 2e-7))


def test_bounds_are_total() -> None:
    """No figure that is no number is within any bounds, and no bounds that are no numbers hold any figure."""
    for low, high, figure in itertools.product(ODD[1:], ODD[1:], ODD):
        finite = figure is not None and math.isfinite(figure) and low <= figure <= high
        for expect, found in (
            ("differ", Finding("differ", "", figure, 1.0)),
            ("unresolved", Finding("unresolved", "", 1.0, figure)),
        ):
            within = outside(expecting(expect, band={TIP: (low, high)}), TIP, found) == ""
            assert within == (figure is not None and low <= figure <= high)
            assert within <= (finite or figure in (math.inf, -math.inf))
        ending = Finding("diverged", "", endings=(Ending("diverged", "", figure),))
        assert (outside(expecting("diverged", diverged_s=(low, high)), TIP, ending) == "") == within
    for expect in ("differ", "unresolved", "diverged", "failed", "refused"):
        assert "sets no bounds" in outside(expecting(expect), TIP, Finding(expect, "so", 1.0, 1.0))
    assert outside(expecting("agree"), TIP, Finding("agree", "so", 1.0, 1.0)) == ""


def test_a_reason_without_endings_is_the_findings_own() -> None:
    refused = Finding("refused", "two does not offer energy.total")
    assert outside(expecting("refused", because="does not offer"), TIP, refused) == ""
    assert outside(expecting("refused", because="cannot"), TIP, refused) == 'the expected reason is "cannot"'


def test_what_is_outside_is_named_with_its_figures() -> None:
    """What was measured, what was expected of it, and which bound the case lacks."""
    late = Finding("diverged", "so", endings=(Ending("diverged", "so", 7.0),))
    untimed = Finding("diverged", "so", endings=(Ending("diverged", "so"),))
    failed = Finding("failed", "no luck")
    vague = Finding("unresolved", "so", 1e-9, 0.5, 1.0)
    for item, finding, said in (
        (
            expecting("differ", band={TIP: (1.0, 2.0)}),
            Finding("differ", "so", 3.0),
            "E = 3 is outside the expected 1 to 2",
        ),
        (expecting("differ"), Finding("differ", "so", 3.0), "the case sets no bounds to E"),
        (expecting("unresolved", band={TIP: (1.0, 2.0)}), vague, "U = 0.5 is outside the expected 1 to 2"),
        (expecting("unresolved"), vague, "the case sets no bounds to U"),
        (
            expecting("unresolved", band={TIP: (1.0, 2.0)}),
            Finding("unresolved", "so"),
            "there is no figure for U, expected is 1 to 2",
        ),
        (expecting("diverged", diverged_s=(1.0, 2.0)), late, "the time reached (s) = 7 is outside the expected 1 to 2"),
        (
            expecting("diverged", diverged_s=(1.0, 2.0)),
            untimed,
            "there is no figure for the time reached (s), expected is 1 to 2",
        ),
        (expecting("failed"), failed, "the case sets no bounds to the reason"),
        (expecting("failed", because="license"), failed, 'the expected reason is "license"'),
        (expecting("failed", because="luck"), failed, ""),
        (expecting("agree"), Finding("agree", "so", 0.0, 0.0), ""),
    ):
        assert outside(item, TIP, finding) == said
