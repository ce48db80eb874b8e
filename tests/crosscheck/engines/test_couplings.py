"""Couplings in other codes: in Pinocchio and OpenSim to rounding, in MuJoCo softly, elsewhere refused by name."""

import msgspec
import numpy as np
import pytest

import flexmb as fm
from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.registry import BUILT_IN, engine
from flexmb.scene.build import angular
from flexmb.scene.schema import Scene
from tests.crosscheck.engines.peers import off
from tests.trees import with_armatures


def machine(driven: bool = True) -> Scene:
    """A turntable with two arms and a slide: relations of three angles, of a rack, and of angles and a displacement.

    Its initial values fulfil them, for peers begin there; `driven`: the turntable is prescribed.
    """
    motion = fm.Sine(amplitude=0.4, angular_frequency_rad_s=3.0)
    scene = fm.SceneBuilder("machine", gravity=(0.3, -0.2, -9.81))
    scene.rigid_body("table", mass=4.0, com=(0.1, 0.0, 0.05), inertia=np.diag([0.4, 0.5, 0.6]))
    for name in ("arm", "hand", "slide"):
        scene.rigid_body(name, mass=1.0, com=(0.2, 0.05, -0.1), inertia=np.diag([0.02, 0.05, 0.06]))
    turn = {"prescribed": motion} if driven else {"rate": 1.2}
    scene.revolute("turn", "ground", "table", axis=(0, 0, 1), **turn)
    scene.universal("shoulder", "table", "arm", parent_position=(0.5, 0, 0.1),
                    first=angular(angle=0.3, rate=0.8),
                    second=angular(angle=0.05, rate=1.5 * 1.2 - 15.0 * 0.08))  # fmt: skip
    scene.revolute("wrist", "arm", "hand", axis=(0, 0.6, 0.8), parent_position=(0.4, 0, 0), angle=0.2, stiffness=3.0,
                   rate=0.2 * 1.2 - 0.5 * 0.8)  # fmt: skip
    scene.prismatic("rail", "table", "slide", axis=(0.6, 0.8, 0), position=0.03, rate=0.1 * 0.8)
    scene.coupling("three", "wrist", {"turn": 0.2, ("shoulder", "first"): -0.5}, offset=0.35)
    scene.coupling("rack", "rail", {("shoulder", "first"): 0.1})
    scene.coupling("cross", "shoulder", {"turn": 1.5, "rail": -15.0}, coordinate="second", offset=0.5)
    return scene.marker("tip", "hand", offset=(0.3, 0.0, 0.1)).scene()


@pytest.mark.parametrize(("name", "armed"), [("pinocchio", True), ("pinocchio", False), ("opensim", False)])
@pytest.mark.parametrize("driven", [True, False])
def test_the_first_instant(driven, name, armed):
    """`armed`: coordinates have armatures too, as the motors behind gears do."""
    pytest.importorskip(name)
    scene = with_armatures(machine(driven), 3) if armed else machine(driven)
    assert CheckedEngine(engine(name)).supports(scene).kind == "exact"
    ours, theirs = (engine(each).compile(scene).evaluate() for each in ("native", name))
    tips = [{"tip": each.markers["tip"].acceleration} for each in (ours, theirs)]
    assert off(*tips) <= 1e-12
    assert off(ours.loads, theirs.loads) <= 1e-12
    assert {"three", "rack", "cross"} <= set(theirs.loads)
    if driven:
        assert off(ours.drives, theirs.drives) <= 1e-12


@pytest.mark.parametrize("name", ["pinocchio", "opensim"])
def test_over_time(name):
    pytest.importorskip(name)
    scene, run = machine(True), Run(np.linspace(0.0, 0.5, 6))
    ours = engine("native").compile(scene).simulate(run, Effort("tolerance", 1e-11, "dop853"))
    theirs = engine(name).compile(scene).simulate(run, Effort("tolerance", 1e-11, "DOP853"))
    assert np.max(np.abs(ours.markers["tip"].position - theirs.markers["tip"].position)) <= 1e-9
    assert off(ours.loads, theirs.loads) <= 1e-8
    assert np.max(np.abs(ours.work - theirs.work)) <= 1e-8 * np.max(np.abs(ours.work))


def test_pinocchio_would_notice_a_wrong_ratio():
    """Negative control: a ratio that is wrong by a millionth."""
    pytest.importorskip("pinocchio")
    scene = machine(False)
    first = scene.couplings[0]
    terms = tuple(msgspec.structs.replace(term, ratio=term.ratio * (1.0 + 1e-6)) for term in first.terms)
    wrong = msgspec.structs.replace(
        scene, couplings=(msgspec.structs.replace(first, terms=terms), *scene.couplings[1:])
    )
    ours, theirs = (engine("pinocchio").compile(each).evaluate() for each in (scene, wrong))
    assert off(ours.loads, theirs.loads) > 1e-9


def test_mujoco_keeps_them_softly():
    """Loads along the same axes with the same signs, and relations that open by a thousandth; the reason is named."""
    pytest.importorskip("mujoco")
    support = CheckedEngine(engine("mujoco")).supports(machine(True))
    assert support.kind == "surrogate" and "couplings are springs and dampers" in support.reason
    run, loads = Run(np.linspace(0.0, 0.1, 6)), ("three", "rack", "cross")
    for driven in (True, False):
        ours = engine("native").compile(machine(driven)).simulate(run, Effort("tolerance", 1e-10, "dop853"))
        theirs = engine("mujoco").compile(machine(driven)).simulate(run, Effort("step", 1e-3, "RK4"))
        gone = np.max(np.abs(ours.markers["tip"].position - ours.markers["tip"].position[0]))
        assert np.max(np.abs(ours.markers["tip"].position - theirs.markers["tip"].position)) <= 0.05 * gone
        for name in loads:
            one, other = ours.loads[name][0], theirs.loads[name][0]
            assert one @ other >= 0.999 * np.linalg.norm(one) * np.linalg.norm(other) > 0.0


@pytest.mark.parametrize("name", [name for name in BUILT_IN if not name.startswith("native")])
def test_others_refuse_them_by_name(name):
    support = CheckedEngine(engine(name)).supports(machine(False))
    assert support.kind == {"pinocchio": "exact", "opensim": "exact", "mujoco": "surrogate"}.get(name, "no")
    alone = engine(name).supports(machine(False))
    assert alone.kind == support.kind
    assert alone.kind != "no" or any(word in alone.reason for word in ("three", "with a beam", "with one beam"))


def test_frischs_equations_refuse_them():
    assert engine("native-frisch").supports(machine(False)).kind == "no"
