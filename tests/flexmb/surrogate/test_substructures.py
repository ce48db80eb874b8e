"""Flexible pieces: everything at its place, the finite elements they are at rest, and what they cannot do without.

Piece by piece the attachment modes span the cubic deflections, linear stretch and linear twist of the simplest beam
element. So a chain at rest is a finite-element model whose errors are known.
"""

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.linalg import eigh

from flexmb.modal import flexible_model
from flexmb.scene.build import SceneBuilder
from flexmb.scene.check import check_scene
from flexmb.scene.functions import Constant
from flexmb.scene.rigid_equivalent import beam_piece, combine
from flexmb.scene.schema import BeamBody, BeamNode, Modes, StrainPolynomials, TipMass, Weld
from flexmb.scene.strains import polynomials
from flexmb.scene.tree import ordered
from flexmb.surrogate import modal_points, substructured
from flexmb.system.compile import compile
from tests.flexmb.surrogate.beams import FIRST_ROOT, LENGTH, LUMP, SECTION, beam_scene, cantilever, rest_positions

ALL = ("axial", "torsion", "bending_y", "bending_z")


@pytest.mark.parametrize("child_node", ["root", "middle", "tip"])
@pytest.mark.parametrize("families", [("bending_y",), ALL])
def test_pieces_make_a_sound_scene_with_every_item_at_its_place(families, child_node):
    whole = beam_scene(families, child_node, "free-free")
    chain = substructured(whole, None, 5)
    check_scene(chain)
    assert len(ordered(chain)) == len(chain.bodies)
    for name, position in rest_positions(whole).items():
        assert rest_positions(chain)[name] == pytest.approx(position, abs=1e-14 * LENGTH)
    system = compile(chain)
    at_rest = system.evaluate(0.0, system.initial_state.q, system.initial_state.u).markers
    for name, position in rest_positions(chain).items():
        assert at_rest[name].position == pytest.approx(position, abs=1e-14 * LENGTH)


def test_names_families_and_orientation_of_the_chain():
    chain = substructured(beam_scene(("bending_y", "axial"), "middle"), "boom", 3)
    pieces = [body for body in chain.bodies if isinstance(body, BeamBody)]
    assert [body.name for body in pieces] == ["boom.p00", "boom.p01", "boom.p02"]
    assert all(body.modes.families == ("bending_y", "axial") for body in pieces)
    assert [flexible_model(body).mode_count for body in pieces] == [3, 3, 3]
    welds = [hinge for hinge in chain.hinges if isinstance(hinge, Weld) and hinge.name != "root"]
    assert [(w.name, w.parent, w.parent_node, w.child, w.child_node) for w in welds] == [
        ("boom.w02", "boom.p01", "tip", "boom.p02", "root"),
        ("boom.w01", "boom.p01", "root", "boom.p00", "tip"),
    ]
    assert [node.name for node in pieces[1].nodes] == ["middle"]
    assert pieces[1].nodes[0].x_m == pytest.approx(0.9 - LENGTH / 3)


def stepped_beam(points="section", lumps=()):
    """A tapered beam with a jump of its sections and a node on a cut of four pieces."""
    thin = replace(SECTION, x_m=0.7, mass_per_length_kg_m=0.2, EIz_Nm2=5.0, rotary_z_kg_m=1e-4)
    stations = [SECTION, replace(SECTION, x_m=0.7), thin, replace(thin, x_m=LENGTH, EA_N=5e4)]
    builder = SceneBuilder("stepped")
    builder.beam("b", length=LENGTH, elements=8, section=stations, points=points, tip_masses=lumps,
                 modes=Modes(count=2), nodes=[BeamNode(name="cut", x_m=LENGTH / 2)])  # fmt: skip
    return builder.weld("w", "ground", "b").scene()


def test_pieces_carry_sections_and_tip_masses_of_their_part_of_the_beam():
    lumps = [TipMass(x_m=x, mass_kg=0.3, com_m=(0.1, 0.0, 0.02), inertia_kg_m2=LUMP) for x in (0.5, 0.9, LENGTH)]
    scene = stepped_beam(lumps=lumps)
    (whole,) = scene.bodies
    chain = substructured(scene, "b", 4)
    assert [len(body.tip_masses) for body in chain.bodies] == [0, 2, 0, 1]
    assert [[node.x_m for node in body.nodes] for body in chain.bodies] == [[], [], [0.0], []]
    assert [s.EIz_Nm2 for s in chain.bodies[1].stations] == [12.0, 12.0, 5.0, 5.0]
    assert [s.x_m for s in chain.bodies[1].stations] == pytest.approx([0.0, 0.2, 0.2, 0.5])
    ends = [body.stations[-1].EA_N for body in chain.bodies]
    assert ends == pytest.approx(np.interp([0.5, 1.0, 1.5, 2.0], [0.7, 2.0], [1e5, 5e4]))
    parts = [beam_piece(body, 0.0, body.length_m) for body in chain.bodies]
    moved = [type(p)(p.mass, p.com + [0.5 * i, 0.0, 0.0], p.inertia) for i, p in enumerate(parts)]
    for key in ("mass", "com", "inertia"):
        expected = getattr(beam_piece(whole, 0.0, LENGTH), key)
        assert getattr(combine(moved), key) == pytest.approx(expected, rel=1e-13, abs=1e-15)


