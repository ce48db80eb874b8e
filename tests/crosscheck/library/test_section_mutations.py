"""Mutations of beams whose sections are matrices, or are stated off the axis."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from crosscheck.library.case import CaseError
from crosscheck.library.mutations import mutate
from flexmb.scene.bodies import BeamBody, BeamStation
from flexmb.scene.build import SceneBuilder
from flexmb.scene.check import check_scene
from flexmb.scene.schema import Scene
from flexmb.scene.sections import mass_centres, matrix, restated
from tests.flexmb.modal.coupled_references import coupled_stiffness, section_mass, station

POINT = (0.03, -0.02)


def blade(section: BeamStation) -> Scene:
    builder = SceneBuilder("blade").beam("blade", length=2.0, elements=4, section=section, modes=4, theory="timoshenko")
    return builder.weld("root", "ground", "blade").scene()


SECTION = station(0.0, coupled_stiffness(), section_mass(), POINT)


def mutated(name, section: BeamStation = SECTION) -> BeamStation:
    """The first station after a mutation, which leaves a sound scene."""
    found = mutate(blade(section), name, "blade")
    check_scene(found)
    body = found.bodies[0]
    assert isinstance(body, BeamBody) and body.stations[0] == replace(body.stations[1], x_m=0.0)
    return body.stations[0]


def test_stiffness_is_that_of_the_whole_matrix() -> None:
    found = mutated("stiffness")
    np.testing.assert_allclose(found.stiffness, 1.01 * coupled_stiffness(), rtol=1e-14)
    assert replace(found, stiffness=SECTION.stiffness) == SECTION


@pytest.mark.parametrize(("name", "mass", "turning"), [("mass", 1.01, 1.0), ("inertia", 1.0, 1.01)])
def test_mass_and_inertia_stay_about_the_mass_centre(name: str, mass: float, turning: float) -> None:
    found = mutated(name)
    before, after = (mass_centres(np.array([each])) for each in (section_mass(), found.inertia))
    np.testing.assert_allclose(after[0], mass * before[0], rtol=1e-14)
    np.testing.assert_allclose(after[1], before[1], rtol=1e-14)
    np.testing.assert_allclose(after[2], turning * before[2], rtol=1e-12)
    assert replace(found, inertia=SECTION.inertia) == SECTION


def test_axes_are_exchanged_in_the_matrix() -> None:
    K = coupled_stiffness({(3, 4): 0.3})
    found = np.array(mutated("section_axes", replace(SECTION, stiffness=matrix(K))).stiffness)
    assert (found[4, 4], found[5, 5]) == (K[5, 5], K[4, 4]) and found[3, 4] == K[3, 4]


def test_the_reference_point_is_forgotten() -> None:
    assert mutated("section_point") == replace(SECTION, reference_point_m=(0.0, 0.0))
    with pytest.raises(CaseError, match="reference point off the axis"):
        mutated("section_point", restated(SECTION, (0.0, 0.0)))
