"""Beams with coupled sections against transfer matrices and closed forms, and at other reference points and axes."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from flexmb.modal.flexible import beam_model, flexible_model
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.modal.section import section_inertia, section_stiffness
from flexmb.scene.bodies import BeamBody, BeamStation, Modes
from flexmb.scene.sections import matrix, restated, transport
from flexmb.scene.shapes import coupled_section
from flexmb.typing import Real
from tests.flexmb.modal.coupled_references import (
    CORRELATION,
    DIAGONAL,
    MASS,
    coupled_stiffness,
    cross,
    natural_frequency,
    section_mass,
    station,
)

LENGTH = 2.0
POINTS = ((0.07, -0.04), (-0.03, 0.05))
LAMINATE = {(0, 3): 0.1, (0, 4): -0.1, (0, 5): 0.15, (3, 4): 0.3, (3, 5): -0.2, (4, 5): 0.25}
"""Correlations that leave shear alone, so that a beam without shear can have them."""


def coupled(*stations: BeamStation, elements: int = 8, count: int = 6, **changes) -> BeamBody:
    given = {"modes": Modes(count=count), "theory": "timoshenko"} | changes
    return BeamBody(name="blade", length_m=LENGTH, elements=elements, stations=stations, **given)


def uniform(K: Real, M: Real, point: tuple[float, float] = (0.0, 0.0), **changes) -> BeamBody:
    return coupled(station(0.0, K, M, point), station(LENGTH, K, M, point), **changes)


def omegas(body: BeamBody) -> Real:
    return np.sqrt(np.diag(flexible_model(body).stiffness))


def assert_order_eight(coarse: Real, fine: Real) -> None:
    """Errors with 8 and 12 elements that are small and fall with h^8, as without couplings, to the integration's."""
    assert np.max(np.abs(coarse)) < 1e-6
    assert np.all(np.abs(fine) < 1.5 * (8.0 / 12.0) ** 8 * np.abs(coarse) + 1e-11)


@pytest.mark.parametrize("free", [False, True], ids=["clamped", "free"])
def test_a_uniform_coupled_beam_has_the_frequencies_of_its_transfer_matrix(free: bool) -> None:
    K, M = coupled_stiffness(), section_mass()
    modes = Modes(count=5, boundary="free-free" if free else "clamped-free")
    coarse, fine = (omegas(uniform(K, M, modes=modes, elements=elements)) for elements in (8, 12))
    expected = np.array([natural_frequency(each, LENGTH, lambda x: K, lambda x: M, free=free) for each in fine])
    assert_order_eight(coarse / expected - 1.0, fine / expected - 1.0)


def test_sections_vary_linearly_about_the_axis_whatever_point_each_is_stated_at() -> None:
    roots = coupled_stiffness(), section_mass()
    tips = 0.4 * coupled_stiffness({(3, 4): -0.2, (1, 5): 0.3}), 0.5 * section_mass(c=(0.0, -0.02, 0.01))
    stations = []
    for x, (K, M), point in zip((0.0, LENGTH), (roots, tips), POINTS, strict=True):
        T = np.linalg.inv(transport(point))
        stations.append(station(x, T.T @ K @ T, T.T @ M @ T, point))
    coarse, fine = (omegas(coupled(*stations, elements=elements, count=4)) for elements in (8, 12))

    def along(which: int):
        return lambda x: roots[which] + x / LENGTH * (tips[which] - roots[which])

    expected = np.array([natural_frequency(each, LENGTH, along(0), along(1)) for each in fine])
    assert_order_eight(coarse / expected - 1.0, fine / expected - 1.0)


@pytest.mark.parametrize("changes", [{}, {"points": "rotary"}, {"points": "line"}, {"mass": "lumped"}], ids=str)
@pytest.mark.parametrize("level", ["linear", "full", "stiffened"])
def test_the_reference_point_changes_rounding_alone(changes: dict, level: str) -> None:
    body = uniform(coupled_stiffness(), section_mass(), level=level, **changes)
    other = replace(body, stations=tuple(map(restated, body.stations, POINTS)))
    assert other.stations != body.stations
    assert strange(body, other) < 1e-9


def test_a_transport_without_its_coupling_is_noticed() -> None:
    body = uniform(coupled_stiffness(), section_mass())
    for key in ("stiffness", "inertia"):
        stations = []
        for given, point in zip(body.stations, POINTS, strict=True):
            moved = restated(given, point)
            whole = np.array(getattr(moved, key))
            whole[:3, 3:], whole[3:, :3] = (
                np.array(getattr(given, key))[:3, 3:],
                np.array(getattr(given, key))[3:, :3],
            )
            stations.append(replace(moved, **{key: matrix(whole)}))
        assert strange(body, replace(body, stations=tuple(stations))) > 1e-3


