"""Closed loops in Exudyn whose closures suppress some motion twice, as the pins of every plane mechanism do.

Its solvers divide by the multipliers' matrix, which is singular then: they stop at t = 0. Closures therefore suppress
only what nothing suppresses before them, which leaves the motion as it is, and the loads that the motion determines.
"""

from __future__ import annotations

import numpy as np

from crosscheck.engines.exudyn.assembly import Assembly, assemble
from crosscheck.engines.exudyn.joints import CONSTRAINED
from crosscheck.engines.exudyn.library import equations
from crosscheck.engines.exudyn.state import States
from crosscheck.engines.links import closed_frames, links, radius_of_gyration
from flexmb.scene.schema import Scene
from flexmb.typing import Real

DEPENDENT = 1e-9
"""Singular values of normalised rows that count as zero: loops begin closed to 1e-12 or less."""
OPENED = 1e-3
"""How far what is left out may open in a run, as sine of an angle or by the larger radius of gyration of the two bodies
about the closure: at an exceptional position of the start, rows seem redundant that are not."""


def independent(scene: Scene) -> tuple[Assembly, Assembly | None]:
    """The system of a scene, with closures that suppress nothing twice; and with whole ones where that differs."""
    whole = assemble(scene)
    if not scene.closures or _rank(whole) == _rows(whole):
        return whole, None
    kept = {closure.name: [0] * 6 for closure in scene.closures}
    rank = _rank(assemble(scene, kept))
    for closure in scene.closures:
        for axis in np.flatnonzero(CONSTRAINED[closure.type]).tolist():
            kept[closure.name][axis] = 1
            more = _rank(assemble(scene, kept))
            kept[closure.name][axis] = int(more > rank)
            rank = max(rank, more)
    return assemble(scene, kept), whole


def opening(whole: Assembly, states: States) -> tuple[int, str]:
    """The first sample at which a whole closure is open, and its name; the number of samples and "" if none is."""
    data, chain = whole.shop.mbs.systemData, links(whole.scene)
    sizes = {
        each.name: max(radius_of_gyration(chain, at) for at in closed_frames(whole.scene, chain, each))
        for each in whole.scene.closures
    }
    rows = {name: list(data.GetObjectLTGAE(link.connectors[0][0])) for name, link in whole.closures.items()}
    with equations(whole.shop.mbs) as system:
        for sample in range(len(states.times)):
            data.SetODE2Coordinates(states.q[sample])
            data.SetODE2Coordinates_t(states.v[sample])
            system.solver.ComputeAlgebraicEquations(whole.shop.mbs, False)
            gap = np.abs(np.array(system.solver.GetSystemResidual())[system.n :])
            for name, own in rows.items():  # of every joint the first three are displacements
                if not (np.max(gap[own[:3]]) <= OPENED * sizes[name] and np.max(gap[own[3:]], initial=0.0) <= OPENED):
                    return sample, name
    return len(states.times), ""


def _rank(assembly: Assembly) -> int:
    """Number of independent rows of all constraints where the run begins."""
    C = _jacobian(assembly)
    norms = np.linalg.norm(C, axis=1)
    scaled = C[norms > 0.0] / norms[norms > 0.0][:, None]
    return int(np.sum(np.linalg.svd(scaled, compute_uv=False) > DEPENDENT))


def _rows(assembly: Assembly) -> int:
    """Number of rows that constrain anything."""
    return int(np.sum(np.linalg.norm(_jacobian(assembly), axis=1) > 0.0))


def _jacobian(assembly: Assembly) -> Real:
    """(k, n) of all constraints where the run begins."""
    with equations(assembly.shop.mbs) as system:
        return system.jacobian()
