"""Surrogates: the segment chain converges to the beam, keeps its mass and its nodes, and is a sound scene."""

import numpy as np
import pytest
from msgspec.structs import replace

from crosscheck.engines.contract import EngineMissing
from crosscheck.engines.registry import engines
from flexmb.modal import flexible_model
from flexmb.scene.build import SceneBuilder
from flexmb.scene.check import check_scene
from flexmb.scene.functions import Constant
from flexmb.scene.rigid_equivalent import beam_piece, combine, inertia_of, rigid_equivalent
from flexmb.scene.schema import (
    BeamBody,
    Closure,
    Gimbal,
    Modes,
    Prismatic,
    Revolute,
    StrainPolynomials,
    TipMass,
)
from flexmb.scene.sections import restated
from flexmb.scene.tree import ordered
from flexmb.surrogate import finite_segments, modal_points, rigidify
from tests.flexmb.surrogate.beams import FIRST_ROOT, LENGTH, LUMP, SECTION, beam_scene, cantilever, rest_positions


@pytest.mark.parametrize("child_node", ["root", "middle", "tip"])
@pytest.mark.parametrize("families", [("bending_y",), ("bending_y", "bending_z", "torsion", "axial")])
def test_segments_make_a_sound_scene_with_every_item_at_its_place(families, child_node):
    whole = beam_scene(families, child_node, "free-free")
    chain = finite_segments(whole, None, 5)
    check_scene(chain)
    assert len(ordered(chain)) == len(chain.bodies)
    for name, position in rest_positions(whole).items():
        assert rest_positions(chain)[name] == pytest.approx(position, abs=1e-15 * LENGTH * 10)


def test_closures_go_with_their_nodes():
    closure = Closure(name="tie", type="spherical", body_a="boom", node_a="middle", body_b="boom", node_b="tip")
    (moved,) = finite_segments(replace(beam_scene(), closures=(closure,)), "boom", 4).closures
    assert (moved.body_a, moved.node_a, moved.body_b, moved.node_b) == ("boom.seg02", "middle", "boom.seg04", "tip")


def test_names_and_kinds_of_hinges():
    chain = finite_segments(beam_scene(), "boom", 3)
    assert [body.name for body in chain.bodies] == ["boom.seg00", "boom.seg01", "boom.seg02", "boom.seg03", "panel"]
    assert [h.name for h in chain.hinges if isinstance(h, Revolute)] == [
        "boom.h01", "boom.h02", "boom.h03", "panel hinge",
    ]  # fmt: skip
    both = finite_segments(beam_scene(("bending_y", "bending_z", "axial")), "boom", 2)
    assert [(h.name, type(h)) for h in both.hinges if h.name.startswith("boom.")] == [
        ("boom.h01", Gimbal), ("boom.a01", Prismatic), ("boom.h02", Gimbal),
    ]  # fmt: skip


@pytest.mark.parametrize("points", ["line", "section"])
def test_segments_carry_the_inertia_of_the_beam(points):
    lump = TipMass(x_m=LENGTH, mass_kg=0.3, com_m=(0.1, 0.0, 0.02), inertia_kg_m2=LUMP)
    scene = beam_scene(("bending_y", "bending_z", "torsion"), points=points, tip_masses=[lump])
    beam = scene.bodies[0]
    chain = finite_segments(scene, "boom", 4)
    starts = [0.0, 0.25, 0.75, 1.25, 1.75]
    parts = [inertia_of(body) for body in chain.bodies[:-1]]
    total = combine([type(p)(p.mass, p.com + [x, 0, 0], p.inertia) for p, x in zip(parts, starts, strict=True)])
    whole = beam_piece(beam, 0.0, LENGTH)
    for key in ("mass", "com", "inertia"):
        assert getattr(total, key) == pytest.approx(getattr(whole, key), rel=1e-13, abs=1e-16)


