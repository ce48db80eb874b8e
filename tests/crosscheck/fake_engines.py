"""Engines that are none: a planar pendulum integrated in a few lines, with the faults that engines have.

They know one scene: a rigid body on a revolute hinge to the ground, axis +-z, mass centre on the body's x axis.
"""

import math
import os
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

from crosscheck.engines.contract import (
    Effort,
    EngineMissing,
    MarkerPath,
    MarkerSnapshot,
    Run,
    Snapshot,
    Support,
    Trajectory,
)  # fmt: skip
from crosscheck.engines.extremes import has_extremes, of_samples
from flexmb.run.channels import channels_of
from flexmb.scene.schema import Scene
from flexmb.typing import Real

TOLERANCES = tuple(Effort(kind="tolerance", value=10.0**-n, method="dop853") for n in (6, 8, 10, 12))
STEPS = tuple(Effort(kind="step", value=0.05 / 2**n, method="rk4") for n in range(2, 6))
COARSE = tuple(Effort(kind="step", value=0.05 / 2**n, method="rk4") for n in range(3))


@dataclass
class Pendulum:
    """theta'' = -m g l sin(theta + phase) / I about the hinge; x = l cos, y = l sin of the angle from the x axis."""

    scene: Scene
    gravity_factor: float = 1.0

    def __post_init__(self) -> None:
        body, hinge = self.scene.bodies[0], self.scene.hinges[0]
        self.mass, self.arm = body.mass_kg, body.com_m[0]
        self.inertia = body.inertia_kg_m2[2][2] + self.mass * self.arm**2
        self.gravity = self.gravity_factor * self.scene.gravity_m_s2[1]
        self.sign = np.sign(hinge.axis[2])
        self.start = np.array([hinge.rotation.angle_rad, hinge.rotation.rate_rad_s]) * self.sign
        self.tips = {marker.name: body.nodes[0].position_m[0] for marker in self.scene.markers}

    def warm_up(self) -> None:
        pass

    def rate(self, t: float, y: Real) -> Real:
        return np.array([y[1], self.mass * self.gravity * self.arm * np.cos(y[0]) / self.inertia])

    def evaluate(self) -> Snapshot:
        start = self.trajectory(np.zeros(1), self.start[None], 0.0, 1)
        angle, speed = self.start
        turn = self.rate(0.0, self.start)[1]
        along, inwards = np.array([-np.sin(angle), np.cos(angle), 0.0]), -np.array([np.cos(angle), np.sin(angle), 0.0])
        markers = {
            name: MarkerSnapshot(
                *(part[0] for part in (path.position, path.quaternion, path.velocity)),
                np.array([0.0, 0.0, turn, *(self.tips[name] * (turn * along + speed**2 * inwards))]),
            )
            for name, path in start.markers.items()
        }
        loads = {name: load[0] for name, load in start.loads.items()}
        energy = {kind: float(values[0]) for kind, values in start.energy.items()}
        return Snapshot(markers, loads, {}, {}, energy, start.momentum[0])

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        pull = self.mass * self.gravity * self.arm / self.inertia
        states, count = solved(pull, tuple(self.start), tuple(run.times), effort)
        found = self.trajectory(run.times, states, 1e-3 if effort.kind == "tolerance" else 2e-3 / effort.value, count)
        return replace(found, envelope=self.extremes(run, effort)) if run.envelope else found

    def extremes(self, run: Run, effort: Effort) -> dict[str, Real]:
        """Those of 20 times as many samples and, as two integrations differ by rounding, of the run's own."""
        shorter = [np.linspace(a, b, 20, endpoint=False) for a, b in pairwise(run.times)]
        fine = self.simulate(Run(np.array([*np.concatenate(shorter), run.times[-1]])), effort)
        own, found = channels_of(self.simulate(Run(run.times), effort)), {}
        for name, values in channels_of(fine).items():
            if has_extremes(name):
                times, both = np.r_[fine.times, run.times], np.vstack([values, own[name]])
                found[name] = np.nan_to_num(of_samples(name, times, both), nan=1e-3)
        return found

    def trajectory(self, times: Real, states: Real, wall: float, evaluations: int) -> Trajectory:
        angle, speed = states.T
        zero = np.zeros_like(angle)
        out = np.column_stack([np.cos(angle), np.sin(angle), zero])
        along = np.column_stack([-np.sin(angle), np.cos(angle), zero])
        turn = np.column_stack([zero, zero, speed])
        acceleration = np.array([self.rate(0.0, state)[1] for state in states])
        com = self.arm * (acceleration[:, None] * along - speed[:, None] ** 2 * out)
        force = self.mass * (com - np.array([0.0, self.gravity, 0.0]))
        quaternion = np.column_stack([np.cos(angle / 2), zero, zero, np.sin(angle / 2)])
        return Trajectory(
            status="finished",
            message="",
            times=times,
            markers={
                name: MarkerPath(length * out, quaternion, np.hstack([turn, length * speed[:, None] * along]))
                for name, length in self.tips.items()
            },
            loads={self.scene.hinges[0].name: np.hstack([np.zeros_like(force), force])},
            energy={
                "kinetic": 0.5 * self.inertia * speed**2,
                "gravity": -self.mass * self.gravity * self.arm * np.sin(angle),
            },
            momentum=np.hstack([self.inertia * turn, self.mass * self.arm * speed[:, None] * along]),
            wall_s=wall,
            evaluations=evaluations,
        )


