"""Beams of level `stiffened` in two planes have derivatives by their stiffness and length.

Their modes in both planes are equal but for the inertia of the sections: equivalent masses are nearly redundant.
"""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm
from flexmb.parameters.numbers import Number
from flexmb.scene.shapes import beam_section

CLOSE = 1e-8  # of the largest derivative, which differences by STEP leave after one extrapolation
STEP = 4e-3  # of a number


def arm(*families: str) -> fm.schema.Scene:
    """A slender beam that bends in two planes, on a hinge."""
    section = beam_section(E=7e10, G=2.7e10, A=2e-4, Iy=2e-9, Iz=4e-9, rho=2700)
    modes = fm.Modes(count=2 * len(families), families=families)
    return (
        fm.SceneBuilder("arm", gravity=(0.0, -9.81, 3.0))
        .beam("rod", length=2.0, elements=4, section=section, level="stiffened", modes=modes)
        .revolute("hinge", "ground", "rod", axis=(0, 0, 1), rate=2.0)
        .scene()
    )


@pytest.mark.parametrize("families", [
    ("bending_y", "bending_z"),
    pytest.param(("bending_y", "bending_z", "torsion"), marks=pytest.mark.slow),
])  # fmt: skip
def test_stiffness_of_each_plane(families):
    scene = arm(*families)
    system, names = fm.compile(scene), [f"rod.stations.*.{key}" for key in ("EIy_Nm2", "EIz_Nm2")]
    start = system.initial_state
    q = start.q.copy()
    q[system.coordinate("rod.modes")] = 0.02 * np.cos(np.arange(2 * len(families)))
    u = start.u + 0.3
    found = system.parameters(names).accelerations(system.state(q, u))
    for k, name in enumerate(names):
        number = Number(scene, name)

        def at(value, number=number):
            other = fm.compile(number.scene_at(value))
            return other.accelerations(other.state(q, u))

        one, two = (
            (at(number.value * (1.0 + h)) - at(number.value * (1.0 - h))) / (2.0 * h * number.value)
            for h in (STEP, STEP / 2.0)
        )
        best = two + (two - one) / 3.0
        assert np.max(np.abs(found[:, k] - best)) <= CLOSE * np.max(np.abs(best))


@pytest.mark.slow
def test_length():
    """The check of scenes wants stations at the end of a longer beam; all that is asked here is that it reaches."""
    found = fm.compile(arm("bending_y", "bending_z")).parameters(["rod.length_m"])
    assert found.reached[0] and found.errors[0] <= 1e-9
