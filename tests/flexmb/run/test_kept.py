"""What runs of one system keep for the next one: it makes them cheap, and changes nothing."""

import numpy as np
import pytest

import flexmb as fm
import flexmb.run.propagate as propagation
import flexmb.run.times as switching
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.run import segments
from flexmb.run.observing import observe
from flexmb.run.propagate import integration
from flexmb.run.warm_up import pendulum
from flexmb.tables.status import Status
from tests.flexmb.closure.mechanisms import windows
from tests.trees import random_scene

RUN = {"t_end": 0.02, "samples": 7, "rtol": 1e-6}


def numbers(run: fm.Trajectory) -> list[np.ndarray]:
    """Everything but seconds."""
    markers = [each for path in run.markers.values() for each in vars(path).values()]
    loads = [*run.loads.values(), *run.wheel_loads.values(), *run.drives.values()]
    return [run.t, run.q, run.u, run.work, run.momentum, *run.energy.values(), *markers, *loads]


def equal(one: fm.Trajectory, other: fm.Trajectory) -> bool:
    pairs = zip(numbers(one), numbers(other), strict=True)
    return one.message == other.message and all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)


@pytest.fixture(scope="module")
def system() -> fm.System:
    return fm.compile(random_scene(3))


def kept(system: fm.System) -> int:
    return sum(len(value) for key, value in system.kept.items() if isinstance(value, list))


@pytest.mark.parametrize("algorithm", ["articulated", "composite", "frisch"])
def test_a_later_run_is_the_first_one_again(algorithm):
    fresh, used = fm.compile(random_scene(4)), fm.compile(random_scene(4))  # one that all algorithms finish
    first = fm.simulate(fresh, **RUN, algorithm=algorithm)
    assert first.finished
    for t_end in (0.05, 0.02):
        fm.simulate(used, t_end, "rk4", step=1e-3, algorithm=algorithm)
    fm.simulate(used, 0.05, samples=3, rtol=1e-3, max_steps=2, algorithm=algorithm)  # stops in the middle
    assert equal(fm.simulate(used, **RUN, algorithm=algorithm), first)
    assert equal(fm.simulate(used, **RUN, algorithm=algorithm), first)
    assert kept(used) == 2  # one of each method


CHAINS = {
    "through singular positions": {}, "stabilised": {"stabilise": 20.0}, "composite": {"algorithm": "composite"},
    "equal steps": {"method": "rk4", "step": 1e-3}, "stiff": {"method": "radau5", "rtol": 1e-5, "atol": 1e-6},
}  # fmt: skip


@pytest.mark.filterwarnings("ignore:.*branches of the motion nearly meet there:flexmb.SceneWarning")  # of other steps
@pytest.mark.parametrize("settings", CHAINS.values(), ids=CHAINS)
def test_a_later_run_of_a_closed_chain_is_the_first_one_again(settings):
    """On its branch from the start, whichever branch the one before was on when it ended."""
    fresh, used = (fm.compile(windows(2, 5.0)) for _ in range(2))
    first = fm.simulate(fresh, 1.0, samples=7, **settings)
    assert first.finished
    for t_end, max_steps in ((0.3, 10**6), (1.0, 10**6), (1.0, 40)):
        fm.simulate(used, t_end, samples=3, max_steps=max_steps, **settings)
    fm.simulate(used, 0.3, samples=3, **settings | {"stabilise": 5.0})  # with other equations of motion
    assert equal(fm.simulate(used, 1.0, samples=7, **settings), first)
    assert kept(used) == 2  # one of each way to keep closures closed


def test_what_a_closed_chain_remembers_would_be_noticed(monkeypatch):
    """The test above, with integrations that go on from where they were."""
    monkeypatch.setattr(propagation.Integration, "forget", lambda _: None)
    fresh, used = (fm.compile(windows(2, 5.0)) for _ in range(2))
    for t_end in (0.3, 0.6):
        fm.simulate(used, t_end, samples=3)
    assert not equal(fm.simulate(used, 1.0, samples=7), fm.simulate(fresh, 1.0, samples=7))


