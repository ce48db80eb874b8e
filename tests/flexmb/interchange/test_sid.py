"""SID files: written from bodies, read back, and compared by what bodies do, not by what files contain."""

from __future__ import annotations

import re
from dataclasses import fields, replace

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.dense.dense_system import DenseSystem
from flexmb.interchange.point_masses import NoMasses, equivalent_masses
from flexmb.interchange.sid import Sid, SidError, Taylor, imported_sid, read_sid, sid_of, write_sid
from flexmb.modal.first_order import first_order
from flexmb.modal.flexible import flexible_model
from flexmb.scene.bodies import Modes
from tests.bounds import algebra, backward_error, relative
from tests.flexmb.interchange.made_bodies import at_level, beam, free_beam, swinging

pytestmark = pytest.mark.filterwarnings("ignore:.*leaves out that this pulls it straight")  # fast turns are meant

ROUTES = algebra(speeds=8, depth=2, points=500)
BODIES = {"clamped": (beam(), "root"), "free-free": (free_beam(), "middle")}


def through_a_file(sid: Sid, folder, change=lambda text: text) -> Sid:
    write_sid(sid, folder / "body.sid")
    (folder / "body.sid").write_text(change((folder / "body.sid").read_text()))
    return read_sid(folder / "body.sid")


@pytest.mark.parametrize("kind", BODIES)
def test_every_block_is_read_back_as_it_was_written(kind, tmp_path):
    sid = sid_of(BODIES[kind][0])
    back = through_a_file(sid, tmp_path)
    assert [node.name for node in back.nodes] == [node.name for node in sid.nodes]
    for one, other in [(sid, back), *zip(sid.nodes, back.nodes, strict=True)]:
        for field in fields(one):
            a, b = getattr(one, field.name), getattr(other, field.name)
            if isinstance(a, Taylor):
                assert np.array_equal(a.zero, b.zero), field.name
                assert a.first is b.first is None or np.array_equal(a.first, b.first), field.name


@pytest.mark.parametrize("level", ["ruthless", "linear", "full"])
@pytest.mark.parametrize("kind", BODIES)
def test_a_body_moves_as_before_it_went_through_a_file_by_two_routes(kind, level, tmp_path):
    body, inner = BODIES[kind]
    scene = swinging(at_level(body, level), inner, "tip")
    back = imported_sid(through_a_file(sid_of(body), tmp_path), "rod", level).body
    again = swinging(back, inner, "tip")
    system, same = fm.compile(scene), fm.compile(again)
    state = system.initial_state
    moving, expected = same.accelerations(same.initial_state), system.accelerations(state)
    M, terms = system.mass_matrix(state), np.abs(system.mass_matrix(state)) @ np.abs(expected)
    assert backward_error(M, moving, M @ expected, terms) < ROUTES
    loads, wanted = same.hinge_loads(same.initial_state), system.hinge_loads(state)
    for hinge in wanted:
        assert relative(loads[hinge], wanted[hinge]) < 1e3 * ROUTES  # a share of the largest terms, which cancel
    dense = DenseSystem(again).accelerations(0.0, state.q, state.u)
    assert backward_error(M, dense, M @ expected, terms) < ROUTES


def test_a_scene_names_the_file(tmp_path):
    write_sid(sid_of(beam()), tmp_path / "rod.sid")
    named = swinging(fm.SidBody(name="rod", file=str(tmp_path / "rod.sid")), "root", "tip")
    fm.save_scene(named, tmp_path / "scene.toml")
    assert 'file = "rod.sid"' in (tmp_path / "scene.toml").read_text()
    system, wanted = fm.compile(fm.load_scene(tmp_path / "scene.toml")), fm.compile(swinging(beam(), "root", "tip"))
    M, expected = wanted.mass_matrix(wanted.initial_state), wanted.accelerations(wanted.initial_state)
    found = system.accelerations(system.initial_state)
    assert backward_error(M, found, M @ expected, np.abs(M) @ np.abs(expected)) < ROUTES


def test_a_node_that_the_file_lacks_is_told_when_it_is_compiled(tmp_path):
    write_sid(sid_of(beam()), tmp_path / "rod.sid")
    scene = swinging(fm.SidBody(name="rod", file=str(tmp_path / "rod.sid")), "root", "end")
    with pytest.raises(fm.SceneError, match='"end"'):
        fm.compile(scene)


@pytest.mark.parametrize("load", ["spin", "gravity"])
def test_loads_stiffen_an_imported_body_as_they_did(load, tmp_path):
    """First-order sums of level stiffened: frequencies about a straight beam need no others."""
    body = at_level(beam(tip_masses=()), "stiffened")
    back = imported_sid(through_a_file(sid_of(body), tmp_path), "rod", "stiffened").body
    found = [_loaded_frequencies(each, load) for each in (body, back, msgspec.structs.replace(back, level="full"))]
    assert relative(found[1], found[0]) < 1e-9
    assert relative(found[2], found[0]) > 1e-4  # negative control: without geometric stiffness


