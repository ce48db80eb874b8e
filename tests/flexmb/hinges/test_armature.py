"""Armatures: inertia of drives along coordinates, in the equations of motion, loads, energy and impulses."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.run.impulses import struck
from flexmb.scene.build import SceneBuilder, angular, linear
from flexmb.scene.freedoms import Coordinate
from flexmb.scene.tree import coordinates, with_coordinates
from tests import trees
from tests.bounds import algebra, gamma

MASS, AXIAL, ARM, ARMATURE, G = 2.0, 0.3, 0.7, 0.5, 9.81  # kg, kg m^2, m, kg m^2, m/s^2
ANGLE = 0.9  # rad


def pendulum(**options) -> SceneBuilder:
    return (
        SceneBuilder("geared pendulum", gravity=(0.0, 0.0, -G))
        .rigid_body("arm", mass=MASS, com=(0.0, 0.0, -ARM), inertia=(0.2, AXIAL, 0.25))
        .revolute("shaft", "ground", "arm", axis=(0.0, 1.0, 0.0), **({"angle": ANGLE, "armature": ARMATURE} | options))
    )


OWN = AXIAL + MASS * ARM**2
WEIGHT = -MASS * G * ARM * np.sin(ANGLE)  # N m about the shaft


@pytest.mark.parametrize("algorithm", ["articulated", "composite", "unsplit", "frisch"])
def test_it_falls_as_its_equation_says(algorithm):
    """(I + m l^2 + J) q'' = -m g l sin q; the arm alone has the momentum, and feels -J q'' along the shaft."""
    system = fm.compile(pendulum(rate=1.5).scene())
    state = system.initial_state
    found = system.evaluate(state.t, state.q, state.u, algorithm)
    acceleration = WEIGHT / (OWN + ARMATURE)
    assert found.accelerations == pytest.approx([acceleration], rel=gamma(60))
    assert found.loads["shaft"][1] == pytest.approx(-ARMATURE * acceleration, rel=gamma(60))
    assert found.energy["kinetic"] == pytest.approx(0.5 * (OWN + ARMATURE) * 1.5**2, rel=gamma(60))
    assert found.momentum[1] == pytest.approx(OWN * 1.5, rel=gamma(60))
    assert system.mass_matrix(state) == pytest.approx(np.array([[OWN + ARMATURE]]), rel=gamma(60))


def test_a_drive_moves_the_rotor_too():
    sine = fm.Sine(amplitude=0.3, angular_frequency_rad_s=2.0)
    found, without = (
        fm.compile(pendulum(angle=0.0, armature=armature, prescribed=sine).scene()) for armature in (ARMATURE, 0.0)
    )
    acceleration, start = -0.3 * 4.0 * np.sin(0.8), found.initial_state
    drives = [each.evaluate(0.4, start.q, start.u).drives["shaft"] for each in (found, without)]
    loads = [each.evaluate(0.4, start.q, start.u).loads["shaft"] for each in (found, without)]
    assert drives[0] - drives[1] == pytest.approx([ARMATURE * acceleration], rel=1e-13)
    assert np.array_equal(*loads)  # the load on the arm is that of its motion


def test_a_screw_s_armature_is_that_of_its_angle():
    scene = (
        SceneBuilder("nut", gravity=(0.0, 0.0, -G))
        .rigid_body("nut", mass=MASS, inertia=(0.02, 0.03, 0.04))
        .screw("thread", "ground", "nut", pitch=0.05, armature=ARMATURE)
        .scene()
    )
    system = fm.compile(scene)
    expected = -MASS * G * 0.05 / (0.04 + MASS * 0.05**2 + ARMATURE)
    assert system.accelerations(system.initial_state) == pytest.approx([expected], rel=gamma(60))


@pytest.mark.parametrize("recipe", [trees.ARMED, trees.ARMED_RIGID], ids=["every level", "rigid"])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_mass_matrix_has_them_on_its_diagonal(recipe, seed):
    """By composite bodies, by inverse dynamics with unit accelerations, by operators and by their factors."""
    scene = trees.random_scene(seed, recipe)
    system, bare = fm.compile(scene), fm.compile(without_armatures(scene))
    state, armature = system.initial_state, system.constants.speed["armature"]
    assert np.count_nonzero(armature) > 5
    M, bound = system.mass_matrix(state), algebra(system.nu, len(system.body_names))
    size = np.max(np.abs(M))
    assert np.max(np.abs(M - bare.mass_matrix(state) - np.diag(armature))) <= bound * size
    bias = system.bias(state)
    assert np.array_equal(bias, bare.bias(state))
    columns = [system.inverse_dynamics(state, each) - bias for each in np.eye(system.nu)]
    assert np.max(np.abs(M - np.array(columns).T)) <= bound * (size + np.max(np.abs(bias)))
    free = system.constants.speed["prescribed"] < 0
    factors = system.factorise(state)
    x = np.where(free, np.random.default_rng(seed).normal(size=system.nu), 0.0)
    assert np.max(np.abs((factors.multiply(x) - M @ x)[free])) <= bound * size * np.sum(np.abs(x))


def test_operators_have_them():
    """M, its innovations form (54), its inverse (56) and log det, against the recursion."""
    system = fm.compile(trees.random_scene(2, trees.ARMED_RIGID))
    state = system.initial_state
    found, M = system.operators(state), system.mass_matrix(state)
    # operators have wheels behind the hinges of their bodies, as the recursion has
    bound, size = algebra(system.nu, len(system.body_names)), np.max(np.abs(M))
    assert np.max(np.abs(found.M - M)) <= bound * size
    assert np.max(np.abs(found.innovations @ found.D @ found.innovations.T - M)) <= bound * size
    assert found.log_determinant == pytest.approx(np.linalg.slogdet(M)[1], rel=1e-10)
    rates = np.random.default_rng(0).normal(size=system.nu)
    assert found.accelerations(found.inverse_dynamics(rates)) == pytest.approx(rates, rel=1e-8, abs=1e-8)


def without_armatures(scene: fm.Scene) -> fm.Scene:
    def bare(coordinate: Coordinate) -> Coordinate:
        return msgspec.structs.replace(coordinate, **{coordinate.ARMATURE: 0.0})

    def all_bare(item):
        return with_coordinates(item, [bare(each) for _, each in coordinates(item)])

    return msgspec.structs.replace(
        scene, hinges=tuple(map(all_bare, scene.hinges)), point_masses=tuple(map(all_bare, scene.point_masses))
    )


def test_energy_less_work_is_conserved_with_drives_and_losses():
    scene = trees.random_scene(4, trees.ARMED_RIGID)
    found = fm.simulate(scene, t_end=1.0, samples=21, rtol=1e-11, atol=1e-12)
    energy = sum(found.energy[kind] for kind in ("kinetic", "strain", "spring", "gravity"))
    drift = np.max(np.abs(energy - found.work - energy[0]))
    assert drift <= 1e-8 * np.max(np.abs(energy))
    armature, u = fm.compile(scene).constants.speed["armature"], found.u
    assert np.ptp(0.5 * u**2 @ armature) > 1e4 * drift  # their share is not lost in the bound


def test_free_flight_conserves_the_momentum_of_the_bodies():
    scene = trees.with_armatures(trees.random_scene(1, trees.FREE_FLYING), seed=1)
    found = fm.simulate(scene, t_end=0.5, samples=11, rtol=1e-11, atol=1e-12)
    assert np.max(np.abs(found.momentum - found.momentum[0])) <= 1e-8 * np.max(np.abs(found.momentum))


def test_a_latch_stops_the_rotor_too():
    """Two bodies in free space, the hinge between them locked: momentum of the bodies stays, the rotor's is none."""
    I_hub, I_arm, spin, rate = 3.0, 0.4, 0.5, 2.0
    scene = (
        SceneBuilder("spinner")
        .rigid_body("hub", mass=5.0, inertia=(2.0, 2.0, I_hub))
        .rigid_body("arm", mass=1.0, inertia=(0.3, 0.3, I_arm))
        .revolute("base", "ground", "hub", rate=spin)
        .revolute("joint", "hub", "arm", rate=rate, armature=ARMATURE)
    )
    system = fm.compile(scene.scene())
    state = system.initial_state
    found = struck(system, state, {1: 0.0})
    momentum = I_hub * spin + I_arm * (spin + rate)
    after = momentum / (I_hub + I_arm)
    assert found.u == pytest.approx([after, 0.0], abs=1e-14)
    assert found.impulses[1] == pytest.approx(I_arm * (after - spin - rate) - ARMATURE * rate, rel=1e-13)
    before = 0.5 * (I_hub * spin**2 + I_arm * (spin + rate) ** 2 + ARMATURE * rate**2)
    assert found.energy == pytest.approx(0.5 * (I_hub + I_arm) * after**2 - before, rel=1e-13)


