"""Derivatives at one state of closed chains: against differences along what closures allow, and identities."""

from __future__ import annotations

from functools import cache
from typing import Any

import msgspec
import numpy as np
import pytest

import flexmb as fm
from tests.flexmb.closure import mechanisms as m
from tests.flexmb.closure.test_jacobian import LIGHT, NAMES, SCENES, Linearised
from tests.flexmb.entry.test_tangent import extrapolated, rounding_of_limit
from tests.flexmb.system import test_section_loads as sections

pytestmark = pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")
STEP = 2e-3
CLOSED = 1e-12  # to which the assembly closes closures; differences divide it by their smallest step


@cache
def asked(name: str) -> tuple[Any, fm.State, Any, Any]:
    system = fm.compile(SCENES[name]())
    state = system.initial_state
    return system, state, system.acceleration_derivatives(state), system.evaluation_derivatives(state)


def free_speeds(system: Any) -> Any:
    return system.constants.speed["prescribed"] < 0


def rounding(system: Any, state: fm.State) -> float:
    """The relative error of accelerations where a loop has light bodies: the state itself has no more digits."""
    return float(10.0 ** -system.digits_left(state))


def small_direction(system: Any, seed: int) -> tuple[Any, Any]:
    """Displacements, of modes small ones, and changes of the free speeds."""
    xi, du = np.random.default_rng(seed).normal(size=(2, system.nu)) * free_speeds(system)
    modal = np.zeros(system.nu, bool)
    for k in range(len(system.links)):
        body = system.constants.body[k]
        modal[body["etad_index"] : body["etad_index"] + body["modes"]] = True
    return np.where(modal, 1e-2, 1.0) * xi, du


def values(system: Any, state: fm.State) -> dict[str, Any]:
    """What is observed by names, without drives and orientations."""
    found = system.evaluate(state.t, state.q, state.u)
    markers = {
        name: np.r_[marker.position, marker.velocity, marker.acceleration] for name, marker in found.markers.items()
    }
    return {
        "accelerations": found.accelerations, "momentum": found.momentum, "energy": np.array([*found.energy.values()]),
        **markers, **found.loads, **found.wheel_loads, **found.connectors, **found.hinge_forces,
        **{f"drive {name}": drive for name, drive in found.drives.items()},
    }  # fmt: skip


def changes(d: Any, of: Any) -> dict[str, Any]:
    """`of` the records of derivatives, by the same names."""
    markers = {
        name: np.concatenate([of(marker.position), of(marker.velocity), of(marker.acceleration)])
        for name, marker in d.markers.items()
    }
    energy = np.array([of(each) for each in d.energy.values()])
    groups = {**d.loads, **d.wheel_loads, **d.connectors, **d.hinge_forces}
    drives = {f"drive {name}": of(drive) for name, drive in d.drives.items()}
    return {
        "accelerations": of(d.accelerations), "momentum": of(d.momentum), "energy": energy, **markers,
        **{name: of(group) for name, group in groups.items()}, **drives,
    }  # fmt: skip


# Accelerations of 1e8 leave nothing of the differences of what hardly moves.
@pytest.mark.parametrize("name", [name for name in NAMES if "11, light 1e-08" not in str(name)])
def test_along_what_the_closures_allow(name: str) -> None:
    """States are displaced, and put back on the closures: what they really change by is differenced, too."""
    system, state, rates, d = asked(name)
    xi, du = small_direction(system, 1)
    keys = list(values(system, state))

    def beside(h: float) -> Any:
        there = system.admissible(system.state(state.q + h * (rates.motion @ xi), state.u + h * du, state.t))
        return np.concatenate([there.q, there.u, *values(system, there).values()])

    step = 4.0 * STEP if name in LIGHT else STEP  # the error of closing is larger there
    expected, doubt = extrapolated(beside, step)
    nq, nu = system.nq, system.nu
    dq, dv = expected[:nq], expected[nq : nq + nu]
    along = np.linalg.lstsq(rates.motion, dq, rcond=None)[0] if nu else np.zeros(0)
    found = changes(d, lambda each: each.by_displacement @ along + each.by_speed @ dv)
    slopes = changes(d, lambda each: np.abs(each.by_displacement).sum(axis=-1) + np.abs(each.by_speed).sum(axis=-1))
    J = system.closure_operators(state).J
    assert np.max(np.abs(J @ along)) <= 1e-8 * max(1.0, float(np.max(np.abs(along)))), "no allowed displacement"
    start, planted = nq + nu, []
    for key in keys:
        now, stop = found[key], start + len(found[key])
        wanted, unsure = expected[start:stop], doubt[start:stop]
        size = max(1.0, float(np.nanmax(slopes[key], initial=0.0)))
        known = ~np.isnan(values(system, state)[key])
        np.testing.assert_array_equal(np.isnan(now), ~known)
        noise = rounding_of_limit() * (CLOSED + rounding(system, state)) * size / (step / 2**5)
        allowed = 30.0 * np.max(unsure[known], initial=0.0) + noise
        assert np.max(np.abs(now - wanted)[known], initial=0.0) <= allowed, key
        planted.append(float(np.max(np.abs(1.001 * now - wanted)[known], initial=0.0) - allowed))
        start = stop
    assert max(planted) > 0.0, "a planted error of a thousandth is noticed"


