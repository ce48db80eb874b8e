"""Inertia points of beams: their sums are the finite-element mass matrix and the rigid body's mass properties."""

from __future__ import annotations

import numpy as np
import pytest

from flexmb.modal.beam import beam_elements
from flexmb.modal.flexible import flexible_model
from flexmb.modal.integrals import modal_integrals
from flexmb.modal.interpolation import BendingField, ElementMesh, LineField
from flexmb.modal.stations import inertia_stations
from flexmb.scene.bodies import BeamStation, TipMass
from tests.flexmb.modal.beam_references import EPS, UNIT, beam

STOUT = {"rotary_y_kg_m": 2e-3, "rotary_z_kg_m": 1e-3, "EIy_Nm2": 1.7}
LUMP = TipMass(
    x_m=1.0, mass_kg=0.4, com_m=(0.1, 0.05, -0.03),
    inertia_kg_m2=((0.02, 0.001, 0.0), (0.001, 0.03, 0.002), (0.0, 0.002, 0.025)),
)  # fmt: skip


def test_uniform_element_mass_and_stiffness_are_the_textbook_matrices():
    h, mass, EI = 0.7, 1.3, 2.1
    body = beam(1, 0, {"EIz_Nm2": EI, "mass_per_length_kg_m": mass}, {"families": ("bending_y",)}, length_m=h)
    elements = beam_elements(body)
    M = elements.mass(inertia_stations(body, elements.mesh, elements.table), ())[:4, :4]
    K = elements.stiffness()[:4, :4]
    textbook_M = mass * h / 420 * np.array([
        [156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2],
        [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2],
    ])  # fmt: skip
    textbook_K = EI / h**3 * np.array([
        [12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2],
        [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2],
    ])  # fmt: skip
    assert pytest.approx(textbook_M, rel=0, abs=16 * EPS * textbook_M.max()) == M
    assert pytest.approx(textbook_K, rel=0, abs=16 * EPS * textbook_K.max()) == K


@pytest.mark.parametrize("shear", [False, True])
def test_bending_rows_are_derivatives_of_one_another(shear):
    field = BendingField(ElementMesh(np.linspace(0.0, 1.0, 4)), shear)
    x, h = np.linspace(0.05, 0.95, 7), 1e-5
    middle, before, after = field.at(x), field.at(x - h), field.at(x + h)
    # Central differences of polynomials of degree 5 with coefficients up to 60/l^2: h^2 * 1e4.
    assert middle.curvature == pytest.approx((after.rotation - before.rotation) / (2 * h), abs=1e-5)
    assert middle.shear == pytest.approx((after.deflection - before.deflection) / (2 * h) - middle.rotation, abs=1e-5)


def test_fields_are_continuous_and_reproduce_rigid_motion():
    mesh = ElementMesh(np.linspace(0.0, 2.0, 5))
    before = np.nextafter(mesh.nodes[1:-1], 0.0)
    for field in (BendingField(mesh, True), BendingField(mesh, False)):
        here, there = field.at(mesh.nodes[1:-1]), field.at(before)
        assert here.deflection == pytest.approx(there.deflection, abs=1e-14)
        assert here.rotation == pytest.approx(there.rotation, abs=1e-14)
        x = np.linspace(0.0, 2.0, 9)
        assert field.at(x).deflection @ field.rigid()[:, 1] == pytest.approx(x, abs=8 * EPS)
        assert field.at(x).rotation @ field.rigid()[:, 1] == pytest.approx(np.ones(9), abs=16 * EPS)
    line = LineField(mesh)
    assert line.at(mesh.nodes[1:-1]).value == pytest.approx(line.at(before).value, abs=1e-14)


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
@pytest.mark.parametrize("tips", [(), (LUMP,)])
def test_section_and_rotary_points_have_the_same_mass_matrix(mass, tips):
    models = [flexible_model(beam(4, 8, STOUT, points=p, mass=mass, tip_masses=tips)) for p in ("section", "rotary")]
    section, rotary = (modal_integrals(model) for model in models)
    assert not np.any(models[0].inertia)
    assert not np.any(models[0].com_offset)
    assert len(section.turning.mass) == 0
    scale = np.sqrt(np.outer(np.diag(rotary.spatial_mass), np.diag(rotary.spatial_mass)))
    # Both are sums over N points, each good to N eps of its terms; the terms of an entry are bounded by `scale`.
    bound = len(models[0].mass) * EPS * scale
    assert np.all(np.abs(section.spatial_mass - rotary.spatial_mass) <= bound)


def test_line_points_drop_the_section_inertia_from_modes_and_points_alike():
    bending = {"families": ("axial", "bending_y", "bending_z")}
    model = flexible_model(beam(4, 6, STOUT, bending, points="line"))
    integrals = modal_integrals(model)
    assert not np.any(model.inertia)
    assert integrals.M_ff == pytest.approx(np.eye(6), rel=0, abs=1e4 * EPS)
    without = flexible_model(beam(4, 6, {"EIy_Nm2": 1.7}, bending))
    assert np.array_equal(model.stiffness, without.stiffness)


@pytest.mark.parametrize("points", ["line", "rotary", "section"])
@pytest.mark.parametrize("mass", ["consistent", "lumped"])
def test_mass_properties_of_the_undeformed_beam(points, mass):
    body = beam(5, 2, STOUT, {"families": ("bending_y",)}, points=points, mass=mass, tip_masses=(LUMP,))
    spatial = modal_integrals(flexible_model(body)).spatial_mass[2:, 2:]
    c = np.array([1.0, 0.0, 0.0]) + np.array(LUMP.com_m)
    first_moment = np.array([0.5, 0.0, 0.0]) + 0.4 * c
    assert spatial[3:, 3:] == pytest.approx(1.4 * np.eye(3), abs=64 * EPS)
    moment = np.array([spatial[2, 4], spatial[0, 5], spatial[1, 3]])  # of the cross-product matrix: sx, sy, sz
    assert moment == pytest.approx(first_moment, abs=64 * EPS)
    lump = np.array(LUMP.inertia_kg_m2) + 0.4 * (c @ c * np.eye(3) - np.outer(c, c))
    turning = 0.0 if points == "line" else 1.0
    # Lumping at the nodes is the trapezoidal rule for x^2: exact 1/3 plus h^2/6.
    along = 1.0 / 3.0 + (0.2**2 / 6.0 if mass == "lumped" else 0.0)
    own = np.diag([turning * 3e-3, along + turning * 2e-3, along + turning * 1e-3])
    assert spatial[:3, :3] == pytest.approx(lump + own, abs=64 * EPS)


def test_varying_section_mass():
    stations = tuple(
        BeamStation(**(UNIT | {"x_m": x, "mass_per_length_kg_m": m})) for x, m in [(0, 1), (0.3, 2), (1, 0.5)]
    )
    model = flexible_model(beam(4, 2, stations=stations))
    assert model.mass.sum() == pytest.approx(0.3 * 1.5 + 0.7 * 1.25, rel=len(model.mass) * EPS)
