"""URDF files: the scene's accelerations against Pinocchio's on the same text, and what is refused."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
import pytest

import flexmb as fm
from flexmb.interchange.imported import ModelError
from flexmb.interchange.urdf import read_urdf
from flexmb.scene.quaternions import rotation_matrix
from tests.bounds import algebra, backward_error
from tests.flexmb.interchange.made_robots import arm, joint, link, quadruped

GRAVITY = (0.4, -0.3, -9.81)


def read(text: str, folder, **options):
    (folder / "robot.urdf").write_text(text)
    return read_urdf(folder / "robot.urdf", **options)


def planar() -> str:
    """Pinocchio's plane is x-y whatever the axis, so that it is given as both understand it."""
    return (
        f'<robot name="sledge"><link name="world"/>{link("body", 1)}{link("rod", 2)}'
        + joint("slide", "planar", "world", "body", 1, '<axis xyz="0 0 1"/>')
        + joint("pin", "continuous", "body", "rod", 2)
        + "</robot>"
    )


@pytest.mark.parametrize("robot", ["arm", "quadruped", "planar"])
def test_accelerations_are_those_of_pinocchio(robot, tmp_path):
    pin = pytest.importorskip("pinocchio")
    text = {"arm": arm, "quadruped": quadruped, "planar": planar}[robot]()
    free = robot == "quadruped"
    scene = read(text, tmp_path, gravity=GRAVITY, free_base=free).scene
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer()) if free else pin.buildModelFromXML(text)
    model.gravity.linear = np.array(GRAVITY)
    data, system = model.createData(), fm.compile(scene)
    rng = np.random.default_rng(3)
    for _ in range(3):
        ours, theirs = _same_motion(system, model, rng)
        expected = pin.aba(model, data, theirs.q, theirs.v, np.zeros(model.nv))
        M = pin.crba(model, data, theirs.q)
        M = np.triu(M) + np.triu(M, 1).T
        found = theirs.turn @ system.accelerations(system.state(*ours, 0.0))[theirs.order] + theirs.swept
        terms = np.abs(M) @ np.abs(expected) + np.abs(pin.nle(model, data, theirs.q, theirs.v))
        assert backward_error(M, found, M @ expected, terms) < algebra(system.nu, 9)


MIMICS = {"axis4": ("axis2", -1.3, 0.2), "axis6": ("axis4", 0.7, 0.0), "axis3": ("axis5", 0.05, -0.1)}


def mimicking() -> str:
    """The arm with joints that mimic others, one of them a joint that mimics, one a slide that mimics an angle."""
    text = arm()
    for name, (other, multiplier, offset) in MIMICS.items():
        start = text.index(f'<joint name="{name}"')
        end = text.index("</joint>", start)
        given = f'multiplier="{multiplier}"' + (f' offset="{offset}"' if offset else "")
        text = f'{text[:end]}<mimic joint="{other}" {given}/>{text[end:]}'
    return text


def test_mimic_joints_move_as_the_equations_of_pinocchio_reduced_by_their_relations(tmp_path):
    """q = T r + c: T'M T r'' = -T'(M T' r' + nle) with the mass matrix and the bias of the free tree."""
    pin = pytest.importorskip("pinocchio")
    text = mimicking()
    system = fm.compile(read(text, tmp_path, gravity=GRAVITY).scene)
    model = pin.buildModelFromXML(text)
    model.gravity.linear = np.array(GRAVITY)
    data, names = model.createData(), list(model.names)[1:]
    rng = np.random.default_rng(3)
    free = [name for name in names if name not in MIMICS]
    of = {name: (name, 1.0) for name in free}
    for name, (other, multiplier, _) in sorted(MIMICS.items(), key=lambda each: each[0] == "axis6"):
        of[name] = of[other][0], multiplier * of[other][1]
    T = np.array([[factor * (leader == each) for each in free] for leader, factor in map(of.get, names)])
    for _ in range(3):
        values, rates = ({name: float(rng.normal()) for name in free} for _ in range(2))
        for name, (other, multiplier, offset) in sorted(MIMICS.items(), key=lambda each: each[0] == "axis6"):
            values[name], rates[name] = multiplier * values[other] + offset, multiplier * rates[other]
        q, u, theirs, v = np.zeros(system.nq), np.zeros(system.nu), np.zeros(model.nq), np.zeros(model.nv)
        for name in names:
            each = model.joints[model.getJointId(name)]
            q[system.coordinate(name)], u[system.speed(name)] = values[name], rates[name]
            circle = np.cos(values[name]), np.sin(values[name])
            theirs[each.idx_q : each.idx_q + each.nq] = circle if each.nq == 2 else values[name]
            v[each.idx_v] = rates[name]
        M = pin.crba(model, data, theirs)
        M, bias = np.triu(M) + np.triu(M, 1).T, pin.nle(model, data, theirs, v)
        found = system.accelerations(system.state(q, u))[[system.speed(name).start for name in names]]
        assert np.max(np.abs(found - T @ found[[names.index(name) for name in free]])) < 1e-12 * np.max(np.abs(found))
        terms = np.abs(T.T) @ (np.abs(M) @ np.abs(found) + np.abs(bias))
        assert backward_error(T.T @ M, found, -T.T @ bias, terms) < algebra(system.nu, 9)


