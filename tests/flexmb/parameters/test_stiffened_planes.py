"""Beams of level `stiffened` in two planes have derivatives by their stiffness and length.

Their modes in both planes are equal but for the inertia of the sections: equivalent masses are nearly redundant.
"""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm
from flexmb.parameters.numbers import Number
from flexmb.ready import scenes
from flexmb.scene.shapes import beam_section

CLOSE = 1e-8  # of the largest derivative, beyond what halving the steps of the differences changes
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


SCENES = {
    "arm in two planes": (lambda: arm("bending_y", "bending_z"), "rod"),
    "arm with torsion": (lambda: arm("bending_y", "bending_z", "torsion"), "rod"),
    "panel, whose planes are equal": (lambda: scenes.panelled(2, "stiffened").scene(), "panel"),
}
KEYS = "stations.*.EIy_Nm2", "stations.*.EIz_Nm2", "length_m"
QUICK = {("arm in two planes", KEYS[0]), ("panel, whose planes are equal", KEYS[1])}


@pytest.mark.parametrize(("name", "key"), [
    pytest.param(name, key, marks=() if (name, key) in QUICK else pytest.mark.slow) for name in SCENES for key in KEYS
])  # fmt: skip
def test_stiffness_of_each_plane_and_length(name, key):
    """Fields of second order along rotations are zero but for rounding, which is none of a derivative.

    Other values are tables of the same modes: those of equal planes change their order in a scene compiled anew, and
    the check of scenes wants a station at the end of a longer beam.
    """
    made, beam = SCENES[name]
    scene = made()
    system, number = fm.compile(scene), Number(scene, f"{beam}.{key}")
    start, modes = system.initial_state, system.coordinate(f"{beam}.modes")
    q, u = start.q.copy(), start.u + 0.3
    q[modes] = 0.02 * np.cos(np.arange(len(q[modes])))
    found = system.parameters([number.name]).accelerations(system.state(q, u))[:, 0]

    def at(value):
        other = system.with_numbers(number.scene_at(value))
        if name.startswith("arm") and key != "length_m":
            other = fm.compile(number.scene_at(value))
        return other.accelerations(other.state(q, u))

    one, two, three = (
        (at(number.value * (1.0 + h)) - at(number.value * (1.0 - h))) / (2.0 * h * number.value)
        for h in (STEP, STEP / 2.0, STEP / 4.0)
    )
    best, beside = two + (two - one) / 3.0, three + (three - two) / 3.0
    tiny = [at(number.value * (1.0 + k * STEP * 2.0**-30)) for k in range(4)]  # smooth parts have no third differences
    rounding = np.max(np.abs(tiny[3] - 3.0 * tiny[2] + 3.0 * tiny[1] - tiny[0])) / (number.value * STEP / 4.0)
    allowed = CLOSE * np.max(np.abs(best)) + 3.0 * np.max(np.abs(best - beside)) + rounding
    assert np.max(np.abs(found - best)) <= allowed < 1e-4 * np.max(np.abs(best))
