"""Equality constraints of MJCF files: couplings of coordinates, held against MuJoCo's matrices, and connect and weld as
closures, against MuJoCo with constraints as hard as it allows."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import flexmb as fm
from flexmb.interchange.imported import ModelError
from flexmb.interchange.mjcf import read_mjcf
from tests.bounds import algebra, relative
from tests.flexmb.interchange.made_robots import MJCF
from tests.flexmb.interchange.mjcf_motion import compiled, random_motion, read

mujoco = pytest.importorskip("mujoco")

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
    model, data, system = compiled(COUPLED, read(COUPLED, tmp_path).scene)
    assert [coupling.name for coupling in system.scene.couplings] == ["mesh", "equality 1"]
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


def test_what_is_left_out_of_couplings_is_said(tmp_path):
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
    "tendon": (COUPLED.replace('name="strap"', 'name="strap" stiffness="2"'), 'tendon "strap" has stiffness'),
    "polynomial": (
        COUPLED.replace("0.1 -1.5 0 0 0", "0.1 -1.5 0 0.2 0"),
        'equality constraint "mesh" is a polynomial of higher degree',
    ),
    "nothing": (
        COUPLED.replace('joint1="roll" joint2="pitch" polycoef="0.1 -1.5 0 0 0"', 'joint1="roll" joint2="roll"'),
        "MuJoCo refuses",
    ),
}


@pytest.mark.parametrize("fault", BAD)
def test_constraints_that_no_scene_has_are_refused_with_place_and_remedy(fault, tmp_path):
    text, words = BAD[fault]
    with pytest.raises((ModelError, fm.SceneError), match=re.escape(words)):
        read(text, tmp_path)


SOFTNESS = 1e-4  # of constraints in MuJoCo: its largest impedance is 0.9999
HARD = 'solimp="0.9999 0.9999 0.001 0.5 2"'
INERTIAL = '<inertial pos="0.25 0.02 0" mass="{}" diaginertia="0.01 0.03 0.04"/>'
MODEL = """<mujoco><option gravity="0 0 -9.81" tolerance="0"/><worldbody>
  <body name="crank" euler="0 -60 0"><joint name="a" axis="0 1 0"/>{one}
    <site name="middle" pos="0.2 0 0.1" euler="10 20 30"/>
    <body name="rod" pos="0.5 0 0" euler="0 60 0"><joint name="b" axis="0 1 0"/>{two}<site name="end" pos="0.8 0 0"/>
    </body></body>
  <body name="rocker" pos="0.8 0 0" euler="0 -60 0"><joint name="c" axis="0 1 0"/>{three}
    <site name="tip" pos="0.5 0 0"/></body>
  <body name="box" pos="0.3 0.1 0.6" euler="20 30 40"><freejoint name="f"/>{one}
    <site name="corner" euler="5 6 7"/></body>
</worldbody><equality>{equality}</equality></mujoco>""".replace("{equality}", "%s")
MODEL = MODEL.format(one=INERTIAL.format(1), two=INERTIAL.format(2), three=INERTIAL.format(3))
LOOPS = {
    "connect, bodies": f'<connect name="loop" body1="rod" body2="rocker" anchor="0.8 0 0" {HARD}/>',
    "connect, sites": f'<connect site1="end" site2="tip" {HARD}/>',
    "connect, the world": f'<connect body1="rod" anchor="0.8 0 0" {HARD}/>',
    "weld, bodies": f'<weld name="grip" body1="crank" body2="box" {HARD}/>',
    "weld, an anchor": f'<weld body1="box" body2="crank" anchor="0.1 0.2 0.3" {HARD}/>',
    "both": f'<connect body1="rod" body2="rocker" anchor="0.8 0 0" {HARD}/><weld body1="rod" body2="box" {HARD}/>',
}


@pytest.mark.parametrize("kind", LOOPS)
def test_accelerations_are_those_of_mujoco(kind: str, tmp_path: Path) -> None:
    file = tmp_path / "m.xml"
    file.write_text(MODEL % LOOPS[kind])
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = read_mjcf(file)
    assert any("equality constraints of bodies are exact here" in note for note in found.notes)
    system = fm.compile(found.scene)
    ours = system.accelerations(system.initial_state)
    names = [hinge.name for hinge in found.scene.hinges]
    assert names == ["a", "b", "c", "f"]
    assert relative(ours[:3], data.qacc[:3]) < 50.0 * SOFTNESS
    free = read_mjcf(_without(file)).scene
    apart = fm.compile(free)
    assert relative(apart.accelerations(apart.initial_state)[:3], ours[:3]) > 0.1  # the closure matters


def _without(file: Path) -> Path:
    other = file.with_name("free.xml")
    other.write_text(MODEL % "")
    return other


def test_a_weld_of_sites_moves_the_body_to_where_it_holds_it(tmp_path: Path) -> None:
    """The box starts elsewhere, and the closure brings the sites' frames together, as MuJoCo's constraint would."""
    file = tmp_path / "m.xml"
    file.write_text(MODEL % '<weld site1="middle" site2="corner"/>')
    (closure,) = read_mjcf(file).scene.closures
    assert (closure.type, closure.body_a, closure.body_b) == ("weld", "crank", "box")
    assert closure.position_a_m == pytest.approx((0.2, 0.0, 0.1))
    quaternion = np.zeros(4)
    mujoco.mju_euler2Quat(quaternion, np.deg2rad([5.0, 6.0, 7.0]), "xyz")
    assert closure.quaternion_b == pytest.approx(tuple(quaternion))


def test_inactive_ones_are_left_out_with_a_note(tmp_path: Path) -> None:
    file = tmp_path / "m.xml"
    file.write_text(MODEL % '<connect name="off" body1="rod" body2="rocker" anchor="0.8 0 0" active="false"/>')
    found = read_mjcf(file)
    assert found.scene.closures == () and "inactive equality constraints are left out: off" in found.notes
