"""Loads in other frames and across sections, and errors of runs by a second, tighter one: of the size of the true
error, on every channel, with events and controllers too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexmb as fm
from flexmb.run.channels import channels_of, distance
from flexmb.scene.shapes import beam_section

SECTION = beam_section(E=7e10, G=2.7e10, A=4e-4, Iy=5e-9, Iz=5e-9, rho=2700.0)


def boom(*actions: fm.Action, **sampling: float) -> fm.Scene:
    """A beam that swings and is held or made heavier at an angle; with sampling, a controller drives its wrist."""
    torque = fm.ControlSignal(source="law", gain=0.5) if sampling else None
    builder = (
        fm.SceneBuilder("boom", gravity=(0, 0, -9.81))
        .beam("boom", length=1.0, section=SECTION, elements=6, modes=fm.Modes(count=2, families=("bending_z",)))
        .rigid_body("tip", mass=0.5, com=(0.1, 0.0, 0.0), inertia=(0.01, 0.01, 0.01))
        .revolute("root", "ground", "boom", axis=(0.0, 1.0, 0.0), angle=-0.4)
        .revolute("wrist", "boom", "tip", axis=(0.0, 1.0, 0.0), parent_node="tip", damping=0.1, torque=torque)
        .event("reached", "root.rotation", 0.3, *actions)
    )  # fmt: skip
    if sampling:
        builder.sense_coordinate("angle", "wrist").pid("law", "angle", kp=3.0, ki=2.0, **sampling)
    return builder.scene()


@pytest.mark.parametrize("action", [
    fm.Latch(coordinate="root.rotation"), fm.Change(path="tip.mass_kg", value=2.0),
], ids=["held", "heavier"])  # fmt: skip
def test_loads_are_those_of_the_scene_as_it_is_then(action: fm.Action) -> None:
    """The load of the root's hinge in its own axes is that across the first section of the beam."""
    run = fm.simulate(boom(action), 0.8, samples=41)
    assert len(run.events) == 1 and 0.0 < run.events[0].t < 0.8
    found, across = run.loads_in("outboard")["root"], run.section_loads("boom", [0.0]).load[:, 0]
    np.testing.assert_allclose(across, found, atol=1e-9 * np.max(np.abs(found)))
    by_first = fm.compile(boom(action)).section_loads(run.last_state, "boom", [0.0]).load[0]
    assert np.max(np.abs(by_first - across[-1])) > 1e-3 * np.max(np.abs(found))  # the scene before the event is wrong


@pytest.mark.parametrize("sampling", [{"setpoint": 0.1}, {"period": 0.07, "delay": 0.01}], ids=["steady", "sampled"])
def test_loads_are_those_under_the_controllers(sampling: dict[str, float]) -> None:
    run = fm.simulate(boom(fm.Change(path="tip.mass_kg", value=2.0), **sampling), 0.8, samples=41)
    assert len(run.events) == 1 and np.ptp(run.signals["law"]) > 0.1
    found, across = run.loads_in("outboard")["root"], run.section_loads("boom", [0.0]).load[:, 0]
    np.testing.assert_allclose(across, found, atol=1e-9 * np.max(np.abs(found)))


@pytest.mark.parametrize("action", [fm.Latch(coordinate="root.rotation"), fm.EndRun()], ids=["held", "over"])
def test_errors_are_those_of_both_parts(action: fm.Action) -> None:
    """Where an event ends the run, the two runs end at times of their own, and the last outputs are not compared."""
    run, truth = (fm.simulate(boom(action), 0.8, samples=41, rtol=r, atol=r / 100) for r in (1e-6, 1e-13))
    estimate, true = run.error_estimate(), channels_of(truth)
    common = len(run.t) - isinstance(action, fm.EndRun)
    assert common > 10 and not np.any(run.t[:common] != truth.t[:common])
    for name, values in channels_of(run).items():
        error = np.max(distance(name, values[:common], true[name][:common]))
        assert np.all(np.isfinite(estimate[name][:common])) and np.all(np.isnan(estimate[name][common:]))
        assert 0.9 * error <= np.max(estimate[name][:common]) <= 1.1 * error or error < 1e-9, name


def test_what_is_joined_of_runs_has_no_error_estimate() -> None:
    scene = boom(fm.Latch(coordinate="root.rotation"))
    first = fm.simulate(scene, 0.1, samples=5)
    both = first.then(fm.simulate(scene, 0.2, state=first.restart, samples=5))
    with pytest.raises(ValueError, match="use the trajectory of each run"):
        both.error_estimate()


def double_pendulum() -> fm.Scene:
    bar = {"mass": 1.0, "com": (0.5, 0.0, 0.0), "inertia": (0.01, 0.1, 0.1)}
    return (
        fm.SceneBuilder("double pendulum", gravity=(0, -9.81, 0))
        .rigid_body("upper", **bar).rigid_body("lower", **bar)
        .revolute("a", "ground", "upper", angle=1.0)
        .revolute("b", "upper", "lower", parent_position=(1, 0, 0), angle=0.5)
        .marker("end", "lower", offset=(1, 0, 0))
        .scene()
    )  # fmt: skip


@pytest.fixture(scope="module")
def truth() -> dict[str, np.ndarray]:
    return channels_of(fm.simulate(double_pendulum(), 2.0, samples=21, rtol=1e-13, atol=1e-15))


@pytest.mark.parametrize(
    ("method", "settings", "low", "high"),
    [
        ("dop853", {"rtol": 1e-7, "atol": 1e-9}, 0.9, 1.1),
        ("rk4", {"step": 0.01}, 1.0, 1.35),
        ("generalised_alpha", {"step": 0.005}, 0.8, 1.2),
    ],
)
def test_it_is_the_error(method: str, settings: dict, low: float, high: float, truth: dict) -> None:
    run = fm.simulate(double_pendulum(), 2.0, method, samples=21, **settings)
    estimate, own = run.error_estimate(), channels_of(run)
    assert set(estimate) == set(own)
    for name, values in own.items():
        error = np.max(distance(name, values, truth[name]))
        if error > 1e-9:
            assert low * error < np.max(estimate[name]) < high * error, name


def test_a_second_run_that_stops_early_leaves_nan() -> None:
    """Only common times are compared; the end of the first run says nothing of itself."""
    run = fm.simulate(double_pendulum(), 1.0, samples=11, rtol=1e-6, atol=1e-8)
    assert run.made_by is not None
    again = run.made_by.again
    made_by = replace(run.made_by, again=lambda settings: again(replace(settings, max_steps=20)))
    short = replace(run, made_by=made_by).error_estimate()
    assert np.isnan(short["energy.total"][-1]) and np.isfinite(short["energy.total"][0])


def test_what_cannot_be_tighter_or_is_not_known_is_refused() -> None:
    run = fm.simulate(double_pendulum(), 0.1, samples=3, rtol=1e-13, atol=1e-15)
    with pytest.raises(ValueError, match="estimate the error of a run with rtol 2.2e-12 or more"):
        run.error_estimate()
    for other in (replace(run, made_by=None), replace(run, t=run.t + 1.0)):
        with pytest.raises(ValueError, match="one run as simulate made it"):
            other.error_estimate()
