"""MJCF files: the scene's accelerations against MuJoCo's own, and what is refused."""

from __future__ import annotations

import os
import re

import numpy as np
import pytest

import flexmb as fm
from flexmb.interchange.imported import ModelError
from tests.bounds import algebra, backward_error
from tests.flexmb.interchange.made_robots import MJCF
from tests.flexmb.interchange.mjcf_motion import compiled, random_motion, read

mujoco = pytest.importorskip("mujoco")


ARMED = MJCF.replace('name="pitch"', 'name="pitch" armature="0.3"').replace(
    'name="reach"', 'name="reach" armature="1.5"'
)


FLYING = ARMED.replace(
    '<freejoint name="float"/>', '<joint type="free" name="float" armature="0.7" stiffness="0" damping="0"/>'
)


def with_actuators(actuators: str) -> str:
    return ARMED.replace("</mujoco>", f"<actuator>{actuators}</actuator></mujoco>")


def flagged(flag: str) -> str:
    return ARMED.replace('gravity="0.3 -0.2 -9.81"/>', f'gravity="0.3 -0.2 -9.81"><flag {flag}="disable"/></option>')


MODELS = {
    "as it is": MJCF,
    "armatures": ARMED,
    "armature of an actuator": with_actuators('<motor joint="pitch" gear="3" armature="0.1"/>'),
    "damping of an actuator": with_actuators('<motor joint="reach" gear="-2" damping="0.7"/>'),
    "two actuators": with_actuators(2 * '<motor joint="roll" gear="0.5" armature="0.2" damping="0.1"/>'),
    "armature of a free joint": FLYING,
    "armature of a free joint without gravity's pull": FLYING.replace('name="trunk"', 'name="trunk" gravcomp="1"'),
    "gravity compensated": ARMED.replace('name="ankle"', 'name="ankle" gravcomp="1"').replace(
        'name="foot"', 'name="foot" gravcomp="-0.3"'
    ),
    "without gravity": flagged("gravity"),
    "without springs": flagged("spring"),
    "without dampers": flagged("damper"),
    "a tendon that measures": ARMED.replace(
        "</mujoco>", '<tendon><fixed range="-1 1"><joint joint="roll" coef="1"/></fixed></tendon></mujoco>'
    ),
}
"""What the reader represents exactly."""


@pytest.mark.parametrize("name", MODELS)
def test_accelerations_and_masses_are_those_of_mujoco(name, tmp_path):
    _held_against(MODELS[name], read(MODELS[name], tmp_path).scene)


def _held_against(text: str, scene: fm.Scene) -> None:
    """Accelerations and mass matrix of MuJoCo's model of the text, at a random state, are those of the scene."""
    model, data, system = compiled(text, scene)
    (q, u), theirs = random_motion(model, data, system)
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    state, to_theirs = system.state(q, u, 0.0), theirs.turned @ np.eye(system.nu)[theirs.order]
    found = to_theirs @ system.accelerations(state) + theirs.swept
    terms = np.abs(M) @ np.abs(data.qacc) + np.abs(data.qfrc_bias) + np.abs(data.qfrc_passive)
    bound = algebra(system.nu, 6)
    assert backward_error(M, found, M @ data.qacc, terms) < bound
    ours, expected = system.mass_matrix(state), to_theirs.T @ M @ to_theirs
    assert np.max(np.abs(ours - expected)) < bound * np.max(np.abs(expected))


def test_the_armature_of_a_free_joint_is_told_and_matters(tmp_path):
    found = read(FLYING, tmp_path)
    assert "armatures of free joints are mass and inertia without weight: float" in found.notes
    with pytest.raises(AssertionError):
        _held_against(FLYING, read(ARMED, tmp_path).scene)


def test_limits_and_friction_become_connectors(tmp_path):
    text = MJCF.replace('name="pitch"', 'name="pitch" limited="true" range="-0.5 0.4" ref="0.1" frictionloss="0.4"')
    without, found = read(text, tmp_path), read(text, tmp_path, stop_stiffness=50.0, smoothing=1e-3)
    assert any("pitch" in note and note.endswith("(--stop-stiffness makes them stops)") for note in without.notes)
    assert any("pitch" in note and note.endswith("(--smoothing makes it a connector)") for note in without.notes)
    assert not any("pitch" in note for note in found.notes if "limits" in note or "friction" in note)
    made = {each.name: each for each in found.scene.connectors}
    stop, friction = made["pitch.stops"], made["pitch.friction"]
    assert (stop.lower_rad, stop.upper_rad) == pytest.approx((-0.6, 0.3))  # beside `ref`
    assert (stop.stop_stiffness_Nm_rad, friction.sliding_Nm, friction.smoothing_rad_s) == (50.0, 0.4, 1e-3)


def test_armatures_are_read_as_they_are(tmp_path):
    """Negative control of the comparison above: without them the mass matrix is another."""
    hinges = {hinge.name: hinge for hinge in read(MODELS["armature of an actuator"], tmp_path).scene.hinges}
    assert hinges["pitch"].rotation.armature_kg_m2 == pytest.approx(0.3 + 3.0**2 * 0.1, rel=1e-15)
    assert hinges["reach"].translation.armature_kg == 1.5
    assert hinges["roll"].rotation.armature_kg_m2 == 0.0
    with pytest.raises(AssertionError):
        _held_against(MODELS["armature of an actuator"], read(ARMED, tmp_path).scene)


def test_what_is_left_out_is_said(tmp_path):
    text = MODELS["a tendon that measures"].replace("</mujoco>", '<actuator><motor joint="roll"/></actuator></mujoco>')
    notes = " | ".join(read(text.replace('name="pitch"', 'name="pitch" frictionloss="0.1"'), tmp_path).notes)
    for words in (
        "contacts", "actuators of tendons are left out: tendon 0", "limits of joints are left out: tail.joint 5",
        "dry friction is left out: pitch", "1 actuators",
        "count from the reference position, not from zero: tail",
    ):  # fmt: skip
        assert words in notes


BAD = {
    "armature of a ball": (
        MJCF.replace('name="ball"', 'name="ball" armature="0.1"'),
        'the ball joint "ball" has the armature 0.1',
    ),
    "armature at a tendon": (
        MJCF.replace(
            "</mujoco>",
            '<tendon><fixed name="t"><joint joint="roll" coef="1"/></fixed></tendon>'
            '<actuator><motor name="m" tendon="t" armature="0.1"/></actuator></mujoco>',
        ),
        'actuator "m" has armature',
    ),
    "armature at a ball": (with_actuators('<motor joint="ball" damping="0.1"/>'), 'actuator "actuator 0" has damping'),
    "powers of an actuator": (with_actuators('<motor joint="roll" damping="0 0.1"/>'), 'actuator "actuator 0" has da'),
    "powers of a damper": (MJCF.replace('name="pitch"', 'name="pitch" damping="0 1"'), 'joint "pitch" has a nonlinear'),
    "powers of a spring": (MJCF.replace('stiffness="3"', 'stiffness="3 1"'), 'joint "roll" has a nonlinear'),
    "yield": (MJCF.replace('stiffness="3"', 'stiffness="3" springyield="0.1"'), 'joint "roll" has a nonlinear'),
    "tendon": (
        MODELS["a tendon that measures"].replace("<fixed range", '<fixed stiffness="1" range'),
        'tendon "0" has stiffness',
    ),
    "fluid": (MJCF.replace("<option", '<option density="1.2"'), "no fluid"),
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
