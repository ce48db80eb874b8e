"""A run that is taken up where another ended is, to the last bit, one that had never ended."""

import numpy as np
import pytest

import flexmb as fm
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.run.warm_up import looped
from flexmb.scene.shapes import beam_section
from tests.flexmb.run.test_kept import numbers

TIMES = np.linspace(0.0, 1.0, 21)
CUT = 9


def swinging() -> fm.Scene:
    """A flexible rod under a torque that knows the time, with a quaternion, a spring and a damper beside it."""
    strip = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700.0)
    return (
        fm.SceneBuilder("swinging", gravity=(0.0, 0.0, -9.81))
        .rigid_body("hub", mass=2.0, inertia=(0.1, 0.2, 0.3), com=(0.1, 0.0, 0.2))
        .beam("rod", length=1.0, elements=4, section=strip, modes=3)
        .spherical("ball", "ground", "hub", angular_velocity=(0.3, -0.4, 2.0))
        .revolute("arm", "hub", "rod", axis=(0.0, 1.0, 0.0), angle=0.5, stiffness=3.0, damping=0.01,
                  torque=fm.Sine(amplitude=0.2, angular_frequency_rad_s=3.0))
        .marker("end", "rod", node="tip")
        .scene()
    )  # fmt: skip


def options(method: str) -> dict:
    return {"step": 0.004} if INTEGRATORS[method].fixed else {"rtol": 1e-6, "atol": 1e-8}


@pytest.fixture(scope="module")
def systems() -> dict[str, fm.System]:
    return {"tree": fm.compile(swinging()), "closed": fm.compile(looped())}


def taken_up(system, method, first, times):
    return fm.simulate(system, 1.0, method, t_start=times[0], state=first, samples=times, **options(method))


CASES = [(scene, name) for scene in ("tree", "closed") for name in INTEGRATORS]


@pytest.mark.parametrize(("scene", "method"), CASES)
def test_two_runs_are_one(systems, scene, method, tmp_path):
    system, given = systems[scene], options(method)
    whole = fm.simulate(system, 1.0, method, samples=TIMES, **given)
    assert whole.finished
    first = fm.simulate(system, TIMES[CUT], method, samples=TIMES[: CUT + 1], **given)
    first.restart.save(tmp_path / "first.npz")
    restart = fm.Restart.load(tmp_path / "first.npz")
    cut = int(np.searchsorted(TIMES, restart.since))  # what lies in the step that was cut short comes again
    assert CUT - 1 <= cut <= CUT and restart.t == TIMES[CUT]
    second = taken_up(system, method, restart, TIMES[cut:])
    for part, all_of_it in zip(numbers(second), numbers(whole), strict=True):
        if part.ndim != 2 or part.shape[1] != 4:  # quaternions of markers: their sign is of the run
            assert np.array_equal(part, all_of_it[cut:])
    assert np.array_equal(first.q[:cut], whole.q[:cut]) and np.array_equal(first.u[:cut], whole.u[:cut])
    # What follows knows nothing of where the run was cut.
    assert np.array_equal(second.restart.memory.numbers[1:], whole.restart.memory.numbers[1:])
    assert np.array_equal(second.restart.memory.y, whole.restart.memory.y)


@pytest.mark.parametrize("method", list(INTEGRATORS))
def test_a_run_that_was_stopped_goes_on(systems, method):
    system, given = systems["tree"], options(method)
    whole = fm.simulate(system, 1.0, method, samples=TIMES, **given)
    steps = whole.statistics.accepted_steps + whole.statistics.rejected_steps
    stopped = fm.simulate(system, 1.0, method, samples=TIMES, max_steps=steps // 2, **given)
    assert stopped.status is fm.Status.MAX_STEPS and stopped.restart.t == stopped.stopped_at
    left = TIMES[stopped.t[-1] < TIMES]
    rest = taken_up(system, method, stopped.restart, [stopped.restart.t, *left])
    assert np.array_equal(rest.q[1:], whole.q[len(stopped.t) :])
    assert np.array_equal(rest.work[1:], whole.work[len(stopped.t) :])


@pytest.mark.parametrize("method", ["dop853", "rk4", "generalised_alpha"])
def test_a_switch_where_a_run_is_cut(method):
    """A pulse that begins there is seen by the second run only, in one run as in two."""
    scene = fm.SceneBuilder("pushed").rigid_body("body", mass=2.0, inertia=(1.0, 1.0, 1.0))
    pulse = fm.Pulse(value=3.0, start_s=TIMES[CUT], duration_s=0.2)
    system = fm.compile(scene.prismatic("rail", "ground", "body", force=pulse, stiffness=4.0).scene())
    given = options(method)
    whole = fm.simulate(system, 1.0, method, samples=TIMES, **given)
    first = fm.simulate(system, TIMES[CUT], method, samples=TIMES[: CUT + 1], **given)
    second = taken_up(system, method, first.restart, TIMES[CUT:])
    assert np.all(first.q == 0.0) and np.all(whole.q[CUT + 1 :] != 0.0)
    assert np.array_equal(second.q, whole.q[CUT:]) and np.array_equal(second.work, whole.work[CUT:])


def test_a_state_alone_is_less_than_a_restart(systems):
    """The control: from the last state, without memory, the bits differ."""
    system = systems["tree"]
    whole = fm.simulate(system, 1.0, samples=TIMES, **options("dop853"))
    first = fm.simulate(system, TIMES[CUT], samples=TIMES[: CUT + 1], **options("dop853"))
    second = fm.simulate(system, 1.0, state=first.last_state, samples=TIMES[CUT:], **options("dop853"))
    assert not np.array_equal(second.q[1:], whole.q[CUT + 1 :])
    assert np.allclose(second.q, whole.q[CUT:], rtol=0.0, atol=1e-4)


def test_a_run_that_failed_has_no_restart():
    sprung = fm.SceneBuilder("sprung too hard").rigid_body("body", mass=1.0, inertia=(1.0, 1.0, 1.0))
    scene = sprung.prismatic("rail", "ground", "body", stiffness=1e30, position=1.0).scene()
    run = fm.simulate(scene, 1e3, "rk4", step=1.0)
    assert not run.finished and run.restart is None


def test_what_cannot_be_taken_up_is_refused(systems, tmp_path):
    system = systems["closed"]
    run = fm.simulate(system, 0.1, samples=2, rtol=1e-6)
    with pytest.raises(ValueError, match='made by method "dop853"'):
        fm.simulate(system, 0.2, "rk4", step=0.01, state=run.restart)
    with pytest.raises(ValueError, match="with other contents"):
        fm.simulate(systems["tree"], 0.2, state=run.restart)
    with pytest.raises(ValueError, match="or give a time between"):
        fm.simulate(system, 0.2, t_start=0.0, state=run.restart)
    with pytest.raises(fm.SceneError, match="after its start at 0.1 s"):
        fm.simulate(system, 0.1, state=run.restart)
    (tmp_path / "other.npz").write_bytes(b"nothing")
    with pytest.raises(ValueError, match="no restart"):
        fm.Restart.load(tmp_path / "other.npz")
    run.to_npz(tmp_path / "run.npz")
    with pytest.raises(ValueError, match="no restart"):
        fm.Restart.load(tmp_path / "run.npz")
