"""Methods for stiff scenes on real ones: every kind of hinge, drives, wheels, work, against DOP853; what is refused."""

from dataclasses import replace

import numpy as np
import pytest

import flexmb as fm
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.scene.schema import Modes
from flexmb.scene.shapes import beam_section
from flexmb.tables.status import Status
from tests.bounds import observed_order
from tests.flexmb.run.test_simulate import driven_arm, tumbling_pair
from tests.trees import FULL, random_scene

STIFF = [name for name, integrator in INTEGRATORS.items() if integrator.linearises]
ADAPTIVE = [name for name in STIFF if not INTEGRATORS[name].fixed]
# Every element there is, without the high modes of beams: smooth enough to be known to 1e-12 in a second.
EVERYTHING = replace(FULL, bodies=4, carriers=("rigid", "modal"), wheels=1, point_masses=1, deformation=0.02)


def stiff_beam(damping: float = 0.0) -> fm.Scene:
    """A swinging strip with two bending modes, static shapes and an axial mode: 3 to 8800 rad/s."""
    strip = beam_section(E=7e10, G=2.7e10, A=6e-5, Iy=4.5e-11, Iz=2e-9, rho=2700)
    modes = Modes(count=2, families=("bending_z", "axial"), static=True, damping_ratio=damping)
    return (
        fm.SceneBuilder("beam with axial modes", gravity=(0, 0, -9.81))
        .beam("beam", length=1.0, elements=8, section=strip, modes=modes)
        .revolute("hinge", "ground", "beam", axis=(0, 1, 0), angle=0.6)
        .marker("tip", "beam", node="tip")
        .scene()
    )


def everything() -> fm.Scene:
    return random_scene(3, EVERYTHING)


def end(system: fm.System, t_end: float, method: str, **settings) -> np.ndarray:
    """q, u at the end of a run."""
    done = fm.simulate(system, t_end, method, samples=2, **settings)
    assert done.finished, done.message
    return np.r_[done.q[-1], done.u[-1]]


@pytest.mark.parametrize("scene", [tumbling_pair, driven_arm, everything], ids=lambda make: make.__name__)
@pytest.mark.parametrize("method", ADAPTIVE)
def test_adaptive_methods_agree_with_dop853(scene, method):
    """Local errors of 1e-9 of size 1, which a second of smooth motion multiplies by what it multiplies DOP853's."""
    system = fm.compile(scene())
    exact = end(system, 0.5, "dop853", rtol=1e-12, atol=1e-12)
    loose = np.abs(end(system, 0.5, "dop853", rtol=1e-9, atol=1e-9) - exact).max()
    error = np.abs(end(system, 0.5, method, rtol=1e-9, atol=1e-9) - exact).max()
    assert error < 100 * max(loose, 1e-9)


@pytest.mark.parametrize("radius", [0.0, 0.8, 1.0])
def test_generalised_alpha_is_of_order_2_on_quaternions(radius):
    """Free and spherical hinges, and a random tree: errors of q and u fall as h^2."""
    for scene, finest in ((tumbling_pair(), 11), (everything(), 12)):
        system = fm.compile(scene)
        exact = end(system, 0.5, "dop853", rtol=1e-12, atol=1e-12)
        steps = 0.5 / 2.0 ** np.arange(finest - 4, finest)
        errors = [
            np.abs(end(system, 0.5, "generalised_alpha", step=h, spectral_radius=radius) - exact).max() for h in steps
        ]
        assert observed_order(steps, errors, 1e-9) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("method", STIFF)
def test_quaternions_are_unit_and_drives_exact(method):
    settings = {"step": 1e-2} if INTEGRATORS[method].fixed else {"rtol": 1e-5, "atol": 1e-7}
    flying = fm.simulate(tumbling_pair(), 1.0, method, samples=21, **settings)
    for start in (3, 7):
        assert np.abs(np.linalg.norm(flying.q[:, start : start + 4], axis=1) - 1.0).max() < 4 * np.finfo(float).eps
    arm = driven_arm()
    done = fm.simulate(arm, 2.0, method, samples=21, **settings)
    exact = fm.simulate(arm, 2.0, samples=21)
    assert np.abs(done.q[:, 0] - exact.q[:, 0]).max() < 1e-15
    assert np.abs(done.work - exact.work).max() < 1e-3 * np.ptp(exact.work)
    assert np.abs(done.energy_drift).max() < 1e-3 * done.energy_scale


@pytest.mark.parametrize("method", ADAPTIVE)
def test_a_stiff_scene_takes_a_hundredth_of_the_steps(method):
    """Damped axial and bending modes, at an accuracy of a millionth: DOP853 is held to 6 / 8800 s by its stability."""
    system = fm.compile(stiff_beam(damping=0.02))
    exact = fm.simulate(system, 1.0, rtol=1e-11, atol=1e-13, samples=21)
    explicit = fm.simulate(system, 1.0, rtol=1e-3, atol=1e-5, samples=21)
    done = fm.simulate(system, 1.0, method, rtol=1e-3, atol=1e-5, samples=21)
    assert np.abs(done.markers["tip"].position - exact.markers["tip"].position).max() < 1e-4
    cost, rival = done.statistics, explicit.statistics
    assert cost.accepted_steps < rival.accepted_steps / 10
    assert cost.evaluations < rival.evaluations / 10
    assert 0 < cost.jacobians <= cost.factorisations
    assert (rival.jacobians, rival.factorisations) == (0, 0)


def test_generalised_alpha_damps_what_its_step_does_not_resolve():
    """Axial ringing at 8800 rad/s by steps of 5 ms: gone within the time that the spectral radius says."""
    system = fm.compile(stiff_beam())
    axial = system.speed("beam.modes").stop - 1
    sizes = {}
    for radius in (0.0, 1.0):
        done = fm.simulate(
            system, 0.5, "generalised_alpha", step=5e-3, spectral_radius=radius, samples=101, rtol=1e-8, atol=1e-10
        )
        assert done.finished, done.message
        sizes[radius] = np.abs(np.diff(done.u[-20:, axial], 2)).max()
    assert sizes[0.0] < 1e-2 * sizes[1.0]


@pytest.mark.parametrize("method", ADAPTIVE)
def test_a_run_that_fails_says_where(method):
    done = fm.simulate(tumbling_pair(), 1.0, method, rtol=1e-9, max_steps=3)
    assert done.status is Status.MAX_STEPS
    assert 0.0 < done.stopped_at < 1.0
    assert len(done.t) == len(done.q)
