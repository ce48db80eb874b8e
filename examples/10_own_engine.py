"""Your own code as an engine

Any code can take part in crosscheck as an engine: a class that says which scenes it can represent, and answers at
named markers in World axes. Here a pendulum in thirty lines of SciPy, at four tolerances, is held against the finest
run of flexmb.
"""

from time import perf_counter

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp

import flexmb as fm
from crosscheck.engines.contract import Effort, Engine, MarkerPath, Run, Support, Trajectory
from crosscheck.engines.native import NativeEngine


class MyEngine:
    """One body that hangs from a hinge about y, with its marker at the mass centre."""

    name = "mine"

    def version(self):
        return "1.0"

    def supports(self, scene):
        known = len(scene.bodies) == 1 and isinstance(scene.hinges[0], fm.Revolute)
        return Support("exact") if known else Support("no", "this engine knows one body on one revolute hinge")

    def efforts(self, scene):
        return tuple(Effort("tolerance", value, "RK45") for value in (1e-3, 1e-5, 1e-7, 1e-9))

    def compile(self, scene):
        return MyModel(scene)


class MyModel:
    """The scene with what this code needs of it: length (m), squared rate of small swings (1/s^2), start (rad)."""

    def __init__(self, scene):
        (body,), (hinge,) = scene.bodies, scene.hinges
        self.length, self.start, self.marker = -body.com_m[2], hinge.rotation.angle_rad, scene.markers[0].name
        about_hinge = body.inertia_kg_m2[1][1] + body.mass_kg * self.length**2
        self.squared_rate = -scene.gravity_m_s2[2] * body.mass_kg * self.length / about_hinge

    def simulate(self, run, effort):
        def rate(t, y):
            return [y[1], -self.squared_rate * np.sin(y[0])]

        before, span, settings = perf_counter(), (0.0, run.times[-1]), {"rtol": effort.value, "atol": effort.value}
        angle, spin = solve_ivp(rate, span, (self.start, 0.0), effort.method, run.times, **settings).y
        wall, zero = perf_counter() - before, np.zeros_like(angle)
        arm = self.length * np.column_stack([-np.sin(angle), zero, -np.cos(angle)])
        turned = np.column_stack([np.cos(0.5 * angle), zero, np.sin(0.5 * angle), zero])  # a quaternion, scalar first
        turning = np.column_stack([zero, spin, zero])
        speeds = np.hstack([turning, np.cross(turning, arm)])  # [angular; linear]
        return Trajectory("finished", "", run.times, {self.marker: MarkerPath(arm, turned, speeds)}, wall_s=wall)


scene = (
    fm.SceneBuilder("pendulum", gravity=(0.0, 0.0, -9.81))
    .rigid_body("bob", mass=2.0, com=(0.0, 0.0, -0.5), inertia=(0.02, 0.02, 0.01))
    .revolute("pivot", "ground", "bob", axis=(0.0, 1.0, 0.0), angle=1.0)
    .marker("centre", "bob", offset=(0.0, 0.0, -0.5))
    .scene()
)
run = Run(np.linspace(0.0, 10.0, 201))
native = NativeEngine()
held = native.compile(scene).simulate(run, native.efforts(scene)[-1]).markers["centre"]

engine, apart = MyEngine(), {}
figure, axes = plt.subplots()
for effort in engine.efforts(scene):
    mine = engine.compile(scene).simulate(run, effort).markers["centre"]
    distance = np.linalg.norm(mine.position - held.position, axis=1)
    apart[effort.value] = distance.max()
    axes.semilogy(run.times[1:], distance[1:], label=f"rtol = {effort.value:.0e}")
axes.set(xlabel="time (s)", ylabel="distance of the markers (m)", title="SciPy's RK45, by tolerance, against flexmb")
axes.legend(ncols=4, loc="lower right", fontsize=8)
figure.savefig("10_own_engine.svg")

# Each tolerance is a hundredth of the one before, and so is nearly the distance: both codes solve the same equations.
assert isinstance(engine, Engine) and engine.supports(scene).kind == "exact"
distances = np.array(list(apart.values()))
assert distances[-1] < 1e-6 and np.all(distances[:-1] > 20.0 * distances[1:])

print(f"the codes are {distances[-1]:.1e} m apart at the tightest tolerance; wrote 10_own_engine.svg")
