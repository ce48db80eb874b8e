"""MJCF files: the scene's accelerations against MuJoCo's own, and what is refused."""

from __future__ import annotations

import os
import re
from typing import NamedTuple

import numpy as np
import pytest

import flexmb as fm
from flexmb.interchange.imported import ModelError
from flexmb.interchange.mjcf import BALL, FREE, read_mjcf
from flexmb.scene.quaternions import rotation_matrix
from tests.bounds import algebra, backward_error
from tests.flexmb.interchange.made_robots import MJCF

mujoco = pytest.importorskip("mujoco")


def read(text: str, folder):
    (folder / "creature.xml").write_text(text)
    return read_mjcf(folder / "creature.xml")


def test_accelerations_are_those_of_mujoco(tmp_path):
    model, data, system = compiled(MJCF, tmp_path)
    (q, u), theirs = random_motion(model, data, system)
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    found = theirs.turned @ system.accelerations(system.state(q, u, 0.0))[theirs.order] + theirs.swept
    terms = np.abs(M) @ np.abs(data.qacc) + np.abs(data.qfrc_bias) + np.abs(data.qfrc_passive)
    assert backward_error(M, found, M @ data.qacc, terms) < algebra(system.nu, 6)


COUPLED = MJCF.replace(
    "</mujoco>",
    """<tendon><fixed name="cable"><joint joint="reach" coef="2"/><joint joint="roll" coef="-0.3"/></fixed>
    <fixed name="strap"><joint joint="twist" coef="1.5"/></fixed></tendon>
    <equality><joint name="mesh" joint1="roll" joint2="pitch" polycoef="0.1 -1.5 0 0 0"/>
    <tendon tendon1="cable" tendon2="strap" polycoef="0.05 0.4 0 0 0"/>
    <joint joint1="reach" joint2="roll" active="false"/></equality></mujoco>""",
).replace('<joint type="hinge" axis="0 0.3 1"', '<joint name="twist" type="hinge" axis="0 0.3 1"')


def test_equality_constraints_of_coordinates_are_couplings(tmp_path):
    """The equations without them, M a + bias = J' f, and J a = 0 exactly: MuJoCo itself keeps them softly."""
    model, data, system = compiled(COUPLED, tmp_path)
    assert [each.name for each in system.scene.couplings] == ["mesh", "equality 1"]
    (q, u), theirs = random_motion(model, data, system)
    value, rate = ({name: x[at(name).start] for name in ("roll", "pitch", "reach", "twist")}
                   for x, at in ((q, system.coordinate), (u, system.speed)))  # fmt: skip
    for x, constant in ((value, 1.0), (rate, 0.0)):  # roll = 0.1 - 1.5 pitch, 2 reach - 0.3 roll = 0.05 + 0.6 twist
        x["roll"] = 0.1 * constant - 1.5 * x["pitch"]
        x["reach"] = 0.5 * (0.05 * constant + 0.6 * x["twist"] + 0.3 * x["roll"])
    for name in value:
        q[system.coordinate(name)], u[system.speed(name)] = value[name], rate[name]
        data.joint(name).qpos[0] = model.qpos0[model.joint(name).qposadr[0]] + value[name]
        data.joint(name).qvel[0] = rate[name]
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    J = np.zeros((2, model.nv))
    at = {name: model.joint(name).dofadr[0] for name in value}
    J[0, [at["roll"], at["pitch"]]] = 1.0, 1.5
    J[1, [at["reach"], at["roll"], at["twist"]]] = 2.0, -0.3, -0.6
    system.initial_state  # noqa: B018 - counts the rows
    found = theirs.turned @ system.accelerations(system.state(q, u, 0.0))[theirs.order] + theirs.swept
    assert np.max(np.abs(J @ found)) < 1e-12 * np.max(np.abs(found))
    missing = M @ found + data.qfrc_bias - data.qfrc_passive
    left = missing - J.T @ np.linalg.lstsq(J.T, missing, rcond=None)[0]
    terms = np.abs(M) @ np.abs(found) + np.abs(data.qfrc_bias) + np.abs(data.qfrc_passive)
    assert np.max(np.abs(left)) < 4.0 * algebra(system.nu, 6) * np.max(terms)


