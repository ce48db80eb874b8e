"""MJCF files: the scene's accelerations against MuJoCo's own, and what is refused."""

from __future__ import annotations

import re

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
    scene = read(MJCF, tmp_path).scene
    model = mujoco.MjModel.from_xml_string(MJCF)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    data, system = mujoco.MjData(model), fm.compile(scene)
    rng = np.random.default_rng(5)
    q, u = system.initial_state.q.copy(), np.zeros(system.nu)
    order = np.zeros(model.nv, dtype=int)
    data.qpos[:], data.qvel[:] = model.qpos0, rng.normal(size=model.nv)
    turned, swept = np.eye(model.nv), np.zeros(model.nv)
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
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    found = turned @ system.accelerations(system.state(q, u, 0.0))[order] + swept
    terms = np.abs(M) @ np.abs(data.qacc) + np.abs(data.qfrc_bias) + np.abs(data.qfrc_passive)
    assert backward_error(M, found, M @ data.qacc, terms) < algebra(system.nu, 6)


def _quaternion(R: np.ndarray) -> np.ndarray:
    found = np.zeros(4)
    mujoco.mju_mat2Quat(found, R.ravel())
    return found


def test_what_is_left_out_is_said(tmp_path):
    text = MJCF.replace("</mujoco>", '<actuator><motor joint="roll"/></actuator></mujoco>')
    notes = " | ".join(read(text.replace('name="pitch"', 'name="pitch" frictionloss="0.1"'), tmp_path).notes)
    for words in (
        "contacts", "limits of joints are left out: tail.joint 5", "dry friction is left out: pitch", "1 actuators",
        "count from the reference position, not from zero: tail",
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
        MJCF.replace("</mujoco>", '<tendon><fixed><joint joint="roll" coef="1"/></fixed></tendon></mujoco>'),
        "1 tendons",
    ),
    "fluid": (MJCF.replace("<option", '<option density="1.2"'), "no fluid"),
    "levity": (MJCF.replace('name="foot"', 'name="foot" gravcomp="1"'), 'body "foot" has gravity compensation'),
    "no model": ("<mujoco><worldbody><body><joint/></body></worldbody></mujoco>", "MuJoCo refuses"),
    "no xml": ("hello", "MuJoCo refuses"),
}


@pytest.mark.parametrize("fault", BAD)
def test_what_no_scene_has_is_refused_with_place_and_remedy(fault, tmp_path):
    text, words = BAD[fault]
    with pytest.raises((ModelError, fm.SceneError), match=re.escape(words)):
        read(text, tmp_path)