@lru_cache(maxsize=256)
def solved(pull: float, start: tuple[float, ...], times: tuple[float, ...], effort: Effort) -> tuple[Real, int]:
    """States (T, 2) of theta'' = pull cos(theta) and evaluations; kept: hundreds of tests ask for the same runs."""
    if effort.kind == "step":
        return rk4(pull, start, times, effort.value)
    solution = solve_ivp(
        lambda t, y: (y[1], pull * math.cos(y[0])), (0.0, times[-1]), start, "DOP853", times,
        rtol=effort.value, atol=effort.value * 1e-2,
    )  # fmt: skip
    return solution.y.T, solution.nfev


def rk4(pull: float, start: tuple[float, ...], times: tuple[float, ...], step: float) -> tuple[Real, int]:
    """Classical Runge-Kutta with the step cut to reach every sample time; states (T, 2) and evaluations."""
    states, count = [start], 0
    for begin, end in pairwise(times):
        n = max(round((end - begin) / step), 1)
        h, (angle, speed) = (end - begin) / n, states[-1]
        for _ in range(n):
            a1 = pull * math.cos(angle)
            a2 = pull * math.cos(angle + h / 2 * speed)
            a3 = pull * math.cos(angle + h / 2 * (speed + h / 2 * a1))
            a4 = pull * math.cos(angle + h * (speed + h / 2 * a2))
            angle += h * (speed + h / 6 * (a1 + a2 + a3))
            speed += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        states.append((angle, speed))
        count += 4 * n
    return np.array(states), count


@dataclass
class Fake:
    """A sound engine; the others differ in one respect each."""

    name: str
    ladder: tuple[Effort, ...] = TOLERANCES
    gravity_factor: float = 1.0

    def version(self) -> str:
        return "1.0"

    def supports(self, scene: Scene) -> Support:
        return Support("exact")

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        return self.ladder

    def compile(self, scene: Scene) -> Pendulum:
        return Pendulum(scene, self.gravity_factor)


class Absent(Fake):
    """Its library is not installed."""

    def version(self) -> str:
        raise EngineMissing("the library is not installed; install the extra `absent`")


class Refuser(Fake):
    """Cannot represent the scene."""

    def supports(self, scene: Scene) -> Support:
        return Support("no", "revolute hinges are beyond it")


class Crasher(Fake):
    """Dies with its process."""

    def compile(self, scene: Scene) -> Pendulum:
        os._exit(139)


class Raiser(Fake):
    """Raises in the middle of a run."""

    def compile(self, scene: Scene) -> Pendulum:
        raise RuntimeError("the solver gave up on purpose")


class DivergingPendulum(Pendulum):
    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        half = Run(run.times[: max(2, len(run.times) // 2)])
        good = super().simulate(half, effort)
        return Trajectory("diverged", "the step fell below 1e-12 s", good.times, good.markers, energy=good.energy)


class Diverger(Fake):
    """Keeps the good half of its run and says that it diverged."""

    def compile(self, scene: Scene) -> Pendulum:
        return DivergingPendulum(scene)


class LoudPendulum(Pendulum):
    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        with open(os.environ["FAKE_ENGINE_DIARY"], "a", encoding="utf-8") as diary:
            diary.write(f"{effort.label}\n")
        return super().simulate(run, effort)


class Diarist(Fake):
    """Writes down every run in the file named by FAKE_ENGINE_DIARY."""

    def compile(self, scene: Scene) -> Pendulum:
        return LoudPendulum(scene)


def engines() -> dict[str, Fake]:
    """All of them, by name."""
    return {
        engine.name: engine
        for engine in (
            Fake("fine"), Fake("stepper", STEPS), Fake("sloppy", COARSE), Fake("second"),
            Fake("biased", gravity_factor=1.001), Absent("absent"), Refuser("refuser"), Crasher("crasher"),
            Raiser("raiser"), Diverger("diverger"), Diarist("diarist"),
        )  # fmt: skip
    }
