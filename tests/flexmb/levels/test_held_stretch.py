"""A run or an equilibrium says that loads would stretch a beam of level exact whose stretch is held by default."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from msgspec.structs import replace

import flexmb as fm
from flexmb.scene.bodies import Family

LENGTH, EA, MASS, GRAVITY = 1.0, 60.0, 0.6, 9.81
HUNG = MASS * GRAVITY * LENGTH / (2.0 * EA)  # 4.9 % of the length


def rod(families: tuple[Family, ...] | None = None, EA: float = EA) -> fm.Scene:
    """Hanging along its axis."""
    section = fm.BeamStation(
        x_m=0.0, EA_N=EA, EIy_Nm2=0.5, EIz_Nm2=0.5, GJ_Nm2=0.5, mass_per_length_kg_m=MASS,
        rotary_y_kg_m=1e-4, rotary_z_kg_m=1e-4,
    )  # fmt: skip
    made = fm.SceneBuilder("rod", gravity=(GRAVITY, 0.0, 0.0), allow=("wave_speed", "thick_section"))
    modes = fm.Modes(count=4, families=families)
    made.beam("rod", length=LENGTH, elements=8, section=section, modes=modes, level="exact")
    return made.weld("mount", "ground", "rod").marker("tip", "rod", node="tip").scene()


def said(scene: fm.Scene) -> list[str]:
    """By an equilibrium and by a run."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        state = fm.equilibrium(scene)
        fm.simulate(scene, 0.01, samples=3, state=state)
    return [str(each.message) for each in found if "held against stretch" in str(each.message)]


def test_a_hanging_rod_of_default_families_says_what_it_leaves_out() -> None:
    found = said(rod())
    assert len(found) == 2  # of the equilibrium, of the run
    assert all(f"lengthen it by {HUNG:.2g} of its length" in each and '"axial"' in each for each in found)


def test_the_remedy_gives_the_closed_form() -> None:
    scene = rod(("axial", "bending_y"))
    assert said(scene) == []
    state, system = fm.equilibrium(scene), fm.compile(scene)
    tip = system.evaluate(0.0, state.q, state.u).markers["tip"].position
    np.testing.assert_allclose(tip, [LENGTH + HUNG, 0.0, 0.0], atol=1e-12)


def test_nothing_is_said_of_little_and_where_it_is_waived() -> None:
    assert said(rod(EA=60.0 * EA)) == []  # 8e-4
    assert said(replace(rod(), allow=(*rod().allow, "held_stretch"))) == []


@pytest.mark.parametrize("rate", [3.0, 0.3])
def test_a_spinning_rod_is_pulled(rate: float) -> None:
    """A free one, whose hinge carries nothing: N = m w^2 (L^2 / 4 - s^2) / 2 at s from its middle."""
    scene = replace(rod(), gravity_m_s2=(0.0, 0.0, 0.0), hinges=())
    free = fm.Free(name="free", parent="ground", child="rod", angular_velocity_rad_s=(0.0, 0.0, rate),
                   velocity_m_s=(0.0, -rate * LENGTH / 2.0, 0.0))  # fmt: skip
    scene = replace(scene, hinges=(free,))
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        fm.simulate(scene, 0.01, samples=3)
    words = [str(each.message) for each in found if "held against stretch" in str(each.message)]
    stretch = MASS * rate**2 * LENGTH**2 / (12.0 * EA)
    assert words == [] if stretch < 1e-3 else f"lengthen it by {stretch:.2g} of" in words[0]
