"""Derivatives of modes: against those of Fox and Kapoor (1968), and through frequencies that cross or are equal."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb
from flexmb.modal.beam import beam_elements
from flexmb.modal.following import followed
from flexmb.modal.reduce import BeamModes, beam_modes
from flexmb.modal.stations import inertia_stations, lumps
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.shapes import beam_section
from flexmb.scene.values import with_values

ROUND = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=8e-10, rho=2700.0)
KEYS = ("EIy_Nm2", "EIz_Nm2", "GJ_Nm2", "EA_N", "mass_per_length_kg_m", "rotary_z_kg_m")


def scene(section, modes: int = 4, level: str = "full", **more) -> flexmb.Scene:
    builder = SceneBuilder("beam", gravity=(0.0, 0.0, -9.81))
    builder.beam("boom", length=1.0, elements=5, modes=modes, level=level, section=section, **more)
    builder.revolute("root", "ground", "boom", child_node="root", axis=(0.0, 1.0, 0.0), angle=0.3, rate=1.0)
    return builder.marker("end", "boom", node="tip").scene()


def matrices(body: s.BeamBody) -> tuple[np.ndarray, np.ndarray]:
    elements = beam_elements(body)
    return elements.stiffness(), elements.mass(inertia_stations(body, elements.mesh, elements.table), lumps(body))


def fox_kapoor(body: s.BeamBody, dK: np.ndarray, dM: np.ndarray) -> np.ndarray:
    """d omega^2 (m,) of the modes."""
    elements = beam_elements(body)
    K, M = matrices(body)
    free = np.setdiff1d(np.arange(elements.size), elements.clamped_coordinates())
    modes = beam_modes(elements, K, M, body.modes)
    dK, dM = (each[np.ix_(free, free)] for each in (dK, dM))
    return np.array([x @ (dK - w * w * dM) @ x for x, w in zip(modes.columns[free].T, modes.frequencies, strict=True)])


def test_equal_frequencies_of_two_planes():
    """Of a round beam, both planes have equal frequencies; each plane has its derivative, whichever mode comes first.

    Compiled anew for a larger and a smaller number, the modes have another order: states are sorted accordingly.
    """
    whole = scene(ROUND)
    system = flexmb.compile(whole)
    name = "boom.stations.*.EIy_Nm2"
    p = system.parameters([name])
    q, u = system.initial_state.q.copy(), system.initial_state.u.copy()
    eta = slice(1, 5)
    q[eta], u[eta] = [0.02, -0.03, 0.004, 0.001], [0.3, 0.2, -0.1, 0.4]
    found = p.accelerations(system.state(q, u))[:, 0]
    assert np.max(np.abs(np.diff(np.sqrt(np.diag(system.constants.stiffness[0])[:4])[[0, 1]]))) < 1e-6

    def at(change: float) -> np.ndarray:
        other = flexmb.System(with_values(whole, {name: p.values[0] + change}))
        order = [0, 1, 2, 3, 4] if change >= 0.0 else [0, 2, 1, 4, 3]  # bending_z is softer, and comes first
        inverse = np.argsort(order)
        return other.accelerations(other.state(q[order], u[order]))[inverse]

    h = 1e-2 * p.values[0]
    table = [(at(h / 2**i) - at(-h / 2**i)) / (2.0 * h / 2**i) for i in range(4)]
    for k in range(1, 4):
        table = [after + (after - before) / (4.0**k - 1.0) for before, after in zip(table, table[1:], strict=False)]
    np.testing.assert_allclose(found, table[0], rtol=0.0, atol=1e-9 * np.max(np.abs(found)))


def test_frequencies_that_are_nearly_equal():
    """A tip mass with a product of inertia couples the planes, whose frequencies differ by 1e-3: they veer."""
    section = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8.008e-10, Iz=8e-10, rho=2700.0)
    lump = s.TipMass(x_m=1.0, mass_kg=0.1, inertia_kg_m2=((2e-4, 0.0, 0.0), (0.0, 2e-4, 5e-5), (0.0, 5e-5, 2e-4)))
    whole = scene(section, modes=2, tip_masses=(lump,))
    system = flexmb.compile(whole)
    name = "boom.stations.1.EIy_Nm2"
    p = system.parameters([name])
    state = system.state(system.initial_state.q + 0.01, system.initial_state.u + 0.1)
    assert p.errors[0] < 1e-9

    def at(x: float) -> np.ndarray:
        return system.with_numbers(with_values(whole, {name: x})).accelerations(state)

    h = 2.0**-10 * p.values[0]
    first, second = (at(p.values[0] + n * h) - at(p.values[0] - n * h) for n in (1, 2))
    expected = (8.0 * first - second) / (12.0 * h)
    found = p.accelerations(state)[:, 0]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-6 * np.max(np.abs(found)))


def modes_of(columns: np.ndarray, frequencies: list[float]) -> BeamModes:
    return BeamModes(columns, np.array(frequencies))


def test_modes_of_one_frequency_take_the_nearest_basis():
    """Of the basis that the eigenproblem happens to give, only the space matters; signs and order follow, too."""
    rng = np.random.default_rng(0)
    X = np.linalg.qr(rng.normal(size=(8, 3)))[0]
    reference = modes_of(X, [1.0, 1.0, 2.0])
    turned = X.copy()
    c, t = np.cos(0.7), np.sin(0.7)
    turned[:, :2] = X[:, :2] @ np.array([[c, -t], [t, c]])
    turned[:, 2] *= -1.0
    order = [2, 0, 1]
    found = followed(modes_of(turned[:, order], [2.0, 1.0, 1.0]), np.eye(8), reference)
    np.testing.assert_allclose(found.columns, X, atol=1e-14)
    np.testing.assert_allclose(found.stiffness, np.diag([1.0, 1.0, 4.0]), atol=1e-14)


def test_other_modes_are_refused():
    rng = np.random.default_rng(1)
    X = np.linalg.qr(rng.normal(size=(8, 3)))[0]
    with pytest.raises(ValueError, match="cross"):
        followed(modes_of(X[:, [0, 2]], [1.0, 3.0]), np.eye(8), modes_of(X[:, :2], [1.0, 2.0]))
    with pytest.raises(ValueError, match="number"):
        followed(modes_of(X, [1.0, 2.0, 3.0]), np.eye(8), modes_of(X[:, :2], [1.0, 2.0]))
