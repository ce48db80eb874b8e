"""A robot from a URDF file

URDF files describe robots for ROS and many simulators. flexmb makes a scene of one, which then runs like any other:
here an arm of two links falls from the horizontal. Its mass matrix is that of the textbooks.
"""

import matplotlib.pyplot as plt
import numpy as np

import flexmb as fm
from flexmb.interchange.urdf import read_urdf

mass, length = 2.0, 0.5  # of either link, a slender rod along x
inertia = mass * length**2 / 12.0
rod = f"""<inertial><origin xyz="{length / 2} 0 0"/><mass value="{mass}"/>
  <inertia ixx="1e-4" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/></inertial>"""
with open("arm.urdf", "w") as file:
    file.write(f"""<robot name="arm"><link name="base"/><link name="upper">{rod}</link><link name="fore">{rod}</link>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/><axis xyz="0 1 0"/>
    <origin xyz="{length} 0 0"/></joint></robot>""")

system = fm.compile(read_urdf("arm.urdf", gravity=(0.0, 0.0, -9.81)).scene)
run = fm.simulate(system, t_end=0.6, samples=121)
shoulder, elbow = run.q.T

figure, (arm, angles) = plt.subplots(ncols=2)
for sample in range(0, 121, 10):
    directions = np.cumsum([shoulder[sample], elbow[sample]])  # a turn about y takes x downwards
    x, z = (np.cumsum([0.0, *(length * each(directions))]) for each in (np.cos, np.sin))
    arm.plot(x, -z, "o-", ms=3, color=plt.cm.viridis(sample / 140))
arm.set(xlabel="x (m)", ylabel="z (m)", aspect="equal", title="The arm, every 50 ms")
angles.plot(run.t, np.degrees(shoulder), label="shoulder")
angles.plot(run.t, np.degrees(elbow), label="elbow")
angles.set(xlabel="time (s)", ylabel="angle (degrees)", title="Angles of the joints")
angles.legend()
figure.savefig("15_robot_from_urdf.svg")

# M for two slender rods, for example in Craig, Introduction to Robotics, 6.7; c is the cosine of the elbow's angle.
last, c = run.last_state, np.cos(elbow[-1])
unit = mass * length**2
known = unit * np.array([[5.0 / 3.0 + c, 1.0 / 3.0 + 0.5 * c], [1.0 / 3.0 + 0.5 * c, 1.0 / 3.0]])
assert np.allclose(system.mass_matrix(last), known, rtol=1e-12)
assert np.abs(run.energy_drift).max() < 1e-9

print(f"at 0.6 s the elbow is at {np.degrees(elbow[-1]):.2f} degrees; wrote arm.urdf and 15_robot_from_urdf.svg")
