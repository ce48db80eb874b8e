"""A rough measure of the inertia that each speed of a tree moves; pivots are compared with it."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from flexmb.hinges.catalogue import KINDS
from flexmb.typing import Real, Record


class CarriedTables(NamedTuple):
    """The tables of `flexmb.tables.arrays.Constants` that say what is moved."""

    body: Record
    port: Record
    mff: Real
    wheel: Record


def moved_inertia(c: CarriedTables, speeds: int) -> Real:
    """(speeds,) mass (kg) or moment of inertia (kg m^2) of all that a hinge's speed moves; modal masses at rest.

    Moments are about hinges, of chains stretched out, hinges that slide at their zeros: sqrt(J) of what is carried at a
    distance l is sqrt(J) + sqrt(m) l at most.
    """
    parent, kind, nv, speed = (c.body[key].tolist() for key in ("parent", "hinge_kind", "nv", "u_index"))
    mass, inertia = c.body["rigid"][:, 0].tolist(), np.sum(c.body["rigid"][:, 4:7], axis=1).tolist()
    port = np.append(np.linalg.norm(c.port["position"] + c.port["offset"], axis=1), 0.0)  # the last one: none
    to_hinge = port[c.body["outboard_port"]].tolist()
    placed = np.linalg.norm(c.body["placement_position"], axis=1)
    arm = np.where(c.body["inboard_port"] >= 0, port[c.body["inboard_port"]], placed).tolist()
    moved = np.zeros(speeds)
    for k in range(len(parent) - 1, -1, -1):
        about_hinge = _about(inertia[k], mass[k], to_hinge[k])
        linear = KINDS[kind[k]].displacements
        for n in range(nv[k]):
            moved[speed[k] + n] = mass[k] if n in linear else about_hinge
        if parent[k] >= 0:
            mass[parent[k]] += mass[k]
            inertia[parent[k]] += _about(about_hinge, mass[k], arm[k])
    for k in np.flatnonzero(c.body["modes"]):
        first, n = c.body["etad_index"][k], c.body["modes"][k]
        moved[first : first + n] = np.diagonal(c.mff[k])[:n]
    moved[c.wheel["u_index"]] = c.wheel["axial"]
    return moved


def _about(inertia: float, mass: float, distance: float) -> float:
    """Bound of the moment of inertia about a point at a distance."""
    return (sqrt(inertia) + sqrt(mass) * distance) ** 2
