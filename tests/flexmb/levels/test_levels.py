"""Fidelity levels: where they coincide exactly, and how fast they part. Level `ruthless` needs a low spin: the
flapping frequencies of docs/notation.md, and a published one."""

from __future__ import annotations

import re
from dataclasses import replace

import msgspec
import numpy as np
import pytest

import flexmb
import flexmb as fm
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.modal_data import inertia_points
from flexmb.scene.shapes import beam_section
from flexmb.system.system import System
from flexmb.tables.state import DynamicsError
from flexmb.typing import Real
from tests import trees
from tests.bounds import algebra, gamma, observed_order, relative
from tests.repo.project import ROOT

RECIPE = replace(trees.FULL, bodies=5, carriers=("modal", "beam", "floating", "rigid"))
SCALES = np.array([1e-1, 1e-2, 1e-3, 1e-4, 1e-5])
SEEDS = (30, 31)


def at_level(scene: s.Scene, level: s.Level) -> s.Scene:
    bodies = [body if isinstance(body, s.RigidBody) else msgspec.structs.replace(body, level=level)
              for body in scene.bodies]  # fmt: skip
    states = scene.modal_states if level != "rigid" else ()
    return msgspec.structs.replace(scene, bodies=tuple(bodies), modal_states=states)


@pytest.fixture(scope="module", params=SEEDS)
def scene(request) -> s.Scene:
    return trees.random_scene(request.param, RECIPE)


@pytest.fixture(scope="module")
def systems(scene) -> dict[str, System]:
    return {level: flexmb.compile(at_level(scene, level)) for level in ("full", "linear", "ruthless", "rigid")}


@pytest.mark.parametrize("level", ["ruthless", "linear"])
def test_levels_coincide_at_rest_shape(systems, level):
    """Jain & Rodriguez (B1): undeformed and with the modes still, all are the same equations, in other orders."""
    full, other = systems["full"], systems[level]
    state = trees.deformed(full, 0.0)
    bound = algebra(full.nu, len(full.body_names), 15)
    M = full.mass_matrix(state)
    assert relative(M, other.mass_matrix(state)) <= bound
    assert relative(full.bias(state), other.bias(state)) <= bound
    free = full.constants.speed["prescribed"] < 0
    a, b = full.accelerations(state), other.accelerations(state)
    # both solve the same equations to backward error, so their difference is a force within twice that
    size = np.max(np.abs(M) @ np.abs(a) + np.abs(full.bias(state)))
    assert np.max(np.abs(M @ (a - b))[free]) <= 2.0 * bound * size


@pytest.mark.parametrize(("level", "order"), [("ruthless", 1.0), ("linear", 2.0)])
def test_order_of_the_error_in_the_deformation(systems, level, order):
    """Slopes of M, of the bias and of the accelerations: the elastic forces, equal at all levels, do not enter."""
    full, other = systems["full"], systems[level]
    for quantity in (System.mass_matrix, System.bias, System.accelerations):
        errors = []
        for scale in SCALES:
            state = trees.deformed(full, scale)
            a, b = quantity(full, state), quantity(other, state)
            errors.append(np.linalg.norm(a - b) / np.linalg.norm(a))
        assert observed_order(SCALES, errors, floor=1e-15, last=4) == pytest.approx(order, abs=0.1), quantity.__name__


def test_a_stiff_flexible_body_moves_like_the_rigid_one(systems):
    """The rigid level is `full` with its modal rows and columns struck out at rest shape."""
    full, rigid = systems["full"], systems["rigid"]
    state = trees.deformed(full, 0.0)
    modal = np.zeros(full.nu, dtype=bool)
    for body in full.scene.bodies:
        if not isinstance(body, s.RigidBody):
            modal[full.speed(f"{body.name}.modes")] = True
    bound = algebra(full.nu, len(full.body_names), 15)
    assert relative(full.mass_matrix(state)[np.ix_(~modal, ~modal)], rigid.mass_matrix(rigid.initial_state)) <= bound
    assert relative(full.bias(state)[~modal], rigid.bias(rigid.initial_state)) <= bound


