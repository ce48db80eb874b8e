"""A scene in millimetres and tonnes, and one without dimensions, move as the same scene in SI units does."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.check import check_scene

# Every number is scaled by factors that are no powers of two, which rounds in other places; steps are equal.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Units:
    """Lengths, masses and times of a scene over metres, kilograms and seconds."""

    length: float
    mass: float
    time: float

    @property
    def force(self) -> float:
        return self.mass * self.length / self.time**2


MILLIMETRES = Units(length=1e3, mass=1e-3, time=1.0)  # mm, tonne, s: forces are N, moduli MPa
NONE = Units(length=1 / 0.8, mass=1 / 0.35, time=1 / 0.021)  # by the length, mass and a time of the beam
SI = Units(1.0, 1.0, 1.0)
UNIT_WORDS = ("wave_speed", "thick_section", "shear_stiffness", "modal_frequency")


def crank(unit: Units, allow: tuple[str, ...] = ()) -> fm.Scene:
    """A driven hub with a beam, a body on a sprung hinge at its tip, a wheel and a load."""
    L, M, T, F = unit.length, unit.mass, unit.time, unit.force
    E, J = F * L**2, M * L**2  # of bending stiffnesses and moments of inertia
    section = fm.BeamStation(
        x_m=0.0, EA_N=7e6 * F, EIy_Nm2=40.0 * E, EIz_Nm2=90.0 * E, GJ_Nm2=30.0 * E, mass_per_length_kg_m=0.27 * M / L,
        rotary_y_kg_m=2e-6 * M * L, rotary_z_kg_m=4e-6 * M * L,
    )  # fmt: skip
    modes = fm.Modes(count=3, families=("bending_y", "bending_z"), damping_ratio=0.01)
    torque = fm.Sine(amplitude=3.0 * F * L, angular_frequency_rad_s=8.0 / T)
    push = fm.Constant(value=2.0 * F)
    return (
        fm.SceneBuilder("crank", gravity=(0, 0, -9.81 * L / T**2), allow=allow)
        .rigid_body("hub", mass=2.0 * M, inertia=np.diag([0.02, 0.03, 0.03]) * J)
        .beam("arm", length=0.8 * L, elements=4, section=section, modes=modes)
        .rigid_body("bob", mass=0.5 * M, inertia=np.diag([1e-3, 2e-3, 2e-3]) * J, com=np.array([0.05, 0.0, 0.01]) * L)
        .revolute("shaft", "ground", "hub", axis=(0, 0, 1), torque=torque)
        .weld("clamp", "hub", "arm", parent_position=np.array([0.1, 0.0, 0.0]) * L)
        .revolute("elbow", "arm", "bob", parent_node="tip", axis=(0, 1, 0), angle=0.4, stiffness=2.0 * F * L,
                  damping=0.01 * F * L * T)
        .wheel("rotor", "bob", axis=(1, 0, 0), mass=0.1 * M, axial_inertia=1e-4 * J, transverse_inertia=6e-5 * J,
               speed=300.0 / T)
        .force("push", "bob", direction=(0, 1, 0), function=push)
        .marker("end", "bob")
        .scene()
    )  # fmt: skip


def run(unit: Units, allow: tuple[str, ...] = ()) -> fm.Trajectory:
    return fm.simulate(crank(unit, allow), 0.3 * unit.time, "rk4", step=2e-4 * unit.time, samples=7)


@pytest.fixture(scope="module")
def in_si() -> fm.Trajectory:
    return run(SI)


@pytest.mark.parametrize("unit", [MILLIMETRES, NONE], ids=["millimetres", "no dimensions"])
def test_the_motion_does_not_depend_on_the_units(unit: Units, in_si: fm.Trajectory) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        other = run(unit, UNIT_WORDS)
    assert other.finished and in_si.finished
    scales = (
        (other.markers["end"].position, in_si.markers["end"].position, unit.length),
        (other.markers["end"].quaternion, in_si.markers["end"].quaternion, 1.0),
        (other.loads["clamp"][:, :3], in_si.loads["clamp"][:, :3], unit.force * unit.length),
        (other.loads["clamp"][:, 3:], in_si.loads["clamp"][:, 3:], unit.force),
        (other.total_energy, in_si.total_energy, unit.force * unit.length),
    )
    for found, expected, factor in scales:
        np.testing.assert_allclose(found / factor, expected, rtol=0.0, atol=ROUNDING * np.max(np.abs(expected)))


def test_without_a_waiver_it_runs_with_a_warning() -> None:
    """The scene in millimetres has waves of 5 million mm/s: a warning, the same run."""
    scene = crank(MILLIMETRES)
    assert {doubt.waiver for doubt in check_scene(scene)} == {"wave_speed"}
    with pytest.warns(fm.SceneWarning, match="wave_speed"):
        assert fm.simulate(scene, 1e-3, samples=2).finished


def test_in_si_nothing_is_doubtful() -> None:
    assert check_scene(crank(SI)) == ()