def test_a_joint_that_is_kept_at_a_constant_is_prescribed(tmp_path):
    text = COUPLED.replace('joint1="roll" joint2="pitch" polycoef="0.1 -1.5 0 0 0"', 'joint1="pitch" polycoef="0.2"')
    scene = read(text, tmp_path).scene
    pitch = next(hinge for hinge in scene.hinges if hinge.name == "pitch")
    assert pitch.rotation.prescribed_rad == fm.schema.Constant(value=0.2)


class Theirs(NamedTuple):
    """MuJoCo's accelerations are turned @ ours[order] + swept."""

    order: np.ndarray
    turned: np.ndarray
    swept: np.ndarray


def compiled(text: str, folder):
    """A model in MuJoCo, without contacts, limits and equality constraints, and its scene."""
    model = mujoco.MjModel.from_xml_string(text)
    off = mujoco.mjtDisableBit
    model.opt.disableflags |= off.mjDSBL_CONTACT | off.mjDSBL_LIMIT | off.mjDSBL_EQUALITY
    return model, mujoco.MjData(model), fm.compile(read(text, folder).scene)


def random_motion(model, data, system):
    """A random motion of every joint, as (q, u) of ours and in `data`."""
    rng = np.random.default_rng(5)
    q, u = fm.System(system.scene).initial_state.q.copy(), np.zeros(system.nu)
    theirs = Theirs(np.zeros(model.nv, dtype=int), np.eye(model.nv), np.zeros(model.nv))
    order, turned, swept = theirs
    data.qpos[:], data.qvel[:] = model.qpos0, rng.normal(size=model.nv)
    for j in range(model.njnt):
        name = model.joint(j).name or "tail.joint 5"
        at, speed = system.coordinate(name), system.speed(name)
        a, v = int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j])
        if model.jnt_type[j] == FREE:
            quaternion = rng.normal(size=4)
            data.qpos[a : a + 7] = np.r_[rng.normal(size=3), quaternion / np.linalg.norm(quaternion)]
            # ours from the reference pose, speeds [angular; linear] in carried axes; theirs linear in World axes
            R0, R = rotation_matrix(model.qpos0[a + 3 : a + 7]), rotation_matrix(data.qpos[a + 3 : a + 7])
            q[at] = np.r_[R0.T @ (data.qpos[a : a + 3] - model.qpos0[a : a + 3]), _quaternion(R0.T @ R)]
            linear, w = R.T @ data.qvel[v : v + 3], data.qvel[v + 3 : v + 6]
            u[speed] = np.r_[w, linear]
            order[v : v + 6] = np.r_[speed.start + 3 : speed.start + 6, speed.start : speed.start + 3]
            turned[v : v + 3, v : v + 3], swept[v : v + 3] = R, R @ np.cross(w, linear)
        elif model.jnt_type[j] == BALL:
            quaternion = rng.normal(size=4)
            data.qpos[a : a + 4] = q[at] = quaternion / np.linalg.norm(quaternion)
            u[speed], order[v : v + 3] = data.qvel[v : v + 3], np.arange(speed.start, speed.stop)
        else:
            q[at] = rng.normal() * 0.3
            data.qpos[a] = model.qpos0[a] + q[at][0]
            u[speed], order[v] = data.qvel[v], speed.start
    return (q, u), theirs


def _quaternion(R: np.ndarray) -> np.ndarray:
    found = np.zeros(4)
    mujoco.mju_mat2Quat(found, R.ravel())
    return found


def test_what_is_left_out_is_said(tmp_path):
    text = COUPLED.replace("</mujoco>", '<actuator><motor joint="roll"/></actuator></mujoco>')
    notes = " | ".join(read(text.replace('name="pitch"', 'name="pitch" frictionloss="0.1"'), tmp_path).notes)
    for words in (
        "contacts", "equality constraints of coordinates are exact here",
        "inactive equality constraints are left out: equality 2", "actuators of tendons are left out: cable, strap",
        "limits of joints are left out: twist", "dry friction is left out: pitch", "1 actuators",
        "count from the reference position, not from zero: twist",
    ):  # fmt: skip
        assert words in notes


