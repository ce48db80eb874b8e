"""Step against the highest modal frequency, one map for each integrator: a slow and a fast spring, undamped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import msgspec
import numpy as np

from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.registry import engine
from crosscheck.stability.map import Axis, Measurement, Overlay, StabilityMap
from flexmb.integrate.integrator import Method as MethodName
from flexmb.run.simulate import simulate
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import InertiaPoint, ModalNode, Scene
from flexmb.tables.status import Status
from flexmb.typing import Real

STEPS, PARTS = 4096, 64  # of a run: at least 1000 periods if step x frequency is at least 1.54
GROWTH = 2e-5  # of the amplitude's logarithm in a step; beats of a bounded motion stay below a hundredth of it
SLOW = 1.0  # rad/s
START = 1e-3  # m
UNLIMITED, NEVER = np.inf, 0.0
IMAGINARY_RK4 = 2.0 * np.sqrt(2.0)  # |R(iz)|^2 = 1 - z^6/72 + z^8/576 passes 1 there

Signals = tuple[Real, Real, str]  # displacement and velocity of the fast mass (T,), why the run ended early


@dataclass(frozen=True)
class Stepper:
    """An integrator of an engine; `limit` is the largest stable step x frequency of an undamped motion."""

    engine: str
    name: str
    limit: float
    source: str
    scene: Callable[[float, float], Scene]

    @property
    def key(self) -> str:
        return f"integrator_{self.engine}_{self.name}".lower().replace("-", "_")

    def run(self, scene: Scene, step: float, steps: int) -> Signals:
        """The fast mass at `PARTS` equal parts of a run of `steps` steps."""
        times = step * steps / PARTS * np.arange(PARTS + 1)
        if self.engine == "flexmb":
            done = simulate(scene, times[-1], self.name, step=step, samples=times)  # type: ignore[arg-type]
            why = "" if done.finished else Status(done.status).name
            path, finished = done.markers["fast"], done.finished
            return path.position[:, 0], path.velocity[:, 3], "" if finished else why
        other = engine(self.engine)
        other.version()  # raises EngineMissing
        trajectory = other.compile(scene).simulate(Run(times), Effort("step", step, self.name))
        path = trajectory.markers["fast"]
        return path.position[:, 0], path.velocity[:, 3], "" if trajectory.status == "finished" else trajectory.message


def slides(step: float, frequency: float) -> Scene:
    """Two unit masses on slides, with springs of the slow and of the fast frequency."""
    builder = SceneBuilder("a slow and a fast spring")
    for name, omega in (("slow", SLOW), ("fast", frequency)):
        builder.rigid_body(name, mass=1.0, inertia=(1.0, 1.0, 1.0))
        builder.prismatic(f"{name} slide", "ground", name, axis=(1, 0, 0), position=START, stiffness=omega**2)
        builder.marker(name, name)
    return builder.scene()


def breathing_body(step: float, frequency: float) -> Scene:
    """A free body of two pairs of half a kilogram that swing against each other: a slow and a fast mode of mass 1."""
    places = np.array([(0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)])
    modes = [(place, np.zeros(3)) if k < 2 else (np.zeros(3), place) for k, place in enumerate(places)]
    points = [
        InertiaPoint(mass_kg=0.5, position_m=_triple(place), translation_modes=tuple(map(_triple, shapes)))
        for place, shapes in zip(places, modes, strict=True)
    ]
    still = ((0.0, 0.0, 0.0),) * 2
    origin = ModalNode(name="origin", position_m=still[0], translation_modes=still, rotation_modes=still)
    end = msgspec.structs.replace(origin, name="end", translation_modes=tuple(map(_triple, modes[2])))
    stiffness = np.diag([SLOW**2, frequency**2])
    return (
        SceneBuilder("a free body that breathes")
        .modal_body("body", points=points, stiffness=stiffness, boundary="free-free", nodes=[origin, end])
        .free("base", "ground", "body")
        .modal_state("body", coordinates=(START, START))
        .marker("fast", "body", node="end")
        .scene()
    )


def growth(signals: Signals, frequency: float, steps: int) -> Measurement:
    """Growth of the logarithm of the amplitude in a step, from the largest amplitudes of the two halves of a run."""
    x, v, why = signals
    if why:
        return Measurement(status="failed", message=why)
    amplitude = np.hypot(x, v / frequency)
    halves = np.max(amplitude[: PARTS // 2]), np.max(amplitude[PARTS // 2 :])
    return Measurement(float(np.log(halves[1] / halves[0]) / (steps / 2)) if halves[1] > 0.0 else -1.0)


def step_map(method: Stepper) -> StabilityMap:
    """The map of one integrator."""

    def measure(scene: Scene, step: float, frequency: float) -> Measurement:
        return growth(method.run(scene, step, STEPS), frequency, STEPS)

    limit = "no step is stable" if method.limit == NEVER else "every step is stable"
    if method.limit not in (NEVER, UNLIMITED):
        limit = f"step x frequency = {method.limit:.4g}"

    def excess(step: Real, frequency: Real) -> Real:
        return np.asarray(np.clip(step * frequency, 1e-300, 1e300) / np.clip(method.limit, 1e-300, 1e290) - 1.0)

    return StabilityMap(
        name=method.key,
        title=f"{method.name} of {method.engine}: step against the highest frequency",
        quantity="growth of the amplitude in a step",
        scene=method.scene,
        measure=measure,
        x=Axis("step", "s", 1e-3, 1e-1, 8, log=True),
        y=Axis("highest modal frequency", "rad/s", 10.0, 1000.0, 8, log=True),
        thresholds=(GROWTH,),
        overlay=Overlay(limit, method.source, excess),
        shows=f"Steps with which {method.name} of {method.engine} keeps an undamped mode bounded.",
        depth=3 if method.limit not in (NEVER, UNLIMITED) else 1,
        failure=1,
    )


def _triple(values: Real) -> tuple[float, float, float]:
    return (float(values[0]), float(values[1]), float(values[2]))


HAIRER = "Hairer, Wanner, Solving Ordinary Differential Equations II, IV.2: the imaginary axis"
SYMPLECTIC = "semi-implicit Euler: Hairer, Lubich, Wanner, Geometric Numerical Integration, I.1"
CHUNG = "Chung, Hulbert 1993: unconditionally stable"
METHODS = (
    Stepper("flexmb", "rk4", IMAGINARY_RK4, HAIRER, slides),
    Stepper("flexmb", "generalised_alpha", UNLIMITED, CHUNG, slides),
    Stepper("mujoco", "RK4", IMAGINARY_RK4, HAIRER, slides),
    Stepper("mujoco", "Euler", 2.0, SYMPLECTIC, slides),
    Stepper("mujoco", "implicit", 2.0, "MuJoCo documentation, Computation: implicit in velocities only", slides),
    Stepper("exudyn", "GeneralizedAlpha", UNLIMITED, CHUNG, slides),
    Stepper("exudyn", "TrapezoidalIndex2", UNLIMITED, "the trapezoidal rule is A-stable (Dahlquist 1963)", slides),
    Stepper("exudyn", "RK44", IMAGINARY_RK4, HAIRER, breathing_body),
    Stepper("exudyn", "ExplicitEuler", NEVER, HAIRER + ", of which Euler's method has only the origin", breathing_body),
)


# ---- Methods with error control: the tolerance replaces the step

PERIODS = 1000
BOUNDED = 2.0  # times the start
ADAPTIVE: dict[MethodName, str] = {
    "dop853": "the error control keeps h omega inside the stability region: Hairer, Wanner II, IV.2",
    "radau5": "L-stable: Hairer, Wanner II, IV.5",
    "exponential": "exact for linear motion: Hochbruck, Ostermann 2010",
}


def tolerance_map(name: MethodName, source: str) -> StabilityMap:
    """The map of one method with error control."""

    def measure(scene: Scene, tolerance: float, frequency: float) -> Measurement:
        span = PERIODS * 2.0 * np.pi / frequency
        times = np.linspace(0.0, span, 257)
        done = simulate(scene, span, name, rtol=tolerance, atol=0.01 * tolerance * START, samples=times)
        if not done.finished:
            unfinished = done.status is Status.MAX_STEPS
            return Measurement(status="did not finish" if unfinished else "failed", message=done.message)
        path = done.markers["fast"]
        return Measurement(float(np.max(np.hypot(path.position[:, 0], path.velocity[:, 3] / frequency)) / START))

    return StabilityMap(
        name=f"integrator_flexmb_{name}",
        title=f"{name} of flexmb: tolerance against the highest frequency",
        quantity="largest amplitude over the start's in 1000 periods",
        scene=slides,
        measure=measure,
        x=Axis("relative tolerance", "", 1e-7, 1e-3, 4, log=True),
        y=Axis("highest modal frequency", "rad/s", 10.0, 1000.0, 4, log=True),
        thresholds=(BOUNDED,),
        overlay=Overlay("every tolerance is stable", source, lambda tolerance, frequency: -np.ones_like(tolerance)),
        shows=f"{name} with error control keeps an undamped mode bounded, however loose the tolerance.",
        depth=1,
    )


MAPS = (*map(step_map, METHODS), *(tolerance_map(name, source) for name, source in ADAPTIVE.items()))
