"""The one entry point that runs a scene: integrate in the compiled loop, then evaluate what is observable."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple, cast, get_args

import numpy as np
from scipy.spatial.transform import Rotation

from flexmb.entry import composite
from flexmb.frisch import evaluation as nested_evaluation
from flexmb.integrate.control import ACCEPTED, COUNTS, EVALUATIONS, FACTORISATIONS, JACOBIANS, REJECTED, SAMPLES, STOP
from flexmb.integrate.integrator import Method
from flexmb.integrate.problem import Clock
from flexmb.integrate.settings import Settings
from flexmb.run.interruption import Interrupted, interruptible
from flexmb.run.propagate import Integration, Route
from flexmb.run.trajectory import MarkerPath, Statistics, Trajectory
from flexmb.scene.check import check_run, check_scene
from flexmb.scene.check.walk import values
from flexmb.scene.convert import ROOT
from flexmb.scene.functions import Pulse, SmoothStep, SpinUp
from flexmb.scene.schema import Scene
from flexmb.system.labels import state_names
from flexmb.system.system import ENERGIES, ERRATA, Algorithm, Evaluation, System, assembled
from flexmb.tables import arguments
from flexmb.tables.state import DynamicsError, NotFiniteError, PrecisionWarning
from flexmb.tables.status import Status
from flexmb.typing import Real

if TYPE_CHECKING:
    from flexmb.system.closed import ClosedSystem


OUTPUT_BYTES = 2**32
"""Memory that the outputs of one run may take."""
_NUMBER_BYTES, _OBJECT_BYTES, _SAMPLE_BYTES = 16, 200, 2000  # evaluated, then gathered; of Python, measured
_TOO_MANY = f"outputs would take more than {OUTPUT_BYTES / 2**30:g} GiB; ask for fewer, or run the time in pieces"


class _Raw(NamedTuple):
    """What an integrator leaves: states (T, nq+nu+1) at the samples reached, why and when it stopped, its cost."""

    states: Real
    status: Status
    fault: int
    t: float
    counts: list[int]
    compile_s: float
    run_s: float
    interrupted: bool


def simulate(
    scene: Scene | System,
    t_end: float,
    method: Method = "dop853",
    *,
    rtol: float = 1e-10,
    atol: float = 1e-12,
    step: float | None = None,
    samples: int | Sequence[float] | Real = 201,
    max_steps: int = 1_000_000,
    algorithm: Algorithm = "articulated",
    stabilise: float = 0.0,
    spectral_radius: float | None = None,
) -> Trajectory:
    """Simulate a scene from its initial state at t = 0 to `t_end` (s).

    method: "dop853" adapts its step so that the error of each step stays below rtol |y_i| + atol, in the root mean
    square over all coordinates and speeds y_i, in SI units; "rk4" takes equal steps not longer than `step` (s). For
    scenes with modes or springs much faster than what matters: "radau5", which lets them die out where the step is
    longer than their period; "exponential", which follows them exactly as far as they are linear, whatever the step;
    both adapt their steps as "dop853" does. "generalised_alpha" takes equal steps and damps what they do not resolve:
    `spectral_radius` from 1, nothing, to 0, all in one step (0.8 if left out); rtol and atol are what its Newton
    iterations may leave. See docs/integrators.md.
    samples: how many equally spaced output times, both ends included, or the times themselves, from 0 to t_end.
    algorithm: "articulated", the O(N) recursion; "composite", the mass matrix and its Cholesky factors; or Frisch's
    equations, "frisch" or "frisch_as_printed", which take bodies of level `full` as `linear`. Accelerations and loads
    of the output are theirs too.
    stabilise: how closures are kept closed. 0: after every step coordinates and speeds are projected back to where all
    closures are closed, to 1e-13 of the mechanism's size. A rate k (1/s): errors g of closures are left to decay by
    g'' + 2 k g' + k^2 g = 0 (Baumgarte), which costs less and leaves a drift; k times the step should stay below 1.

    Raises SceneError for a scene that is wrong or whose profiles end before t_end, NotImplementedError for one that is
    not supported yet, ValueError or TypeError for settings that make no sense, ClosureError where no initial state
    closes the closures or they leave no motion. A run that fails raises nothing: `status` and `message` of the
    trajectory say why it stopped, and what was reached is kept. Ctrl-C ends a run at its next step and raises
    `Interrupted`, a KeyboardInterrupt, whose `trajectory` is what was reached; a second one while the outputs of that
    are evaluated keeps those that are.
    """
    t_end = _end(t_end)
    if isinstance(scene, System):
        check_run(scene.scene, t_end)
    else:
        check_scene(scene, t_end)
    settings = Settings(method, rtol, atol, step, max_steps, spectral_radius).checked(t_end)
    stabilise = arguments.number("stabilise", stabilise)
    times = _sample_times(samples, t_end)
    system = scene if isinstance(scene, System) else assembled(scene)
    _refuse_too_many(len(times), system)
    if settings.integrator.linearises:
        _refuse_without_jacobian(system, algorithm, method)
    route, start = _route(system, algorithm, stabilise), system.precision(system.initial_state)
    if start.status != Status.OK:
        nothing = np.empty((0, system.nq + system.nu + 1))
        raw = _Raw(nothing, Status(start.status), start.fault, 0.0, [0] * COUNTS, 0.0, 0.0, interrupted=False)
        return _observed(system, times, raw, algorithm)
    raw = _integrate(system, route, times, settings)
    trajectory = _observed(system, times, raw, algorithm)
    if start.is_low:
        warnings.warn(start.warning, PrecisionWarning, stacklevel=2)
        trajectory = replace(trajectory, message=f"{trajectory.message}; at the start {start.warning}")
    if raw.interrupted or trajectory.status is Status.INTERRUPTED:
        raise Interrupted(trajectory)
    return trajectory


def switch_times(scene: Scene, t_end: float) -> list[float]:
    """Times in (0, t_end) where a function of the scene jumps or is no longer smooth: no step may cross one (s)."""
    found: set[float] = set()
    for _, _, function in values(ROOT, scene):
        match function:
            case Pulse(start_s=start, duration_s=duration) | SmoothStep(start_s=start, duration_s=duration):
                found |= {start, start + duration}
            case SpinUp(duration_s=duration):
                found.add(duration)
    return sorted(time for time in found if 0.0 < time < t_end)


def _refuse_without_jacobian(system: System, algorithm: Algorithm, method: Method) -> None:
    if system.scene.closures:
        raise NotImplementedError(f'method "{method}" runs trees, and the scene has closures: use "dop853" or "rk4"')
    if algorithm != "articulated":
        raise NotImplementedError(
            f'method "{method}" needs Jacobians, which algorithm "articulated" alone has: leave algorithm out, or use '
            'method "dop853" or "rk4"'
        )


def _sample_times(samples: int | Sequence[float] | Real, t_end: float) -> Real:
    if np.ndim(samples) == 0:
        number = arguments.whole("samples", samples)
        if number < 2:
            raise ValueError(f"samples is {number}: ask for at least 2 output times, the start and the end")
        if number > OUTPUT_BYTES // _SAMPLE_BYTES:
            raise ValueError(f"samples is {number}: {_TOO_MANY}")
        times = np.linspace(0.0, t_end, number)
        if np.all(np.diff(times) > 0.0):
            return times
        raise ValueError(f"samples is {number}: there are not so many numbers from 0 to t_end = {t_end:g} s")
    times = arguments.array("samples", samples)
    increasing = times.ndim == 1 and len(times) > 1 and bool(np.all(np.diff(times) > 0.0))
    if not (increasing and times[0] == 0.0 and times[-1] == t_end):
        raise ValueError(f"the output times must increase from 0 to t_end = {t_end:g} s: sort them and add both ends")
    return times.copy()


def _end(t_end: float) -> float:
    """Plain; whether a run can end there is for the scene's check to say."""
    try:
        return arguments.number("t_end", t_end)
    except ValueError:  # not finite
        return float(t_end) if isinstance(t_end, float) else np.inf