@pytest.mark.parametrize("method", [name for name, integrator in INTEGRATORS.items() if integrator.linearises])
def test_a_later_run_with_jacobians_is_the_first_one_again(method):
    options = {"step": 5e-3} if INTEGRATORS[method].fixed else {}
    system = fm.compile(pendulum())
    runs = [fm.simulate(system, 0.02, method, samples=3, **options) for _ in range(3)]
    assert equal(runs[0], runs[1]) and equal(runs[0], runs[2])


def test_what_fails_in_python_is_not_kept(system):
    solver, count = INTEGRATORS["dop853"], kept(system)
    with pytest.raises(ZeroDivisionError), integration(system, "articulated", 0.0, solver):
        raise ZeroDivisionError
    assert kept(system) <= count


def test_runs_at_once_do_not_share_workspaces(system):
    """Two at once have an integration each. (Numbers: tests/flexmb/system/test_threads.py.)"""
    solver = INTEGRATORS["dop853"]
    with integration(system, "articulated", 0.0, solver) as one, integration(system, "articulated", 0.0, solver) as two:
        assert one is not two and not np.shares_memory(one._workspace.body, two._workspace.body)


def test_a_scene_is_walked_once(monkeypatch):
    """And cannot change afterwards."""
    scene = pendulum()
    system, walks = fm.compile(scene), []
    whole = switching.timing
    monkeypatch.setattr(switching, "timing", lambda scene: walks.append(scene) or whole(scene))
    for _ in range(3):
        fm.simulate(system, 1e-3, samples=2)
    assert walks == [scene]
    with pytest.raises(AttributeError):
        scene.bodies = ()
    with pytest.raises(AttributeError):
        scene.hinges[0].coordinate.angle_rad = 1.0


def test_kernels_are_compiled_in_the_first_run_only(monkeypatch):
    system = fm.compile(pendulum())
    first, second = (fm.simulate(system, 1e-3, samples=2).statistics for _ in range(2))
    assert first.compile_s > second.compile_s
    monkeypatch.setattr(propagation, "problem", None)  # none is stated again
    assert fm.simulate(system, 1e-3, samples=2).finished


@pytest.mark.parametrize("sound", [0, 3])
def test_single_states_take_over_where_the_compiled_loop_ends(system, sound):
    """A loop that gives up at the first sample, or after some, changes nothing; a wrong row of it is seen."""
    run = fm.simulate(system, **RUN)
    states = np.hstack([run.q, run.u, run.work[:, None]])
    with integration(system, "articulated", 0.0, INTEGRATORS["dop853"]) as solve:
        whole = observe(system, "articulated", run.t, states, solve.batch)

        def gives_up(times, states, rows):
            count = min(len(times), 1) if times[0] < run.t[sound] else 0
            return solve.batch(times[:count], states[:count], rows[:count])

        assert np.array_equal(observe(system, "articulated", run.t, states, gives_up).rows, whole.rows)
        assert np.array_equal(observe(system, "articulated", run.t, states, None).rows, whole.rows)
        assert whole.trouble is None and len(whole.rows) == len(run.t)
        states[4, 0] = np.nan
        broken = observe(system, "articulated", run.t, states, solve.batch)
    assert len(broken.rows) == 4 and isinstance(broken.trouble, fm.DynamicsError)
    assert np.array_equal(broken.rows, whole.rows[:4])


def test_outputs_that_overflow_end_the_samples(monkeypatch):
    """Squares of speeds overflow before the speeds do: the samples before are kept."""
    whole = segments.integrate

    def overflowing(*given, **settings):
        raw = whole(*given, **settings)
        raw.states[2:, 1] = 1e200
        return raw

    monkeypatch.setattr(segments, "integrate", overflowing)
    run = fm.simulate(pendulum(), 1.0, samples=5)
    assert run.status is Status.NONFINITE and run.stopped_at == 0.5
    assert run.message.startswith("stopped at t = 0.5 s: the result at t = 0.5 s is not finite")
    assert all(len(number) == 2 for number in numbers(run))