@pytest.mark.parametrize("points", ["line", "rotary", "section"])
@pytest.mark.parametrize("mass", ["consistent", "lumped"])
@pytest.mark.parametrize("aside", [(0.0, 0.0), (0.02, -0.03)], ids=["on axis", "aside"])
def test_rigid_equivalent_has_the_inertia_of_the_modal_points(points, mass, aside):
    ends = SECTION, replace(SECTION, x_m=LENGTH, mass_per_length_kg_m=0.3, rotary_y_kg_m=3e-5)
    numbers = {"mass_per_length_kg_m": None, "rotary_y_kg_m": 0.0, "rotary_z_kg_m": 0.0}
    taper = [replace(end, inertia=restated(end, aside).inertia, **numbers) if any(aside) else end for end in ends]
    lump = TipMass(x_m=1.5, mass_kg=0.3, com_m=(0.1, 0.0, 0.02), inertia_kg_m2=LUMP)
    beam = beam_scene(section=taper, points=points, mass=mass, tip_masses=[lump]).bodies[0]
    own, model = inertia_of(rigid_equivalent(beam)), flexible_model(beam)
    points = zip(model.mass, model.position + model.com_offset, model.inertia, strict=True)
    summed = combine([type(own)(*point) for point in points])
    for key in ("mass", "com", "inertia"):
        assert getattr(own, key) == pytest.approx(getattr(summed, key), rel=1e-12, abs=1e-15)


def first_frequency(n):
    """Of the clamped chain, from its segments: small angles, M and K of the hinge angles."""
    chain = finite_segments(cantilever(("bending_y",), "line").scene(), "b", n)
    l = LENGTH / n  # noqa: E741
    hinge_x = (np.arange(n) + 0.5) * l
    M = np.zeros((n, n))
    for piece, body in enumerate(chain.bodies):
        start = 0.0 if piece == 0 else hinge_x[piece - 1]
        turned = np.where(hinge_x <= start + 1e-12, 1.0, 0.0) if piece else np.zeros(n)
        arm = turned * (start + body.com_m[0] - hinge_x)
        M += body.mass_kg * np.outer(arm, arm) + body.inertia_kg_m2[2][2] * np.outer(turned, turned)
    K = np.diag([h.rotation.stiffness_Nm_rad for h in chain.hinges if isinstance(h, Revolute)])
    return np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)).real.min())


def test_first_frequency_converges_with_order_two():
    exact = FIRST_ROOT**2 * np.sqrt(SECTION.EIz_Nm2 / (SECTION.mass_per_length_kg_m * LENGTH**4))
    error = np.array([first_frequency(n) / exact - 1.0 for n in (8, 16, 32)])
    assert np.log2(error[:-1] / error[1:]) == pytest.approx(2.0, abs=0.1)
    assert error == pytest.approx([3.6e-3, 9.0e-4, 2.2e-4], rel=0.05)  # half a rigid segment at the root


def test_static_tip_deflection_in_a_peer():
    """A chain in equilibrium under a tip force stays there: hinge angles from the compliance, checked by an engine."""
    whole = cantilever(("bending_y", "bending_z", "torsion"), "rotary").marker("tip", "b", node="tip")
    whole.force("f", "b", node="tip", direction=(0, 1, 0), function=Constant(value=1e-6))
    chain = finite_segments(whole.scene(), "b", 6)
    l = LENGTH / 6  # noqa: E741
    x = (np.arange(6) + 0.5) * l
    angles = iter(1e-6 * (LENGTH - x) / (SECTION.EIz_Nm2 / l))
    hinges = tuple(
        replace(hinge, rotations=(replace(hinge.rotations[0], angle_rad=next(angles)), *hinge.rotations[1:]))
        if isinstance(hinge, Gimbal)
        else hinge
        for hinge in chain.hinges
    )
    engine = engines()["pinocchio"]
    try:
        snapshot = engine.compile(replace(chain, hinges=hinges)).evaluate()
    except EngineMissing as missing:
        pytest.skip(str(missing))
    deflection = snapshot.markers["tip"].position[1]
    assert deflection == pytest.approx(1e-6 * LENGTH**3 / (3 * SECTION.EIz_Nm2), rel=1 / (4 * 6**2) + 1e-3)
    # Unbalanced acceleration: second order in angles of 1e-7, against 1e-6 N on 1e-2 kg of tip segment.
    assert np.abs(snapshot.markers["tip"].acceleration).max() < 1e-9


def test_damping_is_that_of_the_first_mode():
    chain = finite_segments(beam_scene(damping=0.01), "boom", 4)
    hinge = next(h for h in chain.hinges if h.name == "boom.h01")
    model = flexible_model(beam_scene().bodies[0])
    omega = np.sqrt(model.stiffness[0, 0])
    ratio = hinge.rotation.damping_Nms_rad / hinge.rotation.stiffness_Nm_rad
    assert ratio == pytest.approx(2 * 0.01 / omega, rel=1e-12)