def _refuse_too_many(samples: int, system: System) -> None:
    """ValueError where the outputs would not fit into OUTPUT_BYTES."""
    most = OUTPUT_BYTES // sample_bytes(system)
    if samples > most:
        raise ValueError(f"samples is {samples}, and this scene allows {most}: {_TOO_MANY}")


def sample_bytes(system: System) -> int:
    """Memory that one output time of a run takes, at most."""
    scene = system.scene
    places = len(scene.hinges) + len(scene.wheels) + len(scene.closures) + len(scene.point_masses)
    numbers = system.nq + 2 * system.nu + 24 * len(scene.markers) + 6 * places + 11
    return _NUMBER_BYTES * numbers + _OBJECT_BYTES * (4 * len(scene.markers) + places) + _SAMPLE_BYTES


def _route(system: System, algorithm: Algorithm, stabilise: float) -> Route:
    if system.scene.closures:
        return Route(*cast("ClosedSystem", system).route(algorithm, stabilise))
    if stabilise != 0.0:
        raise ValueError(f"stabilise is {stabilise:g}, but the scene has no closures: leave it out")
    if algorithm == "articulated":
        return Route(lambda: (system.recursion_constants, system.recursion_workspace()))
    if algorithm == "composite":
        return Route(lambda: (system.constants, system.composite_workspace()), composite.rhs)
    if algorithm not in ERRATA:
        routes = [each for each in get_args(Algorithm) if each != "unsplit"]  # a reference for single states
        raise ValueError(f"algorithm is {algorithm!r}: runs use one of {', '.join(map(repr, routes))}")
    nested = system.nested(algorithm)
    return Route(lambda: (nested.constants, nested.workspace()), nested_evaluation.rhs)