def strange(one: BeamBody, other: BeamBody) -> float:
    """Largest difference of the models of two beams, relative to the arrays' sizes."""
    a, b = beam_model(one), beam_model(other)
    names = ("mass", "position", "com_offset", "inertia", "translation", "rotation", "stiffness")
    pairs = [(getattr(a, name), getattr(b, name)) for name in names]
    pairs += [] if a.second is None or b.second is None else [(a.second.translation, b.second.translation)]
    return max(float(np.max(np.abs(x - y)) / (np.max(np.abs(x)) or 1.0)) for x, y in pairs)


def test_inertia_points_have_the_kinetic_energy_of_the_sections() -> None:
    """Of three forms of the points the whole mass matrix, rigid motion included, is that of the section's inertia."""
    for points in ("section", "rotary"):
        body = uniform(coupled_stiffness(), section_mass(), points=points)
        model = flexible_model(body)
        turn = np.concatenate([np.zeros((len(model.mass), 3, 3)), np.tile(np.eye(3), (len(model.mass), 1, 1))], axis=2)
        move = np.concatenate([np.tile(np.eye(3), (len(model.mass), 1, 1)), -_cross(model.position)], axis=2)
        translation, rotation = np.dstack([move, model.translation]), np.dstack([turn, model.rotation])
        u = translation - _cross(model.com_offset) @ rotation if points == "rotary" else translation
        found = np.einsum("p,pai,paj->ij", model.mass, u, u)
        if points == "rotary":
            found += np.einsum("pai,pab,pbj->ij", rotation, model.inertia, rotation)
        places = np.array([[each, 0.0, 0.0] for each in LENGTH / 2.0 * (1.0 + np.array([-1.0, 1.0]) / np.sqrt(3.0))])
        whole = np.zeros((6, 6))
        for place in places:
            about = np.block([[np.eye(3), -cross(tuple(place))], [np.zeros((3, 3)), np.eye(3)]])
            whole += LENGTH / 2.0 * about.T @ section_mass() @ about
        np.testing.assert_allclose(found[:6, :6], whole, atol=1e-12 * np.max(whole))
        np.testing.assert_allclose(found[6:, 6:], np.eye(model.mode_count), atol=1e-12)


def _cross(v: Real) -> Real:
    return np.array([cross(tuple(each)) for each in v])


def test_matrices_of_an_uncoupled_section_are_its_numbers() -> None:
    names = ("EA_N", "GAy_N", "GAz_N", "GJ_Nm2", "EIy_Nm2", "EIz_Nm2")
    numbers = BeamStation(
        x_m=0.0, mass_per_length_kg_m=MASS, rotary_y_kg_m=2e-3, rotary_z_kg_m=4e-3,
        **dict(zip(names, DIAGONAL.tolist(), strict=True)),
    )  # fmt: skip
    M = section_mass(c=(0.0, 0.0, 0.0), J=np.diag([6e-3, 2e-3, 4e-3]))
    for theory in ("euler-bernoulli", "timoshenko"):
        by_numbers = coupled(numbers, replace(numbers, x_m=LENGTH), theory=theory)
        assert strange(by_numbers, uniform(np.diag(DIAGONAL), M, theory=theory)) < 1e-12


