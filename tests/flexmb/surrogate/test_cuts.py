"""Beams of level exact are cut where their strains jump, by themselves; and it is said where they are not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.testing import assert_allclose

import flexmb as fm
from flexmb.advisor.modes import with_strains
from flexmb.modal.exact import exact_model
from flexmb.scene.files import dumps, loads
from flexmb.scene.pieces import across, edges
from flexmb.surrogate import cut_where_loaded, substructured
from flexmb.system.watches import WAIVERS

SECTION = fm.BeamStation(
    x_m=0.0, EA_N=1e6, EIy_Nm2=1.0, EIz_Nm2=1.0, GJ_Nm2=0.8, mass_per_length_kg_m=1.0, rotary_y_kg_m=1e-4,
    rotary_z_kg_m=1e-4,
)  # fmt: skip
PLANE = ("bending_y",)
PORT = 0.37
UPRIGHT = (float(np.sqrt(0.5)), 0.0, 0.0, float(np.sqrt(0.5)))


def stem(modes: fm.Modes, **more: Any) -> fm.SceneBuilder:
    """A clamped beam of 1 m with a node inside; its builder."""
    builder = fm.SceneBuilder("T", allow=("wave_speed", "thick_section", *WAIVERS))
    nodes = [fm.BeamNode(name="port", x_m=PORT), fm.BeamNode(name="free", x_m=0.8)]
    section = more.pop("section", SECTION)
    builder.beam("stem", length=1.0, elements=8, section=section, modes=modes, level="exact", nodes=nodes, **more)
    return builder.weld("clamp", "ground", "stem").marker("tip", "stem", node="tip").marker("at", "stem", node="free")


def frame(count: int, **modes: Any) -> fm.Scene:
    """A T-frame: a branch of 0.5 m across the stem at the port, with a force at its end."""
    own = fm.Modes(count=count, families=PLANE)
    return (
        stem(replace(own, **modes))
        .beam("branch", length=0.5, elements=8, section=SECTION, modes=own, level="exact")
        .weld("fork", "stem", "branch", parent_node="port", parent_quaternion=UPRIGHT)
        .force("pull", "branch", node="tip", direction=(1, 0, 0), function=fm.Constant(value=8.0))
        .marker("end", "branch", node="tip")
        .scene()
    )


def stem_of(scene: fm.Scene) -> fm.BeamBody:
    body = scene.bodies[0]
    assert isinstance(body, fm.BeamBody)
    return body


def with_modes(scene: fm.Scene, **modes: Any) -> fm.Scene:
    """The scene with other modes of its stem."""
    own = stem_of(scene)
    return replace(scene, bodies=(replace(own, modes=replace(own.modes, **modes)), *scene.bodies[1:]))


def at_rest(scene: fm.Scene) -> np.ndarray:
    """Markers (3,3) at the equilibrium."""
    system = fm.compile(scene)
    found = fm.equilibrium(system)
    markers = system.evaluate(0.0, found.q, found.u).markers
    return np.array([markers[name].position for name in ("tip", "at", "end") if name in markers])


def test_a_frame_cut_at_its_port_converges_as_fast_as_a_smooth_beam() -> None:
    """It is by default. Left whole, four polynomials leave 2.9e-2 L and ten 1.0e-2 L, and the scene says so."""
    truth = at_rest(substructured(frame(9), "stem", ["port"]))
    with pytest.warns(fm.SceneWarning, match=r'strains jump at x = 0.37 m \(hinge "fork" at node "port"\)'):
        whole = at_rest(frame(4, cuts=()))
    assert np.max(np.abs(whole - truth)) > 1e-2
    for count, error in ((4, 1e-6), (6, 1e-8)):
        one = at_rest(frame(count))
        assert_allclose(one, truth, atol=error)
        assert_allclose(at_rest(frame(count, cuts=("port",))), one, atol=1e-12)
        assert_allclose(at_rest(substructured(frame(count), "stem", [PORT])), one, atol=1e-9)
        assert_allclose(at_rest(with_strains(frame(count), "stem", count, 1, False, ())), one, atol=1e-9)


def test_a_cut_where_nothing_happens_changes_nothing() -> None:
    """The strains of two pieces contain those of one: frequencies of the straight beam, and its motion."""
    modes = fm.Modes(count=8, families=PLANE)
    whole, cut = (fm.linearize(stem(each).scene()).modes for each in (modes, replace(modes, cuts=("free", "port"))))
    for a, b in zip(whole[:3], cut[:3], strict=True):
        assert b.frequency_hz == pytest.approx(a.frequency_hz, rel=1e-5)


def test_pieces_lie_between_the_cuts() -> None:
    body = stem(fm.Modes(count=1, families=PLANE, cuts=("free", "port"), pieces=2)).scene().bodies[0]
    assert isinstance(body, fm.BeamBody)
    assert_allclose(edges(body), [0.0, PORT / 2, PORT, (PORT + 0.8) / 2, 0.8, 0.9, 1.0])
    equal = replace(body, modes=fm.Modes(count=1, pieces=3))
    assert np.array_equal(edges(equal), np.linspace(0.0, 1.0, 4))


LUMP = fm.TipMass(x_m=0.6, mass_kg=0.1)
STEPPED = [SECTION, replace(SECTION, x_m=0.25), replace(SECTION, x_m=0.25, EIy_Nm2=3.0), replace(SECTION, x_m=1.0)]
PORTS = {
    "hinge": lambda b: b.rigid_body("r", mass=1.0, inertia=(1, 1, 1)).revolute("h", "stem", "r", parent_node="port"),
    "load": lambda b: b.force("f", "stem", node="port", direction=(0, 1, 0), function=fm.Constant(value=1.0)),
    "wheel": lambda b: b.wheel(
        "w", "stem", node="port", axis=(0, 0, 1), mass=0.1, axial_inertia=1e-3, transverse_inertia=1e-3
    ),
    "connector": lambda b: b.spring_damper("s", "ground", "stem", node_b="port", position_a=(0, 1, 0), stiffness=1.0),
    "closure": lambda b: b.closure("c", "spherical", "stem", "ground", node_a="port", position_b=(PORT, 0, 0)),
    "point mass": lambda b: b.point_mass("p", "stem", mass=0.1, node="port"),
}  # fmt: skip


@pytest.mark.parametrize("kind", PORTS)
def test_whatever_is_joined_to_a_node_inside_is_found_and_cut(kind: str) -> None:
    builder = stem(fm.Modes(count=2, families=PLANE))
    assert across(builder.scene(), builder.scene().bodies[0]) == {} and stem_of(builder.scene()).modes.cuts is None
    scene = PORTS[kind](builder).scene()
    assert stem_of(scene).modes.cuts == ("port",)
    assert across(scene, scene.bodies[0]) == {} and cut_where_loaded(scene) is scene
    whole = with_modes(scene, cuts=())
    assert list(across(whole, whole.bodies[0])) == [PORT]
    assert cut_where_loaded(whole) == scene


def test_a_scene_chooses_anew_where_it_is_changed() -> None:
    """Nothing of it stays where nothing is joined any more, or the level is another; what is asked for does."""
    scene = frame(2)
    assert stem_of(scene).modes.cuts == ("port",) and stem_of(loads(dumps(scene))).modes.cuts == ("port",)
    assert "cuts" not in dumps(scene) and "cuts = []" in dumps(frame(2, cuts=()))
    alone = replace(scene, hinges=scene.hinges[:1], bodies=scene.bodies[:1], loads=(), markers=scene.markers[:2])
    assert stem_of(alone).modes.cuts is None
    assert stem_of(scene.with_values({"stem.level": "full"})).modes.cuts is None
    assert stem_of(frame(2, pieces=2)).modes.cuts is None and stem_of(frame(2, cuts=("free",))).modes.cuts == ("free",)


def test_many_places_are_told_and_not_cut() -> None:
    """A beam of twelve pieces would cost a hundred times one of a single piece."""
    lumps = [fm.TipMass(x_m=i / 12.0, mass_kg=0.1) for i in range(1, 12)]
    few, many = (stem(fm.Modes(count=2, families=PLANE), tip_masses=each).scene() for each in (lumps[:7], lumps))
    assert len(edges(few.bodies[0])) == 9 and len(edges(many.bodies[0])) == 2
    assert [str(each.waiver) for each in (*fm.check_scene(few), *fm.check_scene(many))] == ["uncut_beam"]


def test_lumps_and_steps_of_the_section_are_found_and_get_nodes() -> None:
    by_itself = stem_of(stem(fm.Modes(count=2, families=PLANE), section=STEPPED, tip_masses=[LUMP]).scene())
    assert_allclose(edges(by_itself), [0.0, 0.25, 0.6, 1.0])
    scene = stem(fm.Modes(count=2, families=PLANE, cuts=()), section=STEPPED, tip_masses=[LUMP]).scene()
    doubts = [each for each in fm.check_scene(scene) if each.waiver == "uncut_beam"]
    assert len(doubts) == 1 and "x = 0.25 m (a step of the section) and 1 more" in str(doubts[0])
    cut = cut_where_loaded(scene).bodies[0]
    assert isinstance(cut, fm.BeamBody)
    assert cut.modes.cuts == ("cut_1", "cut_2") and [node.x_m for node in cut.nodes[2:]] == [0.25, 0.6]


@pytest.mark.parametrize(("stiffness", "is_told", "left"), [(1.5, False, 1.5e-4), (3.0, True, 1.4e-3)])
def test_sharp_kinks_of_the_stiffness_are_told(stiffness: float, is_told: bool, left: float) -> None:
    """Of a root as stiff as that, tapered to the middle: what 4 polynomials leave across it."""
    section = [replace(SECTION, EIz_Nm2=stiffness), replace(SECTION, x_m=0.5), replace(SECTION, x_m=1.0)]
    builder = stem(fm.Modes(count=4, families=PLANE), section=section)
    scene = builder.force("f", "stem", node="tip", direction=(0, 1, 0), function=fm.Constant(value=5.0)).scene()
    doubts = [str(each) for each in fm.check_scene(scene)]
    assert bool(doubts) == is_told and all("x = 0.5 m (a kink of the stiffness)" in doubt for doubt in doubts)
    assert stem_of(cut_where_loaded(scene)).modes.cuts == (("cut_1",) if is_told else None)
    quiet = replace(scene, allow=(*scene.allow, "uncut_beam"))
    fine = substructured(quiet, "stem", [0.5], polynomials=8)
    assert np.max(np.abs(at_rest(quiet) - at_rest(fine))) == pytest.approx(left, rel=0.3)


@pytest.mark.parametrize("path", ["stem.nodes.0.x_m", "stem.tip_masses.0.x_m"])
def test_where_a_beam_is_cut_by_itself_modes_have_derivatives_by_the_place(path: str) -> None:
    """The cut moves with what is there: differences over twice the step are off by four times as much."""
    scene = PORTS["load"](stem(fm.Modes(count=2, families=PLANE), tip_masses=[LUMP])).scene()
    x, like = {"stem.nodes.0.x_m": PORT, "stem.tip_masses.0.x_m": LUMP.x_m}[path], stem_of(scene)

    def stiffness(shift: float) -> np.ndarray:
        return exact_model(stem_of(scene.with_values({path: x + shift})), like).stiffness

    coarse, middle, fine = ((stiffness(h) - stiffness(-h)) / (2.0 * h) for h in (4e-4, 2e-4, 1e-4))
    assert np.max(np.abs(coarse)) > 100.0
    assert_allclose(coarse - middle, 4.0 * (middle - fine), atol=1e-3 * np.max(np.abs(coarse - middle)))


def test_numbers_of_coordinates_that_were_for_a_whole_beam_are_refused_with_the_remedy() -> None:
    scene = PORTS["load"](stem(fm.Modes(count=2, families=PLANE))).scene()
    bent = replace(scene, modal_states=(fm.ModalState(body="stem", coordinates=(0.1, 0.0)),))
    for wrong in (bent, with_modes(scene, damping_ratio=(0.1, 0.2))):
        with pytest.raises(fm.SceneError, match=r"cuts = \[\] leaves the beam in one piece"):
            fm.check_scene(wrong)
        fm.check_scene(with_modes(wrong, cuts=()))


@pytest.mark.parametrize(("cuts", "words"), [
    (("prot",), 'no node "prot"'), (("port", "port"), "already cut"), (("tip",), 'no node "tip"'),
])  # fmt: skip
def test_what_cannot_be_cut_is_refused(cuts: tuple[str, ...], words: str) -> None:
    with pytest.raises(fm.SceneError, match=words):
        fm.check_scene(stem(fm.Modes(count=2, families=PLANE, cuts=cuts)).scene())


def test_refusals() -> None:
    scene = frame(2, cuts=())
    with pytest.raises(ValueError, match="cannot be cut at x = 1 m: give places inside"):
        substructured(scene, "stem", ["port", 1.0])
    with pytest.raises(ValueError, match='has no node "prot"'):
        substructured(scene, "stem", ["prot"])
    full = replace(scene, bodies=tuple(replace(body, level="full") for body in scene.bodies))
    with pytest.raises(ValueError, match='has level "full", which has no pieces'):
        cut_where_loaded(full, "stem")
    bent = replace(scene, modal_states=(fm.ModalState(body="stem", coordinates=(0.1, 0.0)),))
    with pytest.raises(ValueError, match="its modal state is for other strains"):
        cut_where_loaded(bent)
    wrong = replace(full, bodies=(replace(full.bodies[0], modes=fm.Modes(count=2, cuts=("port",))), full.bodies[1]))
    with pytest.raises(fm.SceneError, match="cuts is for strains"):
        fm.check_scene(wrong)


@pytest.mark.parametrize(("ratio", "is_told"), [(4.0, False), (10.0, True)])
def test_a_stiffness_that_polynomials_do_not_follow_is_told(ratio: float, is_told: bool) -> None:
    """Of a beam that tapers from its middle to both ends; what is left out is what an equilibrium lacks."""
    section = [replace(SECTION, x_m=x, EIz_Nm2=EI) for x, EI in ((0.0, 1.0), (0.37, ratio), (1.0, 1.0))]

    def tapered(count: int) -> fm.Scene:
        builder = stem(fm.Modes(count=count, families=PLANE), section=section)
        return builder.force("f", "stem", node="tip", direction=(0, 1, 0), function=fm.Constant(value=1e-3)).scene()

    def doubts(count: int) -> list[str]:
        return [str(each) for each in fm.check_scene(replace(tapered(count), allow=("wave_speed", "thick_section")))]

    def lacking(count: int) -> float:
        """Of the closed form P times the integral of (1 - x)^2 / EI."""
        system = fm.compile(tapered(count))
        tip = system.evaluate(0.0, fm.equilibrium(system).q, np.zeros(system.nu)).markers["tip"].position[1]
        x, w = np.polynomial.legendre.leggauss(40)
        parts = [(0.5 * (a + b) + 0.5 * (b - a) * x, 0.5 * (b - a) * w) for a, b in ((0.0, 0.37), (0.37, 1.0))]
        EI = [np.interp(at, [0.0, 0.37, 1.0], [1.0, ratio, 1.0]) for at, _ in parts]
        sinks = sum(float(np.sum(w * (1 - at) ** 2 / K)) for (at, w), K in zip(parts, EI, strict=True))
        return 1.0 - float(tip) / (1e-3 * sinks)

    assert bool(doubts(4)) == is_told == (lacking(4) > 1e-2)
    if is_told:
        assert f"leave out {lacking(4):.2g} of its deflection" in doubts(4)[0] and "count = 9" in doubts(4)[0]
        assert lacking(9) < 2e-3 and not doubts(9)
