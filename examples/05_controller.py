"""A sampled controller, and what its delay costs

A torque proportional to angle and rate holds a satellite in place. As a continuous law it is well damped. With the
same gains, but sampled twice a second and applied half a period late, the satellite swings, just as two matrix
exponentials predict.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.linalg import expm

import flexmb as fm

inertia, stiffness, damping = 10.0, 10.0, 14.0  # kg m^2, N m/rad, N m s/rad
gain = -np.array([[stiffness, damping]])


def held(**sampling):
    """The satellite on its axis, 0.1 rad away from where it should be."""
    return (
        fm.SceneBuilder("held satellite")
        .rigid_body("hub", mass=100.0, inertia=(inertia, inertia, inertia))
        .revolute("axis", "ground", "hub", angle=0.1, torque=fm.ControlSignal(source="law"))
        .sense_coordinate("angle", "axis")
        .sense_coordinate("rate", "axis", quantity="rate")
        .state_space("law", ["angle", "rate"], D=gain, **sampling)
        .scene()
    )


period, delay, times = 0.5, 0.25, np.linspace(0.0, 15.0, 601)
figure, axes = plt.subplots()
axes.plot(times, fm.simulate(held(), 15.0, samples=times).q[:, 0], label="continuous")
axes.plot(times, fm.simulate(held(period=period), 15.0, samples=times).q[:, 0], label="sampled at 2 Hz")
late = fm.simulate(held(period=period, delay=delay), 15.0, samples=times).q[:, 0]
axes.plot(times, late, label="sampled at 2 Hz, 0.25 s late")

# Between the instants at which it changes the torque is constant, so that [angle, rate, torque] moves by a matrix
# exponential: over the delay with the old torque, then over the rest of the period with the new one.
constant = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0 / inertia], [0.0, 0.0, 0.0]])
before, after = expm(delay * constant), expm((period - delay) * constant)
x, predicted = np.array([0.1, 0.0, 0.0]), [0.1]
for _ in range(30):
    asked = (gain @ x[:2]).item()
    x = before @ x
    x = after @ np.array([x[0], x[1], asked])
    predicted.append(x[0])
axes.plot(np.arange(31) * period, predicted, "k.", label="predicted")
axes.set(xlabel="time (s)", ylabel="angle (rad)", title="One controller, continuous, sampled, and late")
axes.legend()
figure.savefig("05_controller.svg")

assert np.abs(late[::20] - predicted).max() < 1e-9

print(f"late, it still swings by {np.abs(late[times > 10.0]).max():.4f} rad after 10 s; wrote 05_controller.svg")
