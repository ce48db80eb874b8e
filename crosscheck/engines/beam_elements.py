"""What engines with finite elements of their own take from a beam's data: ends of elements, sections, frequencies."""

from __future__ import annotations

from math import sqrt

import numpy as np

from flexmb.scene.schema import BeamBody
from flexmb.scene.sections import inertia_on_axis, stiffness_on_axis
from flexmb.scene.strains import polynomials
from flexmb.typing import Real


def element_ends(body: BeamBody) -> Real:
    """Ends of the elements (n,) m along the beam: nodes, stations and tip masses, and between them as many as make the
    scene's number."""
    L = body.length_m
    wanted = [0.0, L, *(each.x_m for each in (*body.nodes, *body.stations, *body.tip_masses))]
    fixed = np.unique(np.round(np.array(wanted) / L, 12)) * L
    parts = [
        np.linspace(left, right, max(1, round(body.elements * (right - left) / L)), endpoint=False)
        for left, right in zip(fixed, fixed[1:], strict=False)
    ]
    return np.concatenate([*parts, [L]])


def shears(body: BeamBody) -> bool:
    """Whether the scene's beam shears."""
    if body.level == "exact":
        return bool({"shear_y", "shear_z"} & set(polynomials(body)))
    return body.theory == "timoshenko"


def first_bending(beam: BeamBody) -> float:
    """First frequency (rad/s) of a beam, free and in its stiffer plane, by its first station."""
    station = beam.stations[0]
    stiffer = float(np.diag(stiffness_on_axis(station))[4:].max())
    return 22.37 / beam.length_m**2 * sqrt(stiffer / float(inertia_on_axis(station)[0, 0]))