def test_refusals():
    with pytest.raises(ValueError, match='no beam "rod"'):
        finite_segments(beam_scene(), "rod", 4)
    with pytest.raises(ValueError, match='"panel" is not a beam .kind "rigid"'):
        finite_segments(beam_scene(), "panel", 4)
    with pytest.raises(ValueError, match="at least 2"):
        finite_segments(beam_scene(), "boom", 1)
    section = replace(SECTION, GAy_N=1e4, GAz_N=1e4)
    with pytest.raises(ValueError, match="shear"):
        finite_segments(beam_scene(section=section, theory="timoshenko"), "boom", 4)
    bent = SceneBuilder("bent").beam("b", length=1.0, elements=4, section=SECTION, modes=1).weld("w", "ground", "b")
    with pytest.raises(ValueError, match="undeformed"):
        finite_segments(bent.modal_state("b", coordinates=[0.1]).scene(), "b", 4)


def test_modal_points_are_the_beams_own():
    scene = beam_scene(("bending_y", "bending_z"))
    raw = modal_points(scene)
    check_scene(raw)
    ours, theirs = flexible_model(scene.bodies[0]), flexible_model(raw.bodies[0])
    for key in ("mass", "position", "com_offset", "inertia", "translation", "rotation", "stiffness", "damping"):
        assert np.array_equal(getattr(ours, key), getattr(theirs, key)), key
    assert ours.nodes.keys() == theirs.nodes.keys()
    for name, node in ours.nodes.items():
        assert np.array_equal(node.translation, theirs.nodes[name].translation)
        assert np.array_equal(node.rotation_modes, theirs.nodes[name].rotation_modes)


def test_rigidify_keeps_nodes_and_needs_no_modes():
    rigid = rigidify(beam_scene())
    check_scene(rigid)
    assert rest_positions(rigid)["tip"] == pytest.approx([LENGTH, 0.0, 0.0])
    assert rigid.modal_states == ()


def _curved(turn: float) -> BeamBody:
    """A beam of level exact on an arc that turns by so much (rad) to the left."""
    (boom, *_) = beam_scene().bodies
    stations = tuple(replace(station, curvature_1_m=(0.0, 0.0, turn / LENGTH)) for station in boom.stations)
    return replace(boom, level="exact", stations=stations)


@pytest.mark.parametrize(("turn", "rel"), [(0.5, 1e-12), (np.pi, 1e-12), (30.0, 1e-9)])
def test_a_rigid_curved_beam_has_its_mass_along_the_arc(turn, rel):
    """The centroid of an arc, and its polar moment less that of the offset; the sections' own moments are added."""
    whole, radius = beam_piece(_curved(turn), 0.0, LENGTH), LENGTH / turn
    centre = radius * np.array([(1.0 - np.cos(turn)) / turn, 1.0 - np.sin(turn) / turn])
    assert whole.com[:2] == pytest.approx(centre, rel=rel, abs=rel * LENGTH)
    about_root = 2.0 * radius**2 * (1.0 - np.sin(turn) / turn)  # mean square distance from the root
    polar = SECTION.mass_per_length_kg_m * LENGTH * (about_root - centre @ centre) + SECTION.rotary_z_kg_m * LENGTH
    assert whole.inertia[2, 2] == pytest.approx(polar, rel=rel)


def test_what_a_curved_beam_or_one_of_level_exact_cannot_become_is_refused():
    curved = replace(beam_scene(), bodies=(_curved(0.5), beam_scene().bodies[1]))
    with pytest.raises(ValueError, match='beam "boom" is curved: finite segments are for straight ones'):
        finite_segments(curved, None, 4)
    with pytest.raises(ValueError, match='beam "boom" is of level "exact", and its points do not move by modes'):
        modal_points(curved)


def test_segments_of_an_exact_beam_have_the_hinges_of_its_strains():
    (boom, panel) = beam_scene().bodies
    strains = StrainPolynomials(bending_z=2, axial=1)
    exact = replace(boom, level="exact", modes=Modes(count=0, polynomials=strains))
    chain = finite_segments(replace(beam_scene(), bodies=(exact, panel)), "boom", 2)
    assert [(h.name, type(h)) for h in chain.hinges if h.name.startswith("boom.")] == [
        ("boom.h01", Revolute), ("boom.a01", Prismatic), ("boom.h02", Revolute),
    ]  # fmt: skip
    sheared = replace(exact, modes=Modes(count=0, polynomials=StrainPolynomials(bending_z=2, shear_z=1)))
    with pytest.raises(ValueError, match="finite segments have no shear"):
        finite_segments(replace(beam_scene(), bodies=(sheared, panel)), "boom", 2)
