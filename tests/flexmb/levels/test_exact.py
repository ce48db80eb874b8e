"""Level exact: kinematics against other routes and closed forms, conservation, and what the level is near to."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest
from scipy.optimize import brentq

import flexmb
from flexmb.dense.body_frames import section_frames
from flexmb.dense.jets import Jet
from flexmb.modal.beam import beam_elements
from flexmb.modal.exact import exact_model
from flexmb.modal.second_order import beam_second_order
from flexmb.modal.strain_field import LINEAR, SQUARE, WHOLE
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.modal_data import inertia_points
from flexmb.scene.quaternions import cross_matrix
from flexmb.system.moved_sections import MovedSections, moved_sections
from flexmb.typing import Real
from tests.bounds import observed_order, relative
from tests.flexmb.levels.strain_beams import (
    BEAMS,
    ROUNDING,
    SPACE,
    beam,
    bent,
    body_of,
    curve,
    field_of,
    stations,
    strained,
    strains,
)


@pytest.mark.parametrize("name", BEAMS)
def test_motion_of_sections_against_jets(name):
    """Velocities and accelerations by formulas, against those of jets through positions and rotations alone."""
    field = field_of(beam(**BEAMS[name]))
    eta, etad, etadd = bent(field)
    frames = section_frames(field, Jet(eta[None], etad[None], etadd[None])).first
    found = moved_sections(field, eta, etad, etadd)
    R, skew = frames.rotation, frames.rotation.rate @ np.swapaxes(frames.rotation.value, -1, -2)
    again = R.acceleration @ np.swapaxes(R.value, -1, -2) + R.rate @ np.swapaxes(R.rate, -1, -2)
    expected = MovedSections(
        frames.position.value, frames.position.rate, frames.position.acceleration, R.value, _axial(skew), _axial(again)
    )
    for own, other in zip(found, expected, strict=True):
        assert np.max(np.abs(own - other)) <= ROUNDING * max(1.0, np.max(np.abs(other)))


@pytest.mark.parametrize("name", BEAMS)
def test_positions_follow_from_the_ends_of_intervals(name):
    """What the Gauss points before an interval weigh in its sections is what they weigh in its base, and those beyond
    weigh nothing."""
    body = body_of(beam(**BEAMS[name], nodes=[s.BeamNode(name="third", x_m=1.0 / 3.0), s.BeamNode(name="in", x_m=0.4)]))
    field = exact_model(body).field
    assert field is not None
    assert len(set(field.base)) == body.modes.pieces
    for weight, base, (start, stop) in zip(field.weight, field.base, field.own, strict=True):
        rest = weight.copy()
        rest[start:stop] = 0.0
        assert np.max(np.abs(rest - (field.weight[base] if base >= 0 else 0.0))) <= ROUNDING
        assert base < 0 or field.x[base] <= field.x[field.gauss[start]]


def _axial(matrix: Real) -> Real:
    return np.stack([matrix[..., 2, 1], matrix[..., 0, 2], matrix[..., 1, 0]], axis=-1)


@pytest.mark.parametrize("name", BEAMS)
def test_velocities_are_derivatives_of_positions(name):
    """By complex steps: v = dr, omega~ = dR R'."""
    field = field_of(beam(**BEAMS[name]))
    eta, etad, none = *bent(field)[:2], np.zeros(field.mode_count)
    found, h = moved_sections(field, eta, etad, none), 2.0**-100
    stepped = moved_sections(field, eta + 1j * h * etad, none, none)
    assert relative(stepped.r.imag / h, found.v) <= ROUNDING
    assert relative(_axial(stepped.R.imag / h @ np.swapaxes(stepped.R.real, 1, 2)), found.omega) <= ROUNDING


@pytest.mark.parametrize("name", BEAMS)
def test_compiled_motion_of_nodes_against_formulas(name):
    """Markers on a clamped beam: positions, velocities and accelerations of the recursion's kernels."""
    nodes = {"a": 0.37, "b": 0.81}
    scene = beam(**BEAMS[name], nodes=nodes).weld("clamp", "ground", "rod")
    for node in ("a", "b", "tip"):
        scene.marker(node, "rod", node=node)
    system = flexmb.compile(scene.scene())
    model = system.links[0].model
    eta, etad, _ = bent(model.field)
    seen = system.evaluate(0.0, eta, etad)
    moved = moved_sections(model.field, eta, etad, seen.accelerations)
    for node in ("a", "b", "tip"):
        j, at = model.nodes[node].section, seen.markers[node]
        size = 1.0 + np.max(np.abs(seen.accelerations))
        assert np.max(np.abs(at.position - moved.r[j])) <= ROUNDING
        assert np.max(np.abs(at.rotation - moved.R[j] @ model.nodes[node].rotation)) <= ROUNDING
        assert np.max(np.abs(at.velocity - [*moved.omega[j], *moved.v[j]])) <= ROUNDING * np.max(np.abs(at.velocity))
        assert np.max(np.abs(at.acceleration - [*moved.alpha[j], *moved.a[j]])) <= ROUNDING * size


