"""Spinning beams: the closed form where nothing stiffens, published frequencies where it does; modes are followed."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.shapes import beam_section
from tests.bounds import UNIT_ROUNDOFF

EI, RHO_A, LENGTH = 7e3, 2.7, 8.0
UNIT = np.sqrt(EI / (RHO_A * LENGTH**4))  # rad/s
# Wright, Smith, Thresher & Wang 1982: first two flapping frequencies over UNIT, by spin rate over UNIT, no hub radius.
FLAPPING = {0: (3.516015, 22.034492), 2: (4.137320, 22.614922), 4: (5.585001, 24.273349), 6: (7.360373, 26.809082)}


def blade(level: str) -> fm.Scene:
    """Bends across the spin axis z with EI, along it with 2 EI."""
    section = beam_section(E=7e10, G=2.7e10, A=1e-3, Iy=2e-7, Iz=1e-7, rho=2700.0)
    return (
        fm.SceneBuilder("blade", allow=("level_range",))
        .rigid_body("hub", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .revolute("shaft", "ground", "hub", prescribed=fm.SpinUp(rate=2.0, duration_s=5.0))
        .beam("beam", length=LENGTH, elements=24, section=section, modes=8, level=level, points="line")
        .weld("root", "hub", "beam")
        .scene()
    )


@pytest.mark.parametrize("level", ["linear", "full"])
def test_without_stiffening_spin_softens_in_the_plane(level):
    """omega^2 - Omega^2 in the plane of spin, omega along the axis; growth beyond the first frequency, not before."""
    system = fm.compile(blade(level))
    rest = fm.campbell(system, "shaft", [0.0]).eigenvalues[0].imag
    first = rest[0]
    found = fm.campbell(system, "shaft", np.linspace(0.0, 1.3 * first, 14))
    assert np.min(found.mac) > 1.0 - 1e-9
    for i, rate in enumerate(found.rates):
        in_plane, along = rest[::2] ** 2 - rate**2, rest[1::2] ** 2
        tolerance = 2.0**12 * UNIT_ROUNDOFF * rest[-1] ** 2
        np.testing.assert_allclose(-(found.eigenvalues[i, ::2] ** 2).real, in_plane, rtol=0.0, atol=tolerance)
        np.testing.assert_allclose(-(found.eigenvalues[i, 1::2] ** 2).real, along, rtol=0.0, atol=tolerance)
    away = np.abs(found.rates - first) > 1e-6 * first  # at the threshold itself rounding decides
    assert np.array_equal(found.unstable[away], (found.rates > first)[away])


def test_stiffened_blade_has_the_published_frequencies():
    """Along the axis (flapping), the section's stiffer direction; in the plane omega^2 - Omega^2 of the softer one."""
    system = fm.compile(blade("stiffened"))
    unit = np.sqrt(2.0) * UNIT
    found = fm.campbell(system, "shaft", [unit * rate for rate in FLAPPING])
    assert not found.unstable.any()
    assert np.min(found.mac) > 0.9
    for row, rate in zip(found.eigenvalues, FLAPPING, strict=True):
        np.testing.assert_allclose(row[[1, 3]].imag / unit, FLAPPING[rate], rtol=1e-3)


def test_crossing_modes_are_followed():
    """In the plane the second mode falls below the first one along the axis: by shape, not by rank."""
    scene = (
        fm.SceneBuilder("crossing")
        .rigid_body("rail", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .revolute("drive", "ground", "rail")
        .rigid_body("a", mass=1.0, inertia=(0.0, 0.0, 0.0))
        .prismatic("radial", "rail", "a", axis=(1, 0, 0), stiffness=30.0)
        .rigid_body("b", mass=1.0, inertia=(0.0, 0.0, 0.0))
        .prismatic("axial", "rail", "b", axis=(0, 0, 1), stiffness=20.0)
        .scene()
    )
    found = fm.campbell(scene, "drive", np.linspace(0.0, 5.0, 11))
    assert found.names == ("axial.translation", "radial.translation")
    np.testing.assert_allclose(found.eigenvalues[:, 0].imag, np.sqrt(20.0), rtol=1e-14)
    np.testing.assert_allclose(found.eigenvalues[:, 1].imag, np.sqrt(30.0 - found.rates**2), rtol=1e-14)
    assert found.frequencies_hz[-1, 1] < found.frequencies_hz[-1, 0]


def test_wheel_of_a_free_gyrostat():
    """Its nutation grows with the wheel's rate; the bus rests."""
    scene = (
        fm.SceneBuilder("gyrostat")
        .rigid_body("bus", mass=10.0, inertia=(3.0, 3.0, 2.0))
        .free("fly", "ground", "bus")
        .wheel("w", "bus", axis=(0, 0, 1), mass=0.0, axial_inertia=0.02, transverse_inertia=0.011)
        .scene()
    )
    found = fm.campbell(scene, "w", [10.0, 20.0, 40.0])
    np.testing.assert_allclose(np.max(found.eigenvalues.imag, axis=1), 0.02 * found.rates / 3.011, rtol=1e-14)
    assert not found.unstable.any()


def test_csv_and_picture(tmp_path):
    found = fm.campbell(blade("full"), "shaft", [0.0, 1.0])
    lines = found.to_csv(tmp_path / "deep" / "blade.csv").read_text().splitlines()
    assert lines[0].startswith("rate [rad/s],1 beam.mode[0] frequency [Hz],1 beam.mode[0] growth [1/s],2 ")
    assert len(lines) == 3
    assert float(lines[2].split(",")[1]) == found.frequencies_hz[1, 0]
    assert found.plot(tmp_path / "blade.png", modes=4).stat().st_size > 10_000


def test_a_drive_of_the_scene_is_replaced_in_tables_of_its_own_size():
    """The spin is one more function than the scene has: a workspace without a row for it was written beyond its end."""
    driven = blade("full")
    free = fm.Scene(
        name=driven.name,
        allow=driven.allow,
        bodies=driven.bodies,
        hinges=tuple(
            fm.Revolute(name="shaft", parent="ground", child="hub") if hinge.name == "shaft" else hinge
            for hinge in driven.hinges
        ),
    )
    spins = [fm.steady_spin(scene, "shaft", 1.5) for scene in (driven, free)]
    for spin in spins:
        assert len(spin.equations._real_w.function) == len(spin.equations.constants.function)
    np.testing.assert_array_equal(*(spin.linearize().A for spin in spins))
