"""A stability map: a pendulum on its head

A pendulum whose pivot is shaken up and down can stand upright, and a hanging one can become unstable. Each cell of
the map is a pendulum of its own, two runs of a period each in a batch. The lines are the characteristic values of
Mathieu's equation.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.special import mathieu_a, mathieu_b

import flexmb as fm

# The pivot moves by r sin(2 t). In Mathieu's equation x'' + (a - 2 q cos 2 t) x = 0, a is gravity over length and q is
# 2 r over length; the length is 1 m. Where a is negative gravity points up, which is a pendulum on its head.
pendulum = (
    fm.SceneBuilder("shaken pendulum", gravity=(0.0, 0.0, -1.0))
    .rigid_body("pivot", mass=1.0, inertia=(1.0, 1.0, 1.0))
    .rigid_body("bob", mass=1.0, com=(0.0, 0.0, -1.0), inertia=(1e-12, 1e-12, 1e-12))
    .prismatic("shaker", "ground", "pivot", prescribed=fm.Sine(amplitude=1.0, angular_frequency_rad_s=2.0))
    .revolute("hinge", "pivot", "bob", axis=(0.0, 1.0, 0.0))
    .scene()
)
across, up = np.linspace(-1.0, 5.0, 37), np.linspace(0.05, 3.0, 18)
a, q = (each.ravel() for each in np.meshgrid(across, up))
scenes = [
    pendulum.with_values({"gravity_m_s2": (0, 0, -x), "shaker.translation.prescribed_m.amplitude": 0.5 * y})
    for x, y in zip(a, q, strict=True)
]

# Two small starts, one of the angle and one of its rate, give the matrix by which a period multiplies the motion. Its
# determinant is one: the motion is bounded where the trace is less than two.
batch, small = fm.compile_batch(scenes), 1e-6
angle = batch.systems[0].coordinate("hinge").start
trace = np.zeros(len(scenes))
for number in range(2):
    start = list(batch.initial_states())
    start[number][:, angle] = small
    run = fm.simulate_batch(batch, np.pi, "rk4", q=start[0], u=start[1], samples=2, step=np.pi / 200.0)
    trace += (run.q, run.u)[number][:, -1, angle] / small
stable = np.abs(trace) < 2.0

figure, axes = plt.subplots()
axes.pcolormesh(across, up, stable.reshape(len(up), -1), cmap="Blues", vmax=1.6, rasterized=True)
fine = np.linspace(0.0, 3.0, 200)
lines = [line(order, fine) for line, orders in ((mathieu_a, (0, 1, 2)), (mathieu_b, (1, 2))) for order in orders]
for line in lines:
    axes.plot(line, fine, "k", lw=1.0)
axes.axvline(0.0, color="k", ls=":", lw=0.8)
axes.annotate("upright", (-0.9, 2.8)), axes.annotate("hanging", (0.1, 2.8))
axes.set(xlabel="gravity over length, a", ylabel="shaking, q", xlim=(-1, 5), ylim=(0.05, 3))
axes.set(title="Where a shaken pendulum stays (blue), and Mathieu's boundaries (lines)")
axes.grid(False)
figure.savefig("13_stability_map.svg", dpi=100)

# Between a_0 and b_1, a_1 and b_2, a_2 and b_3 the motion is bounded, elsewhere it grows: in every point of the map.
bounded = [(mathieu_a(n, q) < a) & (a < mathieu_b(n + 1, q)) for n in range(3)]
assert np.array_equal(stable, np.any(bounded, axis=0))

print(f"{stable.sum()} of {len(stable)} pendulums stay, all where Mathieu says; wrote 13_stability_map.svg")
