"""Six thousand double pendulums

A double pendulum is let go from rest at every pair of angles. All runs are one batch, eight at a time in the vector
lanes of the processor. The colour says when either rod first turns over; inside the black line there is not enough
energy for that.
"""

import matplotlib.pyplot as plt
import numpy as np

import flexmb as fm

rod = {"mass": 1.0, "com": (0.0, 0.0, -0.5), "inertia": (1 / 12, 1 / 12, 1e-3)}
scene = (
    fm.SceneBuilder("double pendulum", gravity=(0.0, 0.0, -9.81))
    .rigid_body("upper", **rod)
    .rigid_body("lower", **rod)
    .revolute("shoulder", "ground", "upper", axis=(0.0, 1.0, 0.0))
    .revolute("elbow", "upper", "lower", axis=(0.0, 1.0, 0.0), parent_position=(0.0, 0.0, -1.0))
    .scene()
)

count = 80
angles = np.pi * (2.0 * np.arange(count) + 1.0 - count) / count  # from -180 to 180 degrees, in symmetric steps
upper, lower = (each.ravel() for each in np.meshgrid(angles, angles))
start = np.column_stack([upper, lower - upper])  # the angle of the elbow is relative to the upper rod
runs = fm.simulate_batch(fm.compile(scene), 10.0, "rk4", q=start, samples=201, step=0.01)

absolute = np.cumsum(runs.q, axis=2)  # of both rods from the vertical
turned = np.any(np.abs(absolute) > np.pi, axis=2)
first = np.where(turned.any(axis=1), runs.t[turned.argmax(axis=1)], np.nan)

figure, axes = plt.subplots(figsize=(6.0, 4.8))
grid, shape = np.degrees(angles), (count, count)
image = axes.pcolormesh(grid, grid, first.reshape(shape), cmap="viridis_r", rasterized=True)
depth = 3.0 * np.cos(upper) + np.cos(lower)  # of both mass centres, twice their sum over the length of a rod
axes.contour(grid, grid, depth.reshape(shape), levels=[2.0], colors="k", linewidths=1.0)
figure.colorbar(image, label="first turn-over (s); white: none in 10 s")
axes.set(xlabel="angle of the upper rod (degrees)", ylabel="angle of the lower rod (degrees)", aspect="equal")
axes.set(title="When a double pendulum turns over", xticks=range(-180, 181, 90), yticks=range(-180, 181, 90))
axes.grid(False)
figure.savefig("09_batch.svg", dpi=120)

# The cheapest way to turn over is the lower rod upright on the hanging upper one: there the depth is 2.
assert np.all(np.isnan(first[depth > 2.0]))

# Starts that are mirror images move as mirror images, to the last bit, although the motion is chaotic.
assert np.array_equal(first, first[::-1], equal_nan=True)

print(f"{np.isfinite(first).sum()} of {count**2} pendulums turn over within 10 s; wrote 09_batch.svg")
