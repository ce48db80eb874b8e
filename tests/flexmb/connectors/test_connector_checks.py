"""What is wrong with a connector is said before anything runs, with place and remedy; files keep what they hold."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.scene import files
from flexmb.scene.check.connectors import friction_peak
from tests.flexmb.connectors.connected_scenes import everything, free_flying


def builder() -> fm.SceneBuilder:
    made = fm.SceneBuilder("two")
    for name in "abc":
        made.rigid_body(name, mass=1.0, inertia=(1, 1, 1))
    made.revolute("pivot", "ground", "a").cylindrical("sleeve", "a", "b")
    made.wheel("wheel", "b", axis=(0, 0, 1), mass=0.1, axial_inertia=1e-3, transverse_inertia=1e-3)
    return made.universal("cross", "b", "c")


WRONG = {
    "negative damping": (lambda b: b.spring_damper("s", "a", "b", damping=-1.0), "negative damping"),
    "negative stiffness": (lambda b: b.spring_damper("s", "a", "b", stiffness=-1.0), "negative stiffness"),
    "no such body": (lambda b: b.spring_damper("s", "a", "x", stiffness=1.0), 'no body "x"'),
    "no such node": (lambda b: b.spring_damper("s", "a", "b", node_b="tip"), 'no node "tip"'),
    "one point": (lambda b: b.spring_damper("s", "a", "a", stiffness=1.0), "both ends are one point"),
    "ground to ground": (lambda b: b.spring_damper("s", "ground", "ground", position_a=(1, 0, 0)), "on the ground"),
    "law twice": (
        lambda b: b.spring_damper("s", "a", "b", stiffness=1.0, table=(0.0, 1.0), loads=(0.0, 1.0)), "given twice",
    ),
    "short table": (lambda b: b.spring_damper("s", "a", "b", table=(0.0,), loads=(0.0,)), "1 places and 1 loads"),
    "unsorted table": (lambda b: b.spring_damper("s", "a", "b", table=(1.0, 0.0), loads=(0.0, 1.0)), "do not increase"),
    "too high a degree": (lambda b: b.spring_damper("s", "a", "b", stiffening=(1.0,) * 5), "degree 6"),
    "one-sided table": (
        lambda b: b.spring_damper("s", "a", "b", table=(0.0, 1.0), loads=(0.0, 1.0), acts="tension"), "in tension only",
    ),
    "asymmetric": (lambda b: b.bushing("s", "a", "b", stiffness=np.triu(np.ones((6, 6)))), "not symmetric"),
    "negative matrix": (lambda b: b.bushing("s", "a", "b", stiffness=-np.eye(6)), "negative along some displacement"),
    "no such hinge": (lambda b: b.angular_spring("s", "piv", stiffness=1.0), 'no hinge, point mass or wheel "piv"'),
    "not an angle": (lambda b: b.linear_spring("s", "pivot", stiffness=1.0), "has no displacement"),
    "which angle": (lambda b: b.angular_spring("s", "cross", stiffness=1.0), "more than one angle, first, second"),
    "spring on a wheel": (lambda b: b.angular_spring("s", "wheel", stiffness=1.0), "only angular_friction"),
    "stops without stiffness": (lambda b: b.angular_spring("s", "pivot", upper=1.0), "no stiffness"),
    "stops crossed": (
        lambda b: b.angular_spring("s", "pivot", lower=1.0, upper=0.0, stop_stiffness=1.0), "leave nothing between",
    ),
    "negative smoothing": (lambda b: b.angular_friction("s", "pivot", sliding=1.0, smoothing=-0.1), "smoothing speed"),
    "static alone": (
        lambda b: b.angular_friction("s", "pivot", sliding=1.0, static=2.0, smoothing=0.1), "belong together",
    ),
    "static below sliding": (
        lambda b: b.angular_friction("s", "pivot", sliding=1.0, static=0.5, stribeck=0.1, smoothing=0.1), "is below",
    ),
    "name taken": (lambda b: b.angular_friction("pivot", "pivot", sliding=1.0, smoothing=0.1), "duplicate name"),
    "not a number": (lambda b: b.spring_damper("s", "a", "b", stiffness=float("nan")), "nan"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_refused(name):
    add, message = WRONG[name]
    with pytest.raises(fm.SceneError, match=message) as refused:
        add(builder()).scene()
    problem = refused.value.problems[0]
    assert problem.where.startswith("$.connectors[0]") and problem.remedy


def test_what_is_right_passes():
    made = builder().angular_spring("s", "cross", coordinate="second", stiffness=-1.0, stiffening=(0.0, 2.0))
    made.angular_friction("f", "wheel", sliding=0.1, smoothing=0.1).linear_spring("t", "sleeve", stiffness=2.0)
    fm.compile(made.scene())


@pytest.mark.parametrize("scene", [everything(), free_flying()], ids=["everything", "free flying"])
def test_to_a_file_and_back(scene):
    assert files.loads(files.dumps(scene)) == scene


def test_other_names_are_refused():
    with pytest.raises(TypeError, match=r'spring_damper\(\) has no argument "stifness"'):
        builder().spring_damper("s", "a", "b", stifness=1.0)


def smoothed(sliding, static, stribeck, smoothing):
    return builder().angular_friction(
        "s", "pivot", sliding=sliding, static=static, stribeck=stribeck, smoothing=smoothing
    ).scene()


def law(v, sliding, static, stribeck, smoothing):
    """Hess and Soom as the page has it, written anew."""
    return (sliding + (static - sliding) / (1.0 + (v / stribeck) ** 2)) * v / np.hypot(v, smoothing)


LAWS = [
    (1.0, 1.5, 0.05, 0.01), (0.0, 1.0, 0.05, 0.01), (0.9, 1.0, 0.05, 0.2), (0.5, 1.0, 0.05, 0.5),
    (1.0, 1.5, 0.05, 2e-4), (0.4, 0.6, 0.3, 0.05),
]  # fmt: skip


@pytest.mark.parametrize("numbers", LAWS)
def test_the_peak_of_smoothed_friction_is_that_of_the_law(numbers):
    """A maximum over a million speeds, which knows nothing of derivatives."""
    found = friction_peak(*numbers)[1]
    assert found == pytest.approx(np.max(law(np.geomspace(1e-6, 1e6, 1_000_001), *numbers)), rel=1e-6)


def test_friction_that_smoothing_weakens_is_doubtful_with_figures_that_mend_it():
    (doubt,) = fm.check_scene(smoothed(1.0, 1.5, 0.05, 0.01))
    assert doubt.waiver == "friction_peak" and "86.7%" in doubt.what and "1.301" in doubt.what
    most = float(doubt.remedy.split("smoothing of ")[1].split()[0])
    assert not fm.check_scene(smoothed(1.0, 1.5, 0.05, 0.95 * most))
    assert fm.check_scene(smoothed(1.0, 1.5, 0.05, 1.1 * most))
    assert not fm.check_scene(smoothed(1.0, 1.0, 0.05, 0.01))
    assert not fm.check_scene(msgspec.structs.replace(smoothed(1.0, 1.5, 0.05, 0.01), allow=("friction_peak",)))


def test_a_load_above_the_peak_runs_away_and_one_below_it_creeps():
    """0.948 of the static load: the page's formula says 0.03 m/s, which the smoothed law does not have."""

    def gone(load):
        made = fm.SceneBuilder("block").rigid_body("block", mass=1.0, inertia=(1.0, 1.0, 1.0))
        made.prismatic("rail", "ground", "block", axis=(1, 0, 0))
        made.linear_friction("guide", "rail", sliding=1.0, static=1.5, stribeck=0.05, smoothing=0.01)
        made.force("push", "block", direction=(1, 0, 0), function=fm.Constant(value=load))
        with pytest.warns(fm.SceneWarning, match="runs away"):
            return fm.simulate(made.scene(), 10.0, samples=2).q[-1, 0]

    peak = friction_peak(1.0, 1.5, 0.05, 0.01)[1]
    assert gone(0.948 * 1.5) > 10.0 and gone(1.01 * peak) > 1.0
    assert gone(0.99 * peak) < 0.3
