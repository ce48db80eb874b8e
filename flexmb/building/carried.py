"""A rough estimate of the inertia that each speed of a tree moves, with which pivots are compared."""

from __future__ import annotations

from math import sqrt

import numpy as np

from flexmb.hinges.catalogue import KINDS
from flexmb.typing import Real, Record


def moved_inertia(body: Record, port: Record, mff: Real, wheel: Record, speeds: int) -> Real:
    """(speeds,) mass (kg) or moment of inertia (kg m^2) of all that a hinge's speed moves; modal masses at rest.

    The tables are those of `flexmb.tables.arrays.Constants`. Moments of inertia are about the hinge, for a chain that
    is stretched out and whose sliding hinges are at zero.
    """
    parent, kind, nv, speed = (body[key].tolist() for key in ("parent", "hinge_kind", "nv", "u_index"))
    mass, inertia = body["rigid"][:, 0].tolist(), np.sum(body["rigid"][:, 4:7], axis=1).tolist()
    distance = np.append(np.linalg.norm(port["position"] + port["offset"], axis=1), 0.0)  # the last is for no port, -1
    to_hinge = distance[body["outboard_port"]].tolist()
    placed = np.linalg.norm(body["placement_position"], axis=1)
    arm = np.where(body["inboard_port"] >= 0, distance[body["inboard_port"]], placed).tolist()
    moved = np.zeros(speeds)
    for k in range(len(parent) - 1, -1, -1):
        about_hinge = _about(inertia[k], mass[k], to_hinge[k])
        linear = KINDS[kind[k]].displacements
        for n in range(nv[k]):
            moved[speed[k] + n] = mass[k] if n in linear else about_hinge
        if parent[k] >= 0:
            mass[parent[k]] += mass[k]
            inertia[parent[k]] += _about(about_hinge, mass[k], arm[k])
    for k in np.flatnonzero(body["modes"]):
        first, n = body["etad_index"][k], body["modes"][k]
        by_strain = body["section_stop"][k] > body["section_start"][k]  # unit masses at rest, all of summed points
        moved[first : first + n] = 1.0 if by_strain else np.diagonal(mff[k])[:n]
    moved[wheel["u_index"]] = wheel["axial"]
    return moved


def _about(inertia: float, mass: float, distance: float) -> float:
    """Upper bound of the moment of inertia about a point at a distance, whatever the direction of the mass centre."""
    return (sqrt(inertia) + sqrt(mass) * distance) ** 2
