"""Derivatives of loads: of given accelerations, in other axes, across sections."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import flexmb as fm
from tests.flexmb.entry.test_tangent import extrapolated, rounding_of_limit
from tests.flexmb.system import test_section_loads as sections
from tests.flexmb.system.test_derivatives import asked, directions

pytestmark = pytest.mark.filterwarnings("ignore:.*is doubtful")


@pytest.mark.parametrize("name", ["every level", "stiffened", "exact", "connectors"])
def test_loads_of_given_accelerations(name: str) -> None:
    """By accelerations they are linear; by the state and time as differences of inverse dynamics say."""
    at = asked(name)
    system, t, q, u = at.system, at.state.t, at.state.q, at.state.u
    rng = np.random.default_rng(11)
    rates, other = rng.normal(size=(2, system.nu))
    d = system.evaluation_derivatives(at.state, rates)
    here, there = (system.hinge_loads(at.state, each) for each in (rates, rates + 2.0**20 * other))
    for hinge, load in here.items():
        size = max(np.max(np.abs(each)) for each in there.values()) / 2.0**20
        np.testing.assert_allclose(
            d.loads[hinge].by_acceleration @ other, (there[hinge] - load) / 2.0**20, rtol=0.0, atol=1e-11 * size
        )
    np.testing.assert_array_equal(d.accelerations.by_acceleration, np.eye(system.nu))
    for xi, du, dt in directions(at):
        moved = lambda h, xi=xi, du=du, dt=dt: np.concatenate(list(system.hinge_loads(  # noqa: E731
            system.state(q + h * at.of_rates.motion @ xi, u + h * du, t + h * dt), rates
        ).values()))  # fmt: skip
        expected, doubt = extrapolated(moved, 1e-2)
        found = np.concatenate([
            load.by_displacement @ xi + load.by_speed @ du + load.by_time * dt for load in d.loads.values()
        ])  # fmt: skip
        size = np.max(np.abs(moved(0.0)))
        assert np.max(np.abs(found - expected)) <= 30.0 * np.max(doubt) + 1e-10 * size


@pytest.mark.parametrize(
    ("name", "axes", "node"),
    [("every level", "outboard", None), ("every level", "inboard", "tip"), ("every level", "world", "origin"),
     ("exact", "inboard", "tip")],
)  # fmt: skip
def test_loads_in_other_axes_against_differences(name: str, axes: Any, node: str | None) -> None:
    at = asked(name)
    system, state = at.system, at.state
    beam = next(body.name for body in system.scene.bodies if isinstance(body, fm.BeamBody))
    about = None if node is None else (beam if node == "tip" else "ground", node)
    d = system.hinge_load_derivatives(state, axes=axes, about=about)
    for xi, du, dt in directions(at)[:2]:
        moved = lambda h, xi=xi, du=du: np.array(list(system.hinge_loads(  # noqa: E731
            system.state(state.q + h * at.of_rates.motion @ xi, state.u + h * du, state.t), axes=axes, about=about
        ).values()))  # fmt: skip
        expected, doubt = extrapolated(moved, 1e-2)
        found = np.array([each.by_displacement @ xi + each.by_speed @ du + each.by_time * dt for each in d.values()])
        allowed = 30.0 * np.max(doubt) + 1e-8 * np.max(np.abs(expected))
        assert np.max(np.abs(found - expected)) <= allowed
        assert np.max(np.abs(found * (1.0 + 1e-5) - expected)) > allowed, "a planted error"
    plain = system.hinge_load_derivatives(state)
    for hinge, load in at.of_all.loads.items():
        for one, other in zip(plain[hinge], load, strict=True):
            np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-14 * np.max(np.abs(other), initial=1e-300))


@pytest.mark.parametrize(("connected", "level"), [(False, "full"), (True, "full"), (False, "exact")])
def test_section_loads_against_differences(connected: bool, level: fm.Level) -> None:
    modes = {"modes": fm.Modes(count=2)} if level == "exact" else {}
    scene = sections.everything(connected=connected, level=level, **modes)
    system = fm.compile(scene)
    state, body, x = sections.somewhere(system), "beam", [0.0, 0.7, 1.6]
    rng = np.random.default_rng(8)
    d = system.section_load_derivatives(state, body, x)
    motion = system.acceleration_derivatives(state).motion
    free = system.constants.speed["prescribed"] < 0
    xi, du = rng.normal(size=(2, system.nu)) * np.where(free, 1e-2, 0.0)
    for dq, dv, dt, found in (
        (motion @ xi, 0.0, 0.0, d.by_displacement @ xi),
        (0.0, du, 0.0, d.by_speed @ du),
        (0.0, 0.0, 1e-2, d.by_time * 1e-2),
    ):
        moved = lambda h, dq=dq, dv=dv, dt=dt: system.section_loads(  # noqa: E731
            system.state(state.q + h * dq, state.u + h * dv, state.t + h * dt), body, x
        ).load  # fmt: skip
        expected, doubt = extrapolated(moved, 1e-1)
        tiny = [moved(k * 2.0**-40) for k in range(4)]  # smooth parts have no third differences
        noise = np.max(np.abs(tiny[3] - 3.0 * tiny[2] + 3.0 * tiny[1] - tiny[0]))
        rounding = rounding_of_limit() * noise / (1e-1 / 2**5)
        size = max(np.max(np.abs(expected)), 1e-3 * np.max(np.abs(moved(0.0))))
        allowed = 30.0 * np.max(doubt) + 1e-9 * size + rounding
        assert np.max(np.abs(found - expected)) <= allowed
        if np.max(np.abs(expected)) > 1e-3:
            assert np.max(np.abs(found * (1.0 + 1e-5) - expected)) > allowed, "planted"