def test_mimic_joints_start_where_those_that_they_mimic_are_at_zero(tmp_path):
    system = fm.compile(read(mimicking(), tmp_path).scene)
    at = {name: system.initial_state.q[system.coordinate(name)][0] for name in (*MIMICS, "axis2", "axis5")}
    assert at == {"axis4": 0.2, "axis6": 0.7 * 0.2, "axis3": -0.1, "axis2": 0.0, "axis5": 0.0}


class Theirs(NamedTuple):
    """Pinocchio's coordinates and speeds; its accelerations are turn @ ours[order] + swept."""

    q: np.ndarray
    v: np.ndarray
    order: np.ndarray
    turn: np.ndarray
    swept: np.ndarray


def _same_motion(system, model, rng) -> tuple[tuple[np.ndarray, np.ndarray], Theirs]:
    """A random motion as (q, u) of ours and as theirs."""
    q, u = system.initial_state.q.copy(), rng.normal(size=system.nu)
    theirs = Theirs(
        np.zeros(model.nq), np.zeros(model.nv), np.zeros(model.nv, int), np.eye(model.nv), np.zeros(model.nv)
    )
    for name in model.names[1:]:
        each = model.joints[model.getJointId(name)]
        hinge = "base" if name == "root_joint" else name
        at, speed = system.coordinate(hinge), system.speed(hinge)
        places, speeds = slice(each.idx_q, each.idx_q + each.nq), slice(each.idx_v, each.idx_v + each.nv)
        theirs.order[speeds] = np.arange(speed.start, speed.stop)
        if each.nv == 6:  # speeds [linear; angular], quaternion scalar last
            turn = rng.normal(size=4)
            q[at] = [*rng.normal(size=3), *(turn / np.linalg.norm(turn))]
            theirs.q[places] = [*q[at][:3], *np.roll(q[at][3:], -1)]
            theirs.order[speeds] = np.roll(theirs.order[speeds], 3)
            theirs.v[speeds] = u[theirs.order[speeds]]
            continue
        q[at] = rng.normal(size=each.nv)
        angle = q[at][-1]
        circle = [np.cos(angle), np.sin(angle)]
        theirs.q[places] = [*q[at][:2], *circle] if each.nv == 3 else circle if each.nq == 2 else q[at]
        theirs.v[speeds] = u[speed]
        if each.nv == 3:  # their speeds along x and y are in the carried axes
            plane = slice(each.idx_v, each.idx_v + 2)
            theirs.turn[plane, plane] = R = np.array([circle, [-circle[1], circle[0]]])
            theirs.v[plane] = R @ theirs.v[plane]
            theirs.swept[plane] = u[speed][2] * np.array([theirs.v[plane][1], -theirs.v[plane][0]])
    return (q, u), theirs


def test_frames_are_where_the_file_says(tmp_path):
    text = (
        f'<robot name="r"><link name="a"/>{link("b", 4)}<joint name="j" type="revolute">'
        '<parent link="a"/><child link="b"/>'
        '<origin xyz="1 2 3" rpy="0.1 0.2 0.3"/><axis xyz="0 0 2"/></joint></robot>'
    )
    (hinge,) = [hinge for hinge in read(text, tmp_path).scene.hinges if hinge.name == "j"]
    cx, sx, cy, sy, cz, sz = (f(a) for a in (0.1, 0.2, 0.3) for f in (np.cos, np.sin))
    turns = [
        np.array(each)
        for each in (
            [[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]],
            [[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]],
            [[1, 0, 0], [0, cx, -sx], [0, sx, cx]],
        )
    ]
    assert np.allclose(rotation_matrix(hinge.parent_quaternion), turns[0] @ turns[1] @ turns[2], atol=1e-15)
    assert hinge.parent_position_m == (1.0, 2.0, 3.0)
    assert hinge.axis == (0.0, 0.0, 1.0)


