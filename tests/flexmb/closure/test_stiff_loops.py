"""Methods with Jacobians on closed chains: accuracy, closures, loads, cost, restarts, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm
from crosscheck.library.find import shipped_folder
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.scene import schema as s
from flexmb.scene.files import load_scene
from tests.bounds import observed_order
from tests.flexmb.closure import mechanisms as m
from tests.flexmb.closure.test_jacobian import connected

STIFF = [name for name, integrator in INTEGRATORS.items() if integrator.linearises]
ADAPTIVE = [name for name in STIFF if not INTEGRATORS[name].fixed]


def stiff_four_bar(level: s.Level = "full") -> s.Scene:
    """A four-bar of beams with static shapes, bending and axial modes, damped: up to 21,000 rad/s."""
    modes = s.Modes(count=2, families=("bending_z", "axial"), static=True, damping_ratio=0.02)
    beams = {"modes": modes, "level": level, "points": "section"}
    return m.four_bar_builder({"angle": 1.0, "rate": m.RATE}, beams).scene()


SMOOTH = {
    "four-bar, overconstrained": lambda: m.four_bar(),
    "ball joint": lambda: m.four_bar(closure="spherical", modes=1),
    "driven": lambda: m.four_bar(prescribed=s.Sine(amplitude=0.3, angular_frequency_rad_s=3.0, offset=1.0)),
    "connected": connected,
    "Bennett": m.bennett,
}


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("method", ADAPTIVE)
def test_adaptive_methods_agree_with_dop853(name, method):
    """Motion, loads of closures and hinges, work; closures closed to rounding, between steps too."""
    system = fm.compile(SMOOTH[name]())
    exact = fm.simulate(system, 0.4, rtol=1e-12, atol=1e-12, samples=9)
    done = fm.simulate(system, 0.4, method, rtol=1e-9, atol=1e-9, samples=9)
    assert exact.finished and done.finished, done.message
    assert np.abs(done.q - exact.q).max() < 1e-7 and np.abs(done.u - exact.u).max() < 1e-5
    for key, load in exact.loads.items():
        known = ~np.isnan(load)
        assert np.array_equal(known, ~np.isnan(done.loads[key])), key
        size = max(1.0, np.abs(load)[known].max(initial=0.0))
        assert np.abs(done.loads[key] - load)[known].max(initial=0.0) < 1e-5 * size, key
    assert np.abs(done.work - exact.work).max() < 1e-6 * max(1.0, np.ptp(exact.work))
    assert np.abs(done.energy_drift).max() < 1e-6 * done.energy_scale
    assert m.largest_gap(system, done) < 1e-12


@pytest.mark.parametrize(("method", "order"), [("radau5", 5), ("exponential", 5)])
def test_projection_takes_no_order(method, order):
    """Errors against the number of steps that tolerances ask for."""
    system = fm.compile(m.four_bar())
    exact = fm.simulate(system, 1.0, rtol=1e-12, atol=1e-12, samples=2)
    runs = [fm.simulate(system, 1.0, method, rtol=rtol, atol=1e-2 * rtol, samples=2) for rtol in (1e-5, 1e-7, 1e-9)]
    steps = [run.statistics.accepted_steps for run in runs]
    errors = [np.abs(run.q[-1] - exact.q[-1]).max() for run in runs]
    assert np.log(errors[0] / errors[-1]) / np.log(steps[-1] / steps[0]) > order - 0.5


# Evaluations that radau5 once took for stiff/four_bar at the first of these tolerances, as it followed the ringing of
# axial modes that its own steps had excited.
ONCE = (120507, 134305, 691, 1027, 942, 746, 51736, 730, 916, 753, 843, 889, 884, 7197, 906, 48070, 963, 993, 1986)
UNDAMPED = "stiff/four_bar"
CURVES = {  # scene, end (s)
    UNDAMPED: (lambda: load_scene(shipped_folder() / "stiff/four_bar/scene.toml"), 1.0),
    "stiff four-bar": (lambda: stiff_four_bar(), 0.3),
    "Bennett": (m.bennett, 0.4),
    "driven": (SMOOTH["driven"], 0.4),
}


def excess(work: np.ndarray) -> np.ndarray:
    """Work at each tolerance over the least of those beside it, and over that of any finer tolerance."""
    beside = np.minimum(np.r_[work[1:], np.inf], np.r_[np.inf, work[:-1]])
    finer = np.minimum.accumulate(work[::-1])[::-1]
    return work / np.minimum(beside, finer)


# Not `exponential` on undamped bars: it does not damp what its own errors excite, and takes up to 30 times the
# evaluations at tolerances above 1e-6.
SMOOTH_WORK = [("radau5", name) for name in CURVES] + [("exponential", name) for name in CURVES if name != UNDAMPED]


@pytest.mark.parametrize(("method", "name"), SMOOTH_WORK)
def test_no_tolerance_takes_much_more_work_than_others(name, method):
    """A step that leaves a stiff mode beside its place must not be followed by steps that resolve its ringing."""
    scene, t_end = CURVES[name][0](), CURVES[name][1]
    system = fm.compile(scene)
    runs = [
        fm.simulate(system, t_end, method, rtol=rtol, atol=1e-2 * rtol, samples=2) for rtol in np.logspace(-3, -7, 60)
    ]
    assert all(run.finished for run in runs)
    assert np.max(excess(np.array([run.statistics.evaluations for run in runs]))) < 3.0
    assert np.max(excess(np.array(ONCE))) > 30.0


def alpha_errors(name: str, t_end: float, steps: np.ndarray) -> list[float]:
    """Of generalised-alpha at the end of a run, by step; closures are closed to rounding."""
    system = fm.compile(SMOOTH[name]())
    exact = fm.simulate(system, t_end, rtol=1e-12, atol=1e-12, samples=2)
    runs = [fm.simulate(system, t_end, "generalised_alpha", step=h, samples=2, rtol=1e-9) for h in steps]
    assert max(m.largest_gap(system, run) for run in runs) < 1e-12
    return [np.abs(np.r_[run.q[-1] - exact.q[-1], run.u[-1] - exact.u[-1]]).max() for run in runs]


@pytest.mark.parametrize(
    ("name", "t_end"), [("four-bar, overconstrained", 0.4), ("Bennett", 0.4), ("ball joint", 0.02), ("connected", 0.02)]
)
def test_generalised_alpha_is_of_order_2(name, t_end):
    """A mode of frequency w that rings is late by about w t_end (w h)^2 / 12, which must be much less than a turn.

    That of the last two has 2530 rad/s: over 0.02 s it is late by 0.2 rad at the longest of these steps.
    """
    steps = t_end / 2.0 ** np.arange(9, 13)
    assert observed_order(steps, alpha_errors(name, t_end, steps), 1e-9) == pytest.approx(2.0, abs=0.02)


def test_phases_of_ringing_that_are_lost_hide_the_order():
    """The same mode over 0.4 s: at these steps it is late by more than a turn or about one, and errors hardly fall."""
    steps = 0.4 / 2.0 ** np.arange(9, 12)
    errors = alpha_errors("ball joint", 0.4, steps)
    assert max(errors) < 4.0 * min(errors)


@pytest.mark.parametrize("method", ADAPTIVE)
def test_a_stiff_loop_takes_a_fraction_of_the_steps(method):
    """Axial modes that follow: DOP853 is held by its stability. What the projection moves does not set them ringing."""
    system = fm.compile(stiff_four_bar())
    exact = fm.simulate(system, 0.3, rtol=1e-8, atol=1e-10, samples=7)
    explicit = fm.simulate(system, 0.3, rtol=1e-3, atol=1e-5, samples=7)
    done = fm.simulate(system, 0.3, method, rtol=1e-3, atol=1e-5, samples=7)
    assert done.finished, done.message
    assert np.abs(done.markers["joint"].position - exact.markers["joint"].position).max() < 1e-4
    load = exact.loads["loop"][1:, 3:5]  # in the plane
    assert np.abs(done.loads["loop"][1:, 3:5] - load).max() < 0.2 * np.abs(load).max()
    assert done.statistics.accepted_steps < explicit.statistics.accepted_steps / 8
    assert done.statistics.evaluations < explicit.statistics.evaluations / 6
    assert done.statistics.jacobians > 0


def test_radau5_does_not_try_in_vain():
    """Its iterations bound the step, not the error: by the error alone 313 trials fail beside 302 that do not."""
    done = fm.simulate(stiff_four_bar(), 1.0, "radau5", rtol=1e-3, atol=1e-5, samples=2)
    assert done.statistics.rejected_steps < 0.5 * done.statistics.accepted_steps


def pendulum(how: str) -> s.Scene:
    """Two bodies on pivots; the second by a hinge, or free and held by a closure."""
    scene = fm.SceneBuilder("pendulum", gravity=(0.0, -9.81, 0.0))
    scene.rigid_body("arm", mass=1.0, com=(0.5, 0, 0), inertia=(0.01, 0.1, 0.1), nodes={"tip": (1.0, 0.0, 0.0)})
    scene.rigid_body("bob", mass=2.0, com=(0.2, 0.1, 0), inertia=(0.02, 0.1, 0.1))
    scene.revolute("pivot", "ground", "arm", angle=0.3, stiffness=2e4, damping=20.0, rate=1.0)
    if how == "hinge":
        scene.revolute("joint", "arm", "bob", parent_node="tip")
    else:
        at = np.array([np.cos(0.3), np.sin(0.3), 0.0])
        spin = {"angular_velocity": (0.0, 0.0, 1.0), "velocity": (0.0, 1.0, 0.0)}
        turned = (np.cos(0.15), 0.0, 0.0, np.sin(0.15))
        scene.free("space", "ground", "bob", position=at, quaternion=turned, **spin)
        scene.closure("joint", "revolute", "arm", "bob", node_a="tip")
    return scene.marker("end", "bob", offset=(0.4, 0.0, 0.0)).scene()


@pytest.mark.parametrize("method", STIFF)
def test_a_closure_is_as_good_as_the_hinge_in_its_place(method):
    """By the same method: it errs no more than with the hinge."""
    settings = {"step": 2e-4} if INTEGRATORS[method].fixed else {"rtol": 1e-8, "atol": 1e-10}
    exact = fm.simulate(pendulum("hinge"), 0.5, samples=6, rtol=1e-12, atol=1e-12).markers["end"].position
    runs = [fm.simulate(pendulum(how), 0.5, method, samples=6, **settings) for how in ("hinge", "closure")]
    assert all(run.finished for run in runs)
    tree, loop = (np.abs(run.markers["end"].position - exact).max() for run in runs)
    assert loop < 2.0 * tree + 1e-8


def test_generalised_alpha_says_where_branches_cross():
    run = fm.simulate(m.windows(1, 30.0), 0.5, "generalised_alpha", step=1e-3)
    assert run.status is fm.Status.BRANCH_UNKNOWN and 0.0 < run.stopped_at < 0.06


def test_equal_steps_that_go_too_far_are_told_to_be_shorter():
    system = fm.compile(SMOOTH["ball joint"]())
    run = fm.simulate(system, 1.0, "generalised_alpha", step=0.02, samples=2)
    assert run.status is fm.Status.CLOSURE_OPEN and "use a shorter step" in run.message
    assert fm.simulate(system, 1.0, "generalised_alpha", step=0.005, samples=2).finished


@pytest.mark.parametrize("method", STIFF)
def test_steps_run_out(method):
    settings = {"step": 1e-3} if INTEGRATORS[method].fixed else {"rtol": 1e-9}
    run = fm.simulate(m.four_bar(), 1.0, method, max_steps=5, **settings)
    assert run.status is fm.Status.MAX_STEPS and run.restart is not None


@pytest.mark.parametrize("method", STIFF)
def test_ruthless_bodies_in_loops_are_refused(method):
    settings = {"step": 1e-3} if INTEGRATORS[method].fixed else {}
    with pytest.raises(NotImplementedError, match='as "crank".*use level "linear" or a better one'):
        fm.simulate(stiff_four_bar("ruthless"), 0.1, method, **settings)
