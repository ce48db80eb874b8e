"""Runs that begin at another time and state than the scene's, and stages that follow each other."""

import numpy as np
import pytest

import flexmb as fm
import flexmb.run.segments as segments
import flexmb.run.simulate as simulating
from flexmb.run.warm_up import looped
from flexmb.scene.schema import Scene

PUSH = fm.Sine(amplitude=0.5, angular_frequency_rad_s=3.0, phase_rad=0.4)


def arm(**coordinate) -> Scene:
    """Two bodies on hinges, a wheel, under a torque that knows the time."""
    return (
        fm.SceneBuilder("arm", gravity=(0.0, 0.0, -9.81))
        .rigid_body("upper", mass=2.0, com=(0.5, 0.0, 0.0), inertia=(0.01, 0.2, 0.2))
        .rigid_body("lower", mass=1.0, com=(0.4, 0.0, 0.0), inertia=(0.01, 0.1, 0.1))
        .revolute("shoulder", "ground", "upper", axis=(0.0, 1.0, 0.0), angle=0.3, torque=PUSH)
        .spherical("elbow", "upper", "lower", parent_position=(1.0, 0.0, 0.0))
        .wheel("wheel", "lower", mass=0.2, axial_inertia=1e-3, transverse_inertia=1e-3, axis=(1.0, 0.0, 0.0), speed=40)
        .marker("hand", "lower", offset=(0.8, 0.0, 0.0))
        .scene()
    )


@pytest.fixture(scope="module")
def system() -> fm.System:
    return fm.compile(arm())


def test_another_clock_is_another_time_of_the_same_motion(system):
    """Functions of time written two seconds later, in a run that starts two seconds later."""
    later = arm().with_values({"shoulder.rotation.torque_Nm.phase_rad": 0.4 - 2.0 * 3.0})
    run = fm.simulate(system, 1.0, samples=11)
    shifted = fm.simulate(later, 3.0, t_start=2.0, samples=11)
    assert shifted.t[0] == 2.0 and np.allclose(shifted.t, run.t + 2.0)
    assert np.allclose(shifted.q, run.q, rtol=0.0, atol=1e-9) and np.allclose(shifted.u, run.u, rtol=0.0, atol=1e-8)
    unshifted = fm.simulate(later, 1.0, samples=11)
    assert not np.allclose(unshifted.q, run.q, rtol=0.0, atol=1e-3)


def test_times_before_zero(system):
    run = fm.simulate(system, 0.5, t_start=-1.0, samples=[-1.0, -0.25, 0.5])
    assert run.finished and run.t.tolist() == [-1.0, -0.25, 0.5]
    assert run.drives == {} and np.isclose(run.q[0, 0], 0.3)


def test_a_run_goes_on_from_a_state(system):
    whole = fm.simulate(system, 1.0, samples=11)
    rest = fm.simulate(system, 1.0, state=whole.state_at(4), samples=whole.t[4:])
    assert np.array_equal(rest.q[0], whole.q[4]) and np.array_equal(rest.u[0], whole.u[4])
    assert np.allclose(rest.q, whole.q[4:], rtol=0.0, atol=1e-9)
    assert rest.work[0] == 0.0 and np.isclose(rest.work[-1], whole.work[-1] - whole.work[4])
    by_name = fm.simulate(system, 1.0, t_start=whole.t[4], state=whole.values_at(4), samples=whole.t[4:])
    assert np.array_equal(by_name.q, rest.q)


def test_values_by_name_are_of_coordinates_speeds_and_whole_hinges(system):
    half = np.sqrt(0.5)
    values = {
        "shoulder.rotation": -0.2, "shoulder.rotation.rate": 1.5, "elbow": [half, 0.0, half, 0.0],
        "elbow.speeds": [0.1, 0.2, 0.3], "wheel.speed": 7.0,
    }  # fmt: skip
    run = fm.simulate(system, 1e-3, state=values, samples=2)
    assert run.q[0].tolist() == pytest.approx([-0.2, half, 0.0, half, 0.0, 0.0], abs=1e-15)
    assert run.u[0].tolist() == [1.5, 0.1, 0.2, 0.3, 7.0]
    assert fm.simulate(system, 1e-3, state={"wheel.speed": 7.0}, samples=2).q[0, 0] == 0.3  # the others are the scene's


