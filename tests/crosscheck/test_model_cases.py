"""Scenes and robots without a case folder: what is written for them, and what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import flexmb as fm
from crosscheck import cli
from crosscheck.library.case_error import CaseError
from crosscheck.library.find import load_case
from crosscheck.library.model_case import is_model, scene_of, write_case
from crosscheck.running.installed import partner_of

URDF = """<robot name="a b"><link name="base"/><link name="arm"><inertial><origin xyz="0.1 0 -0.5"/><mass value="1"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.01"/></inertial></link><link name="tool0"/>
<joint name="j" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint>
<joint name="t" type="fixed"><parent link="arm"/><child link="tool0"/><origin xyz="0 0 -1"/></joint></robot>"""


def robot(folder: Path) -> Path:
    (folder / "robot.urdf").write_text(URDF)
    return folder / "robot.urdf"


def test_a_robot_becomes_a_case_with_markers_at_the_bodies_that_move(tmp_path):
    scene, notes = scene_of(robot(tmp_path))
    assert notes == ("links without inertia are bodies without mass: base, tool0",)
    write_case(scene, tmp_path / "cases" / "robot", ("native", "pinocchio"), 5.0, 11)
    case = load_case(tmp_path / "cases" / "robot")
    assert [marker.name for marker in scene.markers] == ["arm", "tool0"]
    assert (case.name, case.run.title, case.run.duration_s, case.run.samples) == ("cases/robot", "a b", 5.0, 11)
    assert case.run.comparisons[0].goals == {"marker": 1e-6, "energy": 1e-6, "load": 1e-5}
    assert case.run.charts[0].observable == "marker:tool0.position"
    assert case.scene(case.run.variants[0]) == scene


def test_a_scene_keeps_its_markers_and_files_lie_where_they_lay(tmp_path):
    rod = (
        fm.SceneBuilder("swing")
        .rigid_body("rod", mass=1.0, inertia=(0.1, 0.1, 0.1))
        .rigid_body("bob", mass=1.0, inertia=(0.1, 0.1, 0.1))
    )
    rod.revolute("j", "ground", "rod").weld("w", "rod", "bob")
    rod.marker("bob", "rod").marker("far", "bob", offset=(1, 0, 0))
    fm.save_scene(rod.scene(), tmp_path / "swing.toml")
    scene, _ = scene_of(tmp_path / "swing.toml")
    assert [(marker.name, marker.body) for marker in scene.markers] == [
        ("bob", "rod"), ("far", "bob"), ("bob frame", "bob")
    ]  # fmt: skip


def test_the_partner_is_a_code_that_can_represent_the_scene():
    beam = fm.SceneBuilder("s").rigid_body("b", mass=1.0, inertia=(1, 1, 1)).revolute("j", "ground", "b").scene()
    assert partner_of(beam, ["native", "exudyn-beam", "basilisk", "pinocchio"]) == "pinocchio"
    assert partner_of(beam, ["native", "a plug-in"]) == "native-radau5"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("robot.urdf",), "needs --t-end in s"),
        (("robot.urdf", "--t-end", "0"), "above zero"),
        (("robot.urdf", "--t-end", "nan"), "above zero"),
        (("robot.urdf", "--t-end", "1", "--samples", "1"), "2 to 100000 --samples"),
        (("nowhere.urdf", "--t-end", "1"), "No such file"),
        (("robot.urdf", "canonical", "--t-end", "1"), "cases and models are run one after the other"),
        (("robot.urdf", "other/robot.toml", "--t-end", "1"), "two models have the same name"),
        (("canonical", "--t-end", "1"), "a case has its own duration"),
        (("bad.toml", "--t-end", "1"), "bad.toml"),
    ],
)
def test_what_cannot_be_run_is_refused_before_anything_runs(words, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    robot(tmp_path)
    (tmp_path / "bad.toml").write_text("name = 3")
    result = CliRunner().invoke(cli.app, ["run", *words, "--out", "o"], env={"COLUMNS": "200"})
    assert result.exit_code == 2, result.output
    assert message in result.output
    assert not (tmp_path / "o").exists()


def test_words_of_cases_are_no_models(tmp_path):
    (tmp_path / "folder.toml").mkdir()
    assert not any(map(is_model, ("canonical", "pendulums/*", str(tmp_path / "folder.toml"), "mine/run.toml")))
    assert all(map(is_model, ("a.urdf", "A.URDF", "b.xml", "c.toml", "d.SID_FEM")))


def test_a_model_that_no_scene_can_be_names_its_file(tmp_path):
    (tmp_path / "r.urdf").write_text("<robot/>")
    with pytest.raises(CaseError, match=r"r\.urdf"):
        scene_of(tmp_path / "r.urdf")


def made(folder: Path, *changes: tuple[str, str]) -> tuple[fm.Scene, tuple[str, ...]]:
    """The scene of the robot with changed text, and the notes."""
    text = URDF
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "changed.urdf").write_text(text)
    return scene_of(folder / "changed.urdf")


def test_impossible_inertia_is_repaired_for_all_codes_and_noted(tmp_path):
    scene, notes = made(tmp_path, ('izz="0.01"', 'izz="0.3"'))
    assert any(note.startswith("impossible inertia tensors were changed by the least amount: arm") for note in notes)
    a, b, c = np.linalg.eigvalsh(scene.bodies[1].inertia_kg_m2)
    assert a + b >= c * (1.0 - 1e-12)
    assert not any("impossible" in note for note in made(tmp_path)[1])


LED = """<link name="led"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="k" type="continuous"><parent link="base"/><child link="led"/>
<mimic joint="j" multiplier="-2"/></joint></robot>"""


def test_a_robot_that_would_rest_begins_with_rates_in_the_proportions_of_its_couplings(tmp_path):
    scene, notes = made(tmp_path, ('"0.1 0 -0.5"', '"0 0 -0.5"'), ("</robot>", LED))
    assert "nothing would move: joints begin at 0.5 rad/s or m/s" in notes
    rates = {hinge.name: hinge.rotation.rate for hinge in scene.hinges if isinstance(hinge, fm.Revolute)}
    assert rates == {"j": 0.5, "k": -1.0}
    state = fm.compile(scene).initial_state
    assert np.allclose(state.u, (0.5, -1.0), rtol=0.0, atol=1e-15)
    falling, notes = made(tmp_path)  # its mass centre is beside the joint: gravity moves it from rest
    assert not any("begin" in note for note in notes) and not np.any(fm.compile(falling).initial_state.u)


def test_a_robot_without_joints_flies_freely_and_one_that_cannot_is_refused(tmp_path):
    scene, notes = made(tmp_path, ("continuous", "fixed"))
    assert "no joint moves: the root link is free, and begins with a spin" in notes
    assert isinstance(scene.hinges[0], fm.Free) and all(scene.hinges[0].angular_velocity_rad_s)
    with pytest.raises(CaseError, match=r"changed\.urdf: no joint moves, .* there is no motion to compare"):
        made(
            tmp_path, ("continuous", "fixed"), ('<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.01"/>', "")
        )


@pytest.mark.slow
def test_a_robot_is_judged_by_the_codes_that_are_installed(tmp_path):
    """With a massless base and tool. (Exudyn's total energy is 2e-10 off, three times what its efforts say.)"""
    words = ["run", str(robot(tmp_path)), "--t-end", "0.5", "--samples", "11", "--out", str(tmp_path / "o"), "-q"]
    result = CliRunner().invoke(cli.app, words)
    assert result.exit_code in (0, 1), result.output
    verdicts = json.loads((tmp_path / "o" / "verdicts.json").read_text())
    others = {"pinocchio", "mujoco"}
    judged = [verdict for verdict in verdicts if verdict["engine_a"] == "native" and verdict["engine_b"] in others]
    assert {each["engine_b"] for each in judged} == others
    assert {each["status"] for each in judged} == {"agree"}
