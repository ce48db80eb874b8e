"""Frequencies of beams against closed forms, transfer matrices and published roots, and how fast they converge."""

from __future__ import annotations

import numpy as np
import pytest

from flexmb.modal.flexible import flexible_model
from flexmb.scene.bodies import BeamStation, TipMass
from tests.flexmb.modal.beam_references import (
    UNIT,
    beam,
    clamped_free_roots,
    free_free_roots,
    frequencies,
    plane_roots,
    slopes,
    tip_mass_roots,
    varying_roots,
)

BENDING = {"families": ("bending_y",)}
SHEAR = {"GAy_N": 300.0, "GAz_N": 300.0, "rotary_y_kg_m": 2e-3, "rotary_z_kg_m": 2e-3}

# With 16 to 24 elements the discretisation error of modes 5 to 7 is 1e-10 to 1e-7, at least 30 times the round-off of
# the eigenproblem (below 1e-11 there), so observed orders are undisturbed to the band of 0.1.
SIZES = [16, 20, 24]
COUNT = 7
LAST = slice(4, COUNT)
BAND = 0.1


def observed_order(models: list, reference: np.ndarray, modes: slice) -> np.ndarray:
    """Orders over the sizes' whole range, for some modes."""
    errors = np.array([np.abs(frequencies(body)[modes] / reference[modes] - 1.0) for body in models])
    return slopes([SIZES[0], SIZES[-1]], errors[[0, -1]])


def test_clamped_roots_of_thirty_two_elements():
    # The printed roots have nine decimals: half a unit, and round-off below that.
    printed = [1.875104069, 4.694091133, 7.854757438, 10.995540735]
    assert np.sqrt(frequencies(beam(32, 4, modes=BENDING))) == pytest.approx(printed, rel=0, abs=1e-9)


@pytest.mark.parametrize("plane", ["bending_y", "bending_z"])
def test_free_free_roots(plane):
    found = frequencies(beam(16, 4, modes={"families": (plane,), "boundary": "free-free"}))
    # h^8 error of mode 4: (beta h)^8 with beta h < 1, measured constant 1e-6, at 16 elements below 1e-8.
    assert np.sqrt(found) == pytest.approx(free_free_roots(4), rel=1e-8)


@pytest.mark.parametrize(
    ("name", "EI", "mass", "length", "printed"),
    [("spin-up beam K", 566.6, 0.2019, 8.0, 2.91032), ("spin-up beam S", 1.4e4, 1.2, 10.0, 3.79773)],
)
def test_first_frequency_of_the_spin_up_beams(name, EI, mass, length, printed):
    body = beam(8, 1, {"EIz_Nm2": EI, "mass_per_length_kg_m": mass}, BENDING, length_m=length)
    assert frequencies(body)[0] == pytest.approx(printed, rel=0, abs=1e-5)  # last printed digit


def test_bending_converges_with_order_eight():
    reference = clamped_free_roots(COUNT) ** 2
    order = observed_order([beam(n, COUNT, modes=BENDING) for n in SIZES], reference, LAST)
    assert order == pytest.approx(8.0, abs=BAND)


def test_timoshenko_converges_to_the_transfer_matrix_with_order_eight():
    models = [beam(n, COUNT, SHEAR, BENDING, theory="timoshenko") for n in SIZES]
    reference = plane_roots(1.0, 1.0, 300.0, 1.0, 2e-3, frequencies(models[-1]))
    assert observed_order(models, reference, LAST) == pytest.approx(8.0, abs=BAND)


@pytest.mark.parametrize(
    ("family", "section", "speed"),
    [("axial", {"EA_N": 90.0, "mass_per_length_kg_m": 0.4}, np.sqrt(90.0 / 0.4)),
     ("torsion", {"GJ_Nm2": 0.7, "rotary_y_kg_m": 1e-3, "rotary_z_kg_m": 3e-3}, np.sqrt(0.7 / 4e-3))],
)  # fmt: skip
def test_axial_and_torsion_closed_forms(family, section, speed):
    reference = (np.arange(COUNT) + 0.5) * np.pi * speed
    models = [beam(n, COUNT, section, {"families": (family,)}) for n in SIZES]
    assert observed_order(models, reference, LAST) == pytest.approx(8.0, abs=BAND)


@pytest.mark.parametrize(
    ("family", "section", "speed"),
    [("axial", {}, 100.0), ("torsion", {"rotary_y_kg_m": 2e-3, "rotary_z_kg_m": 5e-3}, 10.0)],
)
def test_free_rods(family, section, speed):
    found = frequencies(beam(16, 3, section, {"families": (family,), "boundary": "free-free"}))
    # h^8 error of mode 3 at 16 elements, from the measured 7e-11 of clamped mode 3.
    assert found == pytest.approx(np.arange(1, 4) * np.pi * speed, rel=1e-9)