def test_what_is_no_state_is_refused(system):
    for state, message in (
        ({"shoulder.rotatoin": 0.1}, 'did you mean "shoulder.rotation"'),
        ({"elbow": [1.0, 0.0]}, "4 numbers in a row"),
        ({"shoulder.rotation": np.nan}, "is nan"),
        ({"elbow": [0.0, 0.0, 0.0, 0.0]}, "not zero"),
        ({"shoulder.rotation": 0.1, "shoulder": 0.2}, "another name gives the same coordinates"),
        ({"elbow": np.ma.array([1.0, 0.0, 0.0, 0.0], mask=[0, 1, 0, 0])}, r'state\["elbow"\]\[1\] is masked'),
        (fm.State([0.0], [0.0]), "belongs to another"),
    ):
        with pytest.raises(ValueError, match=message):
            fm.simulate(system, 1.0, state=state)
    same = {"shoulder.rotation": 0.1, "shoulder": 0.1}
    assert fm.simulate(system, 1e-3, state=same, samples=2).q[0, 0] == 0.1
    with pytest.raises(TypeError, match="give a State"):
        fm.simulate(system, 1.0, state=np.zeros(6))
    for t_start, t_end in ((1.0, 1.0), (2.0, 1.0)):
        with pytest.raises(fm.SceneError, match="after its start"):
            fm.simulate(system, t_end, t_start=t_start)
    with pytest.raises(ValueError, match="t_start is nan"):
        fm.simulate(system, 1.0, t_start=np.nan)


def test_prescribed_motions_and_values_agree():
    scene = arm().with_values({"shoulder.rotation.torque_Nm": None, "shoulder.rotation.angle_rad": 0.0,
                               "shoulder.rotation.prescribed_rad": fm.Ramp(rate=0.5)})  # fmt: skip
    run = fm.simulate(scene, 2.1, t_start=2.0, state={"shoulder.rotation": 1.0}, samples=2)
    assert run.q[0, 0] == 1.0 and run.u[0, 0] == 0.5
    for name, value in (("shoulder.rotation", 0.9), ("shoulder.rotation.rate", 0.0)):
        with pytest.raises(ValueError, match=f'"{name}" is prescribed'):
            fm.simulate(scene, 2.1, t_start=2.0, state={name: value}, samples=2)


def test_a_table_covers_the_run():
    table = fm.Table(times_s=tuple(np.linspace(0.0, 2.0, 9)), values=tuple(np.zeros(9)))
    scene = arm().with_values({"shoulder.rotation.torque_Nm": table})
    for given in (scene, fm.compile(scene)):
        assert fm.simulate(given, 2.0, t_start=1.0, samples=2).finished
        for t_start, t_end in ((-0.5, 1.0), (1.0, 2.5)):
            with pytest.raises(fm.SceneError, match="the profile covers 0 s to 2 s"):
                fm.simulate(given, t_end, t_start=t_start)


def test_closed_chains_start_closed():
    system = fm.compile(looped())
    run = fm.simulate(system, 0.3, samples=4)
    near = run.last_state
    near.q[0] += 1e-4
    again = fm.simulate(system, 0.6, state=near, samples=2)
    assert max(system.closure_gaps(again.state_at(0))["pivot"]) < 1e-12
    assert np.allclose(again.q[0], run.q[-1], rtol=0.0, atol=3e-4)
    near.q[0] += 0.5
    with pytest.raises(fm.ClosureError, match="give coordinates that close it"):
        fm.simulate(system, 0.6, state=near)


def test_stages_are_one_trajectory():
    """A torque is let go, then the shoulder is held: work and energy balance over all stages."""
    scene = arm().with_values({"shoulder.rotation.damping_Nms_rad": 2000.0})
    held = {"shoulder.rotation.torque_Nm": None}
    turned = fm.RunStage(0.25, {"wheel.torque_Nm": PUSH})
    stages = [fm.RunStage(0.5, samples=6), fm.RunStage(1.0, held, samples=11), turned]
    run = fm.simulate_stages(scene, stages)
    assert run.finished and run.stopped_at == 1.75 and np.all(np.diff(run.t) > 0.0)
    assert len(run.t) == 6 + 10 + 200 and len(run.work) == len(run.t) == len(run.markers["hand"].position)
    assert np.abs(run.energy_drift).max() < 1e-8 * run.energy_scale
    alone = fm.simulate(scene, 0.5, samples=6)
    assert np.array_equal(run.q[:6], alone.q)
    assert run.statistics.accepted_steps > alone.statistics.accepted_steps
    assert np.max(np.abs(np.diff(run.markers["hand"].quaternion, axis=0))) < 0.5