def test_mass_matrix_is_virtual_work():
    """M_ff = sum of m U'U + W' J W of the inertia points, with U and W by complex steps of positions and rotations."""
    tensor = (2e-2, 0.0, 0.0), (0.0, 1e-2, 1e-3), (0.0, 1e-3, 2e-2)
    lump = s.TipMass(x_m=0.6, mass_kg=0.3, com_m=(0.02, 0.1, -0.05), inertia_kg_m2=tensor)
    scene = beam(**BEAMS["six strains"], tip_masses=[lump]).weld("clamp", "ground", "rod").scene()
    system = flexmb.compile(scene)
    model, (eta, _, none) = system.links[0].model, bent(system.links[0].model.field)
    none, h, at = 0.0 * none, 2.0**-100, model.section
    centres = moved_sections(model.field, eta, none, none)
    U, W = [], []
    for unit in np.eye(len(eta)):
        moved = moved_sections(model.field, eta + 1j * h * unit, none, none)
        U.append((moved.r[at] + np.einsum("nab,nb->na", moved.R[at], model.com_offset)).imag / h)
        W.append(_axial(moved.R[at].imag / h @ np.swapaxes(centres.R[at], 1, 2)))
    J = centres.R[at] @ model.inertia @ np.swapaxes(centres.R[at], 1, 2)
    M = np.einsum("n,ina,jna->ij", model.mass, U, U) + np.einsum("ina,nab,jnb->ij", W, J, W)
    assert relative(system.mass_matrix(system.state(eta, none)), M) <= ROUNDING


@pytest.mark.parametrize(("linear", "square", "order"), [(1.0, 1.0, 6.0), (1.0, 0.0, 4.0), (-1.0, 1.0, 2.0)])
def test_rotations_converge(linear, square, order):
    """Of the sixth order in the intervals; of the fourth without the second moment of the curvature, and of the second
    with the wrong sign of the first."""

    def kappa(x: float) -> Real:
        return np.array([3.0 - 6.0 * x * x, 2.0 + 2.0 * x, 5.0 - 4.0 * x + 3.0 * x * x])

    def error(pieces: int) -> float:
        three = s.StrainPolynomials(torsion=3, bending_y=3, bending_z=3)
        field = field_of(beam(s.Modes(count=3, pieces=pieces, polynomials=three, points=4)))
        factors = np.ones(4)
        factors[[LINEAR, SQUARE]] = linear, square
        eta, none = _with_curvature(field, kappa), np.zeros(field.mode_count)
        field = replace(field, rows=field.rows * factors[:, None, None])
        exact, _ = curve(kappa, lambda _: np.eye(3)[0], field.x[-1:])
        return float(np.max(np.abs(moved_sections(field, eta, none, none).R[-1] - exact[0])))

    pieces = np.array([2, 4, 8])
    assert observed_order(1.0 / pieces, [error(n) for n in pieces], 1e-13) == pytest.approx(order, abs=0.3)


def _with_curvature(field: Any, kappa: Any) -> Real:
    """Coordinates of a straight beam whose curvature is kappa(x) (3,), a polynomial that it can have."""
    left = np.where(field.before >= 0, field.x[field.before], 0.0)
    h, (xi, w) = field.x - left, np.polynomial.legendre.leggauss(4)
    at = left[:, None] + h[:, None] / 2.0 * (1.0 + xi)
    wanted = np.einsum("j,p,jpa->ja", h / 2.0, w, np.array([[kappa(x) for x in places] for places in at]))
    found, *_ = np.linalg.lstsq(field.rows[:, WHOLE].reshape(-1, field.mode_count), wanted.ravel())
    np.testing.assert_allclose(np.einsum("jam,m->ja", field.rows[:, WHOLE], found), wanted, atol=1e-11)
    return np.asarray(found)


