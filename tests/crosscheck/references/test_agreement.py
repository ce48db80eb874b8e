"""How routes make a reference: independence, disagreement, uncertainty, horizon; and anchors between samples."""

from dataclasses import replace

import numpy as np
import pytest

from crosscheck.judging.uncertainty import Uncertainty
from crosscheck.library.case import CaseError, PublishedNumber
from crosscheck.references.agreement import KNOWN, agree, meet
from crosscheck.references.routes import RouteSignals
from flexmb.typing import Real

TIMES = np.linspace(0.0, 10.0, 101)
POSITION, FORCE = "marker:tip.position", "load:hinge.force"
PATH = np.column_stack([np.sin(TIMES), np.cos(TIMES), 0.0 * TIMES])


def route(
    engine: str = "native", method: str = "dop853", off: float | Real = 0.0, doubt: float | Real = 1e-9
) -> RouteSignals:
    """A route to PATH, off by `off` along x, known to `doubt`; and to a force ten times as large in all of these."""
    shift = np.outer(np.broadcast_to(off, TIMES.shape), [1.0, 0.0, 0.0])
    envelope = np.maximum.accumulate(np.broadcast_to(doubt, TIMES.shape))
    channels = {POSITION: PATH + shift, FORCE: 10.0 * (PATH + shift)}
    sizes = {POSITION: 1.0, FORCE: 10.0}
    known = {name: Uncertainty(size * envelope, size * float(envelope[-1]), "made up") for name, size in sizes.items()}
    return RouteSignals(engine, engine, engine, method, f"{engine} 1", TIMES, channels, known)


def test_the_uncertainty_is_no_less_than_what_a_route_knows_of_itself_and_than_any_distance() -> None:
    far = agree([route(), route("pinocchio", off=2e-9, doubt=1e-8), route("mujoco", off=1e-9)], ()).known
    assert far[POSITION].uncertainty == pytest.approx(2e-9, rel=0.06)
    assert far[POSITION].uncertainty >= 2e-9
    near = agree([route(doubt=1e-7), route("pinocchio")], ()).known
    assert near[POSITION].uncertainty == pytest.approx(1e-7)
    assert near[FORCE].uncertainty == pytest.approx(1e-6)


def test_a_witness_has_to_agree_and_says_nothing_of_the_uncertainty() -> None:
    witness = replace(route("mujoco", off=5e-7, doubt=1e-6), witness=True)
    found = agree([route(), route("pinocchio"), witness], ()).known[POSITION]
    assert found.uncertainty == pytest.approx(1e-9)
    assert "E 5.0e-07 to mujoco, a witness known to 1.0e-06" in found.how
    with pytest.raises(CaseError, match="are 5e-07 m apart"):
        agree([route(), route("pinocchio"), replace(witness, uncertainties=route("mujoco").uncertainties)], ())
    with pytest.raises(CaseError, match="an uncertainty|uncertainty of mujoco is none"):
        agree([route(), route("pinocchio"), replace(route("mujoco", doubt=np.inf), witness=True)], ())


def test_a_witness_does_not_make_a_route_independent_nor_a_channel_known() -> None:
    witness = replace(route("mujoco"), witness=True)
    with pytest.raises(CaseError, match="no route is independent of native"):
        agree([route(), route(), witness], ())
    alone = replace(route("pinocchio"), channels={POSITION: PATH})
    assert set(agree([route(), alone, witness], ()).known) == {POSITION}


def test_even_equal_routes_leave_the_rounding_of_the_file() -> None:
    known = agree([route(doubt=0.0), route("pinocchio", doubt=0.0)], ()).known
    assert 1e-16 < known[POSITION].uncertainty < 1e-15
    assert 1e-15 < known[FORCE].uncertainty < 1e-14


def test_a_channel_of_zeros_has_an_uncertainty_too() -> None:
    still = [replace(each, channels={FORCE: 0.0 * PATH}) for each in (route(doubt=0.0), route("mujoco", doubt=0.0))]
    assert 0.0 < agree(still, ()).known[FORCE].uncertainty < 1e-15


