"""A Campbell diagram of a blade

A blade becomes stiffer as it spins. The diagram shows its frequencies against the spin rate, with lines for one, two
and three excitations per turn. Where a line crosses a frequency, the blade resonates.
"""

import matplotlib.pyplot as plt
import numpy as np

import flexmb as fm

# A uniform blade of 1 m with sqrt(EI / (m L^4)) = 1 rad/s, so that all figures are those of the tables.
section = fm.BeamStation(x_m=0.0, EA_N=1e5, EIy_Nm2=1.0, EIz_Nm2=1.0, GJ_Nm2=1.0, mass_per_length_kg_m=1.0)
modes = fm.Modes(count=20, families=("bending_y", "bending_z"))
scene = (
    fm.SceneBuilder("blade")
    .beam("blade", length=1.0, elements=24, section=section, modes=modes, level="stiffened", points="line")
    .revolute("hub", "ground", "blade")
    .scene()
)
rates = np.linspace(0.0, 10.0, 21)
diagram = fm.campbell(scene, "hub", rates)
frequencies = np.sort(np.abs(diagram.eigenvalues.imag), axis=1)

# First frequency out of the plane: Wright, Smith, Thresher, Wang, J. Appl. Mech. 49 (1982) 197-202.
published = {0: 3.5160, 1: 3.6816, 2: 4.1373, 3: 4.7973, 4: 5.5850, 5: 6.4495, 6: 7.3604, 8: 9.2568, 10: 11.2023}

figure, axes = plt.subplots()
for column, label in enumerate(("first in the plane", "first out of the plane")):
    axes.plot(rates, frequencies[:, column], label=label)
axes.plot(published.keys(), published.values(), "k.", label="published, out of the plane")
for order, place in ((1, 8.0), (2, 5.2), (3, 3.5)):
    axes.plot(rates, order * rates, color="0.6", lw=0.8)
    axes.annotate(f"{order} per turn", (place + 0.15, order * place - 0.5), color="0.4", fontsize=9)
axes.set(xlabel="spin (rad/s)", ylabel="frequency (rad/s)", ylim=(0.0, 12.0), title="Campbell diagram of a blade")
axes.legend(loc="lower right")
figure.savefig("06_campbell.svg")

found = frequencies[np.searchsorted(rates, list(published)), 1]
assert np.allclose(found, list(published.values()), rtol=1e-4)

print(f"out of the plane {found[0]:.4f} rad/s at rest, {found[-1]:.4f} at 10 rad/s; wrote 06_campbell.svg")