@pytest.mark.parametrize("name", NAMES)
def test_by_all_coordinates_as_the_jacobian_of_runs(name: str) -> None:
    """The other route evaluates each direction again under loads that change; it also holds beside the manifold."""
    system, state, rates, _ = asked(name)
    other = Linearised(system, state.y.copy()).J[system.nq : -1]
    allowed = (1e-11 + 30.0 * rounding(system, state)) * np.max(np.abs(other))
    np.testing.assert_allclose(rates.by_coordinates, other[:, : system.nq], rtol=0.0, atol=allowed)
    np.testing.assert_allclose(rates.by_speed, other[:, system.nq : -1], rtol=0.0, atol=allowed)


@pytest.mark.parametrize("name", NAMES)
def test_forces_move_only_what_closures_allow(name: str) -> None:
    """Rows have no acceleration, the response is symmetric, and of a force that a closure exerts there is none."""
    system, state, rates, d = asked(name)
    found, J, free = rates.by_force, system.closure_operators(state).J, free_speeds(system)
    size = np.linalg.norm(J) * np.max(np.abs(found), initial=1.0)
    small = (1e-12 + rounding(system, state)) * np.max(np.abs(found), initial=1.0)
    np.testing.assert_allclose(found, found.T, rtol=0.0, atol=small)
    np.testing.assert_allclose(found, d.accelerations.by_force, rtol=0.0, atol=small)
    assert np.max(np.abs(J @ found)) <= 1e-11 * size
    assert np.max(np.abs(found @ J.T)) <= (1e-11 + rounding(system, state)) * size
    M = system.mass_matrix(state)[np.ix_(free, free)]
    inner = found[np.ix_(free, free)]
    left = 1e-10 + rounding(system, state)
    np.testing.assert_allclose(inner @ M @ inner, inner, rtol=0.0, atol=left * np.max(np.abs(inner)))
    np.testing.assert_allclose(np.trace(inner @ M), free.sum() - system.rank, rtol=10.0 * left)


@pytest.mark.parametrize("name", [name for name in NAMES if name != "random loops 5"])
def test_closure_loads_do_no_work(name: str) -> None:
    """Along the motion the energy changes by the power of what has no potential: closures have none. Markers move.

    Except at level linear, which leaves terms out.
    """
    system, state, rates, d = asked(name)
    u, udot = state.u, rates.accelerations
    dy = Linearised(system, state.y.copy()).right_side(state.y)
    power = [each.by_displacement @ u + each.by_speed @ udot + each.by_time for each in d.energy.values()]
    size = sum(float(np.abs(each.by_displacement) @ np.abs(u)) for each in d.energy.values())
    size += sum(float(np.abs(each.by_speed) @ np.abs(udot)) for each in d.energy.values()) + abs(dy[-1])
    assert abs(sum(power) - dy[-1]) <= 1e-11 * max(1.0, size)
    evaluated = system.evaluate(state.t, state.q, state.u)
    for marker, motion in evaluated.markers.items():
        speeding = d.markers[marker].velocity
        found = speeding.by_displacement @ u + speeding.by_speed @ udot + speeding.by_time
        scale = max(1.0, float(np.max(np.abs(motion.acceleration))), float(np.max(np.abs(udot))))
        known = 1e-11 + rounding(system, state)  # accelerations are found once here and once there
        np.testing.assert_allclose(found, motion.acceleration, rtol=0.0, atol=known * scale)