@pytest.mark.parametrize("kappa", [(0.0, 0.0, 2.0 * np.pi), (0.0, -3.0, 0.0), (1.5, 2.0, -2.0)])
def test_constant_strains_are_circles_and_helices(kappa):
    """R = exp(x kappa~) at all x to rounding; positions to the collocation's error of 18 points."""
    field = field_of(beam(s.Modes(count=1, families=SPACE, points=18)))
    eta, none = _with_curvature(field, lambda _: np.array(kappa)), np.zeros(field.mode_count)
    found = moved_sections(field, eta, none, none)
    K = cross_matrix(np.array(kappa))
    rate = np.linalg.norm(kappa)
    for x, R, r in zip(field.x, found.R, found.r, strict=True):
        S, C = np.sin(rate * x) / rate, (1.0 - np.cos(rate * x)) / rate**2
        np.testing.assert_allclose(R, np.eye(3) + S * K + C * K @ K, atol=ROUNDING)
        expected = (x * np.eye(3) + C * K + (x - S) / rate**2 * K @ K)[:, 0]
        np.testing.assert_allclose(r, expected, atol=1e-12)


def test_curved_at_rest():
    """Positions and rotations of unloaded sections whose curvature and twist vary, against scipy."""
    first, more = np.array([2.0, -1.0, 3.0]), np.array([-3.0, 4.0, 1.0])
    section = stations(1.0, first, more)
    scene = beam(s.Modes(count=2, families=SPACE), section=section, nodes={"a": 0.3, "b": 0.77})
    model = exact_model(body_of(scene))
    R, r = curve(lambda x: first + x * more, lambda _: np.eye(3)[0], np.array([0.3, 0.77, 1.0]))
    for node, turn, position in zip(("a", "b", "tip"), R, r, strict=True):
        np.testing.assert_allclose(model.nodes[node].position, position, atol=1e-12)
        np.testing.assert_allclose(model.nodes[node].rotation, turn, atol=1e-12)


def test_second_derivatives_at_rest_are_the_field_of_level_stiffened():
    """Of positions and rotation vectors, for strains whose shapes finite elements have: constant torsion, linear
    curvatures."""
    counts = s.StrainPolynomials(torsion=1, bending_y=2, bending_z=2)
    body = body_of(beam(s.Modes(count=2, polynomials=counts), nodes={f"n{i}": i / 20 for i in range(20)}))
    model = exact_model(body)
    field = model.field
    elements = beam_elements(as_stiffened(body))
    turn, shift = field.shapes()
    motion = elements.motion(field.x, np.eye(elements.size))
    columns, *_ = np.linalg.lstsq(motion.reshape(-1, elements.size), np.concatenate([shift, turn], 1).reshape(-1, 5))
    assert relative(elements.motion(field.x, columns), np.concatenate([shift, turn], axis=1)) <= 64 * ROUNDING
    expected = beam_second_order(elements, columns, field.x, np.zeros((len(field.x), 3)))
    found = second_derivatives(field)
    assert relative(found[0], expected.translation) <= 1e-9  # differences of derivatives by complex steps
    assert relative(found[1], expected.rotation) <= 1e-9


def as_stiffened(body: s.BeamBody) -> s.BeamBody:
    """The beam with finite elements that have these strains."""
    return msgspec.structs.replace(body, level="stiffened", modes=s.Modes(count=5, families=SPACE))


def second_derivatives(field: Any) -> tuple[Real, Real]:
    """Of positions and rotation vectors at rest (n,3,m,m): central differences of complex steps, extrapolated."""
    m, none, h = field.mode_count, np.zeros(field.mode_count), 2.0**-100

    def slope(eta: Real, unit: Real) -> Real:
        moved = moved_sections(field, eta + 1j * h * unit, none, none)
        # log R to the third order in the angle is (R - R') / 2 (1 + angle^2 / 6): the square does not act here
        return np.concatenate([moved.r, _axial((moved.R - np.swapaxes(moved.R, 1, 2)) / 2.0)], axis=1).imag / h

    found = np.zeros((len(field.x), 6, m, m))
    for k, along in enumerate(np.eye(m)):
        for n, unit in enumerate(np.eye(m)):
            wide, narrow = ((slope(d * along, unit) - slope(-d * along, unit)) / (2.0 * d) for d in (4e-4, 2e-4))
            found[..., n, k] = (4.0 * narrow - wide) / 3.0
    return found[:, :3], found[:, 3:]