def test_a_linear_model_has_its_frequency():
    model = fm.linearize(fm.compile(pendulum(angle=0.0).scene()))
    expected = np.sqrt(MASS * G * ARM / (OWN + ARMATURE)) / (2.0 * np.pi)
    assert model.modes[0].frequency_hz == pytest.approx(expected, rel=1e-12)


def test_a_batch_has_copies_with_and_without():
    scenes = [two_links(armature) for armature in (0.0, 0.1, ARMATURE, 0.0)]
    together = fm.simulate_batch(scenes, t_end=0.3, samples=4)
    for scene, q in zip(scenes, together.q, strict=True):
        assert q == pytest.approx(fm.simulate(scene, t_end=0.3, samples=4).q, rel=1e-9)


def two_links(armature: float) -> fm.Scene:
    """The armature is between both links, so that what the first one feels of the second depends on it."""
    builder = pendulum(armature=0.0).rigid_body("hand", mass=1.0, com=(0.0, 0.0, -0.2), inertia=(0.02, 0.03, 0.04))
    return builder.revolute(
        "wrist", "arm", "hand", axis=(0.0, 1.0, 0.0), parent_position=(0.0, 0.0, -1.0), armature=armature
    ).scene()


def test_a_shaft_without_inertia_needs_one():
    """A gear stage without mass between two springs moves with its armature alone."""

    def stage(armature: float) -> SceneBuilder:
        return (
            SceneBuilder("stage")
            .rigid_body("gear", mass=0.0, inertia=(0.0, 0.0, 0.0))
            .revolute("shaft", "ground", "gear", angle=0.1, stiffness=8.0, armature=armature)
        )

    system = fm.compile(stage(0.5).scene())
    assert system.accelerations(system.initial_state) == pytest.approx([-8.0 * 0.1 / 0.5], rel=gamma(20))
    with pytest.raises(fm.SceneError, match="give it an armature"):
        stage(0.0).scene()


