"""What is wrong with feedback is found before anything runs, with its place and its remedy."""

from __future__ import annotations

from typing import Any

import pytest

import flexmb as fm
from tests.flexmb.control.scenes import rotor, tossed


def law(**more: Any) -> fm.StateSpace:
    """A controller of one input and one output."""
    return fm.StateSpace(**({"name": "law", "inputs": ("angle",), "D": ((-1.0,),)} | more))


def pid(**more: Any) -> fm.Pid:
    """Likewise."""
    return fm.Pid(**({"name": "law", "inputs": ("angle",), "kp": 1.0} | more))


FELT = fm.MarkerSensor(name="felt", marker="rim", quantity="acceleration")

WRONG = [
    ((law(inputs=("angel",)),), "$.controllers[0].inputs[0]", 'did you mean "angle"?'),
    ((law(inputs=("angle[1]",)),), "$.controllers[0].inputs[0]", "its numbers are 0 to 0"),
    ((law(inputs=("angle[",)),), "$.controllers[0].inputs[0]", 'write "name"'),
    ((law(name="first", inputs=("law",)), law()), "$.controllers[0].inputs[0]", "before those that read it"),
    ((law(name="angle"),), '$.controllers[0].name (controller "angle")', "rename one of the two"),
    ((law(period_s=0.0),), "$.controllers[0].period_s", "give a positive one"),
    ((law(delay_s=0.1),), "$.controllers[0].delay_s", "give its period_s too"),
    ((law(period_s=0.1, delay_s=-0.1),), "$.controllers[0].delay_s", "not negative"),
    ((law(D=((-1.0, 0.0),)),), "$.controllers[0].D[0]", "give 1: one for each"),
    ((law(A=((-1.0,),)),), "$.controllers[0].B", "give 1: A is 1 x 1"),
    ((law(D=()),), "$.controllers[0]", "give C, D or both"),
    ((law(initial=(1.0,)),), "$.controllers[0].initial", "leave it out"),
    ((pid(kd=1.0),), "$.controllers[0].filter_s", "give filter_s"),
    ((pid(lower=1.0, upper=0.0),), "$.controllers[0].lower", "exchange the two"),
    ((pid(tracking_s=0.0),), "$.controllers[0].tracking_s", "positive"),
    ((FELT, law(inputs=("felt[0]",))), "$.controllers[0].inputs[0]", "give the controller a period_s"),
    ((FELT, fm.Saturation(name="law", inputs=("felt[0]",), lower=0.0, upper=1.0)), "algebraic loop", "period_s"),
    ((fm.Saturation(name="law", inputs=("angle",), lower=1.0, upper=0.0),), "$.controllers[0].lower", "exchange"),
    ((fm.GainTable(name="law", inputs=("angle",), points=(1.0, 0.0), values=(0.0, 0.0)),), "points", "sort them"),
    ((fm.GainTable(name="law", inputs=("angle",), points=(1.0,), values=()),), "values", "one value for each point"),
    ((fm.UserLaw(name="law", inputs=(), function="law"),), "$.controllers[0].function", "package.module:function"),
    ((fm.UserLaw(name="law", inputs=(), function="a:b", outputs=0),), "$.controllers[0].outputs", "1 to 10000"),
    ((fm.CoordinateSensor(name="other", of="pivvot"), law()), "$.sensors[2].of", 'did you mean "pivot"?'),
    ((fm.MarkerSensor(name="other", marker="edge", quantity="position"), law()), "$.sensors[2].marker", "rim"),
    ((fm.LoadSensor(name="other", hinge="pivott"), law()), "$.sensors[2].hinge", 'did you mean "pivot"?'),
    ((fm.ProfileSensor(name="other", function=fm.ControlSignal(source="law")), law()), "$.sensors[2].function", "take"),
]  # fmt: skip


@pytest.mark.parametrize(("parts", "where", "remedy"), WRONG)
def test_defects_are_named(parts: Any, where: str, remedy: str) -> None:
    with pytest.raises(fm.SceneError) as caught:
        rotor(*parts)
    assert where in str(caught.value)
    assert remedy in str(caught.value)


def test_signals_name_one_output_of_a_controller() -> None:
    wide = fm.StateSpace(name="law", inputs=("speed",), D=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    speed = fm.MarkerSensor(name="speed", marker="tip", quantity="velocity")
    builder = tossed(speed, wide).force("f", "hub", direction=(1, 0, 0), function=fm.ControlSignal(source="law"))
    with pytest.raises(fm.SceneError, match=r'say which: "law\[0\]"'):
        builder.scene()
    builder = tossed(speed, wide).force("f", "hub", direction=(1, 0, 0), function=fm.ControlSignal(source="low[0]"))
    with pytest.raises(fm.SceneError, match='did you mean "law"'):
        builder.scene()


def test_a_controller_prescribes_no_motion() -> None:
    builder = (
        fm.SceneBuilder("led").rigid_body("disc", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .revolute("pivot", "ground", "disc", prescribed=fm.ControlSignal(source="law"))
        .add(fm.TimeSensor(name="angle"), law())
    )  # fmt: skip
    with pytest.raises(fm.SceneError, match="cannot prescribe a motion"):
        builder.scene()


def test_an_accelerometer_may_be_sampled_or_filtered() -> None:
    rotor(FELT, law(inputs=("felt[0]",), period_s=0.1))
    rotor(FELT, law(inputs=("felt[1]",), A=((-1.0,),), B=((1.0,),), C=((1.0,),), D=()))
