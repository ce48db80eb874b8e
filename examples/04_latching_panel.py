"""A panel that unfolds and latches

A spring unfolds the flexible panel of a small satellite. When the panel is straight the hinge latches: an impulse
stops it in an instant, and the panel rings.
"""

import matplotlib.pyplot as plt
import numpy as np

import flexmb as fm
from flexmb.scene.shapes import beam_section, cuboid_inertia

sheet = beam_section(E=7e10, G=2.7e10, A=4e-4, Iy=3e-9, Iz=3e-9, rho=2700.0)
modes = fm.Modes(count=3, families=("bending_y",), damping_ratio=0.01)
scene = (
    fm.SceneBuilder("satellite")
    .rigid_body("hub", mass=40.0, inertia=cuboid_inertia(40.0, (0.6, 0.6, 0.6)))
    .beam("panel", length=2.0, elements=12, section=sheet, modes=modes)
    .free("flight", "ground", "hub")
    .revolute("hinge", "hub", "panel", parent_position=(0.3, 0.0, 0.0), angle=-0.5 * np.pi, stiffness=0.4, damping=0.1)
    .event("latch", "hinge.rotation", 0.0, fm.Latch(coordinate="hinge.rotation"))
    .scene()
)
system = fm.compile(scene)
run = fm.simulate(system, t_end=12.0, samples=1201)
(latch,) = run.events

about_z = run.loads["hinge"][:, 2]  # the torque across the hinge, of the spring first and of the latch later
angle = np.degrees(run.q[:, system.coordinate("hinge")])
figure, (upper, lower) = plt.subplots(2, sharex=True)
upper.plot(run.t, angle)
upper.set(ylabel="angle of the panel\n(degrees)", title=f"A panel unfolds and latches at {latch.t:.2f} s")
lower.plot(run.t, about_z, color="C1")
lower.set(xlabel="time (s)", ylabel="torque across\nthe hinge (N m)")
for axes in (upper, lower):
    axes.axvline(latch.t, color="k", lw=0.8, ls="--")
figure.savefig("04_latching_panel.svg")

# Spring, damper and latch act between the parts: the momentum of the whole stays zero, across the latch too. The latch
# dissipates energy, by a known amount; with it and the work of the dampers the energy balance closes.
assert np.abs(run.momentum).max() < 1e-10
assert latch.energy_change < 0.0 and np.abs(run.energy_drift).max() < 1e-9

print(f"the panel latches at {latch.t:.4f} s and loses {-latch.energy_change:.4f} J; wrote 04_latching_panel.svg")
