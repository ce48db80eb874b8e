"""Pictures of the documentation that are made from measurements: python -m tests.benchmarks.figures

The times are of the machine they are drawn on; docs/pictures says nothing that the ratios do not.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import flexmb as fm
from flexmb.frisch.errata import AS_PRINTED
from flexmb.frisch.nested_system import nested_system
from tests.benchmarks import cost_figures
from tests.benchmarks.rivals import flexible_chain, interleaved, rigid_chain
from tests.benchmarks.test_nested import nested, recursion
from tests.flexmb.frisch.scenes import at_level, packed
from tests.flexmb.frisch.test_errata import ORDER, tree
from tests.repo.project import ROOT
from tests.trees import deformed

FOLDER = ROOT / "docs" / "pictures"
SCALES = 10.0 ** -np.arange(0.0, 5.5, 0.5)
BODIES = (1, 2, 3, 5, 10, 20, 50, 100)


def main() -> None:
    """Draw all pictures."""
    plt.switch_backend("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "flexmb", "svg.fonttype": "none", "font.size": 9})
    FOLDER.mkdir(exist_ok=True)
    _draw(_orders, FOLDER / "frisch_orders.svg")
    _draw(_cost, FOLDER / "frisch_cost.svg")
    _draw(cost_figures.of_modes, FOLDER / "jain_cost_modes.svg", panels=2)
    _draw(cost_figures.of_bodies, FOLDER / "jain_cost_bodies.svg", panels=2)


def _draw(picture, path: Path, panels: int = 1) -> None:
    figure, axes = plt.subplots(ncols=panels, figsize=(6.4 if panels == 1 else 9.6, 4.4), layout="constrained")
    picture(axes)
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def _orders(axes: Axes) -> None:
    """Distance of accelerations from level full against the deformation: corrected, as printed, and each defect."""
    scene = tree(2)
    full = fm.compile(at_level(scene, "full"))
    routes = {"corrected": nested_system(scene), "as printed": nested_system(scene, AS_PRINTED)}
    for erratum in sorted(ORDER, key=lambda erratum: erratum.name):
        routes[f"{erratum.name.lower().replace('_', ' ')} {erratum.value}"] = nested_system(scene, frozenset([erratum]))
    for name, route in routes.items():
        only = name not in ("corrected", "as printed")
        distance = [_distance(full, route, deformed(full, scale), routes["corrected"] if only else None)
                    for scale in SCALES]  # fmt: skip
        axes.loglog(SCALES, distance, "-" if only else "o-", lw=1.0 if only else 2.0, label=name)
    axes.loglog(SCALES, 1e-5 * SCALES**2, "k:", lw=0.8, label="slope 2")
    axes.loglog(SCALES, 1e-3 * SCALES, "k--", lw=0.8, label="slope 1")
    axes.set(xlabel="modal coordinates and rates, times 0.03", ylabel="generalised force, relative to inertia forces")
    axes.set_title("Corrected and printed against level full (dots),\neach defect alone against the corrected (lines)")
    axes.legend(fontsize=7, loc="lower right")


def _distance(full: fm.System, route, state: fm.State, reference) -> float:
    y = packed(state)
    right = full.accelerations(state) if reference is None else reference.accelerations(0.0, y)[1]
    M = full.mass_matrix(state)
    return float(np.max(np.abs(M @ (route.accelerations(0.0, y)[1] - right))) / np.max(np.abs(M) @ np.abs(right)))


def _cost(axes: Axes) -> None:
    """Time of one evaluation against the number of bodies, both routes in turns."""
    for modes, marker in ((0, "o"), (5, "s")):
        systems = [fm.compile(flexible_chain(n, modes, "linear") if modes else rigid_chain(n)) for n in BODIES]
        times = np.array([interleaved(nested(system), recursion(system)) for system in systems])
        kind = f"{modes} modes each" if modes else "rigid"
        for times_of, route, style in zip(times.T, ("nested bodies", "recursion"), ("-", "--"), strict=True):
            axes.loglog(BODIES, 1e6 * times_of, style + marker, ms=4, label=f"{route}, {kind}")
    axes.axhline(60.0, color="k", lw=0.5)
    axes.set(xlabel="bodies in a chain", ylabel="one evaluation [us]",
             title="Nested bodies O(N²) + O(n³) against the recursion O(N)")  # fmt: skip
    axes.legend(fontsize=8)


if __name__ == "__main__":
    main()
