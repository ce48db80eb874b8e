"""A first pendulum

A bar hangs from a hinge and is let go at 60 degrees. The picture shows its angle and the force that the hinge
carries. After one period, which Jacobi's elliptic functions know, the bar is back where it was let go.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.special import ellipk

import flexmb as fm

# Bodies are joined by hinges, beginning at the ground. Units are SI, and gravity points down along -z.
mass, length, start = 2.0, 1.0, np.radians(60.0)
inertia = mass * length**2 / 12.0
scene = (
    fm.SceneBuilder("pendulum", gravity=(0.0, 0.0, -9.81))
    .rigid_body("bar", mass=mass, com=(0.0, 0.0, -0.5 * length), inertia=(inertia, inertia, 1e-3))
    .revolute("pivot", "ground", "bar", axis=(0.0, 1.0, 0.0), angle=start)
    .scene()
)

# The period of a swing of any size, by the complete elliptic integral; about the pivot the inertia is m L^2 / 3.
small = np.sqrt(1.5 * 9.81 / length)
period = 4.0 * ellipk(np.sin(0.5 * start) ** 2) / small
run = fm.simulate(scene, t_end=period, samples=401)

force = np.linalg.norm(run.loads["pivot"][:, 3:], axis=1)  # a load is [torque; force] on the bar, in World axes
figure, (upper, lower) = plt.subplots(2, sharex=True)
upper.plot(run.t, np.degrees(run.q[:, 0]))
upper.set(ylabel="angle (degrees)", title=f"Pendulum let go at 60 degrees: period {period:.4f} s")
lower.plot(run.t, force, color="C1", label="force in the hinge")
lower.axhline(mass * 9.81, color="k", lw=0.8, ls="--", label="weight of the bar")
lower.set(xlabel="time (s)", ylabel="force (N)")
lower.legend(loc="upper center")
figure.savefig("01_first_pendulum.svg")

# At the lowest point all of the fallen weight is motion, and the hinge carries the weight and the centripetal force.
lowest = mass * 9.81 * (1.0 + 1.5 * (1.0 - np.cos(start)))
assert abs(run.q[-1, 0] - start) < 1e-9
assert abs(force[100] - lowest) < 1e-7

print(f"period {period:.4f} s; the hinge carries up to {force.max():.2f} N; wrote 01_first_pendulum.svg")
