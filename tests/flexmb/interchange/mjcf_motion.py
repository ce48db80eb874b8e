"""A model in MuJoCo and its scene, in the same random motion."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

import flexmb as fm
from flexmb.interchange.mjcf import BALL, FREE, read_mjcf
from flexmb.scene.quaternions import rotation_matrix

mujoco = pytest.importorskip("mujoco")


def read(text: str, folder, **options):
    (folder / "creature.xml").write_text(text)
    return read_mjcf(folder / "creature.xml", **options)


class Theirs(NamedTuple):
    """MuJoCo's accelerations are turned @ ours[order] + swept."""

    order: np.ndarray
    turned: np.ndarray
    swept: np.ndarray


def compiled(text: str, scene: fm.Scene):
    """A model in MuJoCo, without contacts, limits and equality constraints, and its scene."""
    model = mujoco.MjModel.from_xml_string(text)
    off = mujoco.mjtDisableBit
    model.opt.disableflags |= off.mjDSBL_CONTACT | off.mjDSBL_LIMIT | off.mjDSBL_EQUALITY
    return model, mujoco.MjData(model), fm.compile(scene)


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