@pytest.mark.parametrize(("one", "other", "independent"), [
    (("native", "dop853"), ("pinocchio", "dop853"), True),
    (("", ""), ("native", "dop853"), True),
    (("native", "dop853"), ("native-frisch", "rk4"), True),
    (("native", "dop853"), ("native-frisch", "dop853"), False),
    (("native", "dop853"), ("native", "rk4"), False),
    (("native", "dop853"), ("native", "dop853"), False),
    (("exudyn", "a"), ("exudyn-beam", "a"), False),
    (("", ""), ("", ""), False),
])  # fmt: skip
def test_independence(one: tuple[str, str], other: tuple[str, str], independent: bool) -> None:
    assert route(*one).independent_of(route(*other)) == independent
    if independent:
        assert agree([route(*one), route(*other)], ()).channels
    else:
        with pytest.raises(CaseError, match="no route is independent"):
            agree([route(*one), route(*other)], ())


@pytest.mark.parametrize("off", [3e-9, np.nan, np.inf])
def test_routes_that_do_not_agree_make_no_reference(off: float) -> None:
    with pytest.raises(CaseError) as refused, np.errstate(invalid="ignore"):
        agree([route(), route("pinocchio", off=np.where(TIMES[40] == TIMES, off, 0.0))], ())
    assert f"{POSITION}: native and pinocchio are" in str(refused.value)
    assert "at t = 4 s" in str(refused.value)


@pytest.mark.parametrize("doubt", [np.nan, np.inf])
def test_a_route_that_knows_nothing_makes_no_reference(doubt: float) -> None:
    with pytest.raises(CaseError):
        agree([route(doubt=doubt), route("pinocchio")], ())


def test_a_second_route_that_knows_nothing_confirms_nothing() -> None:
    with pytest.raises(CaseError, match=POSITION):
        agree([route(), route("pinocchio", doubt=np.inf)], ())


def test_patterns_choose_channels_and_must_find_them() -> None:
    assert list(agree([route(), route("pinocchio")], ("load",)).channels) == [FORCE]
    with pytest.raises(CaseError, match='no route offers "drive"'):
        agree([route(), route("pinocchio")], ("drive",))
    alone = replace(route("pinocchio"), channels={POSITION: PATH})
    assert list(agree([route(), alone], ()).channels) == [POSITION]
    with pytest.raises(CaseError, match=f"{FORCE} is offered by native alone"):
        agree([route(), alone], ("load",))


def test_chaotic_motion_ends_where_it_is_known_no_more() -> None:
    """U grows from 1e-12 by a factor e^3 in a second, and two routes part as fast."""
    growing = 1e-12 * np.exp(3.0 * TIMES)
    routes = [route(doubt=growing), route("pinocchio", off=0.5 * growing, doubt=growing)]
    agreed = agree(routes, ())
    end = agreed.times[-1]
    assert 1e-12 * np.exp(3.0 * end) <= 2.0 * KNOWN < 1e-12 * np.exp(3.0 * (end + 0.1)) * 1.3
    assert len(agreed.channels[FORCE]) == len(agreed.times) < len(TIMES)
    assert agreed.known[POSITION].uncertainty < 2.1 * KNOWN


def test_motion_that_nobody_knows_has_no_reference() -> None:
    with pytest.raises(CaseError, match="unknown from the start"):
        agree([route(doubt=0.5), route("pinocchio", doubt=0.5)], ())


@pytest.mark.parametrize(("t", "off", "met"), [(3.0, 0.0, True), (3.03, 0.0, True), (3.03, 3e-6, False)])
def test_anchors_between_samples(t: float, off: float, met: bool) -> None:
    agreed = agree([route(), route("pinocchio")], ())
    number = PublishedNumber(
        channel=POSITION, component="x", t_s=t, value=np.sin(t) + off, uncertainty=1e-8, source="the sine"
    )
    if met:
        meet(agreed, [number])
    else:
        with pytest.raises(CaseError, match="find out which of the two is wrong"):
            meet(agreed, [number])
