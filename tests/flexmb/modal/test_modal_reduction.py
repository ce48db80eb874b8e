"""Order, sign and orthogonality of beam modes, attachment modes, damping, nodes, and what is refused."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from flexmb.modal.beam import beam_elements
from flexmb.modal.flexible import flexible_model
from flexmb.modal.integrals import modal_integrals
from flexmb.modal.reduce import beam_modes
from flexmb.modal.stations import inertia_stations, lumps
from flexmb.scene.bodies import BeamNode, TipMass
from tests.flexmb.modal.beam_references import EPS, beam, frequencies

STOUT = {"GAy_N": 300.0, "GAz_N": 200.0, "rotary_y_kg_m": 2e-3, "rotary_z_kg_m": 1e-3, "EIy_Nm2": 1.7}
LUMP = TipMass(
    x_m=0.8, mass_kg=0.4, com_m=(0.1, 0.05, -0.03),
    inertia_kg_m2=((0.02, 0.001, 0.0), (0.001, 0.03, 0.002), (0.0, 0.002, 0.025)),
)  # fmt: skip


def test_degenerate_pair_comes_as_pure_planes_in_family_order():
    tip = flexible_model(beam(7, 6)).nodes["tip"].translation
    planes = np.argmax(np.abs(tip), axis=0)
    assert planes.tolist() == [1, 2, 1, 2, 1, 2]
    assert np.count_nonzero(tip) == 6


def test_tip_displacement_is_positive():
    model = flexible_model(beam(7, 12, {"rotary_y_kg_m": 1e-2, "rotary_z_kg_m": 1e-2, "EIz_Nm2": 1.3}))
    tip = model.nodes["tip"]
    assert np.all(tip.translation.sum(axis=0) + tip.rotation_modes[0] > 0.0)
    assert np.any(tip.rotation_modes[0] > 0.0)


def test_clamped_modes_vanish_at_the_root_exactly():
    root = flexible_model(beam(5, 8, STOUT, theory="timoshenko", tip_masses=(LUMP,))).nodes["root"]
    assert not np.any(root.translation)
    assert not np.any(root.rotation_modes)


@pytest.mark.parametrize("boundary", ["clamped-free", "free-free"])
@pytest.mark.parametrize("static", [False, True])
@pytest.mark.parametrize("points", ["section", "rotary"])
@pytest.mark.parametrize("lump", [(), (LUMP,)])
def test_modes_have_unit_mass_and_are_orthogonal(boundary, static, points, lump):
    modes = {"boundary": boundary, "static": static}
    body = beam(6, 7, STOUT, modes, theory="timoshenko", points=points, tip_masses=lump)
    model = flexible_model(body)
    integrals = modal_integrals(model)
    m = model.mode_count
    assert m == 7 + (6 if static else 0)
    spatial = integrals.spatial_mass
    # Eigenvectors are orthogonal to eps / gap; the gaps in 1/omega^2 are above 1e-4 of the largest value.
    assert spatial[:m, :m] == pytest.approx(np.eye(m), rel=0, abs=len(spatial) * EPS / 1e-4)
    if boundary == "free-free":
        # Momentum and angular momentum of every mode vanish: a mean-axis frame.
        scale = np.sqrt(spatial[-1, -1])
        assert np.abs(spatial[:m, m:]).max() < 1e3 * EPS * scale


def test_stiffness_and_frequencies_agree_with_the_finite_elements():
    body = beam(6, 7, STOUT, {"static": True}, theory="timoshenko", tip_masses=(LUMP,))
    elements = beam_elements(body)
    K = elements.stiffness()
    M = elements.mass(inertia_stations(body, elements.mesh, elements.table), lumps(body))
    modes = beam_modes(elements, K, M, body.modes)
    reduced = modes.columns.T @ K @ modes.columns
    highest = modes.frequencies[-1] ** 2
    assert reduced == pytest.approx(np.diag(modes.frequencies**2), rel=0, abs=1e4 * EPS * highest)


def test_free_beam_has_no_stiffness_against_rigid_motions():
    body = beam(6, 1, STOUT, {"boundary": "free-free"}, theory="timoshenko")
    elements = beam_elements(body)
    K, R = elements.stiffness(), elements.rigid()
    assert R.shape[1] == 6
    assert np.abs(K @ R).max() <= len(K) * EPS * (np.abs(K) @ np.abs(R)).max()


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
def test_static_modes_make_tip_loads_exact(theory):
    length, EI, GA, P = 2.0, 1.0, 300.0, 0.3
    body = beam(4, 1, STOUT, {"families": ("bending_y",), "static": True}, theory=theory, length_m=length)
    model = flexible_model(body)
    tip = model.nodes["tip"].translation[1]
    deflection = tip @ np.linalg.solve(model.stiffness, tip * P)
    shear = P * length / GA if theory == "timoshenko" else 0.0
    assert deflection == pytest.approx(P * length**3 / (3.0 * EI) + shear, rel=1e-10)
    slope = model.nodes["tip"].rotation_modes[2] @ np.linalg.solve(model.stiffness, tip * P)
    assert slope == pytest.approx(P * length**2 / (2.0 * EI), rel=1e-10)


def test_static_modes_of_a_free_beam_make_its_tip_flexibility_exact():
    # Sum over all modes of (tip / omega)^2 with tip^2 = 4 / (m L): 4 L^3/EI sum 1/(beta_n L)^4, and the power
    # series of 1 - cos cosh gives sum 1/(beta_n L)^4 = 1/420.
    modes = {"families": ("bending_z",), "static": True, "boundary": "free-free"}
    model = flexible_model(beam(4, 2, {"EIy_Nm2": 1.7}, modes))
    tip = model.nodes["tip"].translation[2]
    assert tip @ np.linalg.solve(model.stiffness, tip) == pytest.approx(1.0 / (105.0 * 1.7), rel=1e-10)


def test_static_modes_keep_the_eigenmodes():
    plain, extended = (frequencies(beam(8, 6, modes={"static": static})) for static in (False, True))
    assert extended[:6] == pytest.approx(plain, rel=1e-14)
    assert len(extended) == 6 + 6  # axial force, torque, two forces and two moments of bending


def test_modal_damping():
    ratios = (0.01, 0.02, 0.03)
    model = flexible_model(beam(4, 3, modes={"damping_ratio": ratios, "families": ("bending_z",)}))
    omega = np.sqrt(np.diag(model.stiffness))
    assert np.array_equal(model.damping, np.diag(2.0 * np.array(ratios) * omega))
    with pytest.raises(ValueError, match="beam 'beam': damping_ratio has 2 entries for 3 modes"):
        flexible_model(beam(4, 3, modes={"damping_ratio": (0.01, 0.02)}))


def test_nodes():
    half = np.sqrt(0.5)
    body = beam(5, 4, nodes=(BeamNode(name="middle", x_m=0.5, quaternion=(half, 0.0, 0.0, half)),))
    nodes = flexible_model(body).nodes
    assert set(nodes) == {"origin", "root", "tip", "middle"}
    assert nodes["middle"].position.tolist() == [0.5, 0.0, 0.0]
    quarter_turn = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    assert nodes["middle"].rotation == pytest.approx(np.array(quarter_turn), abs=2 * EPS)
    assert not np.any(nodes["origin"].translation)


def test_node_rotation_is_the_slope_of_the_deflection():
    h = 1e-5
    names = [("a", 0.55 - h), ("b", 0.55), ("c", 0.55 + h)]
    nodes = flexible_model(beam(5, 6, nodes=tuple(BeamNode(name=n, x_m=x) for n, x in names))).nodes
    slope = (nodes["c"].translation - nodes["a"].translation) / (2 * h)
    # rz = v', ry = -w'; central difference: h^2 v'''/6 with v''' < 1e3, and round-off eps/h.
    assert nodes["b"].rotation_modes[2] == pytest.approx(slope[1], abs=1e-7)
    assert nodes["b"].rotation_modes[1] == pytest.approx(-slope[2], abs=1e-7)


def test_no_modes_at_all():
    model = flexible_model(beam(3, 0))
    assert model.mode_count == 0
    assert modal_integrals(model).spatial_mass.shape == (6, 6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stations": ()}, "no station"),
        ({"elements": 0}, "elements >= 1"),
        ({"theory": "timoshenko"}, "needs GAy_N and GAz_N"),
        ({"tip_masses": (TipMass(x_m=1.5, mass_kg=1.0),)}, "not on"),
        ({"tip_masses": (TipMass(x_m=1.0, mass_kg=0.0),)}, "mass_kg > 0"),
        ({"tip_masses": (TipMass(x_m=1.0, mass_kg=1.0, inertia_kg_m2=((9, 0, 0), (0, 1, 0), (0, 0, 1))),)}, "triangle"),
        ({"nodes": (BeamNode(name="off", x_m=-0.1),)}, "node 'off'"),
    ],
)
def test_bad_beams_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        flexible_model(msgspec.structs.replace(beam(3, 2), **changes))
