"""A rough measure of the inertia that each speed of a tree moves; pivots are compared with it."""

from __future__ import annotations

import numpy as np

from flexmb.hinges.catalogue import KINDS
from flexmb.tables.arrays import Constants
from flexmb.typing import Real


def moved_inertia(c: Constants) -> Real:
    """(nu,) mass (kg) or moment of inertia (kg m^2) of all that a hinge's speed moves, modal mass of a mode at rest.

    Moments are about hinges, of chains stretched out, hinges that slide at their zeros: sqrt(J) of what is carried at a
    distance l is sqrt(J) + sqrt(m) l at most.
    """
    bodies = len(c.body)
    mass, inertia = c.body["rigid"][:, 0].copy(), np.sum(c.body["rigid"][:, 4:7], axis=1)
    moved = np.zeros(len(c.speed))
    for k in range(bodies - 1, -1, -1):
        body = c.body[k]
        about_hinge = _about(inertia[k], mass[k], _distance(c, body["outboard_port"]))
        linear = KINDS[body["hinge_kind"]].displacements
        for n in range(body["nv"]):
            moved[body["u_index"] + n] = mass[k] if n in linear else about_hinge
        for n in range(body["modes"]):
            moved[body["etad_index"] + n] = c.pair["mff"][k, n, n]
        parent, port = body["parent"], body["inboard_port"]
        if parent >= 0:
            arm = float(np.linalg.norm(body["placement_position"])) if port < 0 else _distance(c, port)
            mass[parent] += mass[k]
            inertia[parent] += _about(about_hinge, mass[k], arm)
    for wheel in c.wheel:
        moved[wheel["u_index"]] = wheel["axial"]
    return moved


def _about(inertia: float, mass: float, distance: float) -> float:
    """Bound of the moment of inertia about a point at a distance."""
    return float((np.sqrt(inertia) + np.sqrt(mass) * distance) ** 2)


def _distance(c: Constants, port: int) -> float:
    """Of a port from its body's frame, at rest."""
    return float(np.linalg.norm(c.port["position"][port] + c.port["offset"][port])) if port >= 0 else 0.0
