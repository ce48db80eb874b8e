"""The native adapters: flexmb itself behind the engine contract. Conventions already agree; nothing is converted.

`native` is the O(N) recursion. `native-composite` forms the mass matrix by composite bodies: another solution of the
same equations, closed chains included. `native-frisch` uses the corrected nested-body equations of Frisch (1975), and
`native-frisch-as-printed` the same with the errors of the print: other equations for accelerations, loads and drives on
the same kinematics. They are of first order in the deformation, which is level `linear`.

`native-radau5`, `native-exponential` and `native-generalised-alpha` are `native` with integrators for stiff scenes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from typing import get_args

import numpy as np
from msgspec import structs

from crosscheck.engines.contract import (
    LINEAR,
    OUTPUTS,
    USUAL_S,
    Effort,
    MarkerPath,
    MarkerSnapshot,
    Run,
    Snapshot,
    Status,
    Support,
    Trajectory,
)
from crosscheck.engines.extremes import ROWS, has_extremes
from crosscheck.engines.native_linear import linear_outputs
from crosscheck.engines.openness import LOAD_PARTS, Openness
from crosscheck.engines.pace import fastest_mode, pace
from crosscheck.engines.steps import ladder
from crosscheck.engines.trajectories import first_samples
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.integrate.integrator import Method
from flexmb.kept import kept
from flexmb.modal.flexible import flexible_model
from flexmb.run.channels import channels_of, is_vector
from flexmb.run.envelope import Envelope, Extremes
from flexmb.run.operations import of_evaluation, of_run
from flexmb.run.simulate import RunSettings, refuse_without_jacobian, simulate
from flexmb.run.trajectory import Trajectory as NativeTrajectory
from flexmb.scene.events import EndRun
from flexmb.scene.schema import BeamBody, ModalBody, Scene
from flexmb.system.algorithm import Algorithm
from flexmb.system.algorithms import ALGORITHMS
from flexmb.system.compile import compile
from flexmb.system.system import System
from flexmb.system.watches import WAIVERS
from flexmb.typing import Flags, Real

_TOLERANCES = (1e-6, 1e-8, 1e-10, 1e-12)
_RUNGS = 4  # of steps
_ABSOLUTE = 1e-2  # atol over rtol: modal coordinates and small rates are of the order of hundredths


class NativeEngine:
    """flexmb with one of its algorithms, at the levels the scene asks for, and one of its integrators."""

    settings = (
        "flexmb's integrator in one compiled loop with its compiled equations of motion, on one thread. Workers use "
        "general kernels, which serve all scenes, unless FLEXMB_KERNELS says otherwise; kernels made for one scene are "
        "faster. Compiling is not timed, and outputs are computed after the timed solve."
    )

    takes = ("connectors", "couplings", "controllers", "events", "friction that sticks", "total_loads", "t_start")
    methods = get_args(Method)

    def __init__(
        self,
        name: str = "native",
        algorithm: Algorithm = "articulated",
        summary: str = "flexmb: the O(N) recursion",
        method: Method = "dop853",
    ) -> None:
        self.name = name
        self.summary = summary
        self._algorithm: Algorithm = algorithm
        self._method: Method = method
        self._supported: tuple[Scene, NativeModel] | None = None  # made by `supports`, reused by `compile`

    @property
    def algorithm(self) -> Algorithm:
        """Its algorithm, for timing reports."""
        return self._algorithm

    def version(self) -> str:
        try:
            return version("flexmb")
        except PackageNotFoundError:  # a source tree that is on the path but not installed
            return "source"

    def supports(self, scene: Scene) -> Support:
        try:
            self._supported = scene, self._made(scene)
        except (ValueError, NotImplementedError) as error:  # a faulty scene among the former
            return Support("no", str(error))
        reason = _approximation(scene, self._algorithm)
        return Support("surrogate", reason) if reason else Support("exact")

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        return self.efforts_for(scene, USUAL_S)

    def efforts_for(self, scene: Scene, duration_s: float) -> tuple[Effort, ...]:
        """A ladder of tolerances for adaptive methods, of steps for others."""
        if INTEGRATORS[self._method].fixed:
            read = self._prepared(scene).scene
            return ladder(self._method, pace(read, duration_s, _fastest_mode(read)), duration_s, _RUNGS)
        return tuple(Effort("tolerance", value, self._method) for value in _TOLERANCES)

    def compile(self, scene: Scene) -> NativeModel:
        """ValueError if the printed equations do not apply (modes not clamped at the hinge), ClosureError for loops
        that cannot be closed, NotImplementedError if an algorithm or method has no loops."""
        model = self._prepared(scene)
        self._supported = None
        return model

    def _prepared(self, scene: Scene) -> NativeModel:
        """The model that `supports` made, or a new one."""
        before = self._supported
        return before[1] if before is not None and before[0] is scene else self._made(scene)

    def _made(self, scene: Scene) -> NativeModel:
        system = compile(structs.replace(scene, allow=(*scene.allow, *WAIVERS)))  # levels are what cases compare
        system.route(self._algorithm)
        if INTEGRATORS[self._method].linearises:
            refuse_without_jacobian(system, self._algorithm, self._method)
        for event in scene.events:
            if any(isinstance(action, EndRun) for action in event.actions):
                raise NotImplementedError(f'event "{event.name}" ends the run, and engines are asked for all samples')
        return NativeModel(system, self._algorithm, self._method)


composite = partial(NativeEngine, "native-composite", "composite", "flexmb: mass matrix by composite bodies, Cholesky")
frisch = partial(NativeEngine, "native-frisch", "frisch", "flexmb: Frisch's equations of 1975, first order")
frisch_as_printed = partial(
    NativeEngine, "native-frisch-as-printed", "frisch_as_printed", "flexmb: the same as printed, errors included"
)
radau5 = partial(NativeEngine, "native-radau5", "articulated", "flexmb, integrated by Radau IIA of order 5", "radau5")
exponential = partial(
    NativeEngine, "native-exponential", "articulated", "flexmb, integrated by exponential collocation", "exponential"
)
generalised_alpha = partial(  # spectral radius 0.8
    NativeEngine, "native-generalised-alpha", "articulated", "flexmb, integrated by generalised-alpha",
    "generalised_alpha",
)  # fmt: skip


class NativeModel:
    """A compiled system with the algorithm that runs it, and the integrator its efforts name."""

    def __init__(self, system: System, algorithm: Algorithm, method: Method = "dop853") -> None:
        self._system = system
        self._algorithm: Algorithm = algorithm
        self._method: Method = method

    @property
    def scene(self) -> Scene:
        """The scene with its SID bodies read."""
        return self._system.scene

    @kept
    def _each(self) -> int:
        """Floating-point operations of an evaluation; the first run, which is `warm_up`, counts them."""
        return of_evaluation(self._system, self._algorithm)

    def warm_up(self) -> None:
        """Compile or load what a run needs: the integrator, by a run over next to no time, and the outputs."""
        effort = Effort("step" if INTEGRATORS[self._method].fixed else "tolerance", 1e-3, self._method)
        self.simulate(Run(np.array([0.0, 1e-6])), effort)

    def evaluate(self) -> Snapshot:
        state = self._system.initial_state
        seen = self._system.evaluate(0.0, state.q, state.u, self._algorithm)
        return Snapshot(
            markers={
                name: MarkerSnapshot(m.position, m.quaternion, m.velocity, m.acceleration)
                for name, m in seen.markers.items()
            },
            loads=seen.loads,
            wheel_loads=seen.wheel_loads,
            drives=seen.drives,
            energy=seen.energy,
            momentum=seen.momentum,
            connectors=seen.connectors,
            hinge_forces=seen.hinge_forces,
            total_loads={
                total.name: self._system.total_load(state, total.joints, total.body, about=(total.body, total.node))
                for total in self.scene.total_loads
            },
        )

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        """The method is the effort's; of a tolerance, atol is a hundredth."""
        accuracy: RunSettings = (
            {"rtol": effort.value, "atol": _ABSOLUTE * effort.value}
            if effort.kind == "tolerance"
            else {"step": effort.value}
        )
        done = simulate(
            self._system,
            float(run.times[-1]),
            effort.method,  # type: ignore[arg-type]  # simulate refuses what is none
            t_start=run.t_start,
            samples=run.times,
            algorithm=self._algorithm,
            **accuracy,
        )
        trajectory = Trajectory(
            status=_status(done, run.t_start),
            message="" if done.finished else done.message,
            times=done.t,
            markers={
                name: MarkerPath(path.position, path.quaternion, path.velocity) for name, path in done.markers.items()
            },
            **{name: getattr(done, name) for name in OUTPUTS if name not in LINEAR},
            wall_s=done.statistics.run_s,
            evaluations=done.statistics.evaluations,
            steps=done.statistics.accepted_steps + done.statistics.rejected_steps,
            operations=int(of_run(effort.method, self._each, self._system.nq + self._system.nu + 1, done.statistics)),
            undetermined=Openness.of_flags(_undetermined(done)).names,
            events=tuple((event.name, event.t) for event in done.events),
        )
        trajectory = first_samples(
            trajectory, int(np.isin(done.t, run.times).sum())
        )  # Zeno events end a run between samples
        states = (done.state_at(sample) for sample in range(len(trajectory.times)))
        asked = linear_outputs(self._system, self._algorithm, states, run.linear)
        extremes = _extremes(done.envelope, trajectory) if run.envelope and trajectory.status == "finished" else {}
        return replace(trajectory, envelope=extremes, **asked.as_outputs)