def test_levels_share_strain_energy_and_marker_positions(systems):
    """`ruthless` forgets the deformation in its inertia only: springs and drawings see it."""
    full, ruthless = systems["full"], systems["ruthless"]
    state = full.initial_state
    a, b = (system.evaluate(0.0, state.q, state.u) for system in (full, ruthless))
    bound = algebra(full.nu, len(full.body_names), 15)
    assert a.energy["strain"] == b.energy["strain"] > 0.0
    for name, marker in a.markers.items():
        assert relative(marker.position, b.markers[name].position) <= bound


def test_a_body_without_second_order_field_is_not_stiffened(scene):
    with pytest.raises(flexmb.SceneError, match='(?s)"b.".*needs a second-order field.*give second_'):
        flexmb.compile(at_level(scene, "stiffened"))


def test_tables_are_no_larger_than_the_bodies_that_need_them():
    """Slopes by body of level `linear`; those of modal masses, cubic in the modes, where inertia turns or hangs off."""
    arm = flexmb.compile(mass_on_a_radial_spring("linear", 0.0)).constants
    assert (arm.slope.shape, arm.mass_slope.shape) == ((1, 1, 1), (0, 1, 1, 1))
    recipe = replace(RECIPE, carriers=("modal", "rigid"), levels=("linear", "linear", "full", "full"), bodies=4)
    tree = flexmb.compile(trees.random_scene(32, recipe)).constants
    assert (len(tree.slope), len(tree.mass_slope), len(tree.mff)) == (1, 1, 6)
    full = flexmb.compile(mass_on_a_radial_spring("full", 0.0)).constants
    assert len(full.slope) == len(full.mass_slope) == 0


def mass_on_a_radial_spring(
    level: s.Level, eta: float, rate: float = 0.0, torque: float = 0.0, turn: float = 0.0, stiffness: float = 4.0
) -> s.Scene:
    """1 kg at 1 m from a hinge, on a spring along its radius: its inertia is (1 + eta)^2, 1 + 2 eta, or 1."""
    point = inertia_points([1.0], [[1.0, 0.0, 0.0]], [[[1.0], [0.0], [0.0]]])
    return (
        SceneBuilder("mass on a radial spring")
        .modal_body("arm", points=point, stiffness=[[stiffness]], level=level)
        .revolute("pivot", "ground", "arm", rate=turn, torque=s.Constant(value=torque))
        .modal_state("arm", coordinates=[eta], rates=[rate])
        .scene()
    )


@pytest.mark.parametrize(("level", "inertia"), [("full", 0.55**2), ("linear", 0.1), ("ruthless", 1.0)])
def test_linear_can_be_worse_than_ruthless(level, inertia):
    """Pushed in by 0.45 m under 1 N m, the arm should turn at 3.3 rad/s^2; `linear` says 10, `ruthless` 1."""
    system = flexmb.compile(mass_on_a_radial_spring(level, -0.45, torque=1.0))
    assert system.accelerations(system.initial_state)[0] == pytest.approx(1.0 / inertia, rel=gamma(40))


def test_a_mass_matrix_that_left_its_range_is_a_status_with_advice():
    """Pushed in by 0.6 m the inertia of first order is negative: -0.2 kg m^2."""
    full, linear = (flexmb.compile(mass_on_a_radial_spring(level, -0.6)) for level in ("full", "linear"))
    assert full.mass_matrix(full.initial_state)[0, 0] == pytest.approx(0.16, rel=gamma(40))
    assert linear.mass_matrix(linear.initial_state)[0, 0] == pytest.approx(-0.2, rel=gamma(40))
    full.accelerations(full.initial_state)
    with pytest.raises(DynamicsError, match='body "arm" .* first-order mass matrix .* use level "full"'):
        linear.accelerations(linear.initial_state)