def _integrate(system: System, route: Route, times: Real, settings: Settings) -> _Raw:
    """Run once over no time at all, which compiles, and then in earnest."""
    initial = system.initial_state
    ends = np.array([*switch_times(system.scene, times[-1]), times[-1]])

    def run(times: Real, ends: Real, call: Callable[..., tuple[Any, bool]]) -> _Raw:
        y, out = np.concatenate([initial.q, initial.u, [0.0]]), np.empty((len(times), system.nq + system.nu + 1))
        counts = np.zeros(COUNTS, np.int64)
        begun = perf_counter()
        solve = Integration(route, settings, system.constants, system.nq, system.nu)
        start = perf_counter()
        (status, t), interrupted = call(solve, (y, Clock(times, ends), out, counts), counts[STOP : STOP + 1])
        end = perf_counter()
        return _Raw(
            out[: counts[SAMPLES]], Status(status), solve.fault, t, counts.tolist(), end - begun, end - start,
            interrupted,
        )  # fmt: skip

    compiled = run(times[:1], ends[:0], lambda solve, arguments, _: (solve(*arguments), False))
    return run(times, ends, interruptible)._replace(compile_s=compiled.compile_s)


def _observed(system: System, times: Real, raw: _Raw, algorithm: Algorithm) -> Trajectory:
    """Evaluate everything observable at the samples reached."""
    start = perf_counter()
    status, stopped_at, seen = raw.status, raw.t, list[Evaluation]()
    message = _message(system, raw)
    for t, y in zip(times, raw.states, strict=False):
        try:
            seen.append(system.evaluate(t, y[: system.nq], y[system.nq : -1], algorithm))
        except NotFiniteError as error:  # squares overflow before the state does
            if status is Status.OK:
                status, stopped_at, message = Status.NONFINITE, float(t), f"stopped at t = {t:g} s: {error}"
            break
        except DynamicsError as error:  # fixed steps may have jumped over the place where the dynamics ends
            status, stopped_at, message = Status.NOT_POSITIVE_DEFINITE, float(t), f"stopped at t = {t:g} s: {error}"
            break
        except KeyboardInterrupt:
            status, stopped_at = Status.INTERRUPTED, float(t)
            message = f"stopped at t = {t:g} s, while outputs were evaluated: {status.advice}"
            break
    states = raw.states[: len(seen)]
    first = seen[0] if seen else None
    q_names, u_names = state_names(system)
    return Trajectory(
        scene=system.scene.name,
        status=status,
        message=message,
        stopped_at=stopped_at,
        t=times[: len(seen)],
        q=states[:, : system.nq],
        u=states[:, system.nq : -1],
        q_names=q_names,
        u_names=u_names,
        markers={marker.name: _marker_path(seen, marker.name) for marker in system.scene.markers},
        loads={name: np.array([e.loads[name] for e in seen]) for name in (first.loads if first else ())},
        wheel_loads={
            name: np.array([e.wheel_loads[name] for e in seen]) for name in (first.wheel_loads if first else ())
        },
        drives={name: np.array([e.drives[name] for e in seen]) for name in (first.drives if first else ())},
        energy={kind: np.array([e.energy[kind] for e in seen]) for kind in ENERGIES},
        momentum=np.array([e.momentum for e in seen]).reshape(-1, 6),
        work=states[:, -1],
        statistics=Statistics(
            evaluations=raw.counts[EVALUATIONS],
            accepted_steps=raw.counts[ACCEPTED],
            rejected_steps=raw.counts[REJECTED],
            jacobians=raw.counts[JACOBIANS],
            factorisations=raw.counts[FACTORISATIONS],
            compile_s=raw.compile_s,
            run_s=raw.run_s,
            output_s=perf_counter() - start,
        ),
    )


def _message(system: System, raw: _Raw) -> str:
    if raw.status is Status.OK:
        return f"finished at t = {raw.t:g} s"
    place = system.fault_name(raw.status, raw.fault)
    return f"stopped at t = {raw.t:g} s: " + raw.status.advice.format(body=f'"{place}"')


def _marker_path(seen: list[Evaluation], name: str) -> MarkerPath:
    motions = [evaluation.markers[name] for evaluation in seen]
    return MarkerPath(
        position=np.array([m.position for m in motions]).reshape(-1, 3),
        quaternion=_continuous_quaternions(np.array([m.rotation for m in motions]).reshape(-1, 3, 3)),
        velocity=np.array([m.velocity for m in motions]).reshape(-1, 6),
        acceleration=np.array([m.acceleration for m in motions]).reshape(-1, 6),
    )


def _continuous_quaternions(rotations: Real) -> Real:
    """Scalar-first quaternions of (T,3,3) rotations, each with the sign that is closer to the one before."""
    if not len(rotations):
        return np.empty((0, 4))
    quaternions = Rotation.from_matrix(rotations).as_quat(canonical=True, scalar_first=True)
    turns = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0
    return quaternions * np.cumprod(np.r_[1.0, np.where(turns, -1.0, 1.0)])[:, None]
