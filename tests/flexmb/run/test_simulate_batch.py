"""Runs of many copies at once, against each copy run alone."""

from __future__ import annotations

from threading import Barrier, Thread
from time import sleep

import numpy as np
import pytest
from msgspec.structs import replace

import flexmb as fm
from flexmb.run import lane_runs
from flexmb.run.interruption import Stop, interruptible
from flexmb.run.simulate_batch import simulate_batch
from flexmb.scene.build import SceneBuilder
from tests.bounds import gamma
from tests.flexmb.control.scenes import rotor

STEP = 0.01
T_END = 0.5
FINE = {"rtol": 1e-9, "atol": 1e-11}
AXES = ((0.0, 1.0, 0.0), (0.6, 0.8, 0.0))


def pendulum(mass: float = 1.0, damping: float = 0.05, start: float = 0.2, duration: float = 0.1) -> fm.Scene:
    """Two links, the first driven smoothly for a while, the second free, with a damper."""
    scene = SceneBuilder("double pendulum", gravity=(0.0, 0.0, -9.81))
    push = fm.SmoothStep(start_value=0.0, end_value=2.0, start_s=start, duration_s=duration)
    motions = {"angle": 0.4, "damping": damping, "torque": push}, {"angle": -0.7, "rate": 1.0, "damping": damping}
    for k, motion in enumerate(motions):
        scene.rigid_body(f"b{k}", mass=mass, com=(0.0, 0.0, -0.4), inertia=np.diag([0.06, 0.06, 0.01]))
        place = {} if k == 0 else {"parent_position": (0.0, 0.0, -0.8)}
        scene.revolute(f"h{k}", "ground" if k == 0 else "b0", f"b{k}", axis=AXES[k], **motion, **place)
    return scene.scene()