def _loaded_frequencies(body: fm.Body, load: str) -> np.ndarray:
    pull = (20.0, 0.0, 0.0) if load == "gravity" else (0.0, 0.0, 0.0)
    builder = fm.SceneBuilder("rotor", gravity=pull).add(body).revolute("shaft", "ground", "rod", axis=(0, 0, 1))
    scene = builder.scene()
    about = (
        fm.steady_spin(scene, "shaft", 20.0).linearize if load == "spin" else lambda: fm.linearize(fm.compile(scene))
    )
    return np.sort(np.abs(np.linalg.eigvals(about().A)))


@pytest.mark.parametrize("points", ["rotary", "line"])
def test_turning_inertia_keeps_the_sums_at_rest_and_what_is_lost_is_said(points, tmp_path):
    body = beam(points=points)
    imported = imported_sid(through_a_file(sid_of(body), tmp_path), "rod")
    before, after = first_order(flexible_model(body)), first_order(flexible_model(imported.body))
    for name in ("mass", "s0", "J0", "E", "C0", "L0", "M0"):
        assert relative(getattr(after, name), getattr(before, name)) < 1e-10, name
    assert "Me has a slope" in imported.notes[0]


def test_blocks_are_the_derivatives_of_inertia_about_the_origin(tmp_path):
    """J, mdCM, Ct, Cr, Gr and Oe against differences of sums over the displaced points: no formula in common."""
    body = beam()
    sid, model, h = sid_of(body), flexible_model(body), 1e-4

    def inertia(q):
        rho = model.position + model.translation @ q
        squares = np.einsum("p,pa,pb->ab", model.mass, rho, rho)
        return np.trace(squares) * np.eye(3) - squares

    for k, q in enumerate(h * np.eye(5)):
        slope = (inertia(q) - inertia(-q)) / (2.0 * h)
        assert relative(sid.J.first[:, k], slope) < 1e-9
        Gr = sid.Gr.zero[:, 3 * k : 3 * k + 3]
        assert relative(Gr + Gr.T, 2.0 * slope) < 1e-9  # torque of a growing inertia, w' J' w
        w = np.array([1.0, -2.0, 0.5])
        products = np.array([1.0, 4.0, 0.25, -2.0, -1.0, 0.5])
        assert abs(sid.Oe.zero[k] @ products + 0.5 * w @ slope @ w) < 1e-9 * abs(w @ slope @ w) + 1e-12
        for n in range(5):
            rho = model.position + model.translation @ q
            torque = np.einsum("p,pa->a", model.mass, np.cross(rho, model.translation[:, :, n]))
            assert np.allclose(torque, sid.Cr.zero[n] + h * sid.Cr.first[n, k], rtol=0.0, atol=1e-12)


def test_files_of_other_writers_are_read(tmp_path):
    """D exponents, capitals, comments, blank lines, another order of blocks, one half of a symmetric matrix."""
    sid = sid_of(beam())

    def other_hand(text: str) -> str:
        text = re.sub(r"(= -?[\d.]+)e([+-]\d+)", r"\1D\2", text)
        text = text.replace("    mdCM\n", "\n% centre of mass\n    MDCM   ! a comment\n\n").replace(
            "m0(1,1)", "M0(  1,   1)"
        )
        head, ke, tail = re.split(r"(    Ke\n.*    end Ke\n)", text, flags=re.DOTALL)
        return head.replace("    frame\n", ke + "    frame\n") + tail

    assert imported_sid(through_a_file(sid, tmp_path, other_hand), "rod").body == imported_sid(sid, "rod").body
    assert "D-" in (tmp_path / "body.sid").read_text()

    def half(text: str) -> str:
        start, end = text.index("    J\n"), text.index("    end J\n")
        block = text[start:end].replace("structure = 3", "structure = 2")
        return text[:start] + re.sub(r" *m0\((2,1|3,1|3,2)\) = .*\n", "", block) + text[end:]

    assert np.array_equal(through_a_file(sid, tmp_path, half).J.zero, sid.J.zero)


def test_both_orders_of_products_in_oe_are_understood():
    """xy, yz, zx as in the standard, and xy, xz, yz: Gr says which one it is."""
    sid = sid_of(beam())
    swapped = (0, 1, 2, 3, 5, 4)
    other = replace(sid, Oe=Taylor(sid.Oe.zero[:, swapped], sid.Oe.first[:, :, swapped]))
    assert imported_sid(other, "rod").body == imported_sid(sid, "rod").body


def test_without_slopes_of_gr_those_of_oe_and_ge_serve():
    sid = sid_of(beam())
    less = imported_sid(replace(sid, Gr=Taylor(sid.Gr.zero)), "rod")
    before, after = (first_order(flexible_model(each.body)) for each in (imported_sid(sid, "rod"), less))
    for field in fields(before):
        assert relative(getattr(after, field.name), getattr(before, field.name)) < 1e-10, field.name
    assert less.notes == ()


