"""Whole runs of real scenes: conservation, closed forms, failing runs, settings, files."""

import math
import tracemalloc

import numpy as np
import pytest
from msgspec import structs

import flexmb as fm
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.run import trajectory
from flexmb.run.times import sample_bytes, sample_times, timing
from flexmb.tables.status import Status
from tests.trees import random_scene

EPS = np.finfo(float).eps
GRAVITY = 9.81


def pendulum(**coordinate: float) -> fm.Scene:
    """A point-like bob at 1 m: angular frequency sqrt(g / l) for small swings."""
    return (
        fm.SceneBuilder("pendulum", gravity=(0.0, -GRAVITY, 0.0))
        .rigid_body("bob", mass=2.0, com=(0.0, -1.0, 0.0), inertia=(0.3, 0.2, 0.1))
        .revolute("pivot", "ground", "bob", **coordinate)
        .marker("end", "bob", offset=(0.0, -1.0, 0.0))
        .scene()
    )


def tumbling_pair() -> fm.Scene:
    """A free body with a second one on a spherical hinge, in free fall from gravity: nothing outside pushes."""
    return (
        fm.SceneBuilder("pair")
        .rigid_body("a", mass=3.0, com=(0.1, 0.0, -0.05), inertia=(0.3, 0.4, 0.5), nodes={"side": (0.4, 0.1, 0.0)})
        .rigid_body("b", mass=1.0, com=(0.3, 0.1, 0.0), inertia=(0.02, 0.05, 0.06))
        .free("base", "ground", "a", angular_velocity=(0.5, -0.8, 1.1), velocity=(0.2, 0.0, -0.1))
        .spherical("ball", "a", "b", parent_node="side", angular_velocity=(1.0, 0.4, -0.7))
        .marker("end", "b", offset=(0.6, 0.0, 0.0))
        .scene()
    )


def driven_arm() -> fm.Scene:
    """A prescribed arm carrying a free one with a damper: the drive and the damper do work."""
    return (
        fm.SceneBuilder("arm", gravity=(0.0, 0.0, -GRAVITY))
        .rigid_body("inner", mass=1.0, com=(0.5, 0.0, 0.0), inertia=(0.01, 0.1, 0.1), nodes={"tip": (1.0, 0.0, 0.0)})
        .rigid_body("outer", mass=0.5, com=(0.3, 0.0, 0.0), inertia=(0.01, 0.02, 0.02))
        .revolute("drive", "ground", "inner", axis=(0.0, 0.6, 0.8), prescribed=fm.SpinUp(rate=2.0, duration_s=1.5))
        .revolute("elbow", "inner", "outer", axis=(0.0, 1.0, 0.0), parent_node="tip", angle=0.3, damping=0.2)
        .marker("end", "outer", offset=(0.6, 0.0, 0.0))
        .scene()
    )