def test_what_is_left_out_is_said(tmp_path):
    notes = read(arm(), tmp_path).notes
    assert any(note.startswith("limits of joints are left out: axis1, axis3") for note in notes)
    assert not any("damping" in note or "friction" in note for note in notes)  # they are zero
    assert any("bodies without mass: base, flange" in note for note in notes)


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
def test_damping_is_that_of_the_hinge_and_friction_is_noted(kind, tmp_path):
    robot = SINGLE.replace('type="revolute"', f'type="{kind}"')
    damped = read(robot.replace("<axis", '<dynamics damping="0.7" friction="0.2"/><axis'), tmp_path)
    hinge = damped.scene.hinges[-1]
    coordinate = hinge.translation if kind == "prismatic" else hinge.rotation
    assert (coordinate.damping_Ns_m if kind == "prismatic" else coordinate.damping_Nms_rad) == 0.7
    assert "dry friction of joints is left out: j (--smoothing makes it a connector)" in damped.notes


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_limits_become_stops_and_friction_a_connector(kind, tmp_path):
    """What the connectors push with is what their laws say: the stop pressed in by 0.1, friction at a high rate."""
    limits = '<limit lower="-0.3" upper="0.2" effort="5" velocity="2"/><dynamics friction="0.2"/><axis'
    text = SINGLE.replace('type="revolute"', f'type="{kind}"').replace("<axis", limits)
    imported = read(text, tmp_path, stop_stiffness=50.0, smoothing=1e-3)
    assert not any("limits" in note or "friction" in note for note in imported.notes)
    friction, stop = imported.scene.connectors
    assert (stop.name, friction.name, stop.hinge, friction.hinge) == ("j.stops", "j.friction", "j", "j")
    system, apart = fm.compile(imported.scene), fm.compile(read(text, tmp_path).scene)
    for place, rate, push in ((0.0, 4.0, -0.2), (0.3, 0.0, -5.0), (-0.4, 0.0, 5.0), (0.3, -4.0, -4.8)):
        (found, M), (free, _) = (_along(each, place, rate) for each in (system, apart))
        assert M * (found - free) == pytest.approx(push, rel=1e-6)
    assert _along(system, 0.19, 0.0)[0] == pytest.approx(_along(apart, 0.19, 0.0)[0], rel=1e-12)  # within the limits


def _along(system: fm.System, place: float, rate: float) -> tuple[float, float]:
    """Acceleration and mass of the only coordinate."""
    state = system.state(np.array([place]), np.array([rate]), 0.0)
    return float(system.accelerations(state)[0]), float(system.mass_matrix(state)[0, 0])


def test_joints_that_begin_beyond_their_limits_are_told(tmp_path):
    text = SINGLE.replace("<axis", '<limit lower="0.1" upper="0.2"/><axis')
    notes = read(text, tmp_path, stop_stiffness=50.0).notes
    assert "joints begin beyond their limits, and are pushed back: j" in notes
    with pytest.raises(ModelError, match="its limits are '0.3' and '0.2': give numbers in SI units, lower first"):
        read(text.replace("0.1", "0.3"), tmp_path, stop_stiffness=50.0)
    with pytest.raises(ValueError, match="stop_stiffness is 0: give a positive number"):
        read(text, tmp_path, stop_stiffness=0.0)


@pytest.mark.parametrize("losses", ['damping="-1"', 'damping="x"', 'friction="nan"'])
def test_losses_that_are_no_losses_are_refused(losses, tmp_path):
    with pytest.raises(ModelError, match="give a number in SI units, zero or more"):
        read(SINGLE.replace("<axis", f"<dynamics {losses}/><axis"), tmp_path)


def test_prefixes_of_extensions_need_no_declaration(tmp_path):
    text = SINGLE.replace("<axis", '<limit drake:acceleration="2"/><axis').replace("</robot>", "<drake:x/></robot>")
    assert any("drake:x" in note for note in read(text, tmp_path).notes)


