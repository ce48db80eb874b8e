"""Which model is good enough?

A satellite with a flexible panel turns by 60 degrees. How many modes, which level and which integrator are enough for
the position of its tip? `advise` tries models from the cheapest on, measures their errors, and says which it would
take, and why.
"""

import matplotlib.pyplot as plt
import numpy as np

import flexmb as fm
from flexmb.scene.shapes import beam_section, cuboid_inertia

sheet = beam_section(E=7e10, G=2.7e10, A=4e-4, Iy=5e-9, Iz=5e-9, rho=2700.0)
modes = fm.Modes(count=6, families=("bending_y",))
turn = fm.SmoothStep(start_value=0.0, end_value=np.pi / 3.0, start_s=0.0, duration_s=4.0)
scene = (
    fm.SceneBuilder("turning satellite")
    .rigid_body("hub", mass=100.0, inertia=cuboid_inertia(100.0, (1.0, 1.0, 1.0)))
    .beam("panel", length=3.0, elements=12, section=sheet, modes=modes, level="stiffened")
    .revolute("attitude", "ground", "hub", prescribed=turn)
    .weld("yoke", "hub", "panel", parent_position=(0.5, 0.0, 0.0))
    .marker("tip", "panel", node="tip")
    .scene()
)
tolerance = 5e-5
advice = fm.advise(scene, tolerance, "marker:tip.position", t_end=6.0)
for body in advice.bodies:
    print(f"{body.body}: {body.rung}; {body.reason}")
print(f"{advice.method}, {advice.operations:.1e} operations, error {advice.measured:.1e}")

figure, axes = plt.subplots()
for level, marker in (("ruthless", "v"), ("linear", "<"), ("full", ">"), ("stiffened", "^")):
    tried = [(trial, rung) for trial in advice.trials for _, rung in trial.model if rung.level == level]
    axes.loglog([trial.operations for trial, _ in tried], [trial.measured for trial, _ in tried], marker, label=level)
    for trial, rung in tried:
        aside = 0.91 if level == "linear" else 1.06  # so that numbers of equal errors stand side by side
        axes.annotate(rung.modes, (aside * trial.operations, trial.measured), fontsize=8)
axes.plot(advice.operations, advice.measured, "k*", ms=12, label="advised, with its integrator")
axes.axhline(tolerance, color="k", ls="--", lw=0.8, label="tolerance")
axes.set(xlabel="operations of a run", ylabel="error of the tip, relative to its path", xlim=(1e6, 3e7))
axes.set_title("Models that were tried, by level, with their numbers of modes")
axes.legend(fontsize=8)
figure.savefig("14_advice.svg")

# What was advised, run for itself, is as near to the scene with twelve modes as was asked.
fine = scene.with_values({"panel.modes.count": 12})
found, known = (
    fm.simulate(each, 6.0, rtol=rtol, atol=1e-2 * rtol).markers["tip"].position
    for each, rtol in ((advice.scene, 1e-9), (fine, 1e-11))
)
assert np.linalg.norm(found - known, axis=1).max() < tolerance * np.ptp(known, axis=0).max()
assert advice.operations < max(trial.operations for trial in advice.trials)

print("wrote 14_advice.svg")