def test_a_cut_in_a_jump_has_on_each_side_its_own_section():
    scene = stepped_beam()
    (beam,) = scene.bodies
    jump = tuple(replace(s, x_m=1.0) if s.x_m == 0.7 else s for s in beam.stations)
    first, second = substructured(replace(scene, bodies=(replace(beam, stations=jump),)), "b", 2).bodies
    assert [s.EIz_Nm2 for s in first.stations] == [12.0, 12.0]
    assert [s.EIz_Nm2 for s in second.stations] == [5.0, 5.0]


def linear_model(chain):
    """M and K of a clamped chain at rest, from the compiled dynamics and from the pieces' stiffness."""
    system = compile(chain)
    M = system.mass_matrix(system.initial_state)
    K = np.zeros_like(M)
    for body in chain.bodies:
        own = system.speed(f"{body.name}.modes")
        K[own, own] = flexible_model(body).stiffness
    return system, M, K


def clamped(n, families=("bending_y",), **options):
    return substructured(cantilever(families, "line").marker("tip", "b", node="tip").scene(), "b", n, **options)


def cubic_elements(n):
    """Frequencies (rad/s) of the clamped beam by n elements of cubic deflection, without rotary inertia."""
    l, m, EI = LENGTH / n, SECTION.mass_per_length_kg_m, SECTION.EIz_Nm2
    mass = m * l / 420 * np.array([
        [156, 22 * l, 54, -13 * l], [22 * l, 4 * l * l, 13 * l, -3 * l * l],
        [54, 13 * l, 156, -22 * l], [-13 * l, -3 * l * l, -22 * l, 4 * l * l],
    ])  # fmt: skip
    stiffness = EI / l**3 * np.array([
        [12, 6 * l, -12, 6 * l], [6 * l, 4 * l * l, -6 * l, 2 * l * l],
        [-12, -6 * l, 12, -6 * l], [6 * l, 2 * l * l, -6 * l, 4 * l * l],
    ])  # fmt: skip
    M, K = np.zeros((2 * n + 2, 2 * n + 2)), np.zeros((2 * n + 2, 2 * n + 2))
    for i in range(n):
        own = slice(2 * i, 2 * i + 4)
        M[own, own] += mass
        K[own, own] += stiffness
    return np.sqrt(eigh(K[2:, 2:], M[2:, 2:], eigvals_only=True))


@pytest.mark.parametrize("n", [1, 2, 5])
def test_a_chain_at_rest_is_a_model_of_cubic_beam_elements(n):
    _, M, K = linear_model(clamped(n))
    assert np.sqrt(eigh(K, M, eigvals_only=True)) == pytest.approx(cubic_elements(n), rel=1e-9)


def test_eigenmodes_besides_bring_frequencies_closer():
    exact = FIRST_ROOT**2 * np.sqrt(SECTION.EIz_Nm2 / (SECTION.mass_per_length_kg_m * LENGTH**4))
    _, M, K = linear_model(clamped(2, eigenmodes=2))
    error = np.sqrt(eigh(K, M, eigvals_only=True)[0]) / exact - 1.0
    assert 0.0 < error < 0.01 * (cubic_elements(2)[0] / exact - 1.0)


@pytest.mark.parametrize("n", [1, 3])
def test_end_loads_deflect_the_chain_as_a_beam(n):
    """Forces and moments at the tip, small: exact in every family of motion, from one piece on."""
    P = 1e-7
    expected = {
        "fx": (1, P * LENGTH / SECTION.EA_N), "fy": (1, P * LENGTH**3 / (3 * SECTION.EIz_Nm2)),
        "fz": (1, P * LENGTH**3 / (3 * SECTION.EIy_Nm2)), "tx": (0, P * LENGTH / SECTION.GJ_Nm2),
        "ty": (0, P * LENGTH / SECTION.EIy_Nm2), "tz": (0, P * LENGTH / SECTION.EIz_Nm2),
    }  # fmt: skip
    for name, (place, answer) in expected.items():
        assert small_answer(n, name, P)[place]["xyz".index(name[1])] == pytest.approx(answer, rel=1e-9)


