"""A four-bar linkage

A crank turns steadily and, by a coupler that closes the loop, lets a rocker swing. The picture shows the path of a
point of the coupler, and the torque that drives the crank.
"""

import matplotlib.pyplot as plt
import numpy as np

import flexmb as fm

crank, coupler, rocker, base, speed = 0.3, 0.8, 0.7, 1.0, 2.0  # m; rad/s


def bar(length):
    """Mass, centre and inertia of a slender bar along x."""
    mass = 0.8 * length
    across = mass * length**2 / 12.0
    return {"mass": mass, "com": (0.5 * length, 0.0, 0.0), "inertia": (1e-4, across, across)}


# In the complex plane, the coupler's end is where circles about the pin and about the rocker's pivot meet.
def pose(crank_angle):
    """Angles (rad) of coupler and rocker for one of the crank, by the law of cosines."""
    pin = crank * np.exp(1j * crank_angle)
    side = np.abs(base - pin)  # of the triangle with coupler and rocker
    direction = np.angle(base - pin) + np.arccos((coupler**2 + side**2 - rocker**2) / (2.0 * coupler * side))
    return direction, np.angle(pin + coupler * np.exp(1j * direction) - base)


# The hinges of crank, coupler and rocker make a tree; the closure joins the ends of coupler and rocker. A universal
# joint, whose first axis is normal to the plane, and a ball joint suppress no motion twice: all loads are determined.
upright = (np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0)
scene = (
    fm.SceneBuilder("four-bar", gravity=(0.0, -9.81, 0.0))
    .rigid_body("crank", **bar(crank))
    .rigid_body("coupler", **bar(coupler))
    .rigid_body("rocker", **bar(rocker))
    .revolute("drive", "ground", "crank", prescribed=fm.Ramp(rate=speed, value=1.0))
    .universal("pin", "crank", "coupler", parent_position=(crank, 0, 0), parent_quaternion=upright,
               child_quaternion=upright, first=fm.AngularCoordinate(angle_rad=pose(1.0)[0] - 1.0))
    .revolute("pivot", "ground", "rocker", parent_position=(base, 0, 0), angle=pose(1.0)[1])
    .closure("loop", "spherical", "coupler", "rocker", position_a=(coupler, 0, 0), position_b=(rocker, 0, 0))
    .marker("point", "coupler", offset=(0.5 * coupler, 0.25, 0))
    .marker("joint", "rocker", offset=(rocker, 0, 0))
    .marker("pin", "crank", offset=(crank, 0, 0))
    .scene()
)  # fmt: skip
turn = 2.0 * np.pi / speed
system = fm.compile(scene)
run = fm.simulate(system, t_end=turn, samples=721)

figure, (path, torque) = plt.subplots(ncols=2, width_ratios=(3, 2))
pin, joint = (run.markers[name].position[0] for name in ("pin", "joint"))
path.plot([0.0, pin[0], joint[0], base], [0.0, pin[1], joint[1], 0.0], color="0.8", lw=5, label="bars at the start")
for name, label in (("pin", "end of the crank"), ("joint", "end of the rocker"), ("point", "point of the coupler")):
    x, y, _ = run.markers[name].position.T
    path.plot(x, y, label=label)
path.plot([0.0, base], [0.0, 0.0], "k^", label="on the ground")
path.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", ylim=(-0.4, 1.45), title="Four-bar linkage")
path.legend(fontsize=8, loc="upper right")
torque.plot(np.linspace(0.0, 360.0, 721), run.drives["drive"][:, 0], color="C3")
torque.set(xlabel="turn of the crank (degrees)", ylabel="torque of the drive (N m)", xticks=range(0, 361, 90))
figure.savefig("07_closed_loop.svg")

# The rocker is where plane geometry says, all the way round, and the work of the drive is the change of energy.
swing = run.q[:, system.coordinate("pivot").start]
assert np.abs(swing - pose(1.0 + speed * run.t)[1]).max() < 1e-9
assert np.abs(run.energy_drift).max() < 1e-9

print(f"the drive needs up to {np.abs(run.drives['drive']).max():.3f} N m; wrote 07_closed_loop.svg")