@pytest.mark.parametrize("name", ["driven flexible four-bar", "connected"])
def test_along_a_run(name: str) -> None:
    """By the chain rule, all loads change as they do in time, of driven chains too."""
    system, state, rates, d = asked(name)
    u, udot = state.u, rates.accelerations
    found = changes(d, lambda each: each.by_displacement @ u + each.by_speed @ udot + each.by_time)
    times = 1e-5 * np.arange(9)
    trajectory = fm.simulate(system, times[-1], rtol=1e-12, atol=1e-14, samples=times)
    seen = [values(system, system.state(*pair)) for pair in zip(trajectory.q, trajectory.u, times, strict=True)]
    for key, now in found.items():
        series = np.array([each[key] for each in seen])
        known = ~np.isnan(series).any(axis=0)
        slope = np.polynomial.polynomial.polyfit(times / times[-1], series[:, known], 7)[1] / times[-1]
        size = max(1.0, float(np.max(np.abs(slope), initial=0.0)), float(np.max(np.abs(series[:, known]), initial=0.0)))
        assert np.max(np.abs(now[known] - slope), initial=0.0) <= 1e-4 * size, key


def test_section_loads_of_a_loop() -> None:
    scene = sections.everything(closed=True)
    system = fm.compile(scene)
    state, x = system.initial_state, [0.0, 0.6, 1.1]
    d = system.section_load_derivatives(state, "beam", x)
    _, du = small_direction(system, 3)

    def beside(h: float) -> Any:
        there = system.admissible(system.state(state.q, state.u + h * du, state.t))
        return np.r_[there.u, system.section_loads(there, "beam", x).load.ravel()]

    expected, doubt = extrapolated(beside, 1e-1)
    found = (d.by_speed @ expected[: system.nu]).ravel()
    wanted = expected[system.nu :]
    assert np.max(np.abs(found - wanted)) <= 30.0 * np.max(doubt) + 1e-8 * np.max(np.abs(wanted))


@pytest.mark.parametrize("name", ["four-bar, overconstrained", "connected"])
def test_loads_in_other_axes(name: str) -> None:
    """What is not determined there has no derivative there; by forces they are turned, for the axes stay."""
    system, state, _, d = asked(name)
    values, found = system.hinge_loads(state, axes="outboard"), system.hinge_load_derivatives(state, axes="outboard")
    world = system.hinge_loads(state)
    for load, value in values.items():
        np.testing.assert_array_equal(np.isnan(found[load].by_speed).all(axis=1), np.isnan(value))
        if not np.isnan(world[load]).any() and not np.isnan(value).any():
            turned, fixed = found[load].by_force[3:], d.loads[load].by_force[3:]
            size = np.max(np.abs(fixed), initial=1.0) ** 2
            np.testing.assert_allclose(turned.T @ turned, fixed.T @ fixed, rtol=0.0, atol=1e-9 * size)


def test_what_is_refused() -> None:
    system, state, *_ = asked("flexible four-bar")
    with pytest.raises(NotImplementedError, match="for given accelerations are for trees only"):
        system.evaluation_derivatives(state, np.zeros(system.nu))
    d = system.inverse_dynamics_derivatives(state, np.zeros(system.nu))
    M = system.mass_matrix(state)
    np.testing.assert_allclose(d.by_acceleration, M, rtol=0.0, atol=1e-13 * np.max(np.abs(M)))
    scene = m.four_bar(rate=2.0, modes=1)
    ruthless = tuple(msgspec.structs.replace(body, level="ruthless") for body in scene.bodies)
    resting = fm.compile(msgspec.structs.replace(scene, bodies=ruthless))
    evaluator = lambda _: resting.derivative_evaluator()  # noqa: E731
    for ask in (resting.acceleration_derivatives, resting.evaluation_derivatives, evaluator):
        with pytest.raises(NotImplementedError, match='"ruthless".*use level "linear"'):
            ask(resting.initial_state)


def test_a_singular_position_is_an_error() -> None:
    """Bars of a parallelogram that all lie on one line."""
    system = fm.compile(m.windows(1, 1.5))
    state = system.state(np.zeros(system.nq), np.zeros(system.nu))
    assert system.closure_gaps(state)["window 0"] < (1e-12, 1e-12)
    for ask in (system.acceleration_derivatives, system.evaluation_derivatives):
        with pytest.raises(fm.DynamicsError, match="singular"):
            ask(state)