def test_a_fixed_joint_that_mimics_is_fixed(tmp_path):
    text = SINGLE.replace('"revolute"', '"fixed"').replace("<axis", '<mimic joint="j"/><axis')
    imported = read(text, tmp_path)
    assert imported.scene.couplings == ()
    assert "fixed joints mimic nothing: j" in imported.notes


def test_a_scene_goes_to_a_file_and_runs(tmp_path):
    for text, name in ((quadruped(), "quadruped.toml"), (mimicking(), "mimicking.toml")):
        scene = read(text, tmp_path, free_base=True).scene
        fm.save_scene(scene, tmp_path / name)
        assert fm.load_scene(tmp_path / name) == scene


SINGLE = f'<robot name="r">{link("a", 1)}{link("b", 2)}{joint("j", "revolute", "a", "b", 1)}</robot>'
BAD = {
    "mimic": (SINGLE.replace("<axis", '<mimic joint="k"/><axis'), 'joint "j": it mimics'),
    "mimic without multiplier": (
        SINGLE.replace("<axis", '<mimic joint="j" multiplier="0"/><axis'),
        "its multiplier is zero",
    ),
    "mimic of itself": (SINGLE.replace("<axis", '<mimic joint="j" multiplier="2"/><axis'), "it mimics itself"),
    "mimic by a word": (SINGLE.replace("<axis", '<mimic joint="j" offset="one"/><axis'), "offset of its mimic element"),
    "mimic of a weld": (
        SINGLE.replace("<axis", '<mimic joint="k"/><axis').replace(
            "</robot>", link("c", 3) + joint("k", "fixed", "b", "c", 2) + "</robot>"
        ),
        '"k" of type "fixed" has no single coordinate',
    ),
    "kind": (SINGLE.replace('"revolute"', '"screw"'), 'its type is "screw"'),
    "loop": (
        SINGLE.replace("</robot>", joint("k", "fixed", "b", "a", 2) + "</robot>"),
        "0 links are not the child of a joint",
    ),
    "two parents": (
        SINGLE.replace("</robot>", joint("k", "fixed", "a", "b", 2) + "</robot>"),
        'is also the child of "j"',
    ),
    "two roots": (SINGLE.replace("</robot>", link("c", 3) + "</robot>"), "2 links are not the child of a joint"),
    "unknown link": (SINGLE.replace('child link="b"', 'child link="x"'), 'its child is "x"'),
    "no mass": (re.sub(r"<mass[^>]*/>", "", SINGLE), "mass value is missing"),
    "nan": (re.sub(r'ixx="[^"]*"', 'ixx="nan"', SINGLE), "inertia ixx is 'nan'"),
    "words": (re.sub(r'xyz="[^"]*"', 'xyz="1 2"', SINGLE, count=1), 'xyz is "1 2"'),
    **{
        f"two {tag}": (re.sub(rf"(<{tag}\b[^>]*/>)", r"\1\1", SINGLE, count=1), f"has 2 elements {tag}: keep one")
        for tag in ("mass", "inertia", "parent", "child", "axis", "origin")
    },
    "two inertial": (
        re.sub(r"(<inertial>.*?</inertial>)", r"\1\1", SINGLE, count=1),
        'link "a": its link has 2 elements inertial',
    ),
    "two mimic": (
        SINGLE.replace("<axis", '<mimic joint="k"/><mimic joint="k"/><axis'),
        'joint "j": its joint has 2 elements mimic',
    ),
    "no axis": (re.sub(r'<axis xyz="[^"]*"', '<axis xyz="0 0 0"', SINGLE), "axis has no length"),
    "xacro": ('<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:arm/></robot>', "expand them first"),
    "entities": ('<!DOCTYPE robot [<!ENTITY a "b">]><robot/>', "declares entities"),
    "other xml": ("<sdf/>", 'the outermost element is "sdf"'),
    "no xml": ("robot", "not XML"),
    "empty": ("<robot name='r'/>", "it has no links: expand its macros"),
    "same name": (SINGLE.replace('name="b"', 'name="a"'), "one that is taken"),
}


@pytest.mark.parametrize("fault", BAD)
def test_what_is_no_tree_of_rigid_bodies_is_refused_with_place_and_remedy(fault, tmp_path):
    text, words = BAD[fault]
    with pytest.raises(ModelError, match=re.escape(words)) as error:
        read(text, tmp_path)
    assert "robot.urdf" in str(error.value)


