"""Linear models about straight, bent and spinning beams of level exact, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import flexmb as fm

LENGTH = 1.0
FIRST = 1.875104068711961**2  # cantilever, times sqrt(EI / (m L^4))
SLENDER = {"EA_N": 1e6, "GJ_Nm2": 1.0, "mass_per_length_kg_m": 1.0}


def cantilever(section: fm.BeamStation, modes: fm.Modes, points: str = "line") -> fm.SceneBuilder:
    builder = fm.SceneBuilder("cantilever")
    return builder.beam(
        "beam", length=LENGTH, elements=1, section=section, modes=modes, level="exact", points=points
    )


def column(count: int, viscosity: float = 0.0) -> fm.SceneBuilder:
    section = fm.BeamStation(x_m=0.0, EIy_Nm2=1.0, EIz_Nm2=1.0, **SLENDER)
    modes = fm.Modes(count=count, families=("bending_y",), viscosity_s=viscosity)
    return cantilever(section, modes).weld("clamp", "ground", "beam")


def growth(scene: fm.Scene) -> float:
    return float(fm.linearize(scene).eigenvalues.real.max())


def lowest_square(model: fm.LinearModel) -> float:
    """The lowest squared frequency (1/s^2) of an undamped model: negative where it has left a stable equilibrium."""
    return float(np.min(-(model.eigenvalues**2).real))


def test_a_dead_load_buckles_the_column_at_eulers() -> None:
    def square(load: float) -> float:
        scene = column(6).force("push", "beam", node="tip", direction=(-1, 0, 0), function=fm.Constant(value=load))
        return lowest_square(fm.linearize(scene.scene()))

    assert brentq(square, 2.0, 3.0, xtol=1e-9) == pytest.approx(np.pi**2 / 4.0, rel=1e-6)


def followed(load: float, viscosity: float = 0.0) -> fm.Scene:
    push = {"node": "tip", "direction": (-1, 0, 0), "frame": "node", "function": fm.Constant(value=load)}
    return column(8, viscosity).force("push", "beam", **push).scene()


def test_a_follower_force_makes_the_column_flutter() -> None:
    """Beck 1952."""
    assert growth(followed(0.9999 * 20.0509)) < 1e-5
    assert growth(followed(1.0001 * 20.0509)) > 1e-2


def test_internal_damping_however_small_takes_nearly_half_of_that_load() -> None:
    """Bolotin and Zhinzher 1969: 10.94."""
    assert growth(followed(0.998 * 10.94, 1e-3)) < 0.0 < growth(followed(1.002 * 10.94, 1e-3))


def test_a_deep_beam_buckles_sideways_at_its_bent_equilibrium() -> None:
    """4.0126 sqrt(EI GJ) / L^2 for a force at the tip that keeps its direction, if bending in the stiff plane is small:
    by EI of the weak over that of the stiff plane, 1e-5."""
    section = fm.BeamStation(
        x_m=0.0, EA_N=1e8, EIy_Nm2=1e5, EIz_Nm2=1.0, GJ_Nm2=0.7, mass_per_length_kg_m=1.0, rotary_y_kg_m=1e-2,
        rotary_z_kg_m=1e-7,
    )  # fmt: skip
    modes = fm.Modes(count=6, families=("torsion", "bending_y", "bending_z"))

    def square(load: float) -> float:
        scene = cantilever(section, modes, "section").weld("clamp", "ground", "beam")
        scene.force("push", "beam", node="tip", direction=(0, 0, -1), function=fm.Constant(value=load))
        system = fm.compile(scene.scene())
        return lowest_square(fm.linearize(system, fm.equilibrium(system)))

    assert brentq(square, 3.0, 4.0, xtol=1e-8) == pytest.approx(4.0126 * np.sqrt(0.7), rel=1e-4)


def shaft(viscosity: float) -> fm.Scene:
    section = fm.BeamStation(x_m=0.0, EIy_Nm2=1.0, EIz_Nm2=1.0, **SLENDER)
    modes = fm.Modes(count=5, families=("bending_y", "bending_z"), viscosity_s=viscosity)
    return cantilever(section, modes).revolute("drive", "ground", "beam", axis=(1, 0, 0), armature=1.0).scene()


def spinning(scene: fm.Scene, rate: float) -> fm.LinearModel:
    return fm.steady_spin(scene, "drive", rate).linearize()


def test_a_shaft_whirls_at_its_bending_frequency_in_fixed_axes() -> None:
    """In axes that turn with it: the sum and the difference of that frequency and the spin; mass on the axis only."""
    rate = 1.5
    found = np.abs(spinning(shaft(0.0), rate).eigenvalues.imag)
    for expected in (FIRST - rate, FIRST + rate):
        assert np.min(np.abs(found - expected)) < 1e-5 * FIRST


def test_a_shaft_with_internal_damping_is_unstable_above_its_critical_speed() -> None:
    def largest(rate: float) -> float:
        eigenvalues = spinning(shaft(1e-3), rate).eigenvalues
        return float(eigenvalues.real[np.abs(eigenvalues) > 1e-3].max())

    assert largest(0.98 * FIRST) < 0.0 < largest(1.02 * FIRST)


@pytest.mark.parametrize(("ratio", "expected"), [(2.0, 4.1373), (12.0, 13.1702)])
def test_a_beam_on_a_spinning_hub_stiffens(ratio: float, expected: float) -> None:
    """Flapping of a cantilever clamped at the axis (Wright, Smith, Thresher, Wang 1982), sqrt(EI / (m L^4)) = 1."""
    section = fm.BeamStation(x_m=0.0, EIy_Nm2=1.0, EIz_Nm2=1.0, **SLENDER)
    scene = cantilever(section, fm.Modes(count=8, families=("bending_z",)))
    scene = scene.revolute("drive", "ground", "beam", axis=(0, 0, 1)).scene()
    frequencies = 2.0 * np.pi * fm.campbell(scene, "drive", [ratio]).frequencies_hz[0]
    assert np.min(np.abs(frequencies - expected)) < 1e-4 * expected