BAD = {
    "armature": (
        MJCF.replace('name="pitch"', 'name="pitch" armature="0.1"'),
        'joint "pitch" has the rotor inertia 0.1',
    ),
    "equality": (
        MJCF.replace("</mujoco>", '<equality><weld body1="foot" body2="tail"/></equality></mujoco>'),
        "1 equality",
    ),
    "tendon": (
        COUPLED.replace('name="strap"', 'name="strap" stiffness="2"'),
        'tendon "strap" has stiffness',
    ),
    "polynomial": (
        COUPLED.replace("0.1 -1.5 0 0 0", "0.1 -1.5 0 0.2 0"),
        'equality constraint "mesh" is a polynomial of higher degree',
    ),
    "nothing": (
        COUPLED.replace('joint1="roll" joint2="pitch" polycoef="0.1 -1.5 0 0 0"', 'joint1="roll" joint2="roll"'),
        "MuJoCo refuses",
    ),
    "fluid": (MJCF.replace("<option", '<option density="1.2"'), "no fluid"),
    "levity": (MJCF.replace('name="foot"', 'name="foot" gravcomp="1"'), 'body "foot" has gravity compensation'),
    "no model": ("<mujoco><worldbody><body><joint/></body></worldbody></mujoco>", "MuJoCo refuses"),
    "no xml": ("hello", "not XML"),
}
NAN = r"is not a finite number up to 1e+150: give a finite number, or leave the attribute out"
UNSOUND = {  # MuJoCo compiles all of the first kind, with a default in place of the number
    "inertial": (
        "<geom ", '<inertial pos="nan 0 0" mass="1" diaginertia="1 1 1"/><geom ', f'inertial, pos: "nan" {NAN}',
    ),
    "capitals and sign": ('pos="0 0 1"', 'pos="0 -NaN 1"', f'body "trunk", pos: "-NaN" {NAN}'),
    "payload": ('stiffness="3"', 'stiffness="nan(7)"', f'joint "roll", stiffness: "nan(7)" {NAN}'),
    "infinite": ('mass="3"', 'mass="1e999"', f'geom, mass: "1e999" {NAN}'),
    "its square infinite": ('pos="0 0 1"', 'pos="0 0 1" quat="1 0 -1e151 0"', f'body "trunk", quat: "-1e151" {NAN}'),
    "word": ('gravity="0.3', 'gravity="-Infinity', f'option, gravity: "-Infinity" {NAN}'),
    "escaped": ('pos="0 0 1"', 'pos="0 &#110;an 1"', f'body "trunk", pos: "nan" {NAN}'),
    "default": ('damping="0.05"', 'damping="nan"', f'joint, damping: "nan" {NAN}'),
    "compiler": ('<compiler ', '<compiler boundmass="nan" ', f'compiler, boundmass: "nan" {NAN}'),
    "included": ("<worldbody>", '<include file="more.xml"/><worldbody>', f'more.xml: joint, armature: "nan" {NAN}'),
    "copies": (
        "</worldbody>",
        '<replicate count="1000"><replicate count="1000"><body/></replicate></replicate></worldbody>',
        "it requests 1000000 copies, and the limit is 10000",
    ),
    "texture": ("<worldbody>", '<asset><texture width="99999" height="9999"/></asset><worldbody>', "999890001 entries"),
    "room": ("<worldbody>", '<size nuser_body="999999999"/><worldbody>', "999999999 entries"),
}  # fmt: skip


@pytest.mark.parametrize("fault", UNSOUND)
def test_numbers_that_are_none_are_seen_before_mujoco_takes_them_for_defaults(fault, tmp_path):
    old, new, words = UNSOUND[fault]
    assert old in MJCF
    (tmp_path / "more.xml").write_text('<mujoco><default><joint armature="nan"/></default></mujoco>')
    with pytest.raises(ModelError, match=re.escape(words)):
        read(MJCF.replace(old, new, 1), tmp_path)


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: os.symlink("/dev/zero", path)])
def test_an_included_file_that_is_none_is_refused(make, tmp_path):
    """MuJoCo would wait for a pipe for ever."""
    make(tmp_path / "more.xml")
    with pytest.raises(OSError, match="name a regular file"):
        read(MJCF.replace("<worldbody>", '<include file="more.xml"/><worldbody>'), tmp_path)


def test_names_may_be_words_for_infinity_and_comments_may_hold_dashes(tmp_path):
    text = MJCF.replace('"foot"', '"inf"').replace("<worldbody>", "<!-- nan -- pos='nan' --><worldbody>")
    assert "inf" in [body.name for body in read(text, tmp_path).scene.bodies]


@pytest.mark.parametrize("fault", BAD)
def test_what_no_scene_has_is_refused_with_place_and_remedy(fault, tmp_path):
    text, words = BAD[fault]
    with pytest.raises((ModelError, fm.SceneError), match=re.escape(words)):
        read(text, tmp_path)
