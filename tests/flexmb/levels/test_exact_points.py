"""Level exact: the default number of points is sufficient, and runs tell where points are too few."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.spatial.transform import Rotation

import flexmb
from flexmb.modal.strain_field import WHOLE, gauss_weights, strain_field
from flexmb.parameters.parameters import ParameterError
from flexmb.scene import schema as s
from flexmb.scene.functions import Ramp
from flexmb.scene.problems import SceneWarning
from flexmb.scene.strains import points_of_piece
from flexmb.system.enough_points import ALLOWED, unfollowed
from flexmb.system.moved_sections import moved_sections
from tests.benchmarks import exact_scenes
from tests.bounds import relative
from tests.flexmb.levels.strain_beams import ALLOW, PLANE, SPACE, beam, body_of, curve, stations

LOADS = {
    "tip force in the plane": (PLANE, (0.0, 10.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    "tip force across two planes": (SPACE, (0.0, 4.0, 6.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    "force and torque": (SPACE, (0.0, 2.0, 4.0), (3.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    "most of a turn of twist, and a force": (SPACE, (0.0, 1.0, 2.0), (5.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    "helix": (SPACE, (0.0, 2.0, 4.0), (1.0, 0.0, 0.0), (4.0, 0.0, 3.0)),
}  # fmt: skip
"""Strains, force (EI / L^2) and torque (EI / L) on the tip, of constant directions, and curvature at rest (1 / L)."""


def tip_at_rest(name, count, points):
    """Position of the tip under the loads of that name."""
    families, force, torque, curvature = LOADS[name]
    modes = s.Modes(count=count, families=families, points=points)
    scene = beam(modes, section=stations(1.0, curvature)).weld("clamp", "ground", "rod")
    for kind, load in (("force", force), ("torque", torque)):
        if size := float(np.linalg.norm(load)):
            direction = tuple((np.array(load) / size).tolist())
            getattr(scene, kind)(kind, "rod", node="tip", direction=direction, function=Ramp(rate=size))
    scene = replace(scene.marker("tip", "rod", node="tip").scene(), allow=(*ALLOW, "few_points"))
    return exact_scenes.tip_at_rest(scene, *np.linspace(0.0, 1.0, 9)[1:])


@pytest.mark.parametrize("count", [2, 3, 4, 6])
@pytest.mark.parametrize("name", LOADS)
def test_default_points_are_enough(name, count):
    """They leave less than a quarter of what the polynomials leave; both by 16 points and 3 polynomials more."""
    families, *_ = LOADS[name]
    default = points_of_piece(body_of(beam(s.Modes(count=count, families=families))))
    found, truth = (tip_at_rest(name, count, points) for points in (default, default + 16))
    richer = tip_at_rest(name, count + 3, default + 16)
    assert np.linalg.norm(found - truth) <= 0.25 * np.linalg.norm(truth - richer)


def test_princeton_by_default_points():
    """Of the beam at 45 degrees, 27 polynomials: 16 points more move the tip by less than 1e-10 m."""
    curvatures = dict.fromkeys(("torsion", "bending_y", "bending_z"), 6)
    polynomials = s.StrainPolynomials(**curvatures, axial=3, shear_y=3, shear_z=3)
    found, truth = (
        exact_scenes.tip_at_rest(exact_scenes.princeton(polynomials, 45.0, points), 2.0, 4.0, 6.0, 8.896)
        for points in (None, 25)
    )
    assert np.linalg.norm(found - truth) < 1e-10


def test_a_circle_closes_by_default_points():
    """Wound to a circle by one to four polynomials: the first of them bends evenly. In the plane turns are exact."""
    for count in range(1, 5):
        body = body_of(beam(s.Modes(count=count, families=("bending_z",))))
        field = strain_field(body, np.array([1.0]))
        eta = np.zeros(count)
        eta[0] = 2.0 * np.pi
        moved = moved_sections(field, eta, 0.0 * eta, 0.0 * eta)
        assert np.linalg.norm(moved.r[-1]) < 1e-6
        np.testing.assert_allclose(moved.R[-1], np.eye(3), atol=1e-13)


def random_strains(turn, count=20):
    """(count,9) coordinates of 3 polynomials of twist and of each curvature; together they add up to `turn` (rad) along
    a beam of length 1."""
    degrees = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, 400), 2)
    found = np.random.default_rng(0).normal(size=(count, 9))
    size = [np.mean(np.linalg.norm(degrees @ eta.reshape(3, 3).T, axis=1)) for eta in found]
    return turn * found / np.array(size)[:, None]


def rotation_of_tip(points, eta):
    """Of a straight beam of length 1 with these strains."""
    body = body_of(beam(s.Modes(count=3, families=SPACE, points=points)))
    return moved_sections(strain_field(body, np.array([1.0])), eta, 0.0 * eta, 0.0 * eta).R[-1]


@pytest.mark.parametrize(
    ("turn", "points", "least", "most"), [(5.0, 6, 5e-5, 5e-4), (5.0, 12, 1e-6, 1e-5), (2.0, 6, 1e-7, 3e-5)]
)
def test_points_that_strong_twist_and_bending_need(turn, points, least, most):
    """What docs/exact.md says of rotations: median above `least`, largest error below `most` (rad)."""
    off = []
    for eta in random_strains(turn):
        truth, _ = curve(lambda x, eta=eta: curvature(eta, x), lambda _: np.eye(3)[0], np.array([1.0]))
        off.append(Rotation.from_matrix(truth[0].T @ rotation_of_tip(points, eta)).magnitude())
    assert least < np.median(off) and max(off) < most, off


def curvature(eta, x):
    """(3,) of these coordinates at x of a beam of length 1."""
    return eta.reshape(3, 3) @ np.polynomial.legendre.legvander(np.array([2.0 * x - 1.0]), 2)[0]


def in_flight(points, strains):
    """A system of one free beam, and its state with strains that are given by Legendre's polynomials (9,)."""
    scene = beam(s.Modes(count=3, families=SPACE, points=points)).free("base", "ground", "rod")
    system = flexmb.compile(scene.scene())
    body = system.scene.bodies[0]
    field, model = strain_field(body, np.zeros(0)), system.links[0].model.field
    wanted = field.rows[: field.steps, WHOLE].reshape(-1, 9) @ strains
    eta, *_ = np.linalg.lstsq(model.rows[: model.steps, WHOLE].reshape(-1, 9), wanted)
    return system, np.concatenate([system.initial_state.q[:7], eta])


