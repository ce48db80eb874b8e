"""A turn that does not shake a flexible arm

A motor turns a flexible arm by a constant torque forwards and then backwards. If each half lasts a whole number of
periods of the first bending mode, that mode is at rest when the motor stops. With half a period more the arm goes on
shaking.
"""

import matplotlib.pyplot as plt
import numpy as np

import flexmb as fm
from flexmb.scene.shapes import beam_section

strip = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700.0)
modes = fm.Modes(count=4, families=("bending_y",))


def arm(half=1.0, torque=0.0):
    """The arm, with the torque of its motor (N m) that changes its sign after `half` of the turn (s)."""
    forwards = fm.Pulse(value=torque, start_s=0.0, duration_s=half)
    backwards = fm.Pulse(value=-torque, start_s=half, duration_s=half)
    return (
        fm.SceneBuilder("arm")
        .rigid_body("hub", mass=2.0, inertia=(0.4, 0.4, 0.4))
        .beam("rod", length=1.5, elements=12, section=strip, modes=modes, level="stiffened")
        .rigid_body("hand", mass=0.3, inertia=(1e-4, 1e-4, 1e-4))
        .revolute("motor", "ground", "hub", torque=forwards)
        .weld("root", "hub", "rod")
        .weld("wrist", "rod", "hand", parent_node="tip")
        .angular_spring("second half", "motor", torque=backwards)  # a drive beside the motor, without any stiffness
        .marker("tip", "rod", node="tip")
        .scene()
    )


# The period of the first mode of the arm on its free hinge comes from the linear model.
found = fm.linearize(arm()).modes
period = 1.0 / min(mode.frequency_hz for mode in found if not mode.is_rigid_body)

figure, axes = plt.subplots()
shaking = {}
for periods in (2.0, 2.5):
    half = periods * period
    run = fm.simulate(arm(half, torque=2.0 / half**2), t_end=8.0 * period, samples=801)
    angle, tip = run.q[:, 0], run.markers["tip"].position
    bent = -np.sin(angle) * tip[:, 0] + np.cos(angle) * tip[:, 1]  # deflection across the arm
    shaking[periods] = np.abs(bent[run.t > 2.0 * half]).max()
    axes.plot(run.t, 1e3 * bent, label=f"each half {periods:g} periods")
axes.set(xlabel="time (s)", ylabel="deflection of the tip (mm)", title="A flexible arm, while it turns and afterwards")
axes.legend()
figure.savefig("02_flexible_arm.svg")

# What is left comes from the second mode, and from the little that the torque bends the arm out of its linear range.
assert shaking[2.0] < 0.01 * shaking[2.5]

left = {periods: 1e3 * size for periods, size in shaking.items()}
print(f"shaking afterwards {left[2.0]:.3f} mm, else {left[2.5]:.1f} mm; wrote 02_flexible_arm.svg")