@pytest.fixture(scope="module", autouse=True)
def kernels_of_their_own():
    """Few scenes, many methods: kernels of what these scenes contain are compiled sooner than general ones."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("FLEXMB_KERNELS", raising=False)
        yield


@pytest.fixture(scope="module")
def system() -> fm.System:
    return fm.compile(pendulum())


def starts(system: fm.System, n: int) -> tuple[np.ndarray, np.ndarray]:
    rng, start = np.random.default_rng(0), system.initial_state
    return start.q + 0.5 * rng.standard_normal((n, system.nq)), start.u + 0.5 * rng.standard_normal((n, system.nu))


def alone(scene: fm.Scene, q: np.ndarray, u: np.ndarray, method: str, **settings) -> fm.Trajectory:
    """One copy by `simulate`, from these initial angles and rates."""
    changed = [
        _replaced(hinge, angle_rad=float(angle), rate_rad_s=float(rate))
        for hinge, angle, rate in zip(scene.hinges, q, u, strict=True)
    ]
    return fm.simulate(replace(scene, hinges=tuple(changed)), T_END, method, samples=21, **settings)


def _replaced(hinge: fm.Revolute, **changes) -> fm.Revolute:
    return replace(hinge, rotation=replace(hinge.rotation, **changes))


@pytest.mark.parametrize(("method", "settings"), [("rk4", {"step": STEP}), ("dop853", FINE)])
def test_every_copy_is_its_own_run(system, method, settings):
    """Steps are the same to rounding, which a motion of half a second magnifies by less than a thousand."""
    q, u = starts(system, 11)
    found = simulate_batch(system, T_END, method, q=q, u=u, samples=21, threads=1, **settings)
    assert found.finished
    assert found.q.shape == (11, 21, system.nq)
    steps = found.accepted_steps + found.rejected_steps
    bound = 1e3 * gamma(20 * int(steps.max()))
    for i in range(11):
        run = alone(system.scene, q[i], u[i], method, **settings)
        assert run.statistics.accepted_steps == found.accepted_steps[i]
        assert run.statistics.rejected_steps == found.rejected_steps[i]
        for got, right in ((found.q[i], run.q), (found.u[i], run.u), (found.work[i], run.work)):
            np.testing.assert_allclose(got, right, rtol=0.0, atol=bound * (1.0 + np.max(np.abs(right))))
        assert found.message(i) == run.message
    assert np.max(np.abs(found.q[0] - found.q[1])) > 0.1  # the copies are not all the same


def test_lanes_do_not_share_steps(system):
    """Negative control: copies of different vigour need different numbers of steps, and get them."""
    q, u = starts(system, 8)
    u *= np.linspace(0.0, 20.0, 8)[:, None]
    found = simulate_batch(system, T_END, q=q, u=u, **FINE)
    assert len(set(found.accepted_steps.tolist())) > 4


def test_output_times_of_a_run_that_are_steps_of_none(system):
    q, u = starts(system, 9)
    times = np.array([0.0, 1e-6, 0.123456, 0.2, 0.2000001, 0.37, T_END])
    found = simulate_batch(system, T_END, q=q, u=u, samples=times, **FINE)
    whole = simulate_batch(system, T_END, q=q, u=u, samples=2, **FINE)
    np.testing.assert_array_equal(found.t, times)
    assert np.isfinite(found.q).all()
    np.testing.assert_array_equal(found.q[:, -1], whole.q[:, -1])


@pytest.mark.parametrize(("method", "settings"), [("rk4", {"step": STEP}), ("dop853", FINE)])
def test_a_copy_that_fails_fails_alone(system, method, settings):
    q, u = starts(system, 10)
    right = simulate_batch(system, T_END, method, q=q, u=u, samples=5, **settings)
    u[3] = np.nan
    u[8] = 1e160
    found = simulate_batch(system, T_END, method, q=q, u=u, samples=5, **settings)
    assert found.failed.tolist() == [3, 8]
    assert set(found.status[found.failed].tolist()) <= {int(fm.Status.NONFINITE), int(fm.Status.STEP_TOO_SMALL)}
    assert np.isnan(found.q[8, -1]).all()
    others = right.status == found.status
    np.testing.assert_array_equal(found.q[others], right.q[others])
    assert "stopped" in found.message(3)


def test_too_many_steps_stop_a_copy_where_they_stop_it_alone(system):
    q, u = starts(system, 5)
    found = simulate_batch(system, T_END, q=q, u=u, samples=21, max_steps=9, **FINE)
    assert (found.status == fm.Status.MAX_STEPS).all()
    for i in range(5):
        run = alone(system.scene, q[i], u[i], "dop853", max_steps=9, **FINE)
        assert run.status is fm.Status.MAX_STEPS
        assert found.stopped_at[i] == pytest.approx(run.stopped_at, rel=1e-9)
        assert np.isfinite(found.q[i, :, 0]).sum() == len(run.t)


@pytest.mark.parametrize(("method", "settings"), [("rk4", {"step": STEP}), ("dop853", FINE)])
def test_copies_with_masses_dampings_and_switch_times_of_their_own(method, settings):
    scenes = [pendulum(1.0 + 0.1 * i, 0.05 * i, 0.2 - 0.01 * i, 0.1 + 0.005 * i) for i in range(9)]
    found = simulate_batch(scenes, T_END, method, samples=21, threads=2, **settings)
    assert found.finished
    bound = 1e3 * gamma(20 * int(found.accepted_steps.max()))
    for i, scene in enumerate(scenes):
        run = fm.simulate(scene, T_END, method, samples=21, **settings)
        assert run.statistics.accepted_steps == found.accepted_steps[i]
        np.testing.assert_allclose(found.q[i], run.q, rtol=0.0, atol=bound * (1.0 + np.max(np.abs(run.q))))


def test_one_of_two_states_may_be_that_of_the_scene(system):
    q, _ = starts(system, 3)
    found = simulate_batch(system, T_END, "rk4", q=q, step=STEP, samples=2)
    u = np.repeat(system.initial_state.u[None], 3, axis=0)
    whole = simulate_batch(system, T_END, "rk4", q=q, u=u, step=STEP, samples=2)
    np.testing.assert_array_equal(found.q, whole.q)


def test_closed_chains_run_one_by_one():
    scene, y = SceneBuilder("four bar", gravity=(0.0, 0.0, -9.81)), (0.0, 1.0, 0.0)
    for k, x in enumerate((0.0, 1.0)):
        scene.rigid_body(f"rocker{k}", mass=1.0, com=(0.0, 0.0, 0.5), inertia=np.diag([0.1, 0.1, 0.01]))
        scene.revolute(f"h{k}", "ground", f"rocker{k}", parent_position=(x, 0.0, 0.0), axis=y, angle=0.3)
    scene.rigid_body("coupler", mass=1.0, com=(0.5, 0.0, 0.0), inertia=np.diag([0.01, 0.1, 0.1]))
    scene.revolute("joint", "rocker0", "coupler", parent_position=(0.0, 0.0, 1.0), axis=y, angle=-0.3)
    ends = {"position_a": (0.0, 0.0, 1.0), "position_b": (1.0, 0.0, 0.0)}
    scene.closure("loop", "revolute", "rocker1", "coupler", axis=y, **ends)
    system = fm.compile(scene.scene())
    start = system.initial_state
    states = {"q": np.array([start.q] * 2), "u": np.array([start.u] * 2)}
    found = simulate_batch(system, 0.2, "rk4", **states, step=STEP, samples=5)
    run = fm.simulate(system, 0.2, "rk4", step=STEP, samples=5)
    np.testing.assert_array_equal(found.q[1], run.q)
    stiff = simulate_batch(system, 0.2, "radau5", **states, samples=5)
    np.testing.assert_array_equal(stiff.q[1], fm.simulate(system, 0.2, "radau5", samples=5).q)


def test_what_makes_no_sense_is_refused(system):
    q, u = starts(system, 3)
    with pytest.raises(ValueError, match="shape"):
        simulate_batch(system, T_END, q=q[:, :1], u=u)
    with pytest.raises(ValueError, match="rtol"):
        simulate_batch(system, T_END, q=q, u=u, rtol=1.0)
    with pytest.raises(TypeError, match="simulate_batch has no argument 'stabilise'"):
        simulate_batch(system, T_END, q=q, u=u, stabilise=1.0)
    with pytest.raises(ValueError, match="threads"):
        simulate_batch(system, T_END, q=q[:0], u=u[:0], threads=0)
    with pytest.raises(fm.SceneError):
        simulate_batch(system, -1.0, q=q, u=u)
    with pytest.raises(ValueError, match="fewer samples"):
        simulate_batch(system, T_END, q=np.zeros((20000, 2)), u=np.zeros((20000, 2)), samples=100000)


def latching() -> fm.Scene:
    """A boom that latches when it is straight, and a scene that ends when its second link passes an angle."""
    return fm.load_scene("cases/deploying_boom/latching/scene.toml")


def ending() -> fm.Scene:
    end = fm.SceneEvent(name="far", watch="h1.rotation", level=0.3, actions=(fm.EndRun(),))
    return replace(pendulum(), events=(end,))


def controlled() -> fm.Scene:
    return fm.load_scene("cases/control/servos/scene.toml")


@pytest.mark.parametrize(
    ("scene", "t_end"), [(latching, 3.0), (ending, 2.0), (controlled, 0.3)], ids=["latches", "ends", "controlled"]
)
def test_copies_with_events_and_controllers_are_those_of_simulate(scene, t_end):
    system, n = fm.compile(scene()), 5
    q, u = system.initial_state.q, system.initial_state.u
    u = u + 1e-3 * np.random.default_rng(1).standard_normal((n, system.nu))
    runs = simulate_batch(system, t_end, u=u, samples=11, threads=3, **FINE)
    assert len(runs.events) == len(runs.messages) == n
    for copy in range(n):
        alone = fm.simulate(system, t_end, state=system.state(q, u[copy]), samples=11, **FINE)
        reached = int(np.sum(runs.t <= alone.t[-1]))
        np.testing.assert_array_equal(runs.q[copy, :reached], alone.q[:reached])
        np.testing.assert_array_equal(runs.u[copy, :reached], alone.u[:reached])
        np.testing.assert_array_equal(runs.work[copy, :reached], alone.work[:reached])
        assert np.all(np.isnan(runs.q[copy, reached:]))
        assert [(e.name, e.t) for e in runs.events[copy]] == [(e.name, e.t) for e in alone.events]
        assert (runs.message(copy), runs.stopped_at[copy]) == (alone.message, alone.stopped_at)
        assert runs.accepted_steps[copy] == alone.statistics.accepted_steps
        for name, values in alone.signals.items():
            np.testing.assert_array_equal(runs.signals[name][copy, :reached], values[:reached])
    assert any(runs.events) or system.scene.controllers
    assert len({events[0].t for events in runs.events if events}) in (0, n)  # each at its own instant


def test_a_copy_with_events_that_fails_leaves_the_others():
    system = fm.compile(ending())
    start = system.initial_state
    u = np.array([start.u, [1e160, -1e160], start.u])
    runs = simulate_batch(system, 0.3, u=u, samples=4, **FINE)
    assert runs.failed.tolist() == [1] and runs.message(1)
    assert np.all(np.isfinite(runs.q[[0, 2]])) or runs.events[0]


def test_each_copy_has_the_numbers_of_its_scene_and_its_own_instants():
    scenes = [latching().with_values({"gravity_m_s2.2": value}) for value in (0.0, -0.1, -0.2)]
    runs = simulate_batch(scenes, 3.0, samples=3, **FINE)
    for copy, scene in enumerate(scenes):
        alone = fm.simulate(scene, 3.0, samples=3, **FINE)
        assert [(e.name, e.t) for e in runs.events[copy]] == [(e.name, e.t) for e in alone.events]
        np.testing.assert_array_equal(runs.q[copy], alone.q)


def test_ctrl_c_reaches_runs_in_other_threads():
    """All that run now are asked to return, and those that begin afterwards."""
    flags, inside = np.zeros(4, np.int64), Barrier(3)
    stop, asked = Stop(flags[:2]), list[tuple[bool, bool]]()

    def work(own: np.ndarray) -> None:
        def run() -> bool:
            inside.wait(5.0)
            while not own[0]:
                sleep(1e-3)
            return True

        with stop.covering():
            asked.append(interruptible(run, (), own))

    threads = [Thread(target=work, args=(flags[i : i + 1],)) for i in (2, 3)]
    for thread in threads:
        thread.start()
    inside.wait(5.0)
    stop[0] = 1
    for thread in threads:
        thread.join(5.0)
    assert asked == [(True, True)] * 2 and np.all(flags == 1)
    late = np.zeros(1, np.int64)
    done = Thread(target=lambda: stop.run(lambda: None, (), late))
    done.start()
    done.join(5.0)
    assert late[0] == 1


@pytest.mark.parametrize(("law", "threads"), [("compiled", 3), ("called", 1)])
def test_only_laws_in_python_keep_copies_in_one_thread(law, threads, monkeypatch):
    if law == "compiled":
        scene = fm.load_scene("cases/spacecraft/deploy_and_slew/scene.toml")
    else:
        given = {"inputs": ("angle",), "parameters": (2.0,)}
        scene = rotor(fm.UserLaw(name="law", function="tests.flexmb.control.laws:plainly_proportional", **given))
    used = []
    real = lane_runs.in_threads
    monkeypatch.setattr(lane_runs, "in_threads", lambda work, parts, n: (used.append(n), real(work, parts, n)))
    runs = simulate_batch([scene] * 3, 0.05, samples=2, threads=3, rtol=1e-6, atol=1e-8)
    assert runs.finished and used == [threads]


def test_the_last_row_is_after_events_at_the_end():
    """As of a single run: an impact at the end has turned the speed."""
    hit = fm.SceneEvent(name="hit", watch="time", level=0.3, actions=(fm.Impact(coordinate="h1.rotation"),))
    system = fm.compile(replace(pendulum(), events=(hit,)))
    runs = simulate_batch([system.scene], 0.3, samples=4, **FINE)
    alone = fm.simulate(system, 0.3, samples=4, **FINE)
    [event] = runs.events[0]
    np.testing.assert_array_equal(runs.u[0], alone.u)
    np.testing.assert_array_equal(runs.u[0, -1], event.after.u)
    assert np.any(event.after.u != event.before.u)
