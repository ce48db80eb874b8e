"""What a beam is asked to do it does, whatever its inertia: loads at its tip move it as closed forms say.

The catalogue of levels, families and optional keys is read from the schema; sections have no rotary inertia, as by
default.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import get_args, get_type_hints

import numpy as np
import pytest
from msgspec.structs import replace as changed

from flexmb.modal.flexible import flexible_model
from flexmb.modal.integrals import modal_integrals
from flexmb.scene.bodies import (
    FAMILIES,
    BeamBody,
    BeamStation,
    Family,
    Level,
    Modes,
    StrainPolynomials,
    TipMass,
)
from flexmb.scene.strains import STRAINS, as_fine, families, in_words, polynomials, strain_count, strains, twist_inertia
from flexmb.typing import Real

L, EA, EIY, EIZ, GJ, GAY, GAZ, M = 2.0, 1e6, 60.0, 90.0, 50.0, 1e5, 2e5, 0.3
SECTION = BeamStation(
    x_m=0.0, EA_N=EA, EIy_Nm2=EIY, EIz_Nm2=EIZ, GJ_Nm2=GJ, GAy_N=GAY, GAz_N=GAZ, mass_per_length_kg_m=M
)
TWIST = M * (EIY + EIZ) / EA
LEVELS = tuple(level for level in get_args(Level) if level != "rigid")
KEYS = {
    key: get_args(hint)
    for key, hint in get_type_hints(BeamBody).items()
    if key != "level" and get_args(hint) and all(isinstance(value, str) for value in get_args(hint))
}
"""Optional keys of a beam that choose among names."""


def beam(level: Level = "full", own: tuple[Family, ...] | None = None, count: int = 3, section: BeamStation = SECTION,
         **more: object) -> BeamBody:  # fmt: skip
    modes = Modes(count=count, families=own, static=level != "exact")
    stations = section, changed(section, x_m=L)
    body = BeamBody(name="beam", length_m=L, elements=6, stations=stations, modes=modes, level=level)
    return changed(body, **more)


def compliance(body: BeamBody) -> Real:
    """(6,6): displacement and rotation of the tip at rest under unit forces and moments there."""
    model = flexible_model(body)
    shapes = np.vstack([model.nodes["tip"].translation, model.nodes["tip"].rotation_modes])
    found: Real = shapes @ np.linalg.solve(model.stiffness, shapes.T)
    return found


def closed_form(own: tuple[Family, ...], sheared: bool) -> Real:
    found = np.zeros((6, 6))
    if "axial" in own:
        found[0, 0] = L / EA
    if "torsion" in own:
        found[3, 3] = L / GJ
    planes = ("bending_y", 1, 5, EIZ, GAY, 1.0), ("bending_z", 2, 4, EIY, GAZ, -1.0)
    for family, across, about, EI, GA, sign in planes:
        if family in own:
            found[across, across] = L**3 / (3.0 * EI) + (L / GA if sheared else 0.0)
            found[about, about] = L / EI
            found[across, about] = found[about, across] = sign * L**2 / (2.0 * EI)
    return found


def test_the_catalogue_is_whole() -> None:
    assert set(KEYS) == {"theory", "mass", "points"} and len(LEVELS) == 5
    assert set(FAMILIES) == set(get_args(Family))


@pytest.mark.parametrize("key, value", [(key, value) for key, values in KEYS.items() for value in values])
@pytest.mark.parametrize("level", LEVELS)
def test_a_force_and_a_moment_at_the_tip(level: Level, key: str, value: str) -> None:
    if level == "exact" and value == "lumped":
        pytest.skip("level exact has its inertia at Gauss points")
    sheared = value == "timoshenko"
    for own in (None, *((family,) for family in FAMILIES)):
        body = beam(level, own, **{key: value})
        np.testing.assert_allclose(
            compliance(body), closed_form(families(body), sheared), rtol=1e-9, atol=1e-14, err_msg=str(own)
        )
        if own is not None:
            assert set(own) <= set(strains(body))


def test_what_is_left_out_by_default_is_said() -> None:
    borrowed = f"; its sections have no inertia about the axis, and the twist has {TWIST:.3g} kg m"
    assert in_words(beam()) == f"axial, torsion, bending_z, bending_y{borrowed}"
    assert in_words(beam("exact")) == f"3 torsion, 3 bending_z, 3 bending_y; held: axial{borrowed}"
    assert in_words(beam("exact", ("axial", "bending_y"))) == "1 axial, 3 bending_y; held: torsion, bending_z"


@pytest.mark.parametrize("points", KEYS["points"])
def test_twist_has_the_frequencies_of_a_homogeneous_bar(points: str) -> None:
    body = changed(beam(own=("torsion",), count=3, points=points), elements=24)
    found = np.sqrt(np.diag(flexible_model(body).stiffness))[:3]
    wanted = (np.arange(3) + 0.5) * np.pi / L * np.sqrt(GJ / TWIST)
    np.testing.assert_allclose(found, wanted, rtol=1e-6)
    strain = flexible_model(changed(beam("exact", ("torsion",), count=8), points=points)).stiffness
    np.testing.assert_allclose(np.sqrt(np.diag(strain))[:2], wanted[:2], rtol=1e-6)


def test_a_line_twists_with_the_inertia_that_its_sections_state() -> None:
    stated = changed(SECTION, rotary_y_kg_m=2e-5, rotary_z_kg_m=3e-5)
    body = beam(section=stated, points="line")
    np.testing.assert_allclose(twist_inertia(body, list(body.stations)), 5e-5, rtol=1e-15)
    assert not np.any(twist_inertia(beam(section=stated), list(body.stations)))
    assert not np.any(twist_inertia(beam(own=("axial",)), list(body.stations)))


@pytest.mark.parametrize("level", ["ruthless", "linear", "full", "stiffened"])
def test_rigid_motion_and_bending_do_not_feel_it(level: Level) -> None:
    """The spatial mass matrix has one mode more, of unit mass, that couples with nothing."""
    bending: tuple[Family, ...] = ("bending_y", "bending_z")
    without, with_twist = (flexible_model(beam(level, own, count=2)) for own in (bending, (*bending, "torsion")))
    masses = [modal_integrals(replace(model, second=None)).spatial_mass for model in (without, with_twist)]
    twists = int(np.argmax(np.abs(with_twist.nodes["tip"].rotation_modes[0])))
    rest = np.delete(np.arange(len(masses[1])), twists)
    scale = np.max(np.abs(masses[0]))
    np.testing.assert_allclose(masses[1][np.ix_(rest, rest)], masses[0], rtol=0.0, atol=1e-12 * scale)
    np.testing.assert_allclose(masses[1][twists, rest], 0.0, rtol=0.0, atol=1e-12 * scale)
    assert masses[1][twists, twists] == pytest.approx(1.0, rel=1e-12)


def test_a_lump_inside_leaves_the_part_beyond_it_soft() -> None:
    lump = TipMass(x_m=0.7 * L, mass_kg=0.2, inertia_kg_m2=((0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.1)))
    for level, points in product(LEVELS, KEYS["points"]):
        found = compliance(beam(level, ("torsion",), points=points, tip_masses=(lump,)))
        assert found[3, 3] == pytest.approx(L / GJ, rel=1e-9), (level, points)


def test_a_quarter_bow_sinks_across_its_plane() -> None:
    radius = 2.0 * L / np.pi
    body = beam("exact", count=8, section=changed(SECTION, curvature_1_m=(0.0, 0.0, 1.0 / radius)))
    wanted = radius**3 * (np.pi / 4.0 / EIY + (0.75 * np.pi - 2.0) / GJ)
    assert compliance(body)[2, 2] == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("count", [3, 6])
def test_a_ruler_that_shears_is_a_beam(count: int) -> None:
    """1 m x 20 mm x 0.5 mm of steel: in shear it is 1e16 times as stiff as in bending."""
    E, rho, b, h = 2.1e11, 7850.0, 0.02, 0.0005
    A, Iy, Iz = b * h, b * h**3 / 12.0, h * b**3 / 12.0
    ruler = BeamStation(
        x_m=0.0, EA_N=E * A, EIy_Nm2=E * Iy, EIz_Nm2=E * Iz, GJ_Nm2=E * Iy * 1.5, GAy_N=0.32 * E * A,
        GAz_N=0.32 * E * A, mass_per_length_kg_m=rho * A, rotary_y_kg_m=rho * Iy, rotary_z_kg_m=rho * Iz,
    )  # fmt: skip
    body = beam("exact", count=count, section=ruler, theory="timoshenko")
    assert compliance(body)[2, 2] == pytest.approx(L**3 / (3.0 * E * Iy) + L / (0.32 * E * A), rel=1e-9)
    assert set(polynomials(body)) == set(STRAINS) - {"axial"}
    masses = modal_integrals(flexible_model(body)).spatial_mass[: strain_count(body), : strain_count(body)]
    np.testing.assert_allclose(masses, np.eye(len(masses)), rtol=0.0, atol=1e-6)


def test_as_fine_keeps_every_strain() -> None:
    own = StrainPolynomials(axial=3, bending_y=4)
    body = changed(beam("exact"), modes=Modes(count=0, polynomials=own))
    assert as_fine(body, 6) == StrainPolynomials(axial=4, bending_y=6)
    assert as_fine(body, 1) == StrainPolynomials(axial=1, bending_y=1)