def _extremes(envelope: Envelope, run: Trajectory) -> dict[str, Real]:
    """The envelope by channel, as rows of `crosscheck.engines.extremes`: channels cut it as they cut samples."""

    def rows(parts: Extremes) -> Real:
        return np.array([parts.least, parts.t_least, parts.greatest, parts.t_greatest, parts.error])

    def of(parts: dict[str, Extremes]) -> dict[str, Real]:
        return {name: rows(found) for name, found in parts.items()}

    nothing = np.zeros((ROWS, 4))
    places, speeds, energy = of(envelope.positions), of(envelope.velocities), of(envelope.energy)
    seen = Trajectory(
        status="finished", message="", times=np.zeros(ROWS),
        markers={name: MarkerPath(place, nothing, speeds[name]) for name, place in places.items()},
        loads=of(envelope.loads), wheel_loads=of(envelope.wheel_loads), drives=of(envelope.drives),
        connectors=of(envelope.connectors), hinge_forces=of(envelope.hinge_forces),
        total_loads=of(envelope.total_loads),
        energy={kind: found[:, 0] for kind, found in energy.items()}, momentum=rows(envelope.momentum),
    )  # fmt: skip
    channels = channels_of(seen) | ({"energy.total": energy["total"]} if run.energy else {})
    is_open = Openness.of(run.undetermined)
    return {
        name: np.hstack([values, *([rows(envelope.magnitudes[name])] if is_vector(name) else [])])
        for name, values in channels.items()
        if has_extremes(name) and name not in is_open
    }


