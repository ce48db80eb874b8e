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
    (hinge,) = [each for each in read(text, tmp_path).scene.hinges if each.name == "j"]
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
    assert any(note.startswith("damping and friction") for note in notes)
    assert any("bodies without mass: base, flange" in note for note in notes)


def test_a_scene_goes_to_a_file_and_runs(tmp_path):
    scene = read(quadruped(), tmp_path, free_base=True).scene
    fm.save_scene(scene, tmp_path / "quadruped.toml")
    assert fm.load_scene(tmp_path / "quadruped.toml") == scene


SINGLE = f'<robot name="r">{link("a", 1)}{link("b", 2)}{joint("j", "revolute", "a", "b", 1)}</robot>'
BAD = {
    "mimic": (SINGLE.replace("<axis", '<mimic joint="k"/><axis'), 'joint "j": it mimics'),
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
    "no axis": (re.sub(r'<axis xyz="[^"]*"', '<axis xyz="0 0 0"', SINGLE), "axis has no length"),
    "xacro": ('<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:arm/></robot>', "expand them first"),
    "entities": ('<!DOCTYPE robot [<!ENTITY a "b">]><robot/>', "declares entities"),
    "other xml": ("<sdf/>", 'the outermost element is "sdf"'),
    "no xml": ("robot", "not XML"),
    "empty": ("<robot name='r'/>", "0 links"),
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
    with pytest.raises(fm.SceneError, match="triangle|positive"):
        read(text, tmp_path)
    repaired = read(text, tmp_path, repair=True)
    assert "changed by the least amount: a, b" in repaired.notes[-1]
    moments = np.linalg.eigvalsh(repaired.scene.bodies[0].inertia_kg_m2)
    assert moments[0] + moments[1] >= moments[2] * (1.0 - 1e-12)
    assert read(SINGLE, tmp_path, repair=True) == read(SINGLE, tmp_path)  # what is possible stays as it is


def test_a_link_may_be_called_ground_and_namespaces_of_macros_may_be_left_over(tmp_path):
    text = SINGLE.replace('"a"', '"ground"').replace(
        "<robot", '<robot xmlns:xacro="http://ros.org/wiki/xacro" xmlns:g="g"'
    )
    scene = read(text.replace("</robot>", "<g:body/></robot>"), tmp_path).scene
    assert [body.name for body in scene.bodies] == ["ground link", "b"]