def test_a_gimbal_may_start_where_its_axes_align_if_armatures_resist():
    def gimbal(armature: float) -> SceneBuilder:
        rotations = [angular(armature=armature), angular(), angular()]
        return (
            SceneBuilder("gimbal")
            .rigid_body("ball", mass=1.0, inertia=(0.1, 0.2, 0.3))
            .gimbal("joint", "ground", "ball", sequence="zxz", rotations=rotations)
        )

    system = fm.compile(gimbal(0.5).scene())
    assert system.accelerations(system.initial_state) == pytest.approx(np.zeros(3), abs=1e-14)
    with pytest.raises(fm.SceneError, match="gimbal lock"):
        gimbal(0.0).scene()


@pytest.mark.parametrize(("make", "place"), [
    (lambda: pendulum(armature=-0.1), r"rotation\.armature_kg_m2.*negative armature: -0.1"),
    (lambda: pendulum(armature=np.nan), r"rotation\.armature_kg_m2"),
    (lambda: SceneBuilder("bead").rigid_body("bead", mass=1.0, inertia=(1.0, 1.0, 1.0)).planar(
        "plane", "ground", "bead", x=linear(armature=-1.0)), r"x\.armature_kg.*negative armature: -1"),
])  # fmt: skip
def test_impossible_armatures_are_refused_with_their_place(make, place):
    with pytest.raises(fm.SceneError, match=place):
        make().scene()


def test_hinges_without_scalar_coordinates_have_none():
    builder = SceneBuilder("free").rigid_body("ball", mass=1.0, inertia=(1.0, 1.0, 1.0))
    for add in (builder.free, builder.spherical):
        with pytest.raises(TypeError, match="armature"):
            add("joint", "ground", "ball", armature=0.1)


def test_without_armatures_kernels_do_not_know_them():
    assert "armatures" in fm.compile(pendulum().scene(), kernels="special").constants.features()
    assert "armatures" not in fm.compile(pendulum(armature=0.0).scene(), kernels="special").constants.features()
