"""Beams of level `stiffened` in two planes have derivatives by their stiffness and length.

Their modes in both planes are equal but for the inertia of the sections: equivalent masses are nearly redundant.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import flexmb as fm
from flexmb.parameters.numbers import Number
from flexmb.parameters.spectral import INTERVALS, _rule
from flexmb.ready import scenes
from flexmb.scene.shapes import beam_section

CLOSE = 1e-8  # of the largest derivative, beyond what halving the steps of the differences changes
STEP = 3.2e-2  # of a number: a smaller one magnifies the rounding of the tables, which is 1e-9 of accelerations
VALUES = 12  # next to each other, from which rounding is estimated
DEVIATIONS = 6.0  # standard ones of rounding that are allowed


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

    Both routes magnify the rounding of the tables, differences by the inverse of their step and the derivative by that
    of the interval on which it is found, each with the weights of the values there. Other values are tables of the same
    modes: those of equal planes change their order in a scene compiled anew, and the check of scenes wants a station at
    the end of a longer beam.
    """
    made, beam = SCENES[name]
    scene = made()
    system, number = fm.compile(scene), Number(scene, f"{beam}.{key}")
    start, modes = system.initial_state, system.coordinate(f"{beam}.modes")
    q, u = start.q.copy(), start.u + 0.3
    q[modes] = 0.02 * np.cos(np.arange(len(q[modes])))
    parameters = system.parameters([number.name])
    found = parameters.accelerations(system.state(q, u))[:, 0]

    def at(value):
        other = system.with_numbers(number.scene_at(value))
        if name.startswith("arm") and key != "length_m":
            other = fm.compile(number.scene_at(value))
        return other.accelerations(other.state(q, u))

    differences = [
        (at(number.value * (1.0 + h)) - at(number.value * (1.0 - h))) / (2.0 * h * number.value)
        for h in (STEP, STEP / 2.0, STEP / 4.0, STEP / 8.0)
    ]
    fourth = [finer + (finer - coarse) / 3.0 for coarse, finer in pairwise(differences)]  # order
    best, beside = (finer + (finer - coarse) / 15.0 for coarse, finer in pairwise(fourth))
    tiny = [at(number.value * (1.0 + k * STEP * 2.0**-30)) for k in range(VALUES)]
    # Smooth parts have no third differences, whose weights are 1, -3, 3, -1.
    noise = np.sqrt(np.max(np.mean(np.diff(tiny, 3, axis=0) ** 2, axis=0)) / 20.0)
    by_differences = np.linalg.norm([1.0, 20.0 * 2.0, 64.0 * 4.0]) / 45.0 / (STEP * number.value)
    by_tables = 2.0 * np.linalg.norm(_rule(INTERVALS[-1])[1]) / (parameters._rates[0].width * number.scale)
    rounding = DEVIATIONS * noise * np.hypot(by_differences, by_tables) / np.sqrt(2.0)
    allowed = CLOSE * np.max(np.abs(best)) + 3.0 * np.max(np.abs(best - beside)) + rounding
    assert np.max(np.abs(found - best)) <= allowed < 1e-4 * np.max(np.abs(best))
