"""URDF, MJCF and Exudyn scripts are read back by their programs, whose accelerations at random states are ours."""

import runpy
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from crosscheck.export.formats.exudyn_script import exudyn_script
from crosscheck.export.formats.mjcf import mjcf
from crosscheck.export.formats.urdf import urdf
from crosscheck.export.formats.written import Written
from crosscheck.export.model import model_data
from crosscheck.export.rebuild import RebuiltCase
from crosscheck.export.rebuild.rotations import matrix_of
from crosscheck.library.find import shipped_names
from flexmb.scene.schema import Scene
from flexmb.typing import Real
from tests.crosscheck.export.exported import Data, scene_of

TREES = (
    "pendulums/bar_and_plate", "pendulums/compound", "pendulums/foucault", "sliders/crane", "sliders/rotating_tube",
    "manipulators/six_axis_arm", "tops/lagrange", "tops/gyrostat", "wheel_gyrostat/torque_driven",
    "deploying_boom/rigid", "wheel_gyrostat/dual_spinner", "chains/hundred_rods", "spacecraft/slosh",
)  # fmt: skip
CLOSE = 1e-9  # relative: MuJoCo's principal axes and the long chain's condition take up to seven digits of sixteen


def bare(scene: Scene, springs: bool) -> RebuiltCase:
    """The tree as `rebuild` has it, without what the format leaves out."""
    data, _ = model_data(scene)
    data |= {"loads": [], "connectors": [], "controllers": [], "events": []}
    for freedom in (freedom for joint in data["joints"] for freedom in joint["freedoms"]):
        dropped = {"effort": None, "prescribed": None}
        if not springs:
            dropped |= {key: 0.0 for key in freedom if key.startswith(("stiffness", "damping"))}
        freedom |= {key: value for key, value in dropped.items() if key in freedom}
    return RebuiltCase(data, {})


def state(case: RebuiltCase) -> Real:
    """A random state near that of the start; quaternions are unit."""
    y = case.start + 0.4 * np.random.default_rng(7).standard_normal(len(case.start))
    for joint, n, freedom in each_freedom(case):
        start = case.slots[joint["name"], n][0] + 3 * (freedom["motion"] == "free")
        if freedom["motion"] in ("ball", "free"):
            y[start : start + 4] /= np.linalg.norm(y[start : start + 4])
    return y


def each_freedom(case: RebuiltCase):  # noqa: ANN201
    for joint in case.joints:
        for n, freedom in enumerate(joint["freedoms"]):
            yield joint, n, freedom


def joint_name(joint: Data, n: int) -> str:
    kind = joint["kind"] if joint["kind"] in ("wheel", "point mass") else "body"
    return f"{kind} {joint['name']} {n}"


def by_pinocchio(text: str, case: RebuiltCase, y: Real, gravity: Real) -> Real:
    pinocchio = pytest.importorskip("pinocchio")
    model = pinocchio.buildModelFromXML(text)
    model.gravity.linear = gravity
    q, v = pinocchio.neutral(model), np.zeros(model.nv)
    places = []
    for joint, n, freedom in each_freedom(case):
        (i, j), at = case.slots[joint["name"], n], model.joints[model.getJointId(joint_name(joint, n))]
        u = y[case.nq :]
        if freedom["motion"] == "free":  # Pinocchio: quaternion scalar last, linear velocity first
            q[at.idx_q : at.idx_q + 7] = [*y[i : i + 3], *y[i + 4 : i + 7], y[i + 3]]
            v[at.idx_v : at.idx_v + 6] = [*u[j + 3 : j + 6], *u[j : j + 3]]
            places += [(j + k, at.idx_v + (k + 3) % 6) for k in range(6)]
        else:
            angle = [np.cos(y[i]), np.sin(y[i])] if at.nq == 2 else [y[i]]
            q[at.idx_q : at.idx_q + at.nq], v[at.idx_v] = angle, u[j]
            places.append((j, at.idx_v))
    found = pinocchio.aba(model, pinocchio.Data(model), q, v, np.zeros(model.nv))
    return np.array([found[there] for _, there in sorted(places)])


def by_mujoco(text: str, case: RebuiltCase, y: Real) -> Real:
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(text)
    data, u = mujoco.MjData(model), y[case.nq :]
    accelerations = np.zeros(case.nu)
    where = []
    for joint, n, freedom in each_freedom(case):
        (i, j), name = case.slots[joint["name"], n], joint_name(joint, n)
        at = model.joint(name)
        q, v = int(at.qposadr[0]), int(at.dofadr[0])
        if freedom["motion"] == "free":
            R = matrix_of(y[i + 3 : i + 7])
            data.qpos[q - 3 : q + 4], data.qvel[v - 3 : v] = y[i : i + 7], R @ u[j + 3 : j + 6]
            data.qvel[v : v + 3] = u[j : j + 3]
        elif freedom["motion"] == "ball":
            data.qpos[q : q + 4], data.qvel[v : v + 3] = y[i : i + 4], u[j : j + 3]
        else:
            data.qpos[q], data.qvel[v] = y[i], u[j]
        where.append((freedom["motion"], i, j, v))
    mujoco.mj_forward(model, data)
    for motion, i, j, v in where:
        if motion == "free":  # MuJoCo's slides have axes that do not turn: (R v)' = R (v' + w x v)
            R = matrix_of(y[i + 3 : i + 7])
            accelerations[j : j + 3] = data.qacc[v : v + 3]
            accelerations[j + 3 : j + 6] = R.T @ data.qacc[v - 3 : v] - np.cross(u[j : j + 3], u[j + 3 : j + 6])
        else:
            width = 3 if motion == "ball" else 1
            accelerations[j : j + width] = data.qacc[v : v + width]
    return accelerations