def test_inertia_that_no_body_has_is_refused_or_repaired(tmp_path):
    text = re.sub(r'izz="[^"]*"', 'izz="9"', SINGLE)
    with pytest.raises(fm.SceneError, match="(triangle|positive)(.|\\n)*flexmb import --repair makes the least change"):
        read(text, tmp_path)
    repaired = read(text, tmp_path, repair=True)
    assert re.search(r"changed by the least amount: a \(by [\d.]+ of 9 kg m²\), b \(by", repaired.notes[-1])
    moments = np.linalg.eigvalsh(repaired.scene.bodies[0].inertia_kg_m2)
    assert moments[0] + moments[1] >= moments[2] * (1.0 - 1e-12)
    assert read(SINGLE, tmp_path, repair=True) == read(SINGLE, tmp_path)  # what is possible stays as it is


DUST = '<inertia ixx="0" ixy="0" ixz="1e-20" iyy="0" iyz="0" izz="0"/>'


def test_dust_in_the_inertia_of_a_point_mass_is_read_and_repaired_for_codes_that_refuse_it(tmp_path):
    text = re.sub(r"<inertia [^>]*>", DUST, SINGLE, count=1)
    as_written, repaired = (read(text, tmp_path, repair=repair).scene.bodies[0] for repair in (False, True))
    assert np.linalg.eigvalsh(as_written.inertia_kg_m2)[0] < -9e-21
    moments = np.linalg.eigvalsh(repaired.inertia_kg_m2)
    assert moments[0] >= -1e-33 and moments[2] <= 1e-20 * (1.0 + 1e-12)


def test_a_link_with_a_mass_alone_is_a_point_mass_and_that_is_noted(tmp_path):
    tip = (
        '<link name="tip"><inertial><origin xyz="0.1 0 0"/><mass value="2"/></inertial></link>'
        '<joint name="w" type="fixed"><parent link="b"/><child link="tip"/></joint></robot>'
    )
    text = SINGLE.replace("</robot>", tip)
    found = read(text, tmp_path)
    body = found.scene.bodies[2]
    assert (body.mass_kg, body.com_m, np.any(body.inertia_kg_m2)) == (2.0, (0.1, 0.0, 0.0), np.False_)
    assert "links with a mass and no inertia tensor are point masses: tip" in found.notes
    with pytest.raises(ModelError, match="inertia ixx is missing"):  # an element that says nothing is none of a point
        read(text.replace('<mass value="2"/>', '<mass value="2"/><inertia/>'), tmp_path)


def test_commas_behind_numbers_are_blanks_and_that_is_noted(tmp_path):
    text = SINGLE.replace("<axis", '<origin xyz="0.5, 0.25, 1" rpy="0.1, 0.2 0.3"/><axis')
    text = re.sub(r"(<child [^>]*/>)<origin [^>]*/>", r"\1", text, count=1)
    found = read(text, tmp_path)
    assert found.scene.hinges[1].parent_position_m == (0.5, 0.25, 1.0)
    assert any(note.startswith("commas behind numbers are taken for blanks: joint") for note in found.notes)
    with pytest.raises(ModelError, match="give three numbers, with blanks between them"):  # 0.5 or 5/10: nobody knows
        read(text.replace("0.5, 0.25, 1", "0,5 0,25 1"), tmp_path)


def test_a_mimic_joint_that_names_no_joint_is_told_the_nearest_one(tmp_path):
    (name,) = re.findall(r'<joint name="([^"]*)"', SINGLE)
    text = SINGLE.replace("<axis", f'<mimic joint="{name}s"/><axis')
    with pytest.raises(ModelError, match=f'which is not a joint: did you mean "{name}"'):
        read(text, tmp_path)


def test_a_link_may_be_called_ground_and_namespaces_of_macros_may_be_left_over(tmp_path):
    text = SINGLE.replace('"a"', '"ground"').replace(
        "<robot", '<robot xmlns:xacro="http://ros.org/wiki/xacro" xmlns:g="g"'
    )
    scene = read(text.replace("</robot>", "<g:body/></robot>"), tmp_path).scene
    assert [body.name for body in scene.bodies] == ["ground link", "b"]
