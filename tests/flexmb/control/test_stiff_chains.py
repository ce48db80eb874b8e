"""Continuous controllers of closed chains with the methods that need Jacobians."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.control.feedback import Feedback
from flexmb.control.loop import project
from flexmb.control.tangent import jacobian
from flexmb.tables.status import OK
from tests.bounds import observed_order
from tests.flexmb.closure import mechanisms as m
from tests.flexmb.control.test_closed_chains import GRASHOF, LAGGING, LOADS, PD, controlled
from tests.flexmb.control.test_stiff import by_differences, posed

ADAPTIVE: tuple[Any, ...] = ("radau5", "exponential")
STIFF = fm.StateSpace(name="law", inputs=("angle", "rate"), D=((-4e4, -4e2),))
BENDING = m.four_bar(modes=1)
SEEN = (
    fm.MarkerSensor(name="seen", marker="joint", quantity="position"),
    fm.MarkerSensor(name="passing", marker="joint", quantity="velocity"),
    fm.StateSpace(name="law", inputs=("seen[0]", "passing[1]"), A=((-8.0,),), B=((2.0, 0.3),), C=((1.5,),)),
)
FELT = (
    fm.MarkerSensor(name="felt", marker="joint", quantity="specific_force", frame="marker"),
    fm.StateSpace(name="law", inputs=("felt[1]", "angle"), A=((-5.0,),), B=((0.4, 1.0),), C=((-0.2,),)),
)
LOADED = (
    *LOADS,
    fm.StateSpace(
        name="law", inputs=("pin load[3]", "loop load[4]"), A=((-20.0,),), B=((0.4, -0.2),), C=((1.0,),)
    ),
)  # fmt: skip
LAWS = {"pd": (PD,), "lagging": (LAGGING,), "markers": SEEN, "accelerometer": FELT, "loads": LOADED}


@pytest.mark.parametrize("kind", LAWS)
def test_the_jacobian_is_that_of_the_closed_loop_of_the_chain(kind: str) -> None:
    """Beside closed states too, where differences are taken."""
    loop, moving, y, _held = posed(controlled(GRASHOF, "drive", *LAWS[kind]))
    project(0.3, y, loop)  # the chain chooses its rows
    found, expected = np.empty((len(y), len(y))), by_differences(loop, y)
    assert jacobian(0.3, y, found, loop, moving) == OK
    assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()
    expected[:6, :6] -= moving.of_motion[:6, :6]  # and it is not that of the chain alone
    assert np.abs(expected).max() > 1e-2 * np.abs(found).max()


@pytest.mark.parametrize("kind", LAWS)
def test_methods_with_jacobians_agree_with_one_without(kind: str) -> None:
    scene, t_end = controlled(GRASHOF, "drive", *LAWS[kind]), 0.1 if kind == "loads" else 0.5  # Python finds loads
    known = fm.simulate(scene, t_end, samples=6, rtol=1e-12, atol=1e-13)
    for method in ADAPTIVE:
        run = fm.simulate(scene, t_end, method, samples=6)
        assert run.finished and run.statistics.jacobians > 0, run.message
        assert np.abs(run.q - known.q).max() < 1e-8
        assert np.abs(run.signals["law"] - known.signals["law"]).max() < 1e-6 * np.abs(known.signals["law"]).max()
        assert np.abs(run.energy_drift).max() < 1e-8 * run.energy_scale


@pytest.mark.parametrize("law", [PD, LAGGING], ids=["pd", "lagging"])
def test_generalised_alpha_keeps_its_order(law: Any) -> None:
    scene = controlled(GRASHOF, "drive", law)
    known = fm.simulate(scene, 0.5, samples=2, rtol=1e-12, atol=1e-13)
    steps = 0.5 / 2.0 ** np.arange(9, 13)
    runs = [fm.simulate(scene, 0.5, "generalised_alpha", samples=2, step=h) for h in steps]
    for error in (
        [np.abs(run.q[-1] - known.q[-1]).max() for run in runs],
        [abs(run.signals["law"][-1, 0] - known.signals["law"][-1, 0]) for run in runs],
    ):
        assert observed_order(steps, error, 1e-9) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("method", ADAPTIVE)
def test_in_a_chain_a_controller_takes_the_steps_of_the_spring_that_it_stands_for(method: Any) -> None:
    drive: Any = GRASHOF.hinges[0]
    spring = msgspec.structs.replace(drive.rotation, stiffness_Nm_rad=4e4, damping_Nms_rad=4e2)
    hinges = msgspec.structs.replace(drive, rotation=spring), *GRASHOF.hinges[1:]
    sprung = msgspec.structs.replace(GRASHOF, hinges=hinges)
    settings: dict[str, Any] = {"rtol": 1e-6, "atol": 1e-8}
    ours = fm.simulate(controlled(GRASHOF, "drive", STIFF), 0.3, method, **settings)
    passive = fm.simulate(sprung, 0.3, method, **settings)
    assert ours.finished and np.abs(ours.q - passive.q).max() < 1e-6
    assert ours.statistics.accepted_steps == pytest.approx(passive.statistics.accepted_steps, rel=0.05, abs=3)


def test_in_a_chain_without_the_controller_in_the_jacobian_steps_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = controlled(GRASHOF, "drive", STIFF)
    complete = fm.simulate(scene, 0.02, "radau5", rtol=1e-6, atol=1e-8)
    whole = Feedback._tangent
    monkeypatch.setattr(Feedback, "_tangent", lambda *given: replace(whole(*given), column=np.zeros(0, np.int64)))
    incomplete = fm.simulate(scene, 0.02, "radau5", rtol=1e-6, atol=1e-8)
    assert incomplete.statistics.evaluations > 5 * complete.statistics.evaluations


def test_bending_bars_under_a_controller() -> None:
    """Modes of the bars and states of the controller in one linear system, projected with what is stiff settled."""
    scene = controlled(BENDING, "drive", LAGGING)
    known = fm.simulate(scene, 0.1, samples=3, rtol=1e-11, atol=1e-13)
    for method in ADAPTIVE:
        run = fm.simulate(scene, 0.1, method, samples=3, rtol=1e-8, atol=1e-10)
        assert run.finished and np.abs(run.q - known.q).max() < 1e-6


@pytest.mark.parametrize("method", [*ADAPTIVE, "generalised_alpha"])
def test_a_controlled_chain_is_taken_up_to_the_last_bit(method: Any) -> None:
    scene = controlled(GRASHOF, "drive", LAGGING)
    settings: dict[str, Any] = {"step": 1e-3} if method == "generalised_alpha" else {"rtol": 1e-6}
    whole = fm.simulate(scene, 0.4, method, samples=5, **settings)
    first = fm.simulate(scene, 0.2, method, samples=3, **settings)
    second = fm.simulate(scene, 0.4, method, state=first.restart, samples=3, **settings)
    assert np.array_equal(second.q[-1], whole.q[-1])
    assert np.array_equal(second.signals["law"][-1], whole.signals["law"][-1])
