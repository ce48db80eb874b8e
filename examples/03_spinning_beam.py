"""Why a spinning beam needs stiffening

A beam is spun up faster than its own lowest frequency. At level `full` it bends without bound, because linear mode
shapes do not shorten: a real beam that bends pulls its tip inwards, against the centrifugal force. Level `stiffened`
accounts for that by the second-order displacements of the modes.
"""

import matplotlib.pyplot as plt
import numpy as np

import flexmb as fm

# A beam of 1 m with sqrt(EI / (m L^4)) = 1 rad/s: clamped it bends at 3.516 rad/s. It is spun up to 6 rad/s in 15 s.
section = fm.BeamStation(x_m=0.0, EA_N=1e5, EIy_Nm2=1.0, EIz_Nm2=1.0, GJ_Nm2=1.0, mass_per_length_kg_m=1.0)
modes = fm.Modes(count=8, families=("bending_y",))


def beam(level):
    """The beam, spun up smoothly about z; runs at level `full` warn that this is beyond its range, unless allowed."""
    return (
        fm.SceneBuilder(level, allow=("level_range",))
        .beam("beam", length=1.0, elements=24, section=section, modes=modes, level=level, points="line")
        .revolute("hub", "ground", "beam", prescribed=fm.SpinUp(rate=6.0, duration_s=15.0))
        .marker("tip", "beam", node="tip")
        .scene()
    )


figure, axes = plt.subplots()
for level, style in (("full", "C3--"), ("stiffened", "C0")):
    run = fm.simulate(beam(level), t_end=20.0, samples=801, rtol=1e-7, atol=1e-9)
    angle, tip = run.q[:, 0], run.markers["tip"].position
    axes.plot(run.t, -np.sin(angle) * tip[:, 0] + np.cos(angle) * tip[:, 1], style, label=f"level {level}")
axes.set(xlabel="time (s)", ylabel="deflection of the tip (m)", title="A beam of 1 m is spun up to 6 rad/s")
axes.set_ylim(-0.6, 0.2)
axes.legend()
figure.savefig("03_spinning_beam.svg")

# At 6 rad/s the beam flaps out of the plane at 7.360373 rad/s (Wright and others, J. Appl. Mech. 49, 1982), and in the
# plane at the root of that squared less the spin squared. Without stiffening the square is negative: it is unstable.
steady = {level: fm.steady_spin(beam(level), "hub", 6.0).linearize() for level in ("full", "stiffened")}
assert abs(steady["stiffened"].modes[0].frequency_rad_s - np.sqrt(7.360373**2 - 6.0**2)) < 1e-4
assert steady["full"].stability.verdict == "unstable"

print(f"level full is {steady['full'].stability.verdict} at 6 rad/s; wrote 03_spinning_beam.svg")