def _undetermined(done: NativeTrajectory) -> Iterator[tuple[str, Flags]]:
    """Channels of loads and drives with flags of their open components."""
    for name, is_open in done.undetermined.items():
        if name.endswith(".drive") and name not in done.loads | done.total_loads:
            yield f"drive:{name.removesuffix('.drive')}", is_open
        else:
            kind = "total_load" if name in done.total_loads else "load"
            yield from ((f"{kind}:{name}.{part}", is_open[place]) for part, place in LOAD_PARTS.items())


def _approximation(scene: Scene, algorithm: Algorithm) -> str:
    """How an algorithm approximates the scene's levels, "" if it is exact."""
    flexible = [body for body in scene.bodies if body.level != "rigid"]
    full = [f'"{body.name}"' for body in flexible if body.level == "full"]
    first_order = f'level "full" of {", ".join(full)} to first order in the modal coordinates' if full else ""
    declared = ALGORITHMS[algorithm]
    if not declared.is_first_order:
        return ""
    errors = "the print's errors included" if declared.errata and flexible else ""
    return "; ".join(part for part in (first_order, errors) if part)


def _fastest_mode(scene: Scene) -> float:
    """Of all flexible bodies (rad/s)."""
    models = [
        flexible_model(body)
        for body in scene.bodies
        if isinstance(body, BeamBody | ModalBody) and body.level != "rigid"
    ]
    return max(
        (
            fastest_mode(model.mass, model.translation, model.inertia, model.rotation, model.stiffness)
            for model in models
        ),
        default=0.0,
    )


def _status(done: NativeTrajectory, t_start: float) -> Status:
    """A run that stopped at its initial state has failed; one that stopped later has diverged."""
    if done.finished:
        return "finished"
    return "diverged" if done.stopped_at > t_start else "failed"
