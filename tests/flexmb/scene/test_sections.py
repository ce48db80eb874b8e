"""Sections that are refused, each with the place and the remedy; and those that are not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.check import SceneError, check_scene
from flexmb.scene.files import load_scene, save_scene
from flexmb.scene.sections import inertia_on_axis, matrix, restated, stiffness_on_axis
from flexmb.scene.shapes import beam_section
from tests.flexmb.modal.coupled_references import coupled_stiffness, section_mass, station

K, M = coupled_stiffness(), section_mass()
NUMBERS = beam_section(E=7e10, G=2.7e10, A=1e-3, Iy=2e-7, Iz=5e-7, rho=2700.0)
ALONE = coupled_stiffness({(3, 4): 0.3})


def scene(*stations: s.BeamStation, **beam: Any) -> s.Scene:
    given: dict[str, Any] = {"theory": "timoshenko", "modes": 4} | beam
    whole = [replace(each, x_m=x) for each, x in zip(stations * (3 - len(stations)), (0.0, 2.0), strict=True)]
    return SceneBuilder("blade").beam("blade", length=2.0, elements=4, section=whole, **given).weld(
        "root", "ground", "blade"
    ).scene()  # fmt: skip


def with_element(values: np.ndarray, *changes: tuple[int, int, float]) -> np.ndarray:
    changed = values.copy()
    for i, j, value in changes:
        changed[i, j] = value
    return changed


def both(i: int, j: int, value: float) -> tuple[tuple[int, int, float], tuple[int, int, float]]:
    return (i, j, value), (j, i, value)


BENDING = s.Modes(count=2, families=("bending_y", "bending_z"))
CASES: dict[str, tuple[s.BeamStation, dict[str, Any], str, str]] = {
    "stiffness twice": (replace(station(0.0, K, M), EA_N=1e6), {}, "stations[0].stiffness", "twice"),
    "mass twice": (replace(station(0.0, K, M), rotary_y_kg_m=1e-3), {}, "stations[0].inertia", "by rotary_y_kg_m"),
    "no stiffness": (replace(NUMBERS, EA_N=None), {}, "stations[0]", "or the matrix stiffness"),
    "no mass": (replace(NUMBERS, mass_per_length_kg_m=None), {}, "stations[0]", "or the matrix inertia"),
    "no shear": (replace(NUMBERS, GAz_N=None), {}, "stations[0]", "needs GAz_N"),
    "not symmetric": (
        station(0.0, with_element(K, (0, 4, 9.0)), M), {}, "stations[0].stiffness", "not symmetric: [0][4]"),
    "no twisting stiffness": (station(0.0, with_element(K, (3, 3, 0.0)), M), {}, "stiffness[3][3]", "twist is 0"),
    "too much coupling": (
        station(0.0, with_element(K, *both(3, 4, 1.1 * np.sqrt(K[3, 3] * K[4, 4]))), M), {}, "stations[0].stiffness",
        "a strain of twist with curvature about y costs no energy"),
    "no mass in a matrix": (station(0.0, K, 0.0 * M), {}, "inertia[0][0]", "mass per length is 0"),
    "two masses": (station(0.0, K, with_element(M, (1, 1, 3.0))), {}, "inertia[1][1]", "one mass m"),
    "centre out of the section": (
        station(0.0, K, with_element(M, *both(1, 5, 0.3))), {}, "inertia[1][5]", "c = (0, cy, cz)"),
    "first moment of the other sign": (
        station(0.0, K, with_element(M, *both(1, 3, -M[1, 3]))), {}, "inertia[1][3]", "[m 1, -m c~; m c~, J]"),
    "inertia about the mass centre": (
        station(0.0, K, with_element(M, *((i, i, 1e-4 * i) for i in (3, 4, 5)))), {},
        "stations[0].inertia", "is J about the reference point?"),
    "inertia not symmetric": (
        station(0.0, K, with_element(M, (4, 5, 0.0))), {}, "stations[0].inertia", "not symmetric"),
    "polar inertia of its own": (
        station(0.0, K, with_element(M, (3, 3, M[3, 3] - 1e-3))), {}, "stations[0].inertia", 'points = "rotary"'),
    "a family left out": (station(0.0, ALONE, M), {"modes": BENDING}, "modes.families", 'add "torsion"'),
    "shear of a beam without it": (
        station(0.0, K, M), {"theory": "euler-bernoulli"}, "stations[0]", 'theory = "timoshenko"'),
    "an axis off the shear centres": (
        replace(NUMBERS, reference_point_m=(0.0, 0.02)), {"theory": "euler-bernoulli"}, "stations[0]",
        "shears with twist"),
    "an error of units": (station(0.0, 1e3 * K, 1e-3 * M), {}, "stiffness[0][0]", "waves would run"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_what_is_wrong_is_said_with_its_place_and_remedy(name: str) -> None:
    section, beam, place, words = CASES[name]
    with_problem = _unchecked(section, beam)
    if name == "an error of units":
        found = [*check_scene(with_problem)]
    else:
        with pytest.raises(SceneError) as error:
            check_scene(with_problem)
        found = [*error.value.problems]
    assert all(place in each.where and words in str(each) for each in found[:1]), found
    assert all(each.remedy for each in found)


def _unchecked(section: s.BeamStation, beam: dict[str, Any]) -> s.Scene:
    """The scene as a struct, which the builder would refuse."""
    sound = scene(station(0.0, ALONE, M), theory="timoshenko")
    given = {"theory": "timoshenko"} | beam
    stations = section, replace(section, x_m=2.0)
    return replace(sound, bodies=(replace(sound.bodies[0], stations=stations, **given),))


@pytest.mark.parametrize("section", [
    station(0.0, K, M), station(0.0, K, M, (0.1, -0.2)), replace(NUMBERS, reference_point_m=(0.02, 0.0)),
    replace(station(0.0, K, M), inertia=None, mass_per_length_kg_m=2.7, rotary_y_kg_m=1e-3),
    replace(NUMBERS, mass_per_length_kg_m=None, rotary_y_kg_m=0.0, rotary_z_kg_m=0.0, inertia=matrix(M)),
], ids=["matrices", "elsewhere", "numbers elsewhere", "a matrix and numbers", "numbers and a matrix"])  # fmt: skip
def test_sections_are_written_and_read(section: s.BeamStation, tmp_path) -> None:
    whole = scene(section)
    assert check_scene(whole) == ()
    save_scene(whole, tmp_path / "scene.toml")
    assert load_scene(tmp_path / "scene.toml").bodies == whole.bodies


def test_a_plane_beam_may_be_beside_its_axis_without_shear() -> None:
    """What its twist would do is not asked, as it has none."""
    modes = s.Modes(count=3, families=("axial", "bending_y"))
    beside = scene(replace(NUMBERS, reference_point_m=(0.02, 0.0)), theory="euler-bernoulli", modes=modes)
    assert check_scene(beside) == ()


def test_a_section_that_is_stated_elsewhere_comes_back() -> None:
    """There and back to rounding, and nothing is left of what cancels: numbers on the axis couple nothing again."""
    back = restated(restated(NUMBERS, (0.03, -0.05)), (0.0, 0.0))
    for of_axis in (stiffness_on_axis, inertia_on_axis):
        expected = of_axis(NUMBERS)
        np.testing.assert_allclose(of_axis(back), expected, rtol=1e-11)
        assert np.array_equal(of_axis(restated(NUMBERS, (0.03, -0.05))) == 0.0, expected == 0.0)
