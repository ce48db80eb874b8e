"""Is my code right? Verify a CSV

A case has stored results with error bars. Your code writes its own results into a CSV, and `verify_csv` says which
channels agree and, where one does not, what is likely to be wrong. The code of this example makes one classic
mistake.
"""

import csv
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from crosscheck.library.find import resolve
from crosscheck.library.reference import load_reference
from crosscheck.verify.against_case import verify_csv

# The case: a free body that tumbles, as a handle thrown in orbit does. `crosscheck verify` does the same from a shell.
(case,) = resolve(("tops/free_body",))
reference = load_reference(case.folder)
inertia, spin = np.array([2.0, 3.0, 4.2]), np.array([3.1, 0.0, 2.0])
start = np.array([0.6716721818688354, 0.22103502008405412, -0.22103502008405407, 0.6716721818688353])
corner = np.array([0.5, 0.4, -0.3])


def rate(t, y):
    """Euler's equations in body axes, and the rate of the quaternion."""
    w, (q0, *q) = y[:3], y[3:]
    return np.concatenate([-np.cross(w, inertia * w) / inertia, [-0.5 * np.dot(q, w)], 0.5 * (q0 * w + np.cross(q, w))])


y = solve_ivp(rate, (0.0, 20.0), [*spin, *start], "DOP853", reference.times, rtol=1e-11, atol=1e-13).y.T
turn = Rotation.from_quat(y[:, 3:], scalar_first=True)
in_body, in_world = y[:, :3], turn.apply(y[:, :3])


def verified(angular_velocity):
    """The verdicts, by channel, on a file with these angular velocities."""
    names = [f"corner.{name}" for name in ("px", "py", "pz", "qw", "qx", "qy", "qz", "wx", "wy", "wz")]
    with open("mine.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["t", *names])
        writer.writerows(np.column_stack([reference.times, turn.apply(corner), y[:, 3:], angular_velocity]))
    return verify_csv(case, Path("mine.csv"))


wrong, right = verified(in_body), verified(in_world)
cause = wrong.details["marker:corner.angular_velocity"].cause
print(cause)

figure, axes = plt.subplots()
places = np.arange(len(right.all))
files = (wrong, "first file: angular velocity in body axes", -0.2), (right, "second file: corrected", 0.2)
for found, name, shift in files:
    axes.barh(places + shift, [verdict.E for verdict in found.all], 0.4, label=name)
axes.axvline(right.all[0].goal, color="k", ls="--", lw=0.8, label="goal of the case")
axes.set(yticks=places, yticklabels=[verdict.channel.partition(".")[2].replace("_", " ") for verdict in right.all])
axes.set(xscale="log", xlabel="distance from the reference, relative to its range", title="A CSV against a case")
axes.legend(loc="lower right", fontsize=8)
figure.savefig("11_verify_a_csv.svg")

assert right.ok and not wrong.ok and "not in World axes" in cause

print(f"corrected, it is {max(verdict.E for verdict in right.all):.1e} away; wrote mine.csv and 11_verify_a_csv.svg")
