"""Connect and weld of MJCF models as closures, against MuJoCo with constraints as hard as it allows."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import flexmb as fm
from flexmb.interchange.mjcf import read_mjcf
from tests.bounds import relative

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
