"""Inertia points: those of beams sum to the finite-element mass matrix and the rigid body's mass properties, inline
points and `.npz` give the same model, and modal integrals are brute-force sums over them at random states."""

from __future__ import annotations

from math import cos, sin

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flexmb.modal.beam import beam_elements
from flexmb.modal.flexible import flexible_model
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.modal.integrals import ModalIntegrals, TurningPoints, modal_integrals
from flexmb.modal.interpolation import BendingField, ElementMesh, LineField
from flexmb.modal.stations import inertia_stations
from flexmb.scene.bodies import BeamStation, ModalBody, ModalNode, TipMass
from flexmb.scene.modal_data import inertia_points
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


ARRAYS = ("mass", "position", "com_offset", "inertia", "translation", "rotation", "stiffness", "damping")


@pytest.fixture
def model() -> FlexibleModel:
    section = {"rotary_y_kg_m": 2e-3, "rotary_z_kg_m": 1e-3}
    return flexible_model(beam(2, 3, section, {"damping_ratio": 0.01}, points="rotary"))


def node(model: FlexibleModel, name: str) -> ModalNode:
    tip = model.nodes[name]
    return ModalNode(
        name=name,
        position_m=tuple(tip.position),
        translation_modes=tuple(map(tuple, tip.translation.T)),
        rotation_modes=tuple(map(tuple, tip.rotation_modes.T)),
        quaternion=(0.0, 1.0, 0.0, 0.0),
    )


def test_inline_and_file_are_the_beam_they_came_from(model, tmp_path):
    inline = ModalBody(
        name="inline",
        points=inertia_points(
            model.mass, model.position, model.translation, model.rotation, model.inertia, model.com_offset
        ),
        stiffness=tuple(map(tuple, model.stiffness)),
        damping=tuple(map(tuple, model.damping)),
        nodes=(node(model, "tip"),),
    )
    np.savez(
        tmp_path / "body.npz",
        mass=model.mass,
        position=model.position,
        translation_modes=model.translation,
        rotation_modes=model.rotation,
        inertia=model.inertia,
        stiffness=model.stiffness,
        damping=model.damping,
    )
    from_file = ModalBody(name="file", file="body.npz", boundary="free-free")
    for other in (flexible_model(inline), flexible_model(from_file, tmp_path)):
        for name in ARRAYS:
            assert np.array_equal(getattr(other, name), getattr(model, name)), name
        assert np.array_equal(modal_integrals(other).spatial_mass, modal_integrals(model).spatial_mass)
    read = flexible_model(inline)
    assert read.clamped
    assert set(read.nodes) == {"origin", "tip"}
    assert np.array_equal(read.nodes["tip"].translation, model.nodes["tip"].translation)
    assert read.nodes["tip"].rotation == pytest.approx(np.diag([1.0, -1.0, -1.0]), abs=EPS)
    assert not flexible_model(from_file, tmp_path).clamped


def test_wrong_shapes_are_refused_with_the_body_named(model):
    points = inertia_points(model.mass, model.position, model.translation)
    with pytest.raises(ValueError, match=r"modal body 'odd'.*stiffness.*shape"):
        flexible_model(ModalBody(name="odd", points=points, stiffness=((1.0,),)))
    short = ModalNode(name="short", position_m=(0, 0, 0), translation_modes=((0, 1, 0),), rotation_modes=())
    with pytest.raises(ValueError, match="node 'short' has 1 translation and 0 rotation modes, expected 3"):
        flexible_model(ModalBody(name="odd", points=points, nodes=(short,)))


def test_missing_file_is_reported(tmp_path):
    with pytest.raises(OSError, match=r"nowhere\.npz"):
        flexible_model(ModalBody(name="lost", file="nowhere.npz"), tmp_path)


def random_model(rng: np.random.Generator, points: int, modes: int) -> FlexibleModel:
    """Points with all kinds of inertia: a third massy only, a third with a tensor, a third with an offset as well."""
    root = rng.normal(size=(points, 3, 3))
    inertia = root @ np.swapaxes(root, 1, 2)
    inertia[::3] = 0.0
    com_offset = rng.normal(size=(points, 3))
    com_offset[::3] = com_offset[1::3] = 0.0
    stiffness = rng.normal(size=(modes, modes))
    return FlexibleModel(
        mass=rng.uniform(0.1, 2.0, points),
        position=rng.normal(size=(points, 3)),
        com_offset=com_offset,
        inertia=inertia,
        translation=rng.normal(size=(points, 3, modes)),
        rotation=rng.normal(size=(points, 3, modes)),
        stiffness=stiffness @ stiffness.T,
        damping=np.zeros((modes, modes)),
        nodes={},
        clamped=False,
    )


