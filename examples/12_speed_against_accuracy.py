"""Speed against accuracy

A pendulum hangs on a stiff spring, which oscillates more than a hundred times faster than the pendulum swings.
Explicit methods need short steps for that, even where the spring is at rest; implicit and exponential ones do not.
Which is cheapest depends on the accuracy.
"""

from time import process_time

import matplotlib.pyplot as plt
import numpy as np

import flexmb as fm

stiffness, angle = 3e5, 1.0  # N/m, rad; the spring is let go stretched by its load, so that it hardly rings
scene = (
    fm.SceneBuilder("pendulum on a stiff spring", gravity=(0.0, 0.0, -9.81))
    .rigid_body("sleeve", mass=0.5, com=(0.0, 0.0, -0.3), inertia=(0.02, 0.02, 0.01))
    .rigid_body("bob", mass=1.0, inertia=(0.004, 0.004, 0.004))
    .revolute("pivot", "ground", "sleeve", axis=(0.0, 1.0, 0.0), angle=angle)
    .prismatic("spring", "sleeve", "bob", axis=(0.0, 0.0, -1.0), parent_position=(0.0, 0.0, -1.0),
               stiffness=stiffness, position=9.81 * np.cos(angle) / stiffness)
    .marker("bob", "bob")
    .scene()
)  # fmt: skip
system, times = fm.compile(scene), np.linspace(0.0, 5.0, 51)
exact = fm.simulate(system, 5.0, samples=times, rtol=1e-13, atol=1e-15).markers["bob"].position

tolerances = {"rtol": (1e-3, 1e-5, 1e-7, 1e-9)}
settings = {
    "dop853": tolerances, "radau5": tolerances, "exponential": tolerances,
    "rk4": {"step": (1e-3, 5e-4, 2.5e-4)}, "generalised_alpha": {"step": (2e-2, 1e-2, 5e-3, 2.5e-3)},
}  # fmt: skip
figure, axes = plt.subplots()
errors = {}
for method, choices in settings.items():
    ((name, values),) = choices.items()
    seconds, errors[method] = [], []
    for value in values:
        accuracy = {name: value} | ({"atol": 1e-2 * value} if name == "rtol" else {})
        spent = []
        for _ in range(4):  # the fastest of four: the first may have to load or compile something
            before = process_time()
            run = fm.simulate(system, 5.0, method, samples=times, **accuracy)
            spent.append(process_time() - before)
        seconds.append(min(spent))
        errors[method].append(np.abs(run.markers["bob"].position - exact).max())
    axes.loglog(errors[method], 1e3 * np.array(seconds), "o-", ms=4, label=method)
axes.set(xlabel="largest error of the position (m)", ylabel="processor time of a run (ms)")
axes.set_title("A stiff pendulum for 5 s")
axes.invert_xaxis()
axes.legend(fontsize=8)
figure.savefig("12_speed_against_accuracy.svg")

# Runge and Kutta's method is of order 4: with half the step the error is a sixteenth. All others converge too.
halved = errors["rk4"][-2] / errors["rk4"][-1]
assert 12.0 < halved < 20.0
assert all(found[-1] < 0.1 * found[0] for found in errors.values())

print(f"half the step of rk4: an error {halved:.1f} times smaller; wrote 12_speed_against_accuracy.svg")