def off(ours: Real, theirs: Real) -> float:
    return float(np.max(np.abs(ours - theirs)) / np.max(np.abs(ours)))


@pytest.mark.parametrize("name", TREES)
def test_urdf_is_the_same_tree(name: str) -> None:
    scene = scene_of(name)
    written = urdf(scene, "tree")
    if written.refused:
        assert "ball" in written.refused and name.startswith("tops/"), written.refused
        return
    case = bare(scene, springs=False)
    y = state(case)
    theirs = by_pinocchio(written.text, case, y, np.array(scene.gravity_m_s2))
    assert off(case.accelerations(0.0, y), theirs) < CLOSE


@pytest.mark.parametrize("name", TREES)
def test_mjcf_is_the_same_tree(name: str) -> None:
    scene = scene_of(name)
    written = mjcf(scene, "tree")
    if written.refused:
        assert "no inertia" in written.refused, written.refused
        return
    case = bare(scene, springs=True)
    y = state(case)
    assert off(case.accelerations(0.0, y), by_mujoco(written.text, case, y)) < CLOSE


def test_mjcf_starts_where_the_case_starts() -> None:
    mujoco = pytest.importorskip("mujoco")
    scene = scene_of("wheel_gyrostat/torque_driven")
    model = mujoco.MjModel.from_xml_string(mjcf(scene, "tree").text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    case = bare(scene, springs=True)
    seen = case.observed(0.0, case.start)
    for marker in scene.markers:
        assert np.allclose(data.site(marker.name).xpos, seen[f"marker:{marker.name}.position"], atol=1e-14)


@pytest.mark.parametrize("name", ["pendulums/bar_and_plate", "sliders/crane", "manipulators/six_axis_arm"])
def test_the_exudyn_script_moves_as_the_tree(tmp_path: Path, name: str) -> None:
    """A hundredth of a second from a random state: exudyn's own fixed steps leave 1e-10."""
    pytest.importorskip("exudyn")
    scene = scene_of(name)
    case = bare(scene, springs=True)
    y = state(case)
    order = [case.slots[joint["name"], n] for joint, n, _ in each_freedom(case)]
    (tmp_path / "script.py").write_text(exudyn_script(scene, "tree").text, encoding="utf-8")
    script = runpy.run_path(str(tmp_path / "script.py"))
    mbs, _ = script["build"]([y[i] for i, _ in order], [y[case.nq + j] for _, j in order])
    q, v = script["integrate"](mbs, 0.01, 100)
    case.start = y
    end = case.integrate(np.array([0.0, 0.01]), 1e-12)[-1]
    assert off(np.array([end[case.nq + j] for _, j in order]), np.array(v)) < 1e-8
    assert off(np.array([end[i] for i, _ in order]), np.array(q)) < 1e-8


def test_a_wrong_axis_or_mass_in_a_file_is_noticed() -> None:
    scene = scene_of("manipulators/six_axis_arm")
    case = bare(scene, springs=False)
    y = state(case)
    ours = case.accelerations(0.0, y)
    changes = (("axis", "xyz", "0.6 0 0.8"), ("mass", "value", "1.001"), ("origin", "rpy", "0.01 0.02 0"))
    for tag, key, change in changes:
        robot = ElementTree.fromstring(urdf(scene, "tree").text)
        list(robot.iter(tag))[-1].set(key, change)
        text = ElementTree.tostring(robot, encoding="unicode")
        assert off(ours, by_pinocchio(text, case, y, np.array(scene.gravity_m_s2))) > 1e-5, tag


@pytest.mark.parametrize("writer, name, why", [
    (urdf, "connectors/flyball_governor", ""),
    (urdf, "closed_chains/bennett", "closes no loops"),
    (mjcf, "closed_chains/bennett", "closes no loops"),
    (mjcf, "pendulums/point_mass", "no inertia about one of its axes"),
    (mjcf, "chains/thousand_rods", "hang on each other"),
    (urdf, "flexible_mechanisms/double_pendulum", "no flexible bodies"),
    (exudyn_script, "wheel_gyrostat/torque_free", "free flight"),
])  # fmt: skip
def test_what_a_format_cannot_hold_is_refused_with_the_reason(writer, name: str, why: str) -> None:  # noqa: ANN001
    written: Written = writer(scene_of(name), "tree")
    if why:
        assert why in written.refused and not written.text
    else:
        assert any("connector" in each for each in written.left_out) or written.refused


def test_what_a_file_leaves_out_is_listed() -> None:
    assert "gravity" in urdf(scene_of("pendulums/double"), "tree").left_out
    assert any(each.startswith("motor of") for each in mjcf(scene_of("wheel_gyrostat/torque_driven"), "tree").left_out)
    assert any("prescribed" in each for each in urdf(scene_of("sliders/rotating_tube"), "tree").left_out)


def test_every_rigid_tree_has_a_file_or_a_reason() -> None:
    for name in shipped_names()[::6]:
        scene = scene_of(name)
        for writer in (urdf, mjcf, exudyn_script):
            written = writer(scene, "tree")
            assert bool(written.text) != bool(written.refused)
