"""Modes against a rigid body on a spring hinge: closed forms of beams, a truly rigid body, wrong hinges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

from flexmb.frisch.equivalence.appendage import Appendage, appendage, appendage_of
from flexmb.frisch.equivalence.comparison import AT_CLAMP, BEST, GIVEN, coupling_error, directions, equivalence
from flexmb.frisch.equivalence.relations import (
    acceleration_relations,
    best_hinge,
    displacement_relations,
    fit_at,
    modal_effective_inertia,
    rate_relations,
    turning_axis,
)
from flexmb.modal.flexible import flexible_model
from flexmb.modal.flexible_model import FlexibleModel, FlexibleNode
from flexmb.scene.bodies import Modes, TipMass
from flexmb.scene.build import SceneBuilder
from flexmb.scene.shapes import beam_section
from tests.bounds import gamma, observed_order, relative
from tests.flexmb.modal.beam_references import beam, clamped_free_roots

Y, Z = np.eye(3)[1], np.eye(3)[2]
SLENDER = {"points": "line"}
# Quintic elements: what integrals of the lowest six modes of a beam of 32 elements are good to.
FINITE_ELEMENTS = 1e-9


def cantilever(count: int = 6, **changes) -> Appendage:
    """Uniform slender beam of length, mass and stiffness 1, bending about z."""
    return appendage(flexible_model(beam(32, count, modes={"families": ("bending_y",)}, **(SLENDER | changes))), "beam")


def closed_forms(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """beta, A_n = 2 sigma / beta and B_n = 2 / beta^2 of the clamped-free beam, modes normalised to its mass."""
    beta = clamped_free_roots(count)
    sigma = (np.cosh(beta) + np.cos(beta)) / (np.sinh(beta) + np.sin(beta))
    return beta, 2.0 * sigma / beta, 2.0 / beta**2


def hinged(seed: int) -> tuple[FlexibleModel, np.ndarray, np.ndarray, float]:
    """A body that is rigid, but for one mode, a turn about an axis through a point; and axis, point, spring."""
    rng = np.random.default_rng(seed)
    axis, point, stiffness = rng.normal(size=3), rng.normal(size=3), rng.uniform(1.0, 2.0)
    axis /= np.linalg.norm(axis)
    mass, position = rng.uniform(0.5, 2.0, 7), rng.normal(size=(7, 3))
    root = rng.normal(size=(7, 3, 3))
    second = root @ np.swapaxes(root, 1, 2)
    still = np.zeros((3, 1))
    return (
        FlexibleModel(
            mass=mass, position=position, com_offset=rng.normal(size=(7, 3)),
            inertia=np.trace(second, axis1=1, axis2=2)[:, None, None] * np.eye(3) - second,
            translation=np.cross(axis, position - point)[:, :, None], rotation=np.tile(axis, (7, 1))[:, :, None],
            stiffness=np.array([[stiffness]]), damping=np.zeros((1, 1)),
            nodes={"origin": FlexibleNode(np.zeros(3), np.eye(3), still, still)}, clamped=True,
        ), axis, point, stiffness,
    )  # fmt: skip


def test_cantilever_has_the_known_parameters():
    """(48), (54), (56): A_1^2, A_2^2, A_3^2 are the effective masses 0.6131, 0.1883, 0.0647 of beam theory."""
    p = cantilever().parameters
    _, A, B = closed_forms(6)
    signs = np.sign(p.A[:, 1])
    assert relative(signs * p.A[:, 1], A) <= FINITE_ELEMENTS
    assert relative(signs * p.B[:, 2], B) <= FINITE_ELEMENTS
    assert relative(signs * p.Q[:, 2], B - A / 2.0) <= FINITE_ELEMENTS
    assert p.A[:3, 1] ** 2 == pytest.approx([0.6131, 0.1883, 0.0647], abs=5e-5)


def test_best_hinge_of_a_cantilever():
    """(149), (151) met exactly by thetadot = Q / Phi and the point alpha - A / thetadot, 0.132 L from the clamp."""
    body = cantilever()
    beta, A, B = closed_forms(1)
    rate = 12.0 * (B[0] - A[0] / 2.0)
    point = 0.5 - A[0] / rate
    inertia = 1.0 / 12.0 + (0.5 - point) ** 2
    fit = best_hinge(body)
    assert relative(fit.hinge.axes, [Z]) <= gamma(100)
    assert relative(fit.hinge.point, [point, 0.0, 0.0]) <= FINITE_ELEMENTS
    assert point == pytest.approx(0.1320, abs=5e-5)
    assert relative(fit.rates, [[rate]]) <= FINITE_ELEMENTS
    assert relative(fit.hinge.stiffness, [beta[0] ** 4 * inertia]) <= FINITE_ELEMENTS
    assert relative(fit.frequencies, beta**2) <= FINITE_ELEMENTS
    # A slender rod along x deforms its inertia as it turns, so (150) holds with (151).
    assert fit.mismatch <= gamma(1000)


def test_hinge_at_the_clamp_of_a_cantilever():
    """(149)-(151) in closed form: the rate that makes the norm smallest, and what it leaves over."""
    _, (A,), (B,) = closed_forms(1)
    Q, Phi = B - A / 2.0, 1.0 / 12.0
    rate = (A / 2.0 + 2.0 * Q) / (0.25 + 2.0 * Phi)  # (150) counts as (151) for a slender rod
    fit = fit_at(cantilever(), np.zeros(3))
    assert relative(fit.rates, [[rate]]) <= FINITE_ELEMENTS
    mismatches = [relation.mismatch for relation in fit.relations[0]]
    turning = abs(Phi * rate - Q) / np.sqrt(Phi)
    assert relative(mismatches, [abs(rate / 2.0 - A), turning, turning]) <= FINITE_ELEMENTS
    assert mismatches == pytest.approx([0.1120, 0.0970, 0.0970], abs=5e-4)
    assert relative(np.diag(fit.effective_inertia)[[2, 4]], [1.0 / 3.0, 0.75]) <= FINITE_ELEMENTS


@pytest.mark.parametrize("seed", range(4))
def test_rigid_body_on_a_spring_is_found(seed):
    """(149)-(151), (159), (160) hold to round-off, with the axis, the point and the spring of the body."""
    model, axis, point, stiffness = hinged(seed)
    body = appendage(model)
    fit = best_hinge(body)
    rounding = gamma(2000)
    assert relative(abs(fit.hinge.axes @ axis), [1.0]) <= rounding
    assert np.max(np.abs(np.cross(fit.hinge.point - point, axis))) <= 10.0 * rounding
    assert abs(fit.hinge.point @ axis) <= rounding  # along the axis, nearest to the clamp
    assert relative(fit.hinge.stiffness, [stiffness]) <= 10.0 * rounding
    assert fit.mismatch <= 10.0 * rounding
    assert coupling_error(body, fit) <= 10.0 * rounding
    for relation in (*rate_relations(body, fit.hinge, [2.0]), *acceleration_relations(body, fit.hinge, [-3.0])):
        assert relative(relation.rigid, relation.flexible) <= 100.0 * rounding, relation.equation
    again = fit_at(body, point, [axis])
    assert again.mismatch <= 10.0 * rounding


def test_point_mass_on_a_boom_turns_about_the_clamp():
    """(149) alone: a point has no inertia of its own, so the hinge may be anywhere, and is at the clamp."""
    still = np.zeros((3, 1))
    shape = np.array([0.0, 0.3, 0.4])
    boom = FlexibleModel(
        mass=np.array([2.0]), position=np.array([[4.0, 0.0, 0.0]]), com_offset=np.zeros((1, 3)),
        inertia=np.zeros((1, 3, 3)), translation=shape.reshape(1, 3, 1), rotation=np.zeros((1, 3, 1)),
        stiffness=np.array([[3.0]]), damping=np.zeros((1, 1)),
        nodes={"origin": FlexibleNode(np.zeros(3), np.eye(3), still, still)}, clamped=True,
    )  # fmt: skip
    fit = best_hinge(appendage(boom))
    assert np.array_equal(fit.hinge.point, np.zeros(3))
    assert relative(abs(fit.hinge.axes[0]), [0.0, 0.8, 0.6]) <= gamma(20)
    assert fit.mismatch <= gamma(100)
    assert relative(fit.hinge.stiffness, [3.0 * 4.0**2 / 0.5**2]) <= gamma(100)  # the spring's energy is the mode's


def test_displacements_of_a_rigid_body_on_a_spring_differ_at_second_order():
    """(47), (49): the modes are linear, the hinge turns exactly; relative to the displacement that is first order."""
    body = appendage(hinged(0)[0])
    fit = best_hinge(body)
    angles = np.array([0.1, 0.05, 0.025, 0.0125])
    pairs = [displacement_relations(body, fit.hinge, [angle / fit.rates[0, 0]]) for angle in angles]
    for i, equation in enumerate((47, 49)):
        assert pairs[0][i].equation == equation
        assert observed_order(angles, [pair[i].mismatch for pair in pairs], 1e-12) == pytest.approx(1.0, abs=0.02)
    assert displacement_relations(body, fit.hinge, [0.0])[0].mismatch == 0.0
    given = displacement_relations(body, fit.hinge, [0.1 / fit.rates[0, 0]], [0.1])
    assert given[0].mismatch == pytest.approx(pairs[0][0].mismatch, rel=1e-9)


def test_displacement_of_the_mass_centre_in_closed_form():
    """(47): alpha + a A against p + R(theta) b, whose difference is the chord of the turn."""
    body = cantilever()
    fit = best_hinge(body)
    theta = 0.2
    (centre, _) = displacement_relations(body, fit.hinge, np.eye(6)[0] * theta / fit.rates[0, 0])
    arm = body.parameters.alpha - fit.hinge.point
    assert relative(centre.rigid, fit.hinge.point + Rotation.from_rotvec(theta * Z).apply(arm)) <= FINITE_ELEMENTS
    assert relative(centre.flexible, body.parameters.alpha + theta * np.cross(Z, arm)) <= FINITE_ELEMENTS


@pytest.mark.parametrize("step", [[0.05, 0, 0], [-0.05, 0, 0], [0, 0.05, 0]])
def test_wrong_hinges_are_worse(step):
    """(149)-(151): the norm is smallest at the best point, for a cantilever and for a body off every axis."""
    bodies = [cantilever(), appendage(replace(hinged(1)[0], translation=hinged(2)[0].translation))]
    for body in bodies:
        best = best_hinge(body)
        wrong = fit_at(body, best.hinge.point + np.array(step), best.hinge.axes)
        assert wrong.mismatch > best.mismatch + 1e-5


def test_mismatch_and_effective_inertia_know_no_scale_of_the_mode():
    """(149)-(151): mismatches are numbers without unit."""
    body = cantilever()
    hinge = fit_at(body, np.zeros(3)).hinge
    one, other = (rate_relations(body, hinge, factor * np.eye(6)[0]) for factor in (1.0, -7.0))
    for a, b in zip(one, other, strict=True):
        assert a.mismatch == pytest.approx(b.mismatch, rel=1e-12)
    given = rate_relations(body, hinge, np.eye(6)[0], [0.0])  # a hinge that stands still has nothing of the mode
    assert given[0].mismatch == pytest.approx(abs(body.parameters.A[0, 1]), rel=1e-12)


def test_universal_hinge_for_two_planes():
    """(149)-(151) for two modes at once: one point, and a spring for each plane."""
    section = {"EIy_Nm2": 2.0}
    body = appendage(flexible_model(beam(32, 6, section, {"families": ("bending_y", "bending_z")}, **SLENDER)), "beam")
    fit = best_hinge(body, [Z, Y])
    assert fit.modes == (0, 1)
    single = best_hinge(cantilever())
    assert relative(fit.hinge.point, single.hinge.point) <= FINITE_ELEMENTS
    assert relative(fit.hinge.stiffness, single.hinge.stiffness[0] * np.array([1.0, 2.0])) <= FINITE_ELEMENTS
    assert relative(fit.frequencies, body.frequencies[:2]) <= FINITE_ELEMENTS
    assert fit.mismatch <= 1e-9  # the minimiser of several planes is iterative
    assert best_hinge(body, [Y]).modes == (1,)
    assert best_hinge(body, modes=(1,)).hinge.axes[0] == pytest.approx(Y, abs=1e-9)


def coupled_frequency(body: Appendage, hinge_momenta: np.ndarray, inertia: np.ndarray, stiffness: np.ndarray) -> float:
    """Lowest elastic frequency of a base, as heavy as the appendage and free, with what has these momenta on it."""
    base = np.diag([0.2, 0.2, 0.2, 1.0, 1.0, 1.0]) + body.rigid_inertia
    k = len(inertia)
    M = np.block([[base, hinge_momenta.T], [hinge_momenta, inertia]])
    K = np.zeros((6 + k, 6 + k))
    K[6:, 6:] = stiffness
    return float(np.sqrt(np.sort(eigh(K, M, eigvals_only=True))[6]))


def hinge_frequency(body: Appendage, point: np.ndarray) -> float:
    hinge, p = fit_at(body, point).hinge, body.parameters
    arm = p.alpha - hinge.point
    inertia = np.array([[p.Phi[2, 2] + p.mass * arm @ arm]])
    linear = p.mass * np.cross(hinge.axes, arm)
    momenta = np.hstack([hinge.axes @ p.Phi + np.cross(p.alpha, linear), linear])
    return coupled_frequency(body, momenta, inertia, np.diag(hinge.stiffness))


def test_best_hinge_gives_the_frequency_on_a_free_base():
    """(149), (151): base and appendage equally heavy; 1.2 % off with the best hinge, 7.6 % with one at the clamp."""
    body = cantilever(20)
    modal = coupled_frequency(body, body.momenta, np.eye(20), np.diag(body.frequencies**2))
    best = hinge_frequency(body, best_hinge(body).hinge.point)
    clamp = hinge_frequency(body, np.zeros(3))
    assert best / modal - 1.0 == pytest.approx(0.0117, abs=5e-5)
    assert clamp / modal - 1.0 == pytest.approx(0.0761, abs=5e-5)


def test_best_hinge_stiffens_in_spin_as_the_beam_does():
    """Squared flapping frequency grows by 1.193 spin^2 (Southwell's factor of a cantilever on a hub without radius).

    The hinge at p has 1 + m p b / I from the moment of the centrifugal force: 2.5 % off, while modes without
    second-order shapes have 0 for it.
    """
    body = cantilever()
    fit, p = best_hinge(body), body.parameters
    arm = (p.alpha - fit.hinge.point)[0]
    inertia = p.Phi[2, 2] + arm**2
    assert 1.0 + fit.hinge.point[0] * arm / inertia == pytest.approx(1.193, rel=0.03)


def test_axis_of_a_mode():
    """(151): torsion turns about the beam, and an axial mode does not turn at all."""
    families = {"families": ("axial", "torsion")}
    section = {"EA_N": 1.0, "GJ_Nm2": 0.7, "rotary_y_kg_m": 0.5, "rotary_z_kg_m": 0.5}
    body = appendage(flexible_model(beam(8, 4, section, families, points="rotary")), "beam")
    turns = [n for n in range(4) if np.linalg.norm(body.parameters.Q[n]) > 1e-6]
    assert turning_axis(body, turns[0]) == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
    still = next(n for n in range(4) if n not in turns)
    with pytest.raises(ValueError, match=f"beam: mode {still + 1} moves the appendage without turning it"):
        turning_axis(body, still)
    assert best_hinge(body, modes=(turns[0],)).mismatch <= 0.5


@pytest.mark.parametrize(
    ("axes", "modes", "message"),
    [
        ([[0, 0, 0]], None, "three numbers that are not all zero"),
        ([[0, 0, 1], [0, 0, 2]], None, "linearly dependent"),
        ([[0, 0, 1]], (0, 1), "1 hinge axes need as many modes, got 2"),
        (None, (9,), "it has modes 1 to 6"),
        ([[1, 0, 0]], None, "does not turn the appendage about that axis"),
    ],
)
def test_hinges_that_make_no_sense_are_refused(axes, modes, message):
    with pytest.raises(ValueError, match=f"beam: .*{message}"):
        best_hinge(cantilever(), axes, modes)


def test_mode_sums_of_a_cantilever_converge_to_the_rigid_body():
    """(149)-(151): sums over N modes in closed form, for a turn about the clamp and a motion across the beam."""
    body, count = cantilever(12), 12
    _, A, B = closed_forms(count)
    about, along = (next(d for d in directions(body) if d.name == name) for name in ("about z", "along y"))
    assert {d.name for d in directions(body)} == {"about y", "about z", "along x", "along y", "along z"}  # Phi_xx = 0
    total = np.concatenate([[0.0], np.cumsum(3.0 * B**2)])
    assert relative(about.remainder, 1.0 - total, 1.0) <= 10 * FINITE_ELEMENTS
    assert relative(along.mode_shares, A**2, 1.0) <= 10 * FINITE_ELEMENTS
    velocity = np.abs(0.5 - np.concatenate([[0.0], np.cumsum(A * B)])) * np.sqrt(3.0)
    momentum = np.abs(1.0 / 12.0 - np.concatenate([[0.0], np.cumsum((B - A / 2.0) * B)])) * np.sqrt(12.0 * 3.0)
    assert relative(about.relations[0], velocity, 1.0) <= 10 * FINITE_ELEMENTS
    assert relative(about.relations[1], momentum, 1.0) <= 10 * FINITE_ELEMENTS
    assert relative(about.relations[2], momentum, 1.0) <= 10 * FINITE_ELEMENTS
    assert np.all(np.diff(about.remainder) < 0.0)
    # sigma -> 1 and beta -> (N - 1/2) pi: what is left of the mass falls as 4 / (pi^2 N).
    assert along.remainder[-1] == pytest.approx(4.0 / (np.pi**2 * count), rel=0.01)


@pytest.mark.parametrize(("accuracy", "turning", "moving"), [(0.5, 1, 1), (0.1, 2, 5), (0.05, 2, 9)])
def test_modes_needed(accuracy, turning, moving):
    """(149)-(151): counts that follow from the closed forms, and that nothing less would do."""
    found = {d.name: d for d in directions(cantilever(12))}
    for name, count in (("about z", turning), ("along y", moving)):
        needed = found[name].needed(accuracy)
        assert needed == count
        assert found[name].worst[needed] <= accuracy < found[name].worst[needed - 1]
        assert found[name].taking_part(needed) == needed
    assert found["about y"].needed(accuracy) is None
    assert found["about y"].taking_part(12) == 0
    assert found["along y"].needed(0.01) is None


def test_what_sits_in_the_clamp_is_not_counted():
    """(149)-(151): no mode moves it, so no number of modes could carry it away from the base."""
    lump = TipMass(x_m=0.0, mass_kg=5.0, inertia_kg_m2=((0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.1)))
    heavy = {d.name: d for d in directions(cantilever(6, tip_masses=(lump,)))}
    for d in directions(cantilever(6)):
        assert heavy[d.name].inertia == pytest.approx(d.inertia, rel=1e-12)
        assert heavy[d.name].worst == pytest.approx(d.worst, abs=1e-12)


def test_modal_effective_inertia_of_all_modes_tends_to_the_rigid_body():
    """(149)-(151): what is left over is positive semidefinite, and less with more modes."""
    body = cantilever(12)
    left = [body.rigid_inertia - modal_effective_inertia(body, range(n)) for n in (0, 4, 12)]
    for more, less in zip(left, left[1:], strict=False):
        assert np.linalg.eigvalsh(less)[0] >= -gamma(1000)
        assert np.linalg.eigvalsh(more - less)[0] >= -gamma(1000)


def test_verdicts_follow_the_numbers():
    """(149)-(151): the best hinge serves for the first vibration, one at the clamp does not; other modes need modes."""
    result = equivalence(cantilever(), accuracy=0.02, point=[0.0, 0.0, 0.0])
    assert list(result.fits) == [AT_CLAMP, BEST, GIVEN]
    assert [verdict.better for verdict in result.verdicts] == ["flexible", "flexible", "rigid", "rigid"]
    best = equivalence(cantilever(), accuracy=0.02)
    assert [verdict.better for verdict in best.verdicts] == ["either", "flexible", "rigid", "rigid"]
    assert "modes other than 1 have 38.7 % of the mass" in best.verdicts[1].reason
    assert equivalence(cantilever(1)).verdicts[1].better == "rigid"  # no other modes to speak of
    with pytest.raises(ValueError, match="a fraction between 0 and 1"):
        equivalence(cantilever(), accuracy=5.0)


def test_verdicts_on_a_beam_of_level_exact():
    """Its strains omit no order, whatever the number of points of the scene: only the relations are linear."""
    builder = SceneBuilder("appendage").rigid_body("hub", mass=10.0, inertia=(1.0, 1.0, 1.0))
    builder.free("base", "ground", "hub")
    for level, last in (("exact", ["flexible", "either"]), ("full", ["rigid", "rigid"])):
        modes = Modes(count=3, families=("bending_y",), points=5 if level == "exact" else None)
        section = beam_section(E=7e10, G=2.7e10, A=1e-3, Iy=2e-7, Iz=1e-7, rho=2700.0)
        builder.beam(level, length=2.0, elements=12, section=section, modes=modes, level=level)
        scene = builder.weld(f"w {level}", "hub", level).scene()
        found = equivalence(appendage_of(scene, level)).verdicts
        assert [verdict.better for verdict in found[-2:]] == last
        assert any("second order" in verdict.reason for verdict in found) == (level == "full")