def centrifuge(rate: float) -> fm.Scene:
    """A bead on a rail that turns at a constant rate: r = cosh(rate t), which leaves every bound."""
    return (
        fm.SceneBuilder("centrifuge")
        .rigid_body("rail", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .rigid_body("bead", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .revolute("drive", "ground", "rail", prescribed=fm.Ramp(rate=rate))
        .prismatic("slide", "rail", "bead", axis=(1.0, 0.0, 0.0), position=1.0)
        .marker("bead", "bead")
        .scene()
    )


@pytest.mark.parametrize("method", [name for name, integrator in INTEGRATORS.items() if not integrator.fixed])
def test_a_scene_in_which_nothing_moves_is_at_rest_to_the_end(method):
    post = fm.SceneBuilder("post").rigid_body("post", mass=1.0, inertia=(1, 1, 1))
    scene = post.weld("foot", "ground", "post").scene()
    trajectory = fm.simulate(scene, t_end=1.0, method=method)
    assert trajectory.status is Status.OK and trajectory.t[-1] == 1.0


def test_a_pendulum_swings_with_its_closed_form():
    """I q'' = -m g l sin q: the period is 4 K(sin(q0/2)) sqrt(I/(m g l)), found here at quarter points."""
    from scipy.special import ellipk

    amplitude, inertia = 1.2, 0.1 + 2.0 * 1.0**2
    period = 4.0 * ellipk(math.sin(amplitude / 2) ** 2) * math.sqrt(inertia / (2.0 * GRAVITY * 1.0))
    run = fm.simulate(pendulum(angle=amplitude), period, rtol=1e-12, atol=1e-12, samples=5)
    assert run.finished
    assert run.q[:, 0] == pytest.approx([amplitude, 0.0, -amplitude, 0.0, amplitude], abs=100 * 1e-12)
    assert run.markers["end"].position[1] == pytest.approx([0.0, -1.0, 0.0], abs=100 * 1e-12)


def test_work_of_drive_and_damper_balances_the_energy():
    run = fm.simulate(driven_arm(), 4.0, rtol=1e-11, atol=1e-13)
    assert np.ptp(run.work) > 0.1, "the drive does work worth balancing"
    assert np.abs(run.energy_drift).max() < 100 * 1e-11 * run.energy_scale
    t = run.t
    spun = np.where(t < 1.5, t**2 / 1.5 + 1.5 / (2 * np.pi**2) * (np.cos(2 * np.pi * t / 1.5) - 1.0), 2.0 * t - 1.5)
    assert run.q[:, 0] == pytest.approx(spun, abs=10 * EPS * np.abs(spun).max()), "prescribed coordinates are exact"


def test_outputs_have_the_shapes_they_promise():
    run = fm.simulate(driven_arm(), 1.0, samples=7)
    assert run.t == pytest.approx(np.linspace(0.0, 1.0, 7))
    assert run.q.shape == run.u.shape == (7, 2)
    assert [name for name, _ in run.q_names] == ["drive.rotation", "elbow.rotation"]
    path = run.markers["end"]
    assert (path.position.shape, path.quaternion.shape, path.velocity.shape, path.acceleration.shape) == (
        (7, 3), (7, 4), (7, 6), (7, 6),
    )  # fmt: skip
    assert {name: load.shape for name, load in run.loads.items()} == {"drive": (7, 6), "elbow": (7, 6)}
    assert {name: drive.shape for name, drive in run.drives.items()} == {"drive": (7, 1)}
    assert run.momentum.shape == (7, 6)
    cost = run.statistics
    assert cost.evaluations >= 12 * (cost.accepted_steps + cost.rejected_steps) > 0


def test_quaternions_do_not_jump():
    run = fm.simulate(tumbling_pair(), 10.0, samples=401)
    quaternion = run.markers["end"].quaternion
    assert np.linalg.norm(quaternion, axis=1) == pytest.approx(1.0, abs=10 * EPS)
    assert np.sum(quaternion[1:] * quaternion[:-1], axis=1).min() > 0.9


@pytest.mark.parametrize("options", [{}, {"method": "rk4", "step": 1e-4}])
def test_a_diverging_run_keeps_what_it_reached(options, tmp_path):
    run = fm.simulate(centrifuge(1e3), 2.0, **options)
    assert run.status is Status.NONFINITE
    assert not run.finished
    assert f"t = {run.stopped_at:g} s" in run.message
    assert 0.0 < run.t[-1] <= run.stopped_at < 2.0
    assert len(run.t) == len(run.q) == len(run.work) == len(run.markers["bead"].position)
    early = run.t < 0.05
    assert run.q[early, 1] == pytest.approx(np.cosh(1e3 * run.t[early]), rel=1e-3)
    run.to_csv(tmp_path / "run.csv")
    assert run.plot(tmp_path)


def test_the_step_limit_is_a_status():
    run = fm.simulate(pendulum(angle=1.0), 10.0, max_steps=5)
    assert run.status is Status.MAX_STEPS
    assert "raise max_steps" in run.message


def test_steps_stop_where_a_load_switches():
    scene = (
        fm.SceneBuilder("kicked")
        .rigid_body("cart", mass=2.0, inertia=(1.0, 1.0, 1.0))
        .prismatic("rail", "ground", "cart", axis=(1.0, 0.0, 0.0))
        .force("kick", "cart", direction=(1.0, 0.0, 0.0), function=fm.Pulse(value=4.0, start_s=0.3, duration_s=0.2))
        .scene()
    )
    assert timing(scene).between(0.0, 1.0) == [0.3, 0.5]
    assert timing(scene).between(0.0, 0.5) == [0.3]
    assert (timing(scene).start, timing(scene).end) == (-math.inf, math.inf)  # it is defined before the load acts, too
    for options in ({}, {"method": "rk4", "step": 0.07}):
        run = fm.simulate(scene, 1.0, samples=[0.0, 0.4, 1.0], **options)
        assert run.u[:, 0] == pytest.approx([0.0, 0.2, 0.4], abs=20 * EPS)
        assert run.q[:, 0] == pytest.approx([0.0, 0.01, 0.04 + 0.4 * 0.5], abs=20 * EPS)


@pytest.mark.parametrize(
    ("options", "remedy"),
    [
        ({"method": "euler"}, "use one of 'dop853', 'rk4'"),
        ({"method": "rk4"}, "give a positive step"),
        ({"method": "rk4", "step": -1.0}, "give a positive step"),
        ({"step": 0.1}, "leave step out"),
        ({"method": "radau5", "step": 1e-2}, 'method "radau5" chooses its own steps'),
        ({"method": "generalised_alpha"}, '"generalised_alpha" takes fixed steps, but step is None'),
        ({"method": "generalised_alpha", "step": 1e-2, "spectral_radius": 1.5}, "spectral_radius is 1.5: from 0"),
        ({"method": "exponential", "spectral_radius": 0.5}, 'spectral_radius is for method "generalised_alpha"'),
        ({"method": "radau5", "algorithm": "frisch"}, 'needs Jacobians, which only algorithm "articulated" has'),
        ({"rtol": 1e-17}, "use a value between them"),
        ({"atol": 0.0}, "give a positive one"),
        ({"samples": 1}, "at least 2 output times"),
        ({"samples": [0.0, 2.0, 1.0]}, "must increase from 0 to t_end"),
        ({"samples": [0.0, 0.5]}, "must increase from 0 to t_end"),
        ({"max_steps": 0}, "at least one step"),
        ({"max_steps": 10**30}, "at most"),
        ({"rtol": 0.2}, "the error of a step is not known"),
        ({"rtol": math.nan}, "give a finite number"),
        ({"atol": math.inf}, "give a finite number"),
        ({"samples": [0.0, math.nan, 1.0]}, "must increase from 0 to t_end"),
        ({"samples": 10**9}, "outputs take .* GiB, but 4 GiB are allowed: ask for fewer"),
        ({"samples": 6_000_000}, "outputs take .* GiB, but 4 GiB are allowed"),
        ({"method": "rk4", "step": 1e-300}, "does not advance a time of 1 s"),
        ({"t_end": -1.0}, "give a positive, finite time"),
        ({"t_end": math.nan}, "give a positive, finite time"),
    ],
)
def test_settings_that_make_no_sense_are_refused_with_a_remedy(options, remedy):
    with pytest.raises((ValueError, NotImplementedError), match=remedy):
        fm.simulate(pendulum(), **({"t_end": 1.0} | options))


def test_the_memory_of_outputs_is_what_is_reckoned_with():
    """Rows are kept until the run ends, then gathered: between a quarter of the bound and all of it."""
    system = fm.compile(random_scene(3))
    run = fm.simulate(system, 1e-3, samples=2, rtol=1e-3)
    taken = []
    for samples in (10, 210):
        tracemalloc.start()
        fm.simulate(system, 1e-3, samples=samples, rtol=1e-3)
        taken.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert run.finished
    assert 0.25 < (taken[1] - taken[0]) / (200 * sample_bytes(system)) <= 1.0


def test_plots_are_written(tmp_path):
    paths = fm.simulate(driven_arm(), 0.5, samples=5).plot(tmp_path / "charts")
    assert {path.name for path in paths} == {"markers.png", "energy.png", "momentum.png", "loads.png", "drives.png"}
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)


def test_markers_become_quaternions_together_or_in_parts(monkeypatch) -> None:
    """The same path for each of them, whatever is beside it; none is shorter than the samples, of which there may be
    none."""
    scene = tumbling_pair()
    other = structs.replace(scene.markers[0], name="other", body="a")
    system = fm.compile(structs.replace(scene, markers=(*scene.markers, other)))
    whole = fm.simulate(system, 20.0, samples=50).markers
    monkeypatch.setattr(trajectory, "ROTATIONS", 60)  # one marker at a time
    parts = fm.simulate(system, 20.0, samples=50).markers
    assert len(whole) > 1 and list(whole) == list(parts)
    for name, path in whole.items():
        assert np.array_equal(path.quaternion, parts[name].quaternion)
        turned = np.sum(path.quaternion[1:] * path.quaternion[:-1], axis=1)
        assert turned.min() > 0.0 > path.quaternion[:, 0].min()  # a control: signs that are positive would jump
        assert trajectory._marker_paths([name], np.zeros((0, 1, 24)))[name].quaternion.shape == (0, 4)


@pytest.mark.parametrize(("start", "end", "number"), [(0.0, 10.0, 201), (-3.1, 7.7e3, 1000), (0.1, 0.3, 7)])
def test_equal_samples_are_those_of_numpy(start: float, end: float, number: int) -> None:
    assert np.array_equal(sample_times(number, end, start), np.linspace(start, end, number))