def test_a_stage_that_prescribes_a_motion():
    """The motion takes over where the coordinate rests; its drive is an output from then on."""
    scene = fm.SceneBuilder("crank").rigid_body("crank", mass=1.0, inertia=(1.0, 1.0, 1.0))
    scene = scene.revolute("pin", "ground", "crank", angle=0.7).scene()
    turn = fm.SmoothStep(start_value=0.7, end_value=1.2, start_s=1.0, duration_s=1.0)
    driven = {"pin.rotation.angle_rad": 0.0, "pin.rotation.prescribed_rad": turn}
    stages = [fm.RunStage(1.0, samples=3), fm.RunStage(1.0, driven)]
    run = fm.simulate_stages(scene, stages)
    assert run.q[-1, 0] == 1.2
    assert np.all(run.drives["pin"][:2] == 0.0) and np.all(run.drives["pin"][3:20] != 0.0)
    assert np.isclose(run.drives["pin"][52, 0], np.gradient(run.u[:, 0], run.t)[52], rtol=1e-2)
    moving = fm.simulate_stages(scene.with_values({"pin.rotation.rate_rad_s": 0.1}), stages[:1])
    with pytest.raises(ValueError, match='"pin.rotation.rate" is prescribed'):
        fm.simulate_stages(scene, stages[1:], t_start=1.0, state={**moving.values_at(-1), "pin.rotation": 0.7})


def test_stages_that_do_not_fit_are_refused():
    other = fm.SceneBuilder("other").rigid_body("one", mass=1.0, inertia=(1.0, 1.0, 1.0)).free("f", "ground", "one")
    with pytest.raises(ValueError, match=r"stages\[1\] has other coordinates"):
        fm.simulate_stages(arm(), [fm.RunStage(1.0), fm.RunStage(1.0, scene=other.scene())])
    with pytest.raises(ValueError, match="no stages"):
        fm.simulate_stages(arm(), [])
    with pytest.raises(ValueError, match=r"stages\[0\] lasts -1 s"):
        fm.simulate_stages(arm(), [fm.RunStage(-1.0)])


def test_stages_are_checked_before_the_first_one_runs(monkeypatch):
    """Its profile ends within the last stage, or its output times are none: nothing is integrated in vain."""
    begun = []
    monkeypatch.setattr(simulating, "origin", lambda *given: begun.append(given))
    ending = fm.Table(times_s=(0.0, 1.0, 1.5), values=(0.0, 1.0, 0.0))
    short = fm.RunStage(1.0, {"shoulder.rotation.torque_Nm": ending})
    with pytest.raises(fm.SceneError, match="shoulder"):
        fm.simulate_stages(arm(), [fm.RunStage(1.0), short])
    with pytest.raises(ValueError, match="at least 2 output times"):
        fm.simulate_stages(arm(), [fm.RunStage(1.0), fm.RunStage(1.0, samples=1)])
    assert not begun


def test_ctrl_c_in_a_stage_keeps_those_before_it(monkeypatch):
    whole, calls = segments.integrate, []

    def interrupted(*given, **options):
        calls.append(given)
        return whole(*given, **options)._replace(interrupted=len(calls) == 2)

    monkeypatch.setattr(segments, "integrate", interrupted)
    with pytest.raises(fm.Interrupted) as stopped:
        fm.simulate_stages(arm(), [fm.RunStage(0.1, samples=3), fm.RunStage(0.1, samples=5), fm.RunStage(1.0)])
    assert len(calls) == 2
    assert stopped.value.trajectory.t == pytest.approx([0.0, 0.05, 0.1, 0.125, 0.15, 0.175, 0.2])


def test_a_stage_that_fails_is_the_last():
    scene = arm()
    stages = [fm.RunStage(0.1, samples=3), fm.RunStage(5.0, samples=3), fm.RunStage(1.0)]
    run = fm.simulate_stages(scene, stages, max_steps=12)
    assert run.status is fm.Status.MAX_STEPS and 0.1 < run.stopped_at < 5.1


def test_runs_that_do_not_follow_are_not_joined(system):
    first, later = fm.simulate(system, 0.2, samples=3), fm.simulate(system, 0.5, t_start=0.4, samples=3)
    with pytest.raises(ValueError, match=r"began at 0.4 s"):
        first.then(later)
    with pytest.raises(ValueError, match="only one of them has q_names"):
        first.then(fm.simulate(fm.compile(looped()), 0.1, samples=2))
