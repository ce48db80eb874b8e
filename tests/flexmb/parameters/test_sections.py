"""Derivatives by elements of the matrices of sections, and by where these are stated."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb
from flexmb.modal.flexible import beam_model
from flexmb.parameters.spectral import Parts, derivative
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.values import with_values
from tests.flexmb.modal.coupled_references import coupled_stiffness, section_mass, station
from tests.flexmb.parameters.test_modes import fox_kapoor, matrices

POINT = (0.02, -0.01)


def blade(level: str = "full", modes: int = 4) -> flexmb.Scene:
    builder = SceneBuilder("blade", gravity=(0.0, 0.3, -9.81))
    section = station(0.0, coupled_stiffness(), section_mass(), POINT)
    builder.beam(
        "blade", length=2.0, elements=3, modes=modes, level=level, theory="timoshenko", section=section
    )  # fmt: skip
    builder.revolute("root", "ground", "blade", child_node="root", axis=(0.0, 1.0, 0.0), angle=0.3, rate=1.0)
    return builder.marker("end", "blade", node="tip").scene()


@pytest.mark.parametrize("element", ["4.4", "3.4", "4.3", "0.5", "0.1"])
def test_modes_by_an_element_of_the_stiffness(element: str) -> None:
    """Against Fox and Kapoor. K is linear in a pair of elements, so that its derivative is a difference."""
    whole, name = blade(), f"blade.stations.*.stiffness.{element}"
    body = whole.bodies[0]
    i, j = map(int, element.split("."))
    value, size = body.stations[0].stiffness[i][j], np.sqrt(coupled_stiffness()[i, i] * coupled_stiffness()[j, j])

    def at(x: float) -> s.BeamBody:
        return with_values(whole, {name: x}).bodies[0]

    ahead, behind = (matrices(at(value + sign * 0.1 * size))[0] for sign in (1.0, -1.0))
    K, M = matrices(body)
    by_square = fox_kapoor(body, (ahead - behind) / (0.2 * size), np.zeros_like(M))
    assert np.any(by_square)

    def numbers(x: float) -> np.ndarray:
        return np.diag(beam_model(at(x), body).stiffness)

    found = derivative(numbers, value, size, Parts([slice(None)])).values
    rounding = 1e-12 * np.max(np.diag(beam_model(body).stiffness)) / size
    np.testing.assert_allclose(found, by_square, rtol=0.0, atol=1e-9 * np.max(np.abs(by_square)) + 10.0 * rounding)


@pytest.mark.parametrize("level", ["linear", "full"])
@pytest.mark.parametrize("path", ["stiffness.3.4", "inertia.0.0", "reference_point_m.1"])
def test_accelerations_by_a_number_of_all_sections(path: str, level: str) -> None:
    whole, name = blade(level), f"blade.stations.*.{path}"
    system = flexmb.compile(whole)
    q = system.initial_state.q.copy()
    q[1:] = [0.02, -0.01, 0.005, 0.002]
    state = system.state(q, system.initial_state.u)
    p = system.parameters([name])
    assert p.errors[0] < 1e-9

    def at(change: float) -> np.ndarray:
        return system.with_numbers(with_values(whole, {name: p.values[0] + change})).accelerations(state)

    h = 2.0**-6 * abs(p.values[0])
    first, second = (at(n * h) - at(-n * h) for n in (1, 2))
    expected = (8.0 * first - second) / (12.0 * h)
    found = p.accelerations(state)[:, 0]
    assert np.any(found)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-6 * np.max(np.abs(found)))


def test_an_element_stands_for_both() -> None:
    changed = with_values(blade(), {"blade.stations.0.stiffness.3.4": 5.0, "blade.stations.1.inertia.2.4": 7.0})
    first, second = changed.bodies[0].stations
    assert first.stiffness[3][4] == first.stiffness[4][3] == 5.0
    assert second.inertia[2][4] == second.inertia[4][2] == 7.0
    assert second.stiffness == blade().bodies[0].stations[1].stiffness