@pytest.mark.parametrize(("level", "order"), [("ruthless", 1.0), ("linear", 2.0)])
def test_runs_part_by_the_order_of_the_error(level, order):
    """At 1 rad/s the arm swings out by about 2/stiffness: by that, or by its square, the hinge's rate is wrong."""
    stiffness, errors = np.array([200.0, 400.0, 800.0, 1600.0]), []
    for k in stiffness:
        exact, run = (
            flexmb.simulate(mass_on_a_radial_spring(each, 0.0, turn=1.0, stiffness=k), 1.0, rtol=1e-12, atol=1e-14)
            for each in ("full", level)
        )
        assert run.finished, run.message
        errors.append(np.max(np.abs(run.u[:, 0] - exact.u[:, 0])))
    assert observed_order(1.0 / stiffness, errors, floor=1e-11) == pytest.approx(order, abs=0.1)


def test_a_run_that_leaves_the_range_stops_there():
    """In free vibration the radius shrinks to 0.4 m: the hinge's inertia of first order vanishes on the way."""
    runs = {level: flexmb.simulate(mass_on_a_radial_spring(level, 0.0, -1.2), 2.0) for level in ("full", "linear")}
    assert runs["full"].finished, runs["full"].message
    assert runs["full"].q[:, 1].min() < -0.59
    stopped = runs["linear"]
    assert stopped.status is flexmb.Status.NOT_POSITIVE_DEFINITE
    assert 'level "full"' in stopped.message
    assert -0.5 < stopped.q[-1, 1] < 0.0


def test_the_status_tells_exactly_where_the_mass_matrix_is_indefinite():
    """Random trees of large deformation, where `full` always runs."""
    recipe = replace(trees.LINEAR, bodies=3, carriers=("modal", "floating"), conservative=True, prescribed=False,
                     deformation=0.3)  # fmt: skip
    lowest = []
    for seed in range(6):
        scene = trees.random_scene(seed, recipe)
        full, linear = flexmb.compile(at_level(scene, "full")), flexmb.compile(scene)
        state = linear.initial_state
        full.accelerations(state)
        lowest.append(np.linalg.eigvalsh(linear.mass_matrix(state))[0])
        if lowest[-1] > 0.0:
            linear.accelerations(state)
        else:
            with pytest.raises(DynamicsError, match='use level "full"'):
                linear.accelerations(state)
    assert min(lowest) < 0.0 < max(lowest), "both happen"


FIRST = 1.875104068711961**2  # of a clamped-free beam, rad/s for EI = m L^4, the root of cos x cosh x = -1 squared
SECTION = beam_section(E=1e8, G=4e7, A=1.0, Iy=1e-8, Iz=1e-8, rho=1.0)  # EI = 1 N m^2, 1 kg/m
PUBLISHED = (6.0, 7.360373)  # spin and flapping frequency over sqrt(EI / (m L^4)): Wright, Smith, Thresher, Wang (1982)
ROW = re.compile(r"> \| (?:s|flapping frequency[^|]*) \|([\d. |]+)\|")


def flapping(level: fm.Level, spins: Real) -> Real:
    """Lowest frequency (rad/s) across the plane of rotation at these rates (rad/s) of a hub of no radius."""
    scene = (
        fm.SceneBuilder("rotor", allow=("level_range",))
        .beam("blade", length=1.0, elements=16, section=SECTION, level=level, points="line",
              modes=fm.Modes(count=6, families=("bending_z",)))
        .revolute("hub", "ground", "blade", axis=(0, 0, 1))
        .scene()
    )  # fmt: skip
    return 2.0 * np.pi * fm.campbell(scene, "hub", spins).frequencies_hz.min(axis=1)


def test_the_table_of_the_page():
    """`stiffened` over `ruthless`, to the digits that are printed; `full` keeps the frequency at rest as well."""
    text = (ROOT / "docs" / "notation.md").read_text(encoding="utf-8")
    spins, printed = (np.array(row.split("|"), float) for row in ROW.findall(text))
    stiffened = flapping("stiffened", FIRST * spins)
    for level in ("ruthless", "full"):
        assert stiffened / flapping(level, FIRST * spins) == pytest.approx(printed, abs=0.5001e-3)


def test_published_frequency():
    """Six modes are within 1e-4 of the published frequency."""
    spin, frequency = PUBLISHED
    [found] = flapping("stiffened", np.array([spin]))
    assert found == pytest.approx(frequency, rel=1e-4)
