"""Which bodies of a scene are appendages, and the command that compares them."""

from __future__ import annotations

import numpy as np
import pytest
from typer.testing import CliRunner

import flexmb as fm
from flexmb.cli import app
from flexmb.frisch.equivalence.appendage import appendage, appendage_of, with_modes
from flexmb.modal.flexible import flexible_model
from flexmb.scene import schema as s
from flexmb.scene.shapes import beam_section
from tests.bounds import gamma, relative
from tests.flexmb.frisch import exact
from tests.flexmb.modal.beam_references import beam

STRIP = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=8e-10, Iz=4e-10, rho=2700.0)


def gyrostat(child_node: str = "origin", boundary: str = "clamped-free") -> fm.SceneBuilder:
    """A hub with a panel."""
    return (
        fm.SceneBuilder("gyrostat")
        .rigid_body("hub", mass=10.0, inertia=(1.0, 1.0, 1.0))
        .beam("panel", length=1.0, elements=4, section=STRIP, modes=s.Modes(count=3, boundary=boundary))
        .free("flight", "ground", "hub")
        .weld("mount", "hub", "panel", child_node=child_node)
    )


def test_a_beam_is_an_appendage_with_as_many_modes_as_wanted():
    scene = gyrostat().scene()
    assert appendage_of(scene, "panel", 5).mode_count == 5
    body = appendage_of(scene, "panel")
    assert body.mode_count > 20
    assert np.all(np.diff(body.frequencies) > 0.0)
    assert relative(body.parameters.M1, body.parameters.mass * np.eye(body.mode_count)) <= gamma(10_000)


def test_modal_bodies_have_the_modes_they_were_given_in_order_of_frequency():
    model = flexible_model(beam(4, 4))
    shuffled = with_modes(model, np.array([2, 0, 3, 1]))
    body = appendage(shuffled)
    assert body.frequencies**2 == pytest.approx(np.diag(model.stiffness), rel=1e-12)
    two = appendage(with_modes(model, np.array([0, 1])))
    assert relative(two.parameters.A, body.parameters.A[:2]) <= gamma(100)


def test_rigid_inertia_is_that_about_the_clamp():
    body = exact.random_body(0)
    expected = exact.mass_matrix(body, np.zeros(3))[3:, 3:]
    assert relative(appendage(body).rigid_inertia, expected) <= exact.rounding(body)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda b: b.rigid_body("tip", mass=1.0, inertia=(1.0, 1.0, 1.0)).weld("end", "panel", "tip"), 'hinge "end"'),
        (lambda b: b.point_mass("bead", "panel", mass=0.1), 'point mass "bead"'),
        (
            lambda b: b.wheel(
                "spin", "panel", axis=(1, 0, 0), mass=0.1, axial_inertia=1e-3, transverse_inertia=6e-4, node="tip"
            ),
            'wheel "spin"',
        ),
    ],
)
def test_bodies_inside_the_tree_are_refused(change, message):
    with pytest.raises(ValueError, match=f'body "panel" carries {message}'):
        appendage_of(change(gyrostat()).scene(), "panel")


@pytest.mark.parametrize(
    ("scene", "body", "message"),
    [
        (gyrostat(), "wing", 'no flexible body "wing": use one of: panel'),
        (gyrostat(), "hub", 'body "hub" is rigid'),
        (gyrostat(child_node="tip"), "panel", 'hinge "mount" is at its node "tip"'),
        (gyrostat(boundary="free-free"), "panel", "its modes are free-free"),
    ],
)
def test_what_cannot_be_compared_is_refused(scene, body, message):
    with pytest.raises(ValueError, match=message):
        appendage_of(scene.scene(), body)


def test_appendages_without_modes_or_stiffness_are_refused():
    model = flexible_model(beam(4, 2))
    with pytest.raises(ValueError, match="sail: a rigid body has no modes"):
        appendage(with_modes(model, np.arange(0)), "sail")
    slack = exact.random_body(0)
    slack.stiffness[:] = 0.0
    with pytest.raises(ValueError, match="sail: mode 1 has no stiffness"):
        appendage(slack, "sail")
    with pytest.raises(ValueError, match="at least one mode"):
        appendage_of(gyrostat().scene(), "panel", 0)


def invoke(*words: object):
    return CliRunner().invoke(app, ["equivalence", *(str(word) for word in words)], env={"COLUMNS": "160"})


def test_command_prints_tables_and_writes_a_picture(tmp_path):
    scene, picture = tmp_path / "scene.toml", tmp_path / "out" / "panel.png"
    fm.save_scene(gyrostat().scene(), scene)
    result = invoke(scene, "panel", "--axis", "y", "--axis", "0,0,1", "--point", "0.2,0,0", "-o", picture)
    assert result.exit_code == 0, result.output
    assert picture.stat().st_size > 10_000
    equations = ("(149)", "(150)", "(151)", "(47)", "(49)", "(159)", "(160)")
    for word in (*equations, "best hinge", "given hinge", "Modes needed for 5 %", "rigid"):
        assert word in result.output, word


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("hub",), "is rigid"),
        (("panel", "--axis", "up"), "--axis is x, y, z or three numbers"),
        (("panel", "--point", "1,2"), "--point is"),
        (("panel", "--mode", "99"), "it has modes 1 to"),
        (("panel", "--accuracy", "5"), "a fraction between 0 and 1"),
    ],
)
def test_command_says_what_is_wrong(tmp_path, words, message):
    fm.save_scene(gyrostat().scene(), tmp_path / "scene.toml")
    result = invoke(tmp_path / "scene.toml", *words)
    assert result.exit_code == 2
    assert message in result.output
    assert "Traceback" not in result.output