def test_rotated_principal_axes_turn_the_modes() -> None:
    """A section turned about the axis by 30 degrees: the frequencies of the section, and its motion turned."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    R = np.kron(np.eye(2), np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]))
    M = section_mass(c=(0.0, 0.0, 0.0), J=np.diag([6e-3, 2e-3, 4e-3]))
    straight, turned = (
        flexible_model(uniform(Q @ np.diag(DIAGONAL) @ Q.T, Q @ M @ Q.T, elements=4)) for Q in (np.eye(6), R)
    )
    np.testing.assert_allclose(np.diag(turned.stiffness), np.diag(straight.stiffness), rtol=1e-11)
    a, b = (each.nodes["tip"].translation for each in (straight, turned))
    expected = R[:3, :3] @ a
    signs = np.sign(np.sum(expected * b, axis=0))
    signs[signs == 0.0] = 1.0
    np.testing.assert_allclose(signs * b, expected, atol=1e-9)


def statics(model: FlexibleModel, force: Real, torque: Real) -> tuple[Real, Real]:
    """Displacement and rotation (3,) of the tip under a load there; exact with attachment modes."""
    tip = model.nodes["tip"]
    eta = np.linalg.solve(model.stiffness, tip.translation.T @ force + tip.rotation_modes.T @ torque)
    return tip.translation @ eta, tip.rotation_modes @ eta


def tip_under_load(S: Real, force: Real, torque: Real) -> tuple[Real, Real]:
    """Of a uniform cantilever with compliance S (6,6), clamped at x = 0 and loaded at the tip.

    The section's force is F, its moment T + (L - x) e_x x F. With strains S [F; M] the rotation is the integral of
    kappa, and u' = gamma + theta x e_x: integrals of 1, (L - x) and their moments about the tip.
    """
    lever = cross((1.0, 0.0, 0.0)) @ force
    constant, linear = S @ np.concatenate([force, torque]), S @ np.concatenate([np.zeros(3), lever])
    L = LENGTH
    rotation = L * constant[3:] + L**2 / 2 * linear[3:]
    moments = L**2 / 2 * constant[3:] + L**3 / 3 * linear[3:]  # of kappa, with the arms (L - x) to the tip
    displacement = L * constant[:3] + L**2 / 2 * linear[:3] - cross((1.0, 0.0, 0.0)) @ moments
    return displacement, rotation


@pytest.mark.parametrize("theory", ["timoshenko", "euler-bernoulli"])
def test_tip_loads_on_a_coupled_cantilever(theory: str) -> None:
    """Closed form: bend-twist, extension-bending and all other couplings, by attachment modes."""
    sheared = theory == "timoshenko"
    K = coupled_stiffness(CORRELATION if sheared else LAMINATE)
    body = uniform(K, section_mass(), elements=2, theory=theory, modes=Modes(count=0, static=True))
    S = np.linalg.inv(K)
    if not sheared:
        S[1:3] = S[:, 1:3] = 0.0
    for i in range(6):
        force, torque = np.split(np.eye(6)[i] * (100.0 if i < 3 else 10.0), 2)
        found, expected = statics(flexible_model(body), force, torque), tip_under_load(S, force, torque)
        size = np.linalg.norm(expected[0]), np.linalg.norm(expected[1])
        for part in (0, 1):
            np.testing.assert_allclose(found[part], expected[part], atol=1e-9 * max(size[part], size[1 - part]))


def test_without_shear_a_beam_is_the_limit_of_slender_ones() -> None:
    """Frequencies of both theories approach each other with the square of the section's size over the length."""
    differences = []
    for length in (2.0, 4.0, 8.0):
        K, M = coupled_stiffness(LAMINATE), section_mass()
        both = []
        for theory in ("timoshenko", "euler-bernoulli"):
            ends = (station(0.0, K, M), station(length, K, M))
            body = replace(coupled(*ends, theory=theory, count=2, elements=6), length_m=length)
            both.append(omegas(body))
        differences.append(np.max(np.abs(both[0] / both[1] - 1.0)))
    assert differences[0] < 0.01
    np.testing.assert_allclose(np.log2(np.divide(differences[:-1], differences[1:])), 2.0, atol=0.1)


def test_without_shear_a_shear_centre_off_the_axis_loses_its_twist() -> None:
    """Why such sections are refused: a force on the axis, d off the shear centre, twists the tip by F d L / GJ.

    The beam without shear, whose stiffness is that without shear force, does not twist, however slender it is."""
    d, force = 0.02, np.array([0.0, 0.0, 10.0])
    for length in (2.0, 20.0):
        twist = []
        for theory in ("timoshenko", "euler-bernoulli"):
            ends = tuple(station(x, np.diag(DIAGONAL), section_mass(), (d, 0.0)) for x in (0.0, length))
            body = replace(coupled(*ends, theory=theory, modes=Modes(count=0, static=True)), length_m=length)
            twist.append(statics(beam_model(body), force, np.zeros(3))[1][0])
        np.testing.assert_allclose(twist[0], -force[2] * d * length / DIAGONAL[3], rtol=1e-8)  # of statics
        assert abs(twist[1]) < 1e-9 * abs(twist[0])


def test_a_beam_beside_its_axis_is_the_same_beam() -> None:
    """With shear the finite elements contain the motion of every parallel axis: frequencies of the free beam agree.

    Its sections are stated on the first axis, from which the second is POINTS[0] away."""
    modes = Modes(count=6, boundary="free-free")
    body = uniform(coupled_stiffness(), section_mass(), modes=modes)
    y, z = POINTS[0]
    beside = replace(body, stations=tuple(replace(station, reference_point_m=(-y, -z)) for station in body.stations))
    np.testing.assert_allclose(omegas(beside), omegas(body), rtol=1e-9)
    one = replace(beside, stations=(*beside.stations[:1], *body.stations[1:]))  # at one end only: another beam
    assert np.max(np.abs(omegas(one) / omegas(body) - 1.0)) > 1e-3