def test_rotary_inertia_of_an_euler_bernoulli_beam():
    found = frequencies(beam(16, 3, {"rotary_z_kg_m": 2e-3}, BENDING))
    # The transfer matrix needs some shear: GA = 1e10 changes omega by less than EI/GA beta^2 < 1e-8.
    assert found == pytest.approx(plane_roots(1.0, 1.0, 1e10, 1.0, 2e-3, found), rel=1e-8)


def test_tapered_beam_converges_with_order_eight():
    ends = (BeamStation(**UNIT), BeamStation(**(UNIT | {"x_m": 1.0, "EIz_Nm2": 0.2, "mass_per_length_kg_m": 0.4})))
    models = [beam(n, COUNT, modes=BENDING, stations=ends) for n in SIZES]
    reference = varying_roots(lambda x: 1.0 - 0.8 * x, lambda x: 1.0 - 0.6 * x, frequencies(models[-1]))
    # Only mode 5: beyond it the reference itself (shooting, whose solutions grow as exp(beta L)) is off by 1e-9.
    assert observed_order(models, reference, slice(4, 5)) == pytest.approx(8.0, abs=BAND)


def test_section_kink_inside_an_element_is_integrated():
    kink = 0.37
    stations = tuple(
        BeamStation(**(UNIT | {"x_m": x, "EIz_Nm2": EI, "mass_per_length_kg_m": mass}))
        for x, EI, mass in [(0.0, 1.0, 1.0), (kink, 0.5, 1.0), (1.0, 0.3, 0.4)]
    )

    def EI(x):
        return np.interp(x, [0.0, kink, 1.0], [1.0, 0.5, 0.3])

    def mass(x):
        return np.interp(x, [0.0, kink, 1.0], [1.0, 1.0, 0.4])

    found = [frequencies(beam(n, 2, modes=BENDING, stations=stations)) for n in (20, 40)]
    reference = varying_roots(EI, mass, found[-1])
    errors = np.abs(np.array(found) / reference - 1.0)
    # The curvature has a kink there, which no polynomial follows: error h^3 of a small term, no longer h^8.
    assert errors[1].max() < 1e-6
    assert errors[1].max() < errors[0].max() / 4.0


def test_tip_mass_roots():
    tip = (TipMass(x_m=1.0, mass_kg=0.5),)
    found = frequencies(beam(16, 3, modes=BENDING, tip_masses=tip))
    assert np.sqrt(found) == pytest.approx(tip_mass_roots(0.5, 3), rel=1e-9)


@pytest.mark.parametrize("points", ["section", "rotary"])
def test_tip_lump_with_offset_and_inertia_against_the_transfer_matrix(points):
    J = ((0.01, 0.0, 0.0), (0.0, 0.02, 0.0), (0.0, 0.0, 0.015))
    tip = (TipMass(x_m=1.0, mass_kg=0.5, com_m=(0.1, 0.0, 0.0), inertia_kg_m2=J),)
    found = frequencies(beam(16, 3, SHEAR, BENDING, theory="timoshenko", tip_masses=tip, points=points))
    lump = np.array([[0.5, 0.05], [0.05, 0.015 + 0.5 * 0.1**2]])
    assert found == pytest.approx(plane_roots(1.0, 1.0, 300.0, 1.0, 2e-3, found, lump), rel=1e-9)


@pytest.mark.parametrize("GA", [1e6, 1e9, 1e12])
def test_thin_timoshenko_beams_do_not_lock(GA):
    thin = frequencies(beam(2, 2, {"GAy_N": GA, "GAz_N": GA}, BENDING, theory="timoshenko"))
    without_shear = frequencies(beam(2, 2, modes=BENDING))
    # Shear lowers omega by at most (EI / GA) beta^2 (first-order perturbation, no rotary inertia; beta L < 4.7).
    # Round-off: eps times the stiffness ratio GA h^2 / EI that the factorisation meets.
    assert thin == pytest.approx(without_shear, rel=22.1 / GA + 1e-15 * GA / 4)


def test_lumped_mass_converges_with_order_two():
    reference = clamped_free_roots(2) ** 2
    models = [beam(n, 2, modes=BENDING, mass="lumped") for n in SIZES]
    assert observed_order(models, reference, slice(0, 1)) == pytest.approx(2.0, abs=BAND)
    model = flexible_model(models[0])
    assert model.mass.sum() == pytest.approx(1.0, rel=len(model.mass) * np.finfo(float).eps)
    assert len(model.mass) == SIZES[0] + 1
