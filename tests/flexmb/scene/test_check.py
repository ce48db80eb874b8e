"""Every kind of bad scene is refused, naming place and remedy; every doubtful one runs, with a warning. So is
feedback."""

from __future__ import annotations

import json
import warnings
from copy import deepcopy
from dataclasses import replace
from typing import Any, get_args

import msgspec
import pytest

import flexmb as fm
from flexmb.scene import schema as s
from flexmb.scene.check import SceneError, SceneWarning, check_and_warn, check_scene
from flexmb.scene.convert import plain, to_struct
from flexmb.scene.files import dumps, loads
from flexmb.scene.problems import Doubt, in_short
from flexmb.system.watches import WAIVERS
from tests.flexmb.control.scenes import rotor, tossed
from tests.flexmb.scene.bad_scenes import BAD, DOUBTFUL, ORPHANING, satellite


@pytest.fixture(scope="module")
def good() -> dict:
    return json.loads(json.dumps(plain(satellite().scene(t_end=5.0))))


def test_the_good_scene_is_good(good):
    assert check_scene(to_struct(good, s.Scene), t_end=5.0) == ()
    assert check_scene(to_struct(good, s.Scene)) == ()


@pytest.mark.parametrize("name", BAD)
def test_a_bad_scene_is_refused_with_place_and_remedy(good, name):
    """The defect put in is reported, at its place, and nothing else."""
    mutate, *fragments = BAD[name]
    data = deepcopy(good)
    mutate(data)
    with pytest.raises(SceneError) as error:
        check_scene(to_struct(data, s.Scene), t_end=5.0)
    assert len(error.value.problems) == (2 if name in ORPHANING else 1), str(error.value)
    problem = error.value.problems[0]
    _says(problem, *fragments)
    assert str(problem) in str(error.value)


@pytest.mark.parametrize("name", DOUBTFUL)
def test_a_doubtful_scene_is_warned_of_until_it_is_waived(good, name):
    """With place, remedy and the word that waives it; no other word does."""
    mutate, *fragments, waiver = DOUBTFUL[name]
    data = deepcopy(good)
    mutate(data)
    scene = to_struct(data, s.Scene)
    (doubt,) = check_scene(scene, t_end=5.0)
    assert doubt.waiver == waiver
    _says(doubt, *fragments)
    assert f'allow = ["{waiver}"]' in str(doubt)
    with pytest.warns(SceneWarning, match=waiver):
        check_and_warn(scene)
    others = tuple(word for word in get_args(s.Waiver) if word != waiver)
    assert check_scene(msgspec.structs.replace(scene, allow=others)) == (doubt,)
    waived = msgspec.structs.replace(scene, allow=(waiver,))
    assert loads(dumps(waived)) == waived
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_and_warn(waived)


def test_every_waiver_is_needed_by_something():
    """What motions exceed is known when there is one (tests/flexmb/levels/test_watches.py)."""
    assert {waiver for *_, waiver in DOUBTFUL.values()} | set(WAIVERS) == set(get_args(s.Waiver))


def test_an_unknown_waiver_is_refused(good):
    with pytest.raises(SceneError, match="allow"):
        to_struct(good | {"allow": ["everything"]}, s.Scene)


def test_a_defect_is_an_error_whatever_is_waived(good):
    """Doubts do not hide defects, not even those that are looked for last."""
    data = deepcopy(good)
    DOUBTFUL["stiffness in kN"][0](data)
    BAD["gimbal lock at the start, a hinge beyond"][0](data)
    with pytest.raises(SceneError, match="gimbal lock") as error:
        check_scene(to_struct(data | {"allow": list(get_args(s.Waiver))}, s.Scene))
    assert len(error.value.problems) == 1


def test_a_warning_names_what_repeats_once():
    doubt = Doubt("$.bodies[0]", "odd", "check", "wave_speed")
    text = in_short("many", [replace(doubt, where=f"$.bodies[{i}]") for i in range(1000)])
    assert "999 more" in text and len(text.splitlines()) == 3


def _says(problem, where, what, remedy):
    for fragments, text in ((where, problem.where), (what, problem.what), (remedy, problem.remedy)):
        for fragment in fragments:
            assert fragment in text, text


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