@pytest.mark.parametrize(("points", "turn"), [(4, 5.0), (None, 5.0), (None, 8.0), (9, 5.0)])
def test_what_is_said_of_points_is_true(points, turn):
    """Strains of so many rad: beams are named where the tip's rotation is off by more than is allowed, with its size;
    and what is said to be enough is enough. The truth is by scipy."""
    named = 0
    for strains in random_strains(turn, 6):
        truth, _ = curve(lambda x, eta=strains: curvature(eta, x), lambda _: np.eye(3)[0], np.array([1.0]))

        def off(points, strains=strains, truth=truth):
            return Rotation.from_matrix(truth[0].T @ rotation_of_tip(points, strains)).magnitude()

        system, q = in_flight(points, strains)
        found = list(unfollowed(system, np.array([0.25, 0.5]), np.array([0.1 * q, q])))
        if off(points) > ALLOWED:
            assert len(found) == 1, "nothing is said"
        for each in found:
            assert (each.body, each.t) == ("rod", 0.5)
            assert off(points) * 0.95 <= each.rotation
            assert each.enough is not None and off(each.enough) <= 1.05 * ALLOWED
        named += len(found)
    assert named == 6 or (points, turn) in {(None, 5.0), (9, 5.0)}, "beams are known that nothing is said of"


@pytest.mark.parametrize(("points", "turn"), [(None, 1.0), (None, 0.1), (24, 5.0)])
def test_silent_where_points_are_enough(points, turn):
    for strains in random_strains(turn, 6):
        system, q = in_flight(points, strains)
        assert not list(unfollowed(system, np.zeros(1), q[None]))


def test_a_run_tells_that_points_are_too_few():
    """A warning and the message; none with the number of points that they give."""
    (strains,) = random_strains(8.0, 1)
    system, q = in_flight(None, strains)
    state = system.state(q, np.zeros(system.nu))
    with pytest.warns(SceneWarning, match=r"bends more than its points can follow.* give its modes points = \d+"):
        run = flexmb.simulate(system, 1e-3, state=state, samples=2, rtol=1e-6)
    assert run.finished and "points = " in run.message
    enough = int(run.message.rpartition("points = ")[2])
    system, q = in_flight(enough, strains)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert flexmb.simulate(system, 1e-3, state=system.state(q, np.zeros(system.nu)), samples=2, rtol=1e-6).finished


def test_node_on_a_gauss_point_has_a_two_sided_derivative():
    """Of accelerations, by the place of a node and of a tip mass at the third Gauss point, and by the beam's length:
    equal to those a little beside it, to what the place and the error of the rotations change."""
    modes = s.Modes(count=3, families=SPACE, cuts=())
    place = float(gauss_weights(body_of(beam(modes)))[0][2])
    names = ["rod.nodes.0.x_m", "rod.tip_masses.0.x_m", "rod.length_m"]
    found = []
    for x in (place - 1e-6, place, place + 1e-6):
        lump = s.TipMass(x_m=x, mass_kg=0.3, com_m=(0.02, 0.1, -0.05))
        builder = beam(modes, tip_masses=[lump], nodes={"held": x})
        builder.revolute("base", "ground", "rod", axis=(0.0, 0.6, 0.8), child_node="held")
        system = flexmb.compile(builder.scene())
        state, rng = system.initial_state, np.random.default_rng(0)
        omega = np.sqrt(np.diag(next(link.model for link in system.links if link.name == "rod").stiffness))
        state.q[system.coordinate("rod.modes")] = 0.5 * rng.normal(size=9) / omega
        state.u[:] = rng.normal(size=system.nu)
        found.append(system.parameters(names).accelerations(state))
    for column in range(len(names)):
        behind, here, ahead = (each[:, column] for each in found)
        assert relative(here, behind) <= 1e-4 and relative(here, ahead) <= 1e-4
        assert relative(2.0 * here, behind + ahead) <= 1e-4


def test_node_on_the_end_of_a_piece_has_none():
    """The strains jump there; the message says so."""
    modes = s.Modes(count=2, families=PLANE, pieces=2)
    scene = beam(modes, nodes={"half": 0.5}).weld("clamp", "ground", "rod")
    system = flexmb.compile(scene.marker("half", "rod", node="half").scene())
    with pytest.raises(ParameterError, match="passes the end of a piece"):
        system.parameters(["rod.nodes.0.x_m"])