def left_jacobian(theta: np.ndarray) -> np.ndarray:
    """Angular velocity of exp(skew(theta)) in outer axes is left_jacobian(theta) thetadot."""
    angle = float(np.linalg.norm(theta))
    S = np.array([[0, -theta[2], theta[1]], [theta[2], 0, -theta[0]], [-theta[1], theta[0], 0]])
    if angle == 0.0:
        return np.eye(3)
    return np.eye(3) + (1 - cos(angle)) / angle**2 * S + (angle - sin(angle)) / angle**3 * S @ S


def kinetic_energy(points, eta, rate, w, v) -> tuple[float, float]:
    """Energy of points (a model or a set of turning points) by definition, and the number of terms summed."""
    energy = 0.0
    for j in range(len(points.mass)):
        theta = points.rotation[j] @ eta
        R = Rotation.from_rotvec(theta).as_matrix()
        turning = left_jacobian(theta) @ (points.rotation[j] @ rate)
        arm = R @ points.com_offset[j]
        place = points.position[j] + points.translation[j] @ eta + arm
        velocity = v + np.cross(w, place) + points.translation[j] @ rate + np.cross(turning, arm)
        spin = R.T @ (w + turning)
        energy += 0.5 * points.mass[j] * velocity @ velocity + 0.5 * spin @ points.inertia[j] @ spin
    return energy, 60.0 * len(points.mass) * len(eta)


def polynomial_energy(known: ModalIntegrals, eta, rate, w, v) -> float:
    """The kinetic energy of the module's docstring."""
    s = known.s0 + known.s1 @ eta
    J1 = np.einsum("n,nab->ab", eta, known.J1)
    J = known.J0 + J1 + J1.T + np.einsum("n,k,nkab->ab", eta, eta, known.J2)
    C = known.C0 + np.einsum("k,kan->an", eta, known.C1)
    return float(
        0.5 * rate @ known.M_ff @ rate
        + w @ C @ rate
        + v @ known.s1 @ rate
        + 0.5 * w @ J @ w
        + v @ np.cross(w, s)
        + 0.5 * known.mass * v @ v
    )


@pytest.mark.parametrize("seed", range(8))
def test_kinetic_energy_is_the_sum_over_points(seed):
    rng = np.random.default_rng(seed)
    model = random_model(rng, points=10, modes=4)
    integrals = modal_integrals(model)
    eta, rate = rng.normal(size=4), rng.normal(size=4)
    w, v = rng.normal(size=3), rng.normal(size=3)
    direct, terms = kinetic_energy(model, eta, rate, w, v)
    turning, _ = kinetic_energy(integrals.turning, eta, rate, w, v)
    # A sum of `terms` products; all point energies are positive, so no cancellation beyond that within a point.
    assert polynomial_energy(integrals, eta, rate, w, v) + turning == pytest.approx(direct, rel=terms * EPS)


@pytest.mark.parametrize("seed", range(4))
def test_spatial_mass_matrix_is_the_energy_at_rest_shape(seed):
    rng = np.random.default_rng(seed)
    model = random_model(rng, points=10, modes=4)
    M = modal_integrals(model).spatial_mass
    zero = np.zeros(4)
    for _ in range(5):
        rate, w, v = rng.normal(size=4), rng.normal(size=3), rng.normal(size=3)
        speeds = np.concatenate([rate, w, v])
        direct, terms = kinetic_energy(model, zero, rate, w, v)
        assert 0.5 * speeds @ M @ speeds == pytest.approx(direct, rel=terms * EPS)
    assert pytest.approx(M.T, rel=0, abs=10 * EPS * np.abs(M).max()) == M


def test_polynomial_and_turning_parts_split_the_points():
    model = random_model(np.random.default_rng(1), points=9, modes=3)
    integrals = modal_integrals(model)
    turning: TurningPoints = integrals.turning
    assert turning.mass.tolist() == [0.0, model.mass[2], 0.0, model.mass[5], 0.0, model.mass[8]]
    assert integrals.mass + turning.mass.sum() == pytest.approx(model.mass.sum(), rel=9 * EPS)


def test_symmetries_of_the_integrals():
    integrals = modal_integrals(random_model(np.random.default_rng(2), points=9, modes=3))
    assert np.swapaxes(integrals.C1, 0, 2) == pytest.approx(-integrals.C1, abs=1e3 * EPS)
    assert integrals.J2.transpose(1, 0, 3, 2) == pytest.approx(integrals.J2, abs=1e3 * EPS)
    assert pytest.approx(integrals.J0.T, abs=1e3 * EPS) == integrals.J0