def test_accelerations_differ_from_those_of_level_stiffened_in_the_third_order():
    """Coordinates and rates of the size eps, no loads, a free beam: by 8 for each halving of eps."""
    six = s.StrainPolynomials(axial=1, torsion=2, bending_y=2, bending_z=2)
    builder = beam(s.Modes(count=2, polynomials=six))
    exact = flexmb.compile(builder.free("base", "ground", "rod").scene())
    model = exact_model(builder.scene().bodies[0])
    G, H = second_derivatives(model.field)
    points = inertia_points(
        model.mass, model.position, model.translation, model.rotation, model.inertia, model.com_offset,
        second_translation=G[model.section], second_rotation=H[model.section],
    )  # fmt: skip
    raw = SceneBuilder("stiffened", gravity=(0.0, 0.0, 0.0)).modal_body(
        "rod", points=points, stiffness=model.stiffness, level="stiffened"
    )
    stiffened = flexmb.compile(raw.free("base", "ground", "rod").scene())
    rng, gaps = np.random.default_rng(3), []
    (eta, etad, _), spin = bent(model.field, 1), rng.normal(size=6)
    for eps in (0.04, 0.02, 0.01):
        q = np.concatenate([exact.initial_state.q[:7], eps * eta])
        u = np.concatenate([eps * spin, eps * etad])
        gaps.append(np.max(np.abs(np.subtract(*(each.accelerations(each.state(q, u)) for each in (exact, stiffened))))))
    ratios = np.array(gaps[:-1]) / gaps[1:]
    assert np.all((ratios > 7.0) & (ratios < 9.0)), ratios


@pytest.mark.parametrize("name", ["space", "six strains"])
def test_free_flight_conserves_energy_and_momentum(name):
    """Bent by half a radian, with rtol 1e-10: to 1e-10 of the energy and of the largest momentum."""
    motion = {"angular_velocity": (0.3, -0.4, 1.0), "velocity": (0.2, 0.1, 0.0)}
    builder = beam(**BEAMS[name]).free("base", "ground", "rod", **motion)
    field = field_of(beam(**BEAMS[name]))
    eta = np.zeros(field.mode_count)
    eta[0] = brentq(lambda a: _turn(field, a) - 0.5, 0.0, 10.0 / np.max(np.abs(strains(field)[..., 0])))
    done = flexmb.simulate(builder.modal_state("rod", coordinates=eta).scene(), 1.0, rtol=1e-10, atol=1e-12, samples=21)
    assert np.max(np.abs(done.energy_drift)) <= 1e-10 * done.energy_scale
    assert np.ptp(done.energy["kinetic"]) > 0.01 * done.energy_scale, "nothing moves: this would show nothing"
    for part in (slice(0, 3), slice(3, 6)):
        assert np.max(np.abs(done.momentum_drift[:, part])) <= 1e-10 * np.max(np.abs(done.momentum))


def _turn(field: Any, first: float) -> float:
    """How far the tip is turned by the first mode."""
    eta, none = np.zeros(field.mode_count), np.zeros(field.mode_count)
    eta[0] = first
    R = moved_sections(field, eta, none, none).R[field.gauss[-1]]
    return float(np.arccos(np.clip((np.trace(R) - 1.0) / 2.0, -1.0, 1.0)))


@pytest.mark.parametrize(("count", "first", "second"), [(4, 2e-6, 6e-3), (5, 4e-8, 3e-5), (6, 1e-10, 1.5e-5)])
def test_frequencies_of_a_cantilever(count, first, second):
    """From above, relative to those of Euler and Bernoulli's beam: (beta L)^2 sqrt(EI / m') / L^2."""
    section = stations(1.0, rotary=0.0)
    model = exact_model(body_of(beam(s.Modes(count=count, families=("bending_z",)), section=section, points="line")))
    found = np.sqrt(np.diag(model.stiffness))
    errors = found[:2] / np.array([1.8751040687119611, 4.694091132974174]) ** 2 - 1.0
    assert -1e-12 < errors[0] < first and 0.0 < errors[1] < second, errors


