"""The entry point that runs a scene: it integrates in compiled code, then evaluates all observables."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple, TypedDict, Unpack

import numpy as np

from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.integrate.integrator import Method
from flexmb.integrate.settings import Settings
from flexmb.run.beside import computed
from flexmb.run.driver import Driver, Leg
from flexmb.run.envelope import PartialEnvelope
from flexmb.run.followed import FollowedRun, Stretch
from flexmb.run.interruption import Interrupted
from flexmb.run.origin import Given, Values, origin, start_time
from flexmb.run.outputs import observed
from flexmb.run.propagate import integration, unmoved
from flexmb.run.provenance import Making
from flexmb.run.restart import Restart
from flexmb.run.run_arrays import Way, told
from flexmb.run.times import refuse_large_run, refuse_times, sample_times
from flexmb.run.trajectory import Trajectory
from flexmb.scene.check import check_and_warn
from flexmb.scene.problems import SceneWarning
from flexmb.scene.schema import Scene
from flexmb.scene.sticking import any_sticks
from flexmb.system import algorithms
from flexmb.system.algorithm import Algorithm
from flexmb.system.compile import assembled
from flexmb.system.system import System
from flexmb.system.watches import WatchedStates, said
from flexmb.tables import arguments
from flexmb.tables.state import PrecisionWarning, State
from flexmb.tables.status import Status
from flexmb.typing import Real


class RunSettings(TypedDict, total=False):
    """Accuracy and steps of `simulate`; settings that are left out have the default values of `Settings`.

    rtol = 1e-10, atol = 1e-12 (SI units), step (s), max_steps = 1,000,000, spectral_radius = 0.8
    """

    rtol: float
    atol: float
    step: float | None
    max_steps: int
    spectral_radius: float | None


def simulate(
    scene: Scene | System,
    t_end: float,
    method: Method = "dop853",
    *,
    t_start: float | None = None,
    state: State | Restart | Values | None = None,
    samples: int | Sequence[float] | Real = 201,
    algorithm: Algorithm = "articulated",
    stabilise: float = 0.0,
    **settings: Unpack[RunSettings],
) -> Trajectory:
    """Simulate a scene from its initial state at t = 0 to `t_end` (s), or from another time and state.

    method: "dop853" adapts its step so that the error of each step stays below `rtol |y_i| + atol` (1e-10 and 1e-12 if
    left out), in the root mean square over all coordinates and speeds y_i, in SI units; "rk4" takes equal steps not
    longer than `step` (s). Three methods are for scenes with modes or springs that are much faster than the motion of
    interest. "radau5" lets them die out where the step is longer than their period; "exponential" follows them exactly
    as far as they are linear, whatever the step; both adapt their steps as "dop853" does. "generalised_alpha" takes
    equal steps and damps the modes that they do not resolve, by `spectral_radius` from 1 (no damping) to 0 (all in one
    step), 0.8 if left out; rtol and atol bound the remaining error of its Newton iterations. See docs/integrators.md.
    max_steps: a run of more steps stops, 1,000,000 if left out; nothing else bounds a run to a late `t_end`, as nobody
    knows the steps of an adaptive method beforehand. samples: how many equally spaced output times, both ends included,
    or the times themselves, from start to end. algorithm: "articulated", the O(N) recursion; "composite", the mass
    matrix and its Cholesky factors; or Frisch's equations, "frisch" or "frisch_as_printed", which take bodies of level
    `full` as `linear`. Accelerations and loads of the output are theirs too. stabilise: how closures are kept closed.
    0: after every step coordinates and speeds are projected back to where all closures are closed, to 1e-13 of the
    mechanism's size. With a rate k (1/s) errors g of closures decay by g'' + 2 k g' + k^2 g = 0 (Baumgarte), which
    costs less and leaves a drift; k times the step should stay below 1.

    t_start (s): any finite time, the argument of functions of time at the start; 0 or the state's own time if left out.
    state: a `State`, such as `Trajectory.last_state`; or values of coordinates and speeds by name, all others being
    those of the scene. Names are those in `Trajectory.q_names` and `u_names`, or a hinge, a wheel or "<body>.modes" for
    all its coordinates, followed by ".speeds" for all its speeds; closed chains take the nearest state that closes
    their closures. Or state is a `Restart`, from which a run of the same scene and method is resumed bit-identically.

    Warns (`SceneWarning`) of doubtful input, of beams of level exact that bent more than their points or polynomials
    can follow or whose held stretch loads would change by a thousandth, and of bodies that turned faster than their
    level describes (`allow` waives each, see `Scene`).
    Raises SceneError for an invalid scene or one whose profiles end before t_end, NotImplementedError for one that is
    not supported yet, ValueError or TypeError for invalid settings, and ClosureError if no initial state closes the
    closures, if they leave no motion, or if the given state is far from closing them. A run that fails raises nothing:
    `status` and `message` of the trajectory say why it stopped, and the samples up to there are kept. Ctrl-C ends a run
    at its next step and raises `Interrupted`, a KeyboardInterrupt, whose `trajectory` holds the samples up to there; a
    second Ctrl-C while outputs are evaluated keeps those that are finished.
    """
    refuse_unknown("simulate", settings)
    t_end, t = _end(t_end), start_time(t_start, state)
    if isinstance(scene, System):
        refuse_times(scene, t, t_end)
    else:
        check_and_warn(scene, t_end, t)
    chosen = Settings(method, **settings).checked(max(abs(t), abs(t_end)))
    times = sample_times(samples, t_end, t)
    if isinstance(scene, Scene):
        refuse_large_run(scene, len(times), chosen, algorithm)  # before anything is built
        scene = assembled(scene)
    return run_stages([RunPart(scene, times)], state, chosen, algorithm, stabilise)


class RunPart(NamedTuple):
    """A part of a run: its system and its output times (T,) s, from its start to its end."""

    system: System
    times: Real


def run_stages(
    stages: Sequence[RunPart], state: Given, settings: Settings, algorithm: Algorithm, stabilise: float
) -> Trajectory:
    """The trajectory of stages, each of which starts at the last output of the one before, until one fails.

    state: where the first one starts. Warnings are attributed to the line that called the caller.
    """
    stabilise = arguments.number("stabilise", stabilise)
    for system, times in stages:
        refuse_large_run(system, len(times), settings, algorithm)
        if settings.integrator.linearises:
            refuse_without_jacobian(system, algorithm, settings.method)
    whole: Trajectory | None = None
    for stage in stages:
        start = state if whole is None else whole.values_at(-1)
        run, warned, was_interrupted = _looked_at(stage.system, _run(stage, start, settings, algorithm, stabilise))
        for warning in warned:
            warnings.warn(warning, stacklevel=3)
        if algorithm == "articulated" and not settings.integrator.linearises:  # others have no special kernels beside
            computed(stage.system, run.statistics.run_s)
        whole = run if whole is None else whole.then(run)
        if was_interrupted or run.status is Status.INTERRUPTED:
            raise Interrupted(whole)
        if not run.finished:
            break
    assert whole is not None  # there is at least one stage
    return whole


def run_with_course(system: System, times: Real, settings: Settings) -> tuple[Trajectory, list[Leg]]:
    """The trajectory of a scene from its own initial state, as `simulate` makes it, and its parts between events."""
    refuse_large_run(system, len(times), settings, "articulated")
    course: list[Leg] = []
    made = _run(RunPart(system, times), None, settings, "articulated", 0.0, course)
    run, warned, was_interrupted = _looked_at(system, made)
    for warning in warned:
        warnings.warn(warning, stacklevel=3)
    if was_interrupted or run.status is Status.INTERRUPTED:
        raise Interrupted(run)
    return run, course


def run_of_many(
    system: System, times: Real, settings: Settings, algorithm: Algorithm, state: State | None = None
) -> Made:
    """A run from a state (default: the scene's own), as `simulate` makes it, one of many: it warns of nothing, and
    watches of accuracy have not looked at it."""
    refuse_large_run(system, len(times), settings, algorithm)
    if settings.integrator.linearises:
        refuse_without_jacobian(system, algorithm, settings.method)
    made = _run(RunPart(system, times), state, settings, algorithm, 0.0)
    if made.was_interrupted or made.trajectory.status is Status.INTERRUPTED:
        raise Interrupted(made.trajectory)
    return made


class Made(NamedTuple):
    """The trajectory of one stage, what there is to warn of, whether Ctrl-C ended it, and its fastest states, each
    (K,1+nq+nu): see `flexmb.run.propagate.Raw`."""

    trajectory: Trajectory
    warned: list[Warning]
    was_interrupted: bool
    fastest: list[Real]


def _run(
    stage: RunPart, state: Given, settings: Settings, algorithm: Algorithm, stabilise: float,
    course: list[Leg] | None = None,
) -> Made:  # fmt: skip
    """One stage; course: see `Driver`."""
    system, times = stage
    t = float(times[0])
    begin = origin(system, t, state, settings.method)
    start = system.start_precision if state is None and t == 0.0 else system.precision_if_doubtful(begin.state)
    if start is not None and start.status != Status.OK:
        raw = unmoved(begin, Status(start.status), start.fault)
        with integration(system, algorithm, stabilise, settings.integrator) as solve:
            return Made(observed(system, times, raw, algorithm, solve), [], False, [])
    again = partial(_again, stage, state, algorithm, stabilise)
    made_by = Making(system, times, settings, again)
    driver = Driver(system, times, settings, algorithm, stabilise, begin.events, made_by)
    driver.course = course
    trajectory = driver(begin)
    given, stopped = dict(state) if isinstance(state, Mapping) else state, trajectory.stopped_at
    steps = trajectory.statistics.accepted_steps
    parts = partial(_followed, stage, given, settings, algorithm, stabilise, stopped, steps)
    trajectory = told(trajectory, ways=(Way(parts, t, stopped, (trajectory.q_names, trajectory.u_names)),))
    warned: list[Warning] = [SceneWarning(doubt) for doubt in driver.doubts]
    if start is not None and start.is_low:
        warned.append(PrecisionWarning(start.warning))
        trajectory = told(trajectory, message=f"{trajectory.message}; at the start {start.warning}")
    return Made(trajectory, warned, driver.was_interrupted, driver.fastest)


def _followed(
    stage: RunPart, state: Given, settings: Settings, algorithm: Algorithm, stabilise: float, stopped: float,
    steps: int, until: float,
) -> Iterator[PartialEnvelope]:  # fmt: skip
    """Extremes of a run of `steps` steps that stopped at a time (s), up to another one: see `flexmb.run.followed`."""
    system, times = stage
    times = np.array([*times[times < stopped], stopped])
    follow = FollowedRun(times, settings, algorithm, stabilise, steps)
    if not system.scene.events and not any_sticks(system.scene):
        return follow([Stretch(system, origin(system, float(times[0]), state, settings.method), stopped)], until)
    course: list[Leg] = []
    ends = times if settings.integrator.fixed else times[[0, -1]]
    if _run(RunPart(system, ends), state, settings, algorithm, stabilise, course).was_interrupted:
        raise KeyboardInterrupt
    return follow([Stretch(leg.system, leg.begin, leg.raw.t) for leg in course], until)


def _looked_at(system: System, made: Made) -> tuple[Trajectory, list[Warning], bool]:
    """Trajectory, warnings and interruption, with what watches of accuracy say of the samples and the fastest steps."""
    trajectory, warned, was_interrupted, fastest = made
    if system.is_rigid:
        return trajectory, warned, was_interrupted
    t, q, u = trajectory.t, trajectory.q, trajectory.u
    failed = not trajectory.finished
    seen = WatchedStates(system, t, q, u, lambda n: system.turns(float(t[n]), q[n], u[n]), failed, trajectory)
    seen = seen._replace(fastest=np.vstack(fastest)) if fastest and not failed else seen
    for finding in said(seen):
        warned = [*warned, SceneWarning(f'scene "{system.scene.name}": {finding}')]
        trajectory = told(trajectory, message=f"{trajectory.message}; {finding}")
    return trajectory, warned, was_interrupted


def _again(stage: RunPart, state: Given, algorithm: Algorithm, stabilise: float, settings: Settings) -> Trajectory:
    """The same run with other settings; ValueError for a resumed run, whose restart already contains errors."""
    if isinstance(state, Restart):
        raise ValueError("error_estimate() is not available for a resumed run; rerun from t_start")
    return run_stages([stage], state, settings.checked(float(np.max(np.abs(stage.times)))), algorithm, stabilise)


def refuse_without_jacobian(system: System, algorithm: Algorithm, method: Method) -> None:
    """NotImplementedError if a method that needs Jacobians is used where there are none."""
    others = " or ".join(f'"{name}"' for name, integrator in INTEGRATORS.items() if not integrator.linearises)
    if system.closures is not None and system.closures.at_rest:
        raise NotImplementedError(
            f'method "{method}" needs Jacobians, which are not available for closed chains with a body of level '
            f'"ruthless", such as "{system.fault_name(Status.OUT_OF_RANGE, system.closures.at_rest[0])}": its '
            f'inertia is not where closures join it; use level "linear" or a better one, or method {others}'
        )
    if not algorithms.chosen(algorithm).jacobian:
        alone = " or ".join(f'"{name}"' for name in algorithms.WITH_JACOBIAN)
        raise NotImplementedError(
            f'method "{method}" needs Jacobians, which only algorithm {alone} has: leave algorithm out, or use '
            f"method {others}"
        )


def refuse_unknown(function: str, settings: RunSettings) -> None:
    """TypeError for names that are not settings of a run."""
    known = RunSettings.__annotations__
    for name in settings:
        if name not in known:
            raise TypeError(f"{function} has no argument {name!r}: settings of a run are {', '.join(known)}")


def _end(t_end: float) -> float:
    """t_end (s) as a float; values that are not finite are left for the scene's check to refuse."""
    try:
        return arguments.number("t_end", t_end)
    except ValueError:  # not finite
        return float(t_end) if isinstance(t_end, float) else np.inf
