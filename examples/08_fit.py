"""Fitting a model to a measurement

A pendulum was filmed, thirty times a second, so that its angle is known to about half a degree. Least squares find
its damping and its mass centre, with their standard errors.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import least_squares

import flexmb as fm

scene = (
    fm.SceneBuilder("pendulum", gravity=(0.0, 0.0, -9.81))
    .rigid_body("bob", mass=1.5, com=(0.0, 0.0, -0.4), inertia=(0.02, 0.02, 0.01))
    .revolute("pivot", "ground", "bob", axis=(0.0, 1.0, 0.0), angle=0.9, damping=0.1)
    .scene()
)
times = np.arange(0.0, 6.0, 1.0 / 30.0)


def angle(values):
    """The angle (rad) with a damping (N m s/rad) and a depth of the mass centre (m)."""
    damping, depth = values
    changed = scene.with_values({"pivot.rotation.damping_Nms_rad": damping, "bob.com_m": (0.0, 0.0, -depth)})
    return fm.simulate(changed, t_end=times[-1], samples=times, rtol=1e-8, atol=1e-10).q[:, 0]


# The measurement of this example is a run with noise. Its seed is fixed, so that everybody sees the same picture.
truth, noise = np.array([0.06, 0.35]), np.radians(0.5)
measured = angle(truth) + noise * np.random.default_rng(7).normal(size=len(times))

fit = least_squares(lambda values: (angle(values) - measured) / noise, x0=(0.1, 0.4), x_scale=(0.1, 0.1))
error = np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))
for name, value, doubt in zip(("damping (N m s/rad)", "depth (m)"), fit.x, error, strict=True):
    print(f"{name}: {value:.4f} +- {doubt:.4f}")

figure, (upper, lower) = plt.subplots(2, sharex=True, height_ratios=(3, 1))
upper.plot(times, np.degrees(measured), ".", ms=4, color="0.6", label="measured")
upper.plot(times, np.degrees(angle((0.1, 0.4))), "C1--", lw=1.0, label="first guess")
upper.plot(times, np.degrees(angle(fit.x)), "C0", label="fitted")
upper.set(ylabel="angle (degrees)", title="Damping and mass centre of a pendulum, fitted to its motion")
upper.legend(loc="upper right", ncols=3)
lower.plot(times, np.degrees(angle(fit.x) - measured), ".", ms=3, color="C3")
lower.set(xlabel="time (s)", ylabel="residual\n(degrees)")
figure.savefig("08_fit.svg")

# Both values are within three standard errors of the truth, and the sum of squares is that of the noise (chi-squared).
assert np.all(np.abs(fit.x - truth) < 3.0 * error)
assert abs(2.0 * fit.cost - len(times)) < 3.0 * np.sqrt(2.0 * len(times))

print("wrote 08_fit.svg")