def test_a_chain_of_exact_beams_is_one_of_pieces():
    """Two welded beams with the strains of one of two pieces: its accelerations, to rounding."""
    curvature, taper = (0.3, 0.4, -0.6), 0.5
    modes = s.Modes(count=2, polynomials=s.StrainPolynomials(axial=1, torsion=2, bending_y=2, bending_z=2))
    ends = stations(1.0, curvature, taper=taper)
    middle = _between(*ends)
    halves = [[ends[0], middle], [_at(middle, 0.0), _at(ends[1], 0.5)]]
    whole = beam(msgspec.structs.replace(modes, pieces=2), section=[ends[0], middle, ends[1]], nodes={"half": 0.5})
    one = flexmb.compile(whole.free("base", "ground", "rod").marker("tip", "rod", node="tip").scene())
    chain = beam(modes, 0.5, halves[0], name="a").beam(
        "b", length=0.5, elements=4, section=halves[1], modes=modes, level="exact", points="section"
    )
    chain.free("base", "ground", "a").weld("joint", "a", "b", parent_node="tip").marker("tip", "b", node="tip")
    two = flexmb.compile(chain.scene())
    field = one.links[0].model.field
    parts = [link.model.field for link in two.links]
    at = int(np.flatnonzero(np.isclose(field.x[: field.steps], 0.5))[0])
    sections = [np.arange(at), np.arange(at + 1, field.steps)]
    turns = [np.eye(3), one.links[0].model.nodes["half"].rotation.T]
    rng = np.random.default_rng(2)
    eta, etad, _ = bent(field, 4, 0.5)
    spin, place = rng.normal(size=6), one.initial_state.q[:7]

    def split(x: Real) -> list[Real]:
        return [strained(*each) for each in zip(parts, [field] * 2, [x] * 2, sections, turns, strict=True)]

    found = two.evaluate(0.0, np.concatenate([place, *split(eta)]), np.concatenate([spin, *split(etad)]))
    expected = one.evaluate(0.0, np.concatenate([place, eta]), np.concatenate([spin, etad]))
    np.testing.assert_allclose(found.markers["tip"].position, expected.markers["tip"].position, atol=1e-12)
    size = np.max(np.abs(expected.accelerations))
    wanted = np.concatenate([expected.accelerations[:6], *split(expected.accelerations[6:])])
    assert np.max(np.abs(found.accelerations - wanted)) <= 1e-11 * size
    at_eta = one.state(np.concatenate([place, eta]), np.concatenate([spin, etad]))
    loads = one.section_loads(at_eta, "rod", [0.5]).load[0]
    state = two.state(np.concatenate([place, *split(eta)]), np.concatenate([spin, *split(etad)]))
    weld = two.hinge_loads(state, axes="outboard")["joint"]
    assert np.max(np.abs(loads - weld)) <= 1e-10 * np.max(np.abs(weld))


def _at(station: s.BeamStation, x: float) -> s.BeamStation:
    return msgspec.structs.replace(station, x_m=x)


def _between(first: s.BeamStation, last: s.BeamStation) -> s.BeamStation:
    def mean(a: Any, b: Any) -> Any:
        if a is None:
            return None
        return tuple(map(mean, a, b)) if isinstance(a, tuple) else 0.5 * (a + b)

    names = s.BeamStation.__struct_fields__
    return s.BeamStation(**{name: mean(getattr(first, name), getattr(last, name)) for name in names})


def test_hung_by_its_tip_it_moves_alike():
    """The same free beam held by its root or by its tip, at one state: markers accelerate alike."""
    systems = []
    for node in ("origin", "tip"):
        builder = beam(**BEAMS["six strains"], nodes={"a": 0.4}).free("base", "ground", "rod", child_node=node)
        systems.append(flexmb.compile(builder.marker("root", "rod").marker("tip", "rod", node="tip").scene()))
    by_root, by_tip = systems
    eta, etad, _ = bent(by_root.links[0].model.field)
    rng = np.random.default_rng(5)
    u = np.concatenate([rng.normal(size=6), etad])
    seen = by_root.evaluate(0.0, np.concatenate([by_root.initial_state.q[:7], eta]), u)
    tip = seen.markers["tip"]
    R = tip.rotation
    turned = [*(R.T @ tip.velocity[:3]), *(R.T @ tip.velocity[3:])]  # the free hinge's speeds are in axes of the child
    again = by_tip.evaluate(0.0, np.concatenate([tip.position, tip.quaternion, eta]), np.concatenate([turned, etad]))
    size = 1.0 + np.max(np.abs(seen.accelerations))
    for name in ("root", "tip"):
        a, b = seen.markers[name], again.markers[name]
        np.testing.assert_allclose(a.position, b.position, atol=ROUNDING)
        np.testing.assert_allclose(a.velocity, b.velocity, atol=64 * ROUNDING)
        np.testing.assert_allclose(a.acceleration, b.acceleration, atol=64 * ROUNDING * size)