def test_an_axis_off_the_centroid_bends_as_the_centroid_does() -> None:
    """A beam without shear in one plane: its numbers are stated at the centroid, 5 cm beside the axis."""
    numbers = BeamStation(
        x_m=0.0, EA_N=7e6, EIy_Nm2=1e3, EIz_Nm2=2e3, GJ_Nm2=900.0, mass_per_length_kg_m=1.5, rotary_z_kg_m=1e-3,
        rotary_y_kg_m=1e-3, reference_point_m=(0.05, 0.0),
    )  # fmt: skip
    modes = Modes(count=5, boundary="free-free", families=("axial", "bending_y"))
    ends = numbers, replace(numbers, x_m=LENGTH)
    beside = coupled(*ends, theory="euler-bernoulli", modes=modes)
    on_axis = replace(beside, stations=tuple(replace(end, reference_point_m=(0.0, 0.0)) for end in ends))
    np.testing.assert_allclose(omegas(beside), omegas(on_axis), rtol=1e-10)


def test_arrays_of_sections_have_the_stated_order() -> None:
    """`section_stiffness` and `section_inertia`, which other models of a beam take."""
    body = uniform(coupled_stiffness(), section_mass(), POINTS[0])
    T = transport(POINTS[0])
    assert section_stiffness(body).shape == section_inertia(body).shape == (2, 6, 6)
    np.testing.assert_allclose(section_stiffness(body)[1], T.T @ coupled_stiffness() @ T, rtol=1e-12, atol=1e-6)
    np.testing.assert_allclose(section_inertia(body)[0], T.T @ section_mass() @ T, rtol=1e-12, atol=1e-15)
    thin = section_stiffness(uniform(coupled_stiffness(LAMINATE), section_mass(), theory="euler-bernoulli"))
    assert np.all(np.isinf(thin[:, [1, 2], [1, 2]])) and not np.any(thin[:, 1, [0, 2, 3, 4, 5]])
    np.testing.assert_allclose(thin[0, 3, 4], coupled_stiffness(LAMINATE)[3, 4])


def test_the_transport_moves_forces_and_strains() -> None:
    """The energy of a strain, and the moment of a force, from elementary statics at the point itself."""
    y, z = POINTS[0]
    T, strain, force = transport((y, z)), np.arange(1.0, 7.0), np.array([3.0, -1.0, 2.0, 0.5, -4.0, 6.0])
    rho = np.array([0.0, y, z])
    moved = np.concatenate([strain[:3] + np.cross(strain[3:], rho), strain[3:]])
    np.testing.assert_allclose(T @ strain, moved)
    # A force at the point has the moment rho x F more about the axis.
    np.testing.assert_allclose(T.T @ force, np.concatenate([force[:3], force[3:] + np.cross(rho, force[:3])]))


def test_the_order_of_beamdyn() -> None:
    """Its axis is z, and its rows are [x, y, z, about x, about y, about z]: here they are [2, 0, 1, 5, 3, 4]."""
    x_centre, y_centre, edge, flap, product = 0.01, -0.02, 2e-3, 4e-3, 3e-4
    m, polar = MASS, edge + flap
    of_manual = np.array([
        [m, 0, 0, 0, 0, -m * y_centre],
        [0, m, 0, 0, 0, m * x_centre],
        [0, 0, m, m * y_centre, -m * x_centre, 0],
        [0, 0, m * y_centre, edge + m * y_centre**2, -product - m * x_centre * y_centre, 0],
        [0, 0, -m * x_centre, -product - m * x_centre * y_centre, flap + m * x_centre**2, 0],
        [-m * y_centre, m * x_centre, 0, 0, 0, polar + m * (x_centre**2 + y_centre**2)],
    ])  # fmt: skip
    J = np.array([[polar, 0.0, 0.0], [0.0, edge, -product], [0.0, -product, flap]])
    here, order = section_mass(m, (0.0, x_centre, y_centre), J), [2, 0, 1, 5, 3, 4]
    found = coupled_section(stiffness=np.diag(np.arange(1.0, 7.0)), inertia=of_manual, order=order)
    np.testing.assert_allclose(found.inertia, here, atol=1e-18)
    assert np.diag(found.stiffness).tolist() == [3.0, 1.0, 2.0, 6.0, 4.0, 5.0]


@pytest.mark.parametrize(("changes", "words"), [
    ({"order": [0, 1, 2, 3, 4, 4]}, "each of 0 to 5 once"), ({"stiffness": np.eye(4)}, r"shape \(4, 4\)"),
    ({"inertia": np.triu(np.ones((6, 6)))}, "inertia is not symmetric"),
    ({"stiffness": np.full((6, 6), np.nan)}, "stiffness is not symmetric"),
])  # fmt: skip
def test_arrays_that_are_no_section_are_refused(changes: dict, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        coupled_section(**({"stiffness": np.eye(6), "inertia": section_mass()} | changes))
