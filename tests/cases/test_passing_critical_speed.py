"""The rotating shaft: its critical speed and its whirl at a constant speed against Bernoulli's beam with a mass."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.optimize import brentq

import flexmb as fm
from flexmb.scene.files import load_scene
from flexmb.scene.functions import Function, SpinUp
from flexmb.scene.schema import BeamBody, Revolute, RigidBody, Scene, StrainPolynomials

CASE = Path(__file__).parents[2] / "cases" / "rotors" / "passing_critical_speed"
SPEED, BESIDE = 30.0, 1e-4  # rad/s; m, so that the whirl bends the shaft by its slope of 1e-4 only
LITTLE = 1e-6  # kg m, rotary inertia of the section, which the closed form leaves out: some 1e-8 of all energy


def slender(drive: Function, viscosity: float = 0.0) -> Scene:
    """The case's shaft at level exact, without shear, gravity and rotary inertia; the disk is `BESIDE` the axis."""
    scene = load_scene(CASE / "slender.toml")
    curvatures = StrainPolynomials(torsion=2, bending_y=5, bending_z=5)
    bodies = tuple(bernoulli(body, curvatures, viscosity) if isinstance(body, BeamBody) else
                   replace(body, com_m=(0.0, 0.0, BESIDE)) for body in scene.bodies)  # fmt: skip
    (hinge, *others) = scene.hinges
    assert isinstance(hinge, Revolute)
    hinge = replace(hinge, rotation=replace(hinge.rotation, prescribed_rad=drive))
    return replace(scene, bodies=bodies, hinges=(hinge, *others), gravity_m_s2=(0.0, 0.0, 0.0))


def bernoulli(half: BeamBody, curvatures: StrainPolynomials, viscosity: float) -> BeamBody:
    stations = tuple(replace(station, rotary_y_kg_m=LITTLE, rotary_z_kg_m=LITTLE) for station in half.stations)
    modes = fm.Modes(count=0, polynomials=curvatures, viscosity_s=viscosity)
    return replace(half, level="exact", stations=stations, modes=modes)


def stiffness(scene: Scene, frequency: float) -> float:
    """Force over deflection (N/m) in the middle of the shaft at a frequency (rad/s), clamped at both ends.

    Of each half, clamped at one end and without slope at the other, w = a (cosh - cos)(k x) + b (sinh - sin)(k x).
    """
    half = scene.bodies[0]
    assert isinstance(half, BeamBody)
    root = half.stations[0]
    assert root.EIz_Nm2 and root.mass_per_length_kg_m
    k = (root.mass_per_length_kg_m * frequency**2 / root.EIz_Nm2) ** 0.25
    x = k * half.length_m
    b = -(np.sinh(x) + np.sin(x)) / (np.cosh(x) - np.cos(x))
    deflection = np.cosh(x) - np.cos(x) + b * (np.sinh(x) - np.sin(x))
    third = k**3 * (np.sinh(x) - np.sin(x) + b * (np.cosh(x) + np.cos(x)))
    return float(-2.0 * root.EIz_Nm2 * third / deflection)


def disk(scene: Scene) -> float:
    (mass,) = (body.mass_kg for body in scene.bodies if isinstance(body, RigidBody))
    return mass


def critical_speed(scene: Scene) -> float:
    return brentq(lambda w: stiffness(scene, w) - disk(scene) * w**2, 20.0, 80.0, xtol=1e-9)


def test_the_first_frequency_is_that_of_a_beam_with_a_mass() -> None:
    """In both planes, by some 1e-8 for the rotary inertia; a disk 1 % heavier is 4e-3 off."""
    scene = slender(fm.Constant(value=0.0))
    found = np.sort(np.abs(fm.linearize(scene).eigenvalues.imag))
    assert found[:4] == pytest.approx([critical_speed(scene)] * 4, rel=1e-7)
    assert found[4] > 200.0


def test_below_the_critical_speed_the_disk_whirls_as_far_as_a_beam_with_a_mass() -> None:
    """The viscosity damps what the start excites by exp(-15 t/s), which is below 1e-5 a second after it."""
    scene = slender(SpinUp(rate=SPEED, duration_s=0.5), viscosity=0.02)
    run = fm.simulate(scene, 1.5, samples=31, method="radau5", rtol=1e-5, atol=1e-9)
    assert run.finished, run.message
    radius = np.hypot(*run.markers["middle"].position[-5:, 1:].T)
    forced = disk(scene) * SPEED**2
    assert radius == pytest.approx(np.full(5, BESIDE * forced / (stiffness(scene, SPEED) - forced)), rel=1e-5)