def small_answer(n, name, P, change=lambda chain: chain, points="rotary"):
    """Turn and displacement (3,) of the tip under a small tip load `name`: "fy" along y, "tz" about z."""
    builder = cantilever(ALL, points).marker("tip", "b", node="tip")
    load = builder.force if name[0] == "f" else builder.torque
    load("load", "b", node="tip", direction=np.eye(3)["xyz".index(name[1])], function=Constant(value=P))
    system, M, K = linear_model(change(substructured(builder.scene(), "b", n)))
    rest = system.initial_state
    q = np.linalg.solve(K, M @ system.accelerations(rest))
    tip = system.evaluate(0.0, q, rest.u).markers["tip"]
    turn = tip.rotation
    return np.array([turn[2, 1], turn[0, 2], turn[1, 0]]), tip.position - [LENGTH, 0.0, 0.0]


def test_without_attachment_modes_pieces_stay_too_stiff():
    """Of the constant curvature of a short piece its first eigenmode phi follows phi'(l)^2 / (omega^2 m l^2 / EI).

    The chain's compliance tends to that share of the beam's, with an error of the order of the piece's length.
    """

    def bare(chain):
        modes = Modes(count=1, families=("bending_y",))
        return replace(chain, bodies=tuple(replace(body, modes=modes) for body in chain.bodies))

    z = FIRST_ROOT
    sigma = (np.cosh(z) + np.cos(z)) / (np.sinh(z) + np.sin(z))
    slope = z * (np.sinh(z) + np.sin(z) - sigma * (np.cosh(z) - np.cos(z)))
    exact = 1e-7 * LENGTH**3 / (3 * SECTION.EIz_Nm2)
    coarse, fine = (small_answer(n, "fy", 1e-7, bare, "line")[1][1] / exact for n in (8, 16))
    assert fine == pytest.approx(0.64, abs=0.01)
    assert 2 * fine - coarse == pytest.approx(slope**2 / z**4, abs=1 / 16**2)


@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
@pytest.mark.parametrize("mass", ["consistent", "lumped"])
def test_every_kind_of_beam_can_be_split(theory, mass):
    section = replace(SECTION, GAy_N=2e4, GAz_N=2e4)
    whole = beam_scene(ALL, section=section, theory=theory, mass=mass)
    chain = substructured(whole, "boom", 3, eigenmodes=1)
    check_scene(chain)
    assert {flexible_model(body).mode_count for body in chain.bodies[:3]} == {7}


def test_damping_is_that_of_the_first_mode():
    whole = beam_scene(damping=0.01)
    model = flexible_model(beam_scene().bodies[0])
    for body in substructured(whole, "boom", 2, eigenmodes=1).bodies[:2]:
        piece = flexible_model(body)
        assert piece.damping == pytest.approx(2 * 0.01 / np.sqrt(model.stiffness[0, 0]) * piece.stiffness, rel=1e-12)


def test_level_of_the_pieces():
    whole = beam_scene(level="linear")
    assert {body.level for body in substructured(whole, "boom", 2).bodies[:2]} == {"linear"}
    assert {body.level for body in substructured(whole, "boom", 2, level="full").bodies[:2]} == {"full"}


def test_refusals():
    with pytest.raises(ValueError, match='"panel" is not a beam .kind "rigid"'):
        substructured(beam_scene(), "panel", 4)
    with pytest.raises(ValueError, match="at least one piece, got 0"):
        substructured(beam_scene(), "boom", 0)
    with pytest.raises(ValueError, match="number of eigenmodes of a piece is"):
        substructured(beam_scene(), "boom", 2, eigenmodes=-1)
    with pytest.raises(ValueError, match='"boom" is rigid.*"full"'):
        substructured(beam_scene(level="rigid"), "boom", 2)
    bent = cantilever(("bending_y",), "line").modal_state("b", coordinates=[0.1]).scene()
    with pytest.raises(ValueError, match="undeformed"):
        substructured(bent, "b", 2)
    twisted = substructured(beam_scene(ALL, points="line"), "boom", 2)  # as the beam itself
    assert flexible_model(twisted.bodies[0]).mode_count == 6


def test_polynomials_of_pieces_are_of_the_strains_that_the_beam_has():
    own = StrainPolynomials(axial=3, bending_y=4)
    modes = Modes(count=0, polynomials=own)
    scene = SceneBuilder("strains").beam("b", length=LENGTH, elements=8, section=SECTION, level="exact", modes=modes)
    scene = scene.weld("w", "ground", "b").scene()
    pieces = substructured(scene, "b", 2, polynomials=4).bodies
    assert [polynomials(body) for body in pieces] == [{"axial": 2, "bending_y": 4}] * 2


def test_a_modal_body_cannot_be_split():
    with pytest.raises(ValueError, match='"b" is not a beam .kind "modal".: only beams, given by their sections'):
        substructured(modal_points(cantilever(("bending_y",), "line").scene()), "b", 2)