def test_a_slender_body_whose_gr_has_no_slope_keeps_its_geometric_stiffness():
    bending = Modes(count=4, families=("bending_y", "bending_z"))
    sid = sid_of(at_level(beam(tip_masses=(), points="line", modes=bending), "stiffened"))
    less = imported_sid(replace(sid, Gr=Taylor(sid.Gr.zero)), "rod", "stiffened")
    assert "longest axis" in less.notes[0]
    whole = imported_sid(sid, "rod", "stiffened")
    assert relative(*(_loaded_frequencies(each.body, "spin") for each in (less, whole))) < 1e-9


def test_order_0_is_a_ruthless_body():
    sid = sid_of(beam())
    rest = {f.name: Taylor(getattr(sid, f.name).zero) for f in fields(sid) if isinstance(getattr(sid, f.name), Taylor)}
    imported = imported_sid(replace(sid, **rest), "rod")
    assert imported.body.level == "ruthless"
    before, after = first_order(flexible_model(beam())), first_order(flexible_model(imported.body))
    for name in ("mass", "s0", "J0", "E", "C0", "L0", "M0"):
        assert relative(getattr(after, name), getattr(before, name)) < 1e-10, name
    with pytest.raises(SidError, match='level "full" needs'):
        imported_sid(replace(sid, **rest), "rod", "full")


def negated(block: str):
    return lambda sid: replace(sid, **{block: Taylor(-getattr(sid, block).zero, getattr(sid, block).first)})


def doubled(sid):
    """Two modes that are one: the least eigenvalue is rounding, above zero or below."""
    places = [0, 0, *range(2, len(sid.Me.zero))]
    return replace(sid, Me=Taylor(sid.Me.zero[np.ix_(places, places)]))


IMPOSSIBLE = {
    "masses": (negated("Me"), "Me is not positive definite"),
    "one mode twice": (doubled, "Me is not positive definite"),
    "inertia": (negated("J"), "no distribution of mass"),
    "stress": (lambda sid: replace(sid, ksigma=Taylor(np.ones((5, 1)))), "ksigma has an M0"),
    "stiffness": (lambda sid: replace(sid, Ke=Taylor(sid.Ke.zero, np.ones((5, 5, 5)))), "Ke has an M1"),
}


@pytest.mark.parametrize("fault", IMPOSSIBLE)
def test_what_no_body_can_have_is_refused_with_its_file(fault, tmp_path):
    change, words = IMPOSSIBLE[fault]
    write_sid(change(sid_of(beam())), tmp_path / "body.sid")
    with pytest.raises(SidError, match=rf"body\.sid: .*{words}"):
        imported_sid(read_sid(tmp_path / "body.sid"), "rod")


def test_sums_whose_ratios_overflow_belong_to_no_masses():
    """Neither an eigenvalue that is not a number nor LAPACK's message."""
    gram = np.diag([1.0, 1e-200, 1e-200, 1e-200])
    gram[0, 2] = 1e150
    gram[1, 2] = 1e150
    with pytest.raises(NoMasses) as refused:
        equivalent_masses(gram)
    assert refused.value.field in (1, 2)


BROKEN = {
    "cut": (lambda text: text[: len(text) // 2], "ends before|is not a finite number|is not a statement"),
    "a word for a number": (lambda text: text.replace("m0(1,1) = ", "m0(1,1) = one", 1), r"line 47: .* finite number"),
    "infinite": (lambda text: re.sub(r"mass = .*", "mass = 1e999", text), "line 5: .*finite"),
    "its square infinite": (lambda text: re.sub(r"mass = .*", "mass = -1e151", text), "line 5: .*finite"),
    "an element outside": (lambda text: text.replace("m0(1,1)", "m0(9,1)", 1), r"\(9, 1\) is not an element of"),
    "a missing block": (lambda text: re.sub(r"    Me\n.*    end Me\n", "", text, flags=re.DOTALL), "no block Me"),
    "an unknown block": (lambda text: text.replace("    Me\n", "    Mx\n"), '"Mx" is not a block'),
    "a block twice": (
        lambda text: text.replace("    Ke\n", "    De\n").replace("end Ke", "end De"),
        "De is repeated",
    ),
    "a wrong size": (lambda text: text.replace("nrow = 6", "nrow = 7"), "sigma is 7 x 1 .* 6 x 1"),
    "modes beyond memory": (lambda text: text.replace("nelastq = 5", "nelastq = 99999999"), "nelastq"),
    "no SID": (lambda text: "hello", "no block refmod"),
    "empty": (lambda text: "", "no block refmod"),
    "no mass": (lambda text: re.sub(r"mass = .*", "mass = 0", text), "no mass above zero"),
}


@pytest.mark.parametrize("fault", BROKEN)
def test_broken_files_are_refused_with_line_and_remedy(fault, tmp_path):
    change, words = BROKEN[fault]
    with pytest.raises(SidError, match=words) as error:
        through_a_file(sid_of(beam()), tmp_path, change)
    assert "body.sid, line" in str(error.value)


def test_a_file_that_mixes_twist_with_geometric_stiffness_is_refused_with_the_way_out():
    sid = sid_of(at_level(beam(tip_masses=()), "stiffened"))
    with pytest.raises(SidError, match="write the file with M1 of Gr"):
        imported_sid(replace(sid, Gr=Taylor(sid.Gr.zero)), "rod", "stiffened")
