"""`flexmb import`, `export` and `reduce` as a user runs them: messages, notes, exit codes."""

import pytest
from typer.testing import CliRunner

import flexmb as fm
from flexmb.cli import app
from tests.flexmb.interchange.made_bodies import beam, swinging
from tests.flexmb.interchange.made_robots import arm


def invoke(*words: object):
    return CliRunner().invoke(app, [str(word) for word in words])


def test_a_body_goes_out_and_comes_back(tmp_path):
    fm.save_scene(swinging(beam(points="line"), "root", "tip"), tmp_path / "scene.toml")
    result = invoke("export", tmp_path / "scene.toml", "rod", "--out", tmp_path / "new" / "rod.sid")
    assert result.exit_code == 0, result.output
    result = invoke("import", tmp_path / "new" / "rod.sid", "--out", tmp_path / "rod.toml")
    assert result.exit_code == 0, result.output
    assert "note: Me has a slope" in result.output
    assert fm.load_scene(tmp_path / "rod.toml").bodies[0].boundary == "clamped-free"


def test_a_robot_comes_in_with_notes(tmp_path):
    (tmp_path / "arm.urdf").write_text(arm())
    result = invoke("import", tmp_path / "arm.urdf", "--free-base", "--out", tmp_path / "arm.toml")
    assert result.exit_code == 0, result.output
    assert "note: limits of joints are left out: axis1" in result.output
    assert fm.load_scene(tmp_path / "arm.toml").hinges[0].__class__ is fm.Free


WRONG = {
    "ending": (("import", "robot.step"), "is not a known kind of model"),
    "missing": (("import", "robot.urdf"), "No such file"),
    "mjcf and base": (("import", "robot.xml", "--free-base"), "is for URDF"),
    "rigid": (
        ("export", "scene.toml", "load", "--out", "b.sid"), "is not a flexible body of the scene: use one of: rod",
    ),
    "interface": (("reduce", "K.mtx", "M.mtx", "n.csv", "--interface", "a", "--out", "b.sid"), "numbers of nodes"),
    "range": (("reduce", "K.mtx", "M.mtx", "n.csv", "--interface", "9-1", "--out", "b.sid"), "from the lower to the"),
    "attach": (
        ("reduce", "K.mtx", "M.mtx", "n.csv", "--interface", "1", "--attach", "x", "--out", "b.sid"),
        "--attach is numbers",
    ),
    "tie": (
        ("reduce", "K.mtx", "M.mtx", "n.csv", "--interface", "1", "--mean", "900@1=2", "--out", "b.sid"),
        "--mean is a new",
    ),
    "surface": (
        ("reduce", "K.mtx", "M.mtx", "n.csv", "--interface", "1", "--rigid", "900", "--out", "b.sid"),
        "--rigid is numbers",
    ),
    "out": (("reduce", "K.mtx", "M.mtx", "n.csv", "--interface", "1", "--out", "b.txt"), "neither a SID file"),
    "no matrix": (
        ("reduce", "K.mtx", "M.mtx", "scene.toml", "--interface", "1", "--out", "b.sid"),
        "the header has to be",
    ),
    "format": (("simulate", "scene.toml", "--t-end", "1", "--also", "xls"), "--also is one of npz, parquet, rrd"),
}


@pytest.mark.parametrize("fault", WRONG)
def test_mistakes_are_messages_with_exit_code_2(fault, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fm.save_scene(swinging(beam(), "root", "tip"), "scene.toml")
    words, message = WRONG[fault]
    result = invoke(*words)
    assert result.exit_code == 2, result.output
    assert message in result.output
    assert not (tmp_path / "b.sid").exists()
